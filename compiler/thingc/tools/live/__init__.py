"""Live view of a document: rebuild it after every save and show it in a browser."""
