"""Index the names in documents: find the declaration and all uses of a name, and rename it."""
