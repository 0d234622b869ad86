"""Load a model with MuJoCo Warp: `python ask_warp.py REQUESTS ANSWERS`. The answer contains the mass and the joint positions after some
simulation steps.
"""

from __future__ import annotations

import sys
from importlib.metadata import version

import mujoco_warp
import warp
from asking import started


def answer(asked):
    model, data = started(asked)
    with warp.ScopedDevice("cpu"):
        found, now = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data)
        for _ in range(asked["steps"]):
            mujoco_warp.step(found, now)
    return {"mass": float(found.body_mass.numpy().sum()), "steps": now.qpos.numpy()[0].tolist()}


if __name__ == "__main__":
    from asking import serve

    warp.config.quiet = True
    serve(answer, version("mujoco-warp"), sys.argv)
