"""The order of the passes, and what `import thingc` gives."""
