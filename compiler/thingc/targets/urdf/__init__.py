"""URDF: one file for each mode, for whatever in ROS and beyond reads URDF 1.0."""
