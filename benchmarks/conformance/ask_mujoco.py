"""Read URDF with MuJoCo, which ignores mimics and fixes a free base: `python ask_mujoco.py REQUESTS ANSWERS`."""

from __future__ import annotations

import sys

import mujoco
import numpy as np


def answer(asked):
    model = mujoco.MjModel.from_xml_path(asked["file"])
    data = mujoco.MjData(model)
    dofs = [model.joint(name).dofadr[0] for name in asked["joints"]]
    poses, matrices, torques, centres = [], [], [], []
    for values in asked["q"]:
        for name, value in zip(asked["joints"], values):
            data.joint(name).qpos = value
        mujoco.mj_forward(model, data)
        rows = []
        for name in asked["frames"]:
            matrix = np.eye(4)
            matrix[:3, :3], matrix[:3, 3] = data.body(name).xmat.reshape(3, 3), data.body(name).xpos
            rows.append(matrix.tolist())
        poses.append(rows)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        matrices.append(full[np.ix_(dofs, dofs)].tolist())
        torques.append(data.qfrc_bias[dofs].tolist())
        centres.append(data.subtree_com[0].tolist())
    return {
        "frames": poses, "mass": float(model.body_mass.sum()), "mass_matrix": matrices, "torque": torques, "centre": centres,
        "range": [model.joint(name).range.tolist() if model.joint(name).limited[0] else None for name in asked["joints"]],
    }


if __name__ == "__main__":
    from asking import serve

    serve(answer, mujoco.__version__, sys.argv)
