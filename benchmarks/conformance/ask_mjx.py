"""MJX: whether it takes a model and its scene, and what they weigh. `python ask_mjx.py REQUESTS ANSWERS`."""

from __future__ import annotations

import sys
import warnings
from importlib.metadata import version
from pathlib import Path

import mujoco
from mujoco import mjx


def answer(asked):
    model = Path(asked["file"])
    name = model.parents[1].name
    warnings.simplefilter("ignore")  # of meshes with many corners, which are slow
    for file in (model, model.with_name(model.name.replace(f"{name}_", "scene_", 1))):
        found = mjx.put_model(mujoco.MjModel.from_xml_path(str(file)))
        mjx.make_data(found)
    return {"mass": float(found.body_mass.sum())}


if __name__ == "__main__":
    from asking import serve

    serve(answer, version("mujoco-mjx"), sys.argv)
