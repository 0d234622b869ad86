"""Numeric layout of graph drawings: the places of boxes, labels and lines."""
