"""Spanning trees: one robot per mode. The meaning of coordinates does not depend on the root."""
