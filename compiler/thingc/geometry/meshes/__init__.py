"""Mesh files that links list. trimesh reads the files, and results are cached by content. The CAD kernel never reads these files."""
