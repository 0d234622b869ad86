"""Import robots from files in other formats, such as URDF, SDF and MJCF.

The package contains a reader for each format, the source model that all readers return, and a writer that converts the source model to a
YAML document.
"""
