"""Load a model and its scene with PyMJCF (`dm_control.mjcf`): `python ask_pymjcf.py REQUESTS ANSWERS`. The answer contains the mass."""

from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path

from dm_control import mjcf


def answer(asked):
    model = Path(asked["file"])
    for file in (model, scene_of(model)):
        physics = mjcf.Physics.from_mjcf_model(mjcf.from_path(str(file)))
        missing = [name for name in asked["frames"] if physics.model.name2id(name, "body") < 0]
        assert not missing, missing
    return {"mass": float(physics.model.body_mass.sum())}


def scene_of(model):
    """Return the path of the scene of a model, such as `scene_MODE.xml` for `NAME_MODE.xml`."""
    name = model.parents[1].name
    return model.with_name(model.name.replace(f"{name}_", "scene_", 1))


if __name__ == "__main__":
    from asking import serve

    serve(answer, version("dm_control"), sys.argv)
