"""Read documents: parse their text into trees in which every key and value has a source position.

This package does not interpret the values.
"""
