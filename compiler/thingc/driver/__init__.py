"""The driver, which runs the passes in order, and the Python API of `import thingc`."""
