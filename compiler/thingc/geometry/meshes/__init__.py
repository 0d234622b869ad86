"""Read the mesh files of links with trimesh, and cache the results by the content of the files. The CAD kernel is not used to read these
files.
"""
