"""Represent the exact shapes of parts as closed meshes, and compute the overlaps of these shapes."""
