"""Read the mesh files of links with trimesh, and cache the results by the content of the files. The CAD kernel never reads these files."""
