"""The hierarchical assembly graph as text and as a picture. `emit.py` is the target."""
