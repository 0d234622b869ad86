"""Worker code that uses the CAD kernel to build, measure, mesh and write parts."""
