"""Compute the static efforts with which drives hold a robot still, and compare the efforts with the limits of the drives."""
