"""Statics: the efforts of drives that hold a robot still, compared with the limits of the drives."""
