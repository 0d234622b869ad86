"""The target `sdf`."""
