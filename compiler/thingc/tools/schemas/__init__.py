"""JSON Schemas for editors, one per document. They contain its parts, mounts, joints and names."""
