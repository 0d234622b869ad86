"""For editors: a JSON Schema per document that knows the parts, mounts, joints and names of that document."""
