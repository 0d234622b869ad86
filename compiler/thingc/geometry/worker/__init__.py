"""The process that runs the code of parts, and what holds it in bounds: the server, its children, what they may touch and what they ask."""
