"""Spanning trees: one robot per mode, a tree of bodies whose coordinates have the same meaning for every root."""
