"""Document models and their validation. This package is imported lazily, because importing pydantic is slower than reading a document."""
