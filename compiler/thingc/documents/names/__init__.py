"""Indexes of names in documents: what a name means, where it is used, and renaming it."""
