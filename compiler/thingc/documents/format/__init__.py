"""Rewrite the text of documents without changing its meaning: canonical layout, and edits at places."""
