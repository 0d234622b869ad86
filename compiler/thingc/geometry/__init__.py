"""The geometry service, which alone has access to the CAD kernel. Entry points: `service`, and `worker.server` for the worker process."""
