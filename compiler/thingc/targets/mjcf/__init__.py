"""MJCF: MuJoCo models, their scenes and meshes. `emit.py` is the target; `archive.py` packs the same into one file per mode."""
