"""Spanning trees: one robot per mode. Coordinates have the same meaning whichever link is the root."""
