"""What MuJoCo makes of a model, in numpy: poses of parts, mass properties, and dynamics with any link held still."""

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
    """Fails when MuJoCo warns, by whatever way: its handler, Python's, or a log in the working folder."""
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
    """A homogeneous matrix."""
    found = np.eye(4)
    found[:3, :3] = np.asarray(rotation).reshape(3, 3)
    found[:3, 3] = position
    return found


def turned(quaternion: Array) -> Array:
    """The rotation matrix of a quaternion (w, x, y, z)."""
    w, x, y, z = np.asarray(quaternion) / np.linalg.norm(quaternion)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def joints(model: mujoco.MjModel) -> list[str]:
    """The names of hinges and slides, sorted: an order that no mode chooses."""
    free = int(mujoco.mjtJoint.mjJNT_FREE)
    return sorted(model.joint(i).name for i in range(model.njnt) if int(model.jnt_type[i]) != free)


def at(model: mujoco.MjModel, q: Mapping[str, float], base: Array | None = None) -> mujoco.MjData:
    """The state with joints at `q`; a free or held base at the pose `base`, if one is given. Everything is at rest."""
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
    """The pose in the world of every part that is drawn, in the part's own frame: MuJoCo moves the frame of a mesh to its
    centre and principal axes, which is taken back."""
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
    """The pose in the world of every part that is drawn and of every site of a link."""
    sites = {
        f"site {model.site(i).name}": pose(data.site_xpos[i], data.site_xmat[i])
        for i in range(model.nsite) if not is_anchor(model, int(model.site_bodyid[i]))
    }
    return {**parts(model, data), **sites}


def links(model: mujoco.MjModel) -> list[str]:
    """The names of the bodies but the world's and the anchors of holds, sorted."""
    return sorted(model.body(i).name for i in range(1, model.nbody) if not is_anchor(model, i))


def is_anchor(model: mujoco.MjModel, body: int) -> bool:
    """Whether a body is no link but a place where a hold holds one: it is called so, and is mocap, without mass, geometry or children."""
    if not model.body(body).name.endswith(":held"):
        return False
    assert model.body_mocapid[body] >= 0 and model.body_mass[body] == 0.0, model.body(body).name
    assert model.body_geomnum[body] == 0 and not (model.body_parentid == body).any(), model.body(body).name
    return True


def inertia_of(model: mujoco.MjModel, link: str) -> tuple[float, Array, Array]:
    """Mass, centre and inertia about the centre of a link, in the link's axes."""
    body = model.body(link).id
    r = turned(model.body_iquat[body])
    return float(model.body_mass[body]), model.body_ipos[body].copy(), r @ np.diag(model.body_inertia[body]) @ r.T


def about(mass: float, centre: Array, inertia: Array, point: Array) -> Array:
    """The parallel-axis theorem: an inertia about its centre, about another point."""
    d = np.asarray(centre) - point
    return inertia + mass * (d @ d * np.eye(3) - np.outer(d, d))


def whole(model: mujoco.MjModel, data: mujoco.MjData, frame: Array) -> tuple[float, Array, Array]:
    """Mass, centre, and inertia about the centre of everything, seen from `frame` (a pose in the world)."""
    back = np.linalg.inv(frame)
    bodies = []
    for i in range(1, model.nbody):
        r = back[:3, :3] @ data.ximat[i].reshape(3, 3)
        bodies.append((model.body_mass[i], back[:3, :3] @ data.xipos[i] + back[:3, 3], r @ np.diag(model.body_inertia[i]) @ r.T))
    mass = sum(m for m, _, _ in bodies)
    centre = sum(m * c for m, c, _ in bodies) / mass
    return float(mass), centre, sum(about(m, c, i, centre) for m, c, i in bodies)


def held(model: mujoco.MjModel, q: Mapping[str, float], link: str, gravity: Array, base: Array) -> tuple[Array, Array]:
    """Joint-space mass matrix and gravity torque with `link` held still, from the bodies of this model, whatever it holds.

    `gravity` is in the frame of the link. From MuJoCo come only each body's mass, inertia and Jacobian: motions are taken
    relative to the link's, and with (v, w) those of a body's centre M = sum m v'v + w'Iw + armature, tau = sum m v'g.
    """
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
    """MuJoCo's own joint-space mass matrix and gravity torque, joints sorted by name, base at rest at `base`."""
    data = at(model, q, base)
    full = np.zeros((model.nv, model.nv))
    for unit, column in zip(np.eye(model.nv), full, strict=True):  # M is symmetric: rows are columns
        mujoco.mj_mulM(model, data, column, unit)
    columns = [int(model.joint(name).dofadr[0]) for name in joints(model)]
    return full[np.ix_(columns, columns)], -data.qfrc_bias[columns]


def random_pose(source: np.random.Generator) -> Array:
    """Anywhere within a metre, turned anyhow."""
    return pose(source.uniform(-1, 1, 3), turned(source.normal(size=4)))
