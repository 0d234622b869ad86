"""Documents: their text, schemas, names and tests."""
