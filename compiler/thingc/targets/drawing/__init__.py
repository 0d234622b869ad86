"""Layout of graph drawings, which computes the positions of boxes, labels and lines."""
