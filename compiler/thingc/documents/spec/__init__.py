"""Document models and their validation. The package is imported lazily, because importing pydantic takes longer than reading a document."""
