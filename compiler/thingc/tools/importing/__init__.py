"""Import robots of other formats: a reader per format, a common source model, and a writer of documents."""
