"""Read URDF with pinocchio: `python ask_pinocchio.py REQUESTS ANSWERS`. Mimic joints are read as independent joints (`mimic` is off)."""

from __future__ import annotations

import math
import sys

import numpy as np
import pinocchio


def answer(asked):
    model = pinocchio.buildModelFromUrdf(asked["file"])
    model.gravity.linear = np.array(asked["gravity"])
    data = model.createData()
    ids = [model.getJointId(name) for name in asked["joints"]]
    dofs = [model.joints[k].idx_v for k in ids]
    mass = sum(inertia.mass for inertia in model.inertias)  # the total mass of pinocchio omits links that are fixed to the world
    poses, matrices, torques, centres = [], [], [], []
    for values in asked["q"]:
        q = pinocchio.neutral(model)
        for k, value in zip(ids, values):
            joint = model.joints[k]  # pinocchio represents a joint without limits by cosine and sine
            q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [math.cos(value), math.sin(value)]
        pinocchio.framesForwardKinematics(model, data, q)
        poses.append([data.oMf[model.getFrameId(name)].homogeneous.tolist() for name in asked["frames"]])
        full = pinocchio.crba(model, data, q)
        full = np.triu(full) + np.triu(full, 1).T
        matrices.append(full[np.ix_(dofs, dofs)].tolist())
        torques.append(pinocchio.computeGeneralizedGravity(model, data, q)[dofs].tolist())
        points = [inertia.mass * data.oMi[k].act(inertia.lever) for k, inertia in enumerate(model.inertias)]
        centres.append((np.sum(points, axis=0) / mass).tolist())
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    ends = [(model.joints[k].nq, model.joints[k].idx_q) for k in ids]
    return {
        "frames": poses, "mass": mass, "mass_matrix": matrices, "torque": torques, "centre": centres,
        "effort": [float(model.effortLimit[k]) for k in dofs],
        "range": [[float(lower[at]), float(upper[at])] if size == 1 else None for size, at in ends],
    }


if __name__ == "__main__":
    from asking import serve

    serve(answer, pinocchio.__version__, sys.argv)
