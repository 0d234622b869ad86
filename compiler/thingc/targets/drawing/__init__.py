"""Drawings of graphs: where boxes, labels and lines go, in numbers."""
