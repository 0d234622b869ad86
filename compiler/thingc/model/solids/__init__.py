"""Exact shapes of parts as closed meshes, and their overlaps."""
