"""Document models and their validation. They are imported lazily, because importing pydantic takes longer than reading a document."""
