"""Layout of graph drawings: the positions of boxes, labels and lines."""
