"""Resolve documents: evaluate names, units, expressions, repeats and defaults to create an `AssemblyDefinition`."""
