"""What every other package builds on: diagnostics, source positions, units, poses, files."""
