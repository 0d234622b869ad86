"""Statics: the efforts of drives that hold a robot still, relative to their limits."""
