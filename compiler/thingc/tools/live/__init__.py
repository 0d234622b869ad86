"""A document while somebody works on it: built again after every save, and shown in a browser."""
