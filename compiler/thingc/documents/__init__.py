"""The text, schemas, names and tests of documents."""
