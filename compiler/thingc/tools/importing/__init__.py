"""Robots of other formats, read and written as documents: a reader per format, one model of what was read, one writer."""
