"""Statics: what drives have to give for a robot to stay where it is, and what part of their limits that is."""
