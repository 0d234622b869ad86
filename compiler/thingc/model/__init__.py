"""The robot: from documents and part records to assemblies, trees of modes, and loads."""
