"""Import MJCF files with MuJoCo's `MjSpec`. MuJoCo is imported lazily. MuJoCo itself does not open files."""
