"""Read, validate, format and index documents, and define the types of tests that documents can contain."""
