"""The geometry service: the only access to the CAD kernel. Start reading at `service`; the worker starts at `worker.server`."""
