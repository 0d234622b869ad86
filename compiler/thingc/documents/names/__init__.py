"""Indexes of names in documents: the target of each name, all its uses, and the edits that rename it."""
