"""The text of documents, rewritten without changing what it means: canonical layout, and edits at places."""
