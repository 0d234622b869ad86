"""Run the compiler passes in order, for the command line and for the Python API of `import thingc`."""
