"""The hierarchical assembly graph as text and as a picture. `target.py` is what a build asks."""
