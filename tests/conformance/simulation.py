"""Evaluate MuJoCo models with numpy: poses of parts, mass properties, and dynamics with any link held."""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@contextlib.contextmanager
def no_warning(folder: Path) -> Iterator[None]:
    """Fail if MuJoCo warns by its handler, by Python's warnings, or by a log file in the working folder."""
    said: list[str] = []
    before = os.getcwd()
    os.chdir(folder)
    mujoco.set_mju_user_warning(said.append)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            yield
        assert said == []
        assert "MUJOCO_LOG.TXT" not in os.listdir(folder)
    finally:
        mujoco.set_mju_user_warning(None)
        os.chdir(before)


def pose(position: Array, rotation: Array) -> Array:
    """Return a homogeneous matrix."""
    found = np.eye(4)
    found[:3, :3] = np.asarray(rotation).reshape(3, 3)
    found[:3, 3] = position
    return found


def turned(quaternion: Array) -> Array:
    """Return the rotation matrix of a quaternion (w, x, y, z)."""
    w, x, y, z = np.asarray(quaternion) / np.linalg.norm(quaternion)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def joints(model: mujoco.MjModel) -> list[str]:
    """Return the sorted names of hinges and slides, so that the order does not depend on the mode."""
    free = int(mujoco.mjtJoint.mjJNT_FREE)
    return sorted(model.joint(i).name for i in range(model.njnt) if int(model.jnt_type[i]) != free)


def at(model: mujoco.MjModel, q: Mapping[str, float], base: Array | None = None) -> mujoco.MjData:
    """Return the state at rest with the joint positions `q`. A free or held base is at the pose `base`, if one is given."""
    data = mujoco.MjData(model)
    for name, value in q.items():
        data.joint(name).qpos = value
    if base is not None:
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, base[:3, :3].flatten())
        for i in range(1, model.nbody):
            if int(model.body_mocapid[i]) >= 0 and not is_anchor(model, i):
                place = int(model.body_mocapid[i])
                data.mocap_pos[place], data.mocap_quat[place] = base[:3, 3], quaternion
        for i in range(model.njnt):
            if int(model.jnt_type[i]) == int(mujoco.mjtJoint.mjJNT_FREE):
                data.qpos[model.jnt_qposadr[i] :][:7] = [*base[:3, 3], *quaternion]
    mujoco.mj_forward(model, data)
    return data


def parts(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, Array]:
    """Return the pose in the world of every visible part in the frame of the part. MuJoCo moves the frame of a mesh to its centre and
    principal axes, which is reverted."""
    found = {}
    for i in range(model.ngeom):
        name = model.geom(i).name
        mesh = model.geom_dataid[i]
        if mesh < 0 or ":" in name:
            continue
        own = pose(model.mesh_pos[mesh], turned(model.mesh_quat[mesh]))
        found[name] = pose(data.geom_xpos[i], data.geom_xmat[i]) @ np.linalg.inv(own)
    return found


def frames(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, Array]:
    """Return the pose in the world of every visible part and of every site of a link."""
    sites = {
        f"site {model.site(i).name}": pose(data.site_xpos[i], data.site_xmat[i])
        for i in range(model.nsite) if not is_anchor(model, int(model.site_bodyid[i]))
    }
    return {**parts(model, data), **sites}


def links(model: mujoco.MjModel) -> list[str]:
    """Return the sorted names of all bodies except the world and the anchors of holds."""
    return sorted(model.body(i).name for i in range(1, model.nbody) if not is_anchor(model, i))


def is_anchor(model: mujoco.MjModel, body: int) -> bool:
    """Return whether a body is the anchor of a hold: it has the name of an anchor, is a mocap body, and has no mass, geometry or
    children."""
    if not model.body(body).name.endswith(":held"):
        return False
    assert model.body_mocapid[body] >= 0 and model.body_mass[body] == 0.0, model.body(body).name
    assert model.body_geomnum[body] == 0 and not (model.body_parentid == body).any(), model.body(body).name
    return True


