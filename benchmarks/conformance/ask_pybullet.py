"""Read URDF with PyBullet, which fixes the base and ignores mimics: `python ask_pybullet.py REQUESTS ANSWERS`."""

from __future__ import annotations

import sys
from importlib.metadata import version

import numpy as np
import pybullet


def answer(asked):
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE
    pybullet.resetSimulation()
    free = pybullet.loadURDF(asked["file"], flags=flags)
    links = range(-1, pybullet.getNumJoints(free))
    masses = [pybullet.getDynamicsInfo(free, k)[0] for k in links]  # the mass of a fixed base is 0
    pybullet.resetSimulation()
    pybullet.setGravity(*asked["gravity"])
    robot = pybullet.loadURDF(asked["file"], useFixedBase=True, flags=flags)
    infos = [pybullet.getJointInfo(robot, k) for k in links[1:]]
    moving = [k for k, info in enumerate(infos) if info[2] != pybullet.JOINT_FIXED]
    named = {info[1].decode(): k for k, info in enumerate(infos)}
    order = [moving.index(named[name]) for name in asked["joints"]]
    frames = {info[12].decode(): k for k, info in enumerate(infos)}
    frames[pybullet.getBodyInfo(robot)[0].decode()] = -1
    poses, matrices, torques, centres = [], [], [], []
    for values in asked["q"]:
        q = np.zeros(len(moving))
        q[order] = values
        for k, value in zip(moving, q):
            pybullet.resetJointState(robot, k, value)
        states = pybullet.getLinkStates(robot, list(links[1:]), computeForwardKinematics=True)
        base = pose(*pybullet.getBasePositionAndOrientation(robot))
        inside = [pose(*pybullet.getDynamicsInfo(robot, k)[3:5]) for k in links]
        roots = np.linalg.inv(base @ np.linalg.inv(inside[0]))
        there = {-1: np.eye(4), **{k: roots @ pose(*state[4:6]) for k, state in enumerate(states)}}
        poses.append([there[frames[name]].tolist() for name in asked["frames"]])
        centres.append((sum(mass * (there[k] @ inside[k + 1])[:3, 3] for k, mass in zip(links, masses)) / sum(masses)).tolist())
        none = [0.0] * len(moving)
        matrices.append(np.array(pybullet.calculateMassMatrix(robot, list(q)))[np.ix_(order, order)].tolist() if moving else [])
        torques.append([pybullet.calculateInverseDynamics(robot, list(q), none, none)[k] for k in order] if moving else [])
    joints = [infos[named[name]] for name in asked["joints"]]
    return {
        "frames": poses, "mass": sum(masses), "mass_matrix": matrices, "torque": torques, "centre": centres,
        "effort": [info[10] for info in joints], "range": [list(info[8:10]) if info[8] <= info[9] else None for info in joints],
    }


def pose(position, quaternion):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.reshape(pybullet.getMatrixFromQuaternion(quaternion), (3, 3)), position
    return matrix


if __name__ == "__main__":
    from asking import serve

    pybullet.connect(pybullet.DIRECT)
    serve(answer, version("pybullet"), sys.argv)
