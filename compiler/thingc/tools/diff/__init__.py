"""Implementation of `thingc diff`, which compares two states of a robot, for example in two commits."""
