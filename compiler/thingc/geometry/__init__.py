"""The geometry service, the only package that uses the CAD kernel. The entry points are the module `service` and, for worker processes, the
module `worker.server`.
"""
