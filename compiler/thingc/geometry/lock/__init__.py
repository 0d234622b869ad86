"""Read `parts.lock.json`, a file of the workspace that contains the schemas and records of parts."""
