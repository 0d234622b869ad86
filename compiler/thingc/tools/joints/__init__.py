"""Propose joints between the parts of a document, and write them."""
