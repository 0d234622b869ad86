"""`parts.lock.json`: a file in the workspace with the schemas and records of parts, which replaces building the parts."""
