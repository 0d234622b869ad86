"""MJCF: MuJoCo's own reading of a file, through `MjSpec`, as a robot; MuJoCo is imported when there is one to read, and opens no file."""
