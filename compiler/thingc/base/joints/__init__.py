"""Kinds of joints, one file each: the twists of their coordinates and the limits that they take."""
