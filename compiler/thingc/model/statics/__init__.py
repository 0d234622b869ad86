"""Statics: the drive efforts that hold a robot still, relative to their limits."""
