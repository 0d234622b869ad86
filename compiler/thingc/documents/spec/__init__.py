"""Document models and their validation. They are imported lazily, because importing pydantic is slower than reading a document."""
