"""Functions with which tools use the CAD kernel. They run in worker processes."""
