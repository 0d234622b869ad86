"""`parts.lock.json`: the schemas and records of parts, stored beside the documents and used in place of building the parts."""
