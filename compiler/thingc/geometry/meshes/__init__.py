"""Mesh files that links list: what is known of them, read by trimesh and kept by content. The CAD kernel never sees one."""
