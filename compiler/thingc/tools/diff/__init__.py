"""What changed in a robot between two states of its documents: `thingc diff`."""
