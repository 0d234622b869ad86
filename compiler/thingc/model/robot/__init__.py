"""Spanning trees: one robot per mode. Coordinates have the same meaning for every root."""
