"""Spanning trees: one robot per mode, a tree of bodies whose joints mean the same whatever its root."""
