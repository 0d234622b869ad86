"""Import MJCF files with MuJoCo's `MjSpec`. MuJoCo is imported lazily and does not open any files."""
