"""Import MJCF files with MuJoCo's `MjSpec`. MuJoCo is imported only when needed, and opens no files."""
