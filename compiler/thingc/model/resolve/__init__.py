"""Resolve documents: names, units, expressions, repeats and defaults become an `AssemblyDefinition`."""
