"""Rewrite the source text of documents: format documents in the canonical layout without changing their meaning, and edit single values."""
