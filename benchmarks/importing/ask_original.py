"""Read original URDF files with pinocchio: `python ask_original.py < REQUEST > ANSWER`. Request and answer are JSON.

For each state, the answer contains the poses of all links, the mass matrix, the bias forces and the gravity forces. For some links, the
answer also contains the mass matrix of a robot with a free base when this link is held.
"""

import json
import math
import sys

import numpy as np
import pinocchio


def put(model, names, values):
    q = pinocchio.neutral(model)
    for name, value in zip(names, values):
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [math.cos(value), math.sin(value)]
    return q


def answer(asked):
    model = pinocchio.buildModelFromUrdf(asked["file"])
    free = pinocchio.buildModelFromUrdf(asked["file"], pinocchio.JointModelFreeFlyer())
    data, floating = model.createData(), free.createData()
    names = asked["joints"]
    dofs = [model.joints[model.getJointId(name)].idx_v for name in names]
    free_dofs = [free.joints[free.getJointId(name)].idx_v for name in names]
    states = []
    for q_of, v_of in asked["states"]:
        q, v = put(model, names, q_of), np.zeros(model.nv)
        v[dofs] = v_of
        pinocchio.framesForwardKinematics(model, data, q)
        frames = {name: data.oMf[model.getFrameId(name, pinocchio.FrameType.BODY)].homogeneous.tolist() for name in asked["links"]}
        full = pinocchio.crba(model, data, q)
        full = np.triu(full) + np.triu(full, 1).T
        held = {}
        for root in asked["roots"]:
            q_free = put(free, names, q_of)
            whole = pinocchio.crba(free, floating, q_free)
            whole = np.triu(whole) + np.triu(whole, 1).T
            pinocchio.computeJointJacobians(free, floating, q_free)
            pinocchio.updateFramePlacements(free, floating)
            jacobian = pinocchio.getFrameJacobian(free, floating, free.getFrameId(root, pinocchio.FrameType.BODY), pinocchio.LOCAL)
            still = np.vstack((-np.linalg.solve(jacobian[:, :6], jacobian[:, free_dofs]), np.eye(len(free_dofs))))
            rows = [*range(6), *free_dofs]
            held[root] = (still.T @ whole[np.ix_(rows, rows)] @ still).tolist()
        states.append({
            "frames": frames, "mass_matrix": full[np.ix_(dofs, dofs)].tolist(), "held": held,
            "bias": pinocchio.nonLinearEffects(model, data, q, v)[dofs].tolist(),
            "gravity": pinocchio.computeGeneralizedGravity(model, data, q)[dofs].tolist(),
        })
    ends = {}
    for name in names:
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 1:
            ends[name] = [float(model.lowerPositionLimit[joint.idx_q]), float(model.upperPositionLimit[joint.idx_q])]
    strength = {
        name: [float(getattr(model, key)[at]) for key in ("effortLimit", "velocityLimit", "damping", "friction")]
        for name, at in zip(names, dofs)
    }
    return {"states": states, "ends": ends, "strength": strength}


if __name__ == "__main__":
    json.dump(answer(json.load(sys.stdin)), sys.stdout)
