"""Kinds of joints: the twists of their coordinates and the limits that they accept."""
