"""`thingc diff`: compare a robot between two states of its documents."""
