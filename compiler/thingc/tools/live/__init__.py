"""Rebuild a document after every save of a file, and show the robot in a browser."""
