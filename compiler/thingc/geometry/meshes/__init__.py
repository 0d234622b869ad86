"""Mesh files that links list: their properties, read by trimesh and cached by content. They are never passed to the CAD kernel."""
