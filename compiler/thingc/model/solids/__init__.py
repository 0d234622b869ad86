"""Exact shapes of parts as closed meshes, and the overlaps of these shapes."""
