"""Mesh files that links list: facts about them, read by trimesh and cached by content. They are never passed to the CAD kernel."""
