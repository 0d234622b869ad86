"""Rebuild a document after every save, and show the robot in a browser."""
