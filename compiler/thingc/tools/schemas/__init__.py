"""JSON Schemas for editors, one per document, with its parts, mounts, joints and names."""
