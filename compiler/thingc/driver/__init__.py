"""Run the compiler passes in order. This package also contains the Python API of `import thingc`."""
