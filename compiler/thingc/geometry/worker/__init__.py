"""The worker process that runs the code of parts. This package contains the server, its child processes, their sandbox, and the recording
of their inputs.
"""
