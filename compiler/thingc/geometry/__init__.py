"""The geometry service, the only package that uses the CAD kernel. Entry points: `service`, and `worker.server` for the worker process."""