def inertia_of(model: mujoco.MjModel, link: str) -> tuple[float, Array, Array]:
    """Return the mass, the centre and the inertia about the centre of a link, in the axes of the link."""
    body = model.body(link).id
    r = turned(model.body_iquat[body])
    return float(model.body_mass[body]), model.body_ipos[body].copy(), r @ np.diag(model.body_inertia[body]) @ r.T


def about(mass: float, centre: Array, inertia: Array, point: Array) -> Array:
    """Move an inertia from its centre to another point by the parallel-axis theorem."""
    d = np.asarray(centre) - point
    return inertia + mass * (d @ d * np.eye(3) - np.outer(d, d))


def whole(model: mujoco.MjModel, data: mujoco.MjData, frame: Array) -> tuple[float, Array, Array]:
    """Return the total mass, centre and inertia about the centre, in `frame` (a pose in the world)."""
    back = np.linalg.inv(frame)
    bodies = []
    for i in range(1, model.nbody):
        r = back[:3, :3] @ data.ximat[i].reshape(3, 3)
        bodies.append((model.body_mass[i], back[:3, :3] @ data.xipos[i] + back[:3, 3], r @ np.diag(model.body_inertia[i]) @ r.T))
    mass = sum(m for m, _, _ in bodies)
    centre = sum(m * c for m, c, _ in bodies) / mass
    return float(mass), centre, sum(about(m, c, i, centre) for m, c, i in bodies)


def held(model: mujoco.MjModel, q: Mapping[str, float], link: str, gravity: Array, base: Array) -> tuple[Array, Array]:
    """Return the joint-space mass matrix and the gravity torques with `link` held, from the bodies of this model, regardless of the link
    that it holds. `gravity` is in the frame of the link. Only the mass, the inertia and the Jacobian of each body come from MuJoCo.
    Motions are relative to the motion of the link. With the velocities (v, w) of the centre of a body, M = sum m v'v + w'Iw +
    armature, and tau = sum m v'g."""
    data = at(model, q, base)
    names = joints(model)
    columns = [int(model.joint(name).dofadr[0]) for name in names]
    still = model.body(link).id

    def motion(body: int) -> tuple[Array, Array]:
        linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacBodyCom(model, data, linear, angular, body)
        return linear[:, columns], angular[:, columns]

    v0, w0 = motion(still)
    g = data.xmat[still].reshape(3, 3) @ gravity
    matrix = np.diag([model.dof_armature[column] for column in columns])
    torque = np.zeros(len(names))
    for body in range(1, model.nbody):
        v, w = motion(body)
        arm = data.xipos[body] - data.xipos[still]
        v, w = v - v0 - np.cross(w0.T, arm).T, w - w0
        r = data.ximat[body].reshape(3, 3)
        matrix += model.body_mass[body] * v.T @ v + w.T @ (r @ np.diag(model.body_inertia[body]) @ r.T) @ w
        torque += model.body_mass[body] * v.T @ g
    return matrix, torque


def own_dynamics(model: mujoco.MjModel, q: Mapping[str, float], base: Array) -> tuple[Array, Array]:
    """Return MuJoCo's joint-space mass matrix and gravity torques, with joints sorted by name, and the base at rest at `base`."""
    data = at(model, q, base)
    full = np.zeros((model.nv, model.nv))
    for unit, column in zip(np.eye(model.nv), full, strict=True):  # M is symmetric: rows are columns
        mujoco.mj_mulM(model, data, column, unit)
    columns = [int(model.joint(name).dofadr[0]) for name in joints(model)]
    return full[np.ix_(columns, columns)], -data.qfrc_bias[columns]


def random_pose(source: np.random.Generator) -> Array:
    """Return a random pose within a metre, with a random rotation."""
    return pose(source.uniform(-1, 1, 3), turned(source.normal(size=4)))
