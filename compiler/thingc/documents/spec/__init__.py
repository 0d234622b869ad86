"""Document models and their check. They are imported late: pydantic costs more than reading a document."""
