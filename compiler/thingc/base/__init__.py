"""Shared building blocks of all other packages: diagnostics, source positions, units, poses, files."""
