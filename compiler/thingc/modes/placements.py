"""Check that the poses of links, joints and mounts in a `mujoco.MjModel` match a mode.

The poses differ if the model belongs to another variant of the robot.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from thingc.modes.frames import Array, difference, pose, rotation_of
from thingc.modes.tree import Mode

CLOSE = 1e-6
"""Tolerance for differences between poses [m, rad]."""

SLIDE = 2
"""The number of the type `slide` in MuJoCo's `mjtJoint`."""


def find_displaced(mode: Mode, model: Any, body_of: Mapping[str, int]) -> tuple[str, float] | None:
    """Compare the poses of all links, joints and mounts in a MuJoCo model with a mode.

    Return the name and the deviation [m or rad] of the first element that differs, or None if all match. `body_of` maps the name of each
    link of `mode` to the number of its body in the model.
    """
    return next(((name, far) for name, far in _distances(mode, model, body_of) if far > CLOSE), None)


def _distances(mode: Mode, model: Any, body_of: Mapping[str, int]) -> Iterator[tuple[str, float]]:
    root = body_of[mode.root_link]
    free = [mode.links[joint.child] for joint in mode.joints if joint.kind == "free"]
    X = {root: np.eye(4), **{body_of[link.name]: link.X_root_link for link in free}}
    for body in range(1, model.nbody):
        parent = int(model.body_parentid[body])
        if parent in X:
            X[body] = X[parent] @ pose(rotation_of(model.body_quat[body]), model.body_pos[body])
    with_body = {number for number, link in enumerate(mode.links) if model.body(body_of[link.name]).name == link.name}
    for number in sorted(with_body):
        link = mode.links[number]
        yield f"link `{link.name}`", _difference(link.X_root_link, X[body_of[link.name]])
    zeros = {joint.name: 0.0 for joint in mode.joints}
    motions = np.array(mode.jacobians(mode.state(q=zeros, base_pose=np.eye(4))))[:, :, 6:]  # in the axes of the root link
    for column, joint in enumerate(mode.joints):
        if joint.kind == "free":
            continue
        point = mode.links[joint.child].X_root_link[:3, 3]
        found = np.sum([ratio * _motion(model, name, X, point, joint) for name, ratio in joint.in_model.items()], axis=0)
        yield f"joint `{joint.name}`", float(np.abs(found - motions[joint.child, :, column]).max())
    sites = {model.site(number).name: number for number in range(model.nsite)}
    for carrier, name, X_LM, turns in _frames(mode):
        if carrier in with_body and name in sites:
            site = sites[name]
            found = pose(X_LM[:3, :3] if turns else rotation_of(model.site_quat[site]), model.site_pos[site])
            yield f"mount `{name}`", _difference(X_LM, found)


def _frames(mode: Mode) -> Iterator[tuple[int, str, Array, bool]]:
    """Yield the mounts that must be sites of the MuJoCo model.

    For each mount, yield the index of its link, its name, its pose in the link, and a flag. The flag is True if only the position of the
    site must be compared.
    """
    for hold in mode.holds:
        yield hold.link, hold.anchor.removesuffix(":held"), hold.X_LM, hold.turns
    for cut in mode.cuts:
        yield cut.parent, f"{cut.name}:parent", cut.X_PA, True
        yield cut.child, f"{cut.name}:child", cut.X_CB, True


def _motion(model: Any, name: str, X: Mapping[int, Array], point: Array, joint: Any) -> Array:
    """Return the motion (6,) per unit of joint velocity, at q = 0, that a joint of the MuJoCo model causes at the point `point`."""
    one = model.joint(name)
    place = X[int(one.bodyid[0])]
    if joint.ball is None:
        axis = place[:3, :3] @ one.axis
    else:
        axis = place[:3, :3] @ joint.ball.R[:, joint.ball.coordinates.index(joint.name)]
    if int(one.type[0]) == SLIDE:
        return np.concatenate([axis, np.zeros(3)])
    return np.concatenate([np.cross(axis, point - place[:3, 3] - place[:3, :3] @ one.pos), axis])


def _difference(X: Array, other: Array) -> float:
    """Return the distance [m] or the angle [rad] between two poses, whichever number is larger."""
    return float(max(difference(X, other)))
