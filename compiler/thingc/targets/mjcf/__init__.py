"""MJCF: MuJoCo's models, their scenes and meshes. `target.py` is what a build asks; `archive.py` packs the same into one file per mode."""
