"""Indexes of names in documents: what a name refers to, where it is used, and how to rename it."""
