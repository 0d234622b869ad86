"""Code that runs in the worker with the CAD kernel: parts are built, measured, meshed and written."""
