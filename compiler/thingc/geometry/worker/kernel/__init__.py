"""What runs in the worker with the CAD kernel: parts modelled, measured, meshed and written."""
