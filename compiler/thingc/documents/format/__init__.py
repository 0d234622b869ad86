"""Rewrite the text of documents: format it in the canonical layout without changing its meaning, and edit it at given places."""
