"""The robot model: resolved documents, linked assemblies, the kinematic tree of each mode, and static loads."""
