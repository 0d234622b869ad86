"""Read USD with mujoco-usd, MuJoCo's own USD reader, and compile the model: `python ask_mujoco_usd.py REQUESTS ANSWERS`.

The reader only supports revolute and prismatic joints. The reader ignores mimic joints and frames below links, so the program reads these
frames from the file.
"""

from __future__ import annotations

import re
import sys
from importlib.metadata import version
from pathlib import Path

import mujoco
import numpy as np
from asking import frames_of_usd
from mujoco import _usd

_usd.register_plugins()


def answer(asked):
    others = re.findall(r'def (PhysicsJoint|PhysicsSphericalJoint) "(\w+)"', Path(asked["file"]).read_text())
    if others:
        raise ValueError(f"generic and ball joints are read as welds ({others[0][1]})")
    spec = mujoco.MjSpec.from_file(asked["file"])
    model = spec.compile()
    data = mujoco.MjData(model)
    bodies = {model.body(k).name.rpartition("/")[2]: k for k in range(1, model.nbody)}
    joints = {model.joint(k).name.rpartition("/")[2]: k for k in range(model.njnt)}
    places = frames_of_usd(asked["file"], asked["frames"])
    dofs = [int(model.jnt_dofadr[joints[name]]) for name in asked["joints"]]
    free = [k for k in range(model.njnt) if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_FREE]
    if bool(free) != asked["free"]:
        raise ValueError(f"a base that floats: {bool(free)}")
    poses, matrices, torques, centres = [], [], [], []
    for values in asked["q"]:
        mujoco.mj_resetData(model, data)
        for name, value in zip(asked["joints"], values):
            data.qpos[model.jnt_qposadr[joints[name]]] = value
        if free:
            data.qpos[model.jnt_qposadr[free[0]] :][:7] = (0, 0, 0, 1, 0, 0, 0)
        mujoco.mj_forward(model, data)
        poses.append([(pose(data, bodies[link]) @ inside).tolist() for link, inside in places.values()])
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        full -= np.diag(model.dof_armature)  # the expected mass matrix does not include the armature
        matrices.append(full[np.ix_(dofs, dofs)].tolist())
        torques.append(data.qfrc_bias[dofs].tolist())
        centres.append(data.subtree_com[0].tolist())
    kinds = [joints[name] for name in asked["joints"]]
    return {
        "frames": poses, "mass": float(model.body_mass.sum()), "mass_matrix": matrices, "torque": torques, "centre": centres,
        "range": [model.jnt_range[k].tolist() if model.jnt_limited[k] else None for k in kinds],
    }


def pose(data, body):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return matrix


if __name__ == "__main__":
    from asking import serve

    serve(answer, version("mujoco-usd"), sys.argv)
