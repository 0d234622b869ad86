"""Load a model and its scene with MJX: `python ask_mjx.py REQUESTS ANSWERS`. The answer contains the mass and the joint positions after
some simulation steps.
"""

from __future__ import annotations

import sys
import warnings
from importlib.metadata import version
from pathlib import Path

import jax
import mujoco
from asking import started
from mujoco import mjx


def answer(asked):
    warnings.simplefilter("ignore")  # warnings about meshes with many vertices, which are slow
    file = Path(asked["file"])
    name = file.parents[1].name
    mjx.put_model(mujoco.MjModel.from_xml_path(str(file.with_name(file.name.replace(f"{name}_", "scene_", 1)))))
    model, data = started(asked)
    found, now = mjx.put_model(model), mjx.put_data(model, data)
    step = jax.jit(mjx.step)
    for _ in range(asked["steps"]):
        now = step(found, now)
    return {"mass": float(found.body_mass.sum()), "steps": now.qpos.tolist()}


if __name__ == "__main__":
    from asking import serve

    jax.config.update("jax_enable_x64", True)
    serve(answer, version("mujoco-mjx"), sys.argv)
