"""Simulate many worlds for `worlds.py` in MuJoCo Warp: `python step_worlds.py MODEL.mjb FIELDS.npz FOUND.npy WORLDS STEPS`."""

from __future__ import annotations

import sys

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp


def main() -> None:
    """Simulate all worlds from the first keyframe with joints at 1 rad/s, and write the joint positions after every step. Each world uses
    its row of the fields.
    """
    file, fields, found = sys.argv[1:4]
    worlds, steps = map(int, sys.argv[4:])
    whole = mujoco.MjModel.from_binary_path(file)
    start = mujoco.MjData(whole)
    mujoco.mj_resetDataKeyframe(whole, start, 0)
    start.qvel[:] = 1.0
    with wp.ScopedDevice("cpu"):
        model = mjw.put_model(whole)
        for name, values in np.load(fields).items():
            there = getattr(model, name, None)
            if isinstance(there, wp.array) and there.shape[0] == 1:  # other fields are shared by all worlds
                numbers = values.astype(np.int32 if values.dtype.kind == "i" else np.float32)
                setattr(model, name, wp.array(numbers, dtype=there.dtype))
        data = mjw.put_data(whole, start, nworld=worlds)
        path = []
        for _ in range(steps):
            mjw.step(model, data)
            path.append(data.qpos.numpy().copy())
    np.save(found, np.array(path).transpose(1, 0, 2))


if __name__ == "__main__":
    main()
