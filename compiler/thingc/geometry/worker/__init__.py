"""The process that runs the code of parts: the server, its child processes, their sandbox, and the recording of their inputs."""
