"""The process that runs the code of parts, and its limits: the server, its children, their sandbox, and the recording of their inputs."""
