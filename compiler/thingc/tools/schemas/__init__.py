"""JSON Schemas for editors, one per document. A schema contains the parts, mounts, joints and other names of the document."""
