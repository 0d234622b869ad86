"""URDF 1.0: one file for each mode, for ROS and other readers."""
