"""Compute the forward kinematics, the Jacobians and the mass matrix of a robot in a mode, with numpy or JAX.

A joint can have several coordinates. A *frame* in this module is either the pose of a link, or the frame between two coordinates of one
joint. Frame 0 is the root link, and coordinate k moves frame k + 1. The argument `xp` of methods is the module `numpy` or `jax.numpy`.
"""

from __future__ import annotations

from functools import lru_cache
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from thingc.modes.frames import Array, cross, cross_columns, cross_matrix, generators, inverse, moved_twist, product, rotation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thingc.modes.state import State
    from thingc.modes.tree import Inertias, Link, Mode


class Kinematics:
    """Computes the kinematics of the tree of a mode, which has n links and m joint coordinates.

    Attributes:
        rows: The index of each coordinate of the tree in `Mode.coordinates` (m,).
        gathered: For each element of `Mode.coordinates`, its index in an array of the tree's coordinates, followed by the previous values
            of all coordinates.
        of_link: The index of the frame that moves each link (n,).
        number: The index of each link by name.
        is_coupled: Whether the tree contains mimic joints.
    """

    def __init__(self, mode: Mode) -> None:
        joints, links, count = mode.joints, mode.links, len(mode.joints)
        place = {name: row for row, name in enumerate(mode.coordinates)}
        column = {joint.name: k for k, joint in enumerate(joints)}
        self.rows = np.array([place[joint.name] for joint in joints], dtype=int)
        self.gathered = np.array([column.get(name, count + row) for name, row in place.items()], dtype=int)
        self.number = {link.name: number for number, link in enumerate(links)}
        self.of_link = np.zeros(len(links), dtype=int)
        self._previous: list[int] = []
        self._mask = np.zeros((len(links), 6 + count))
        self._mask[:, :6] = 1.0
        self._place = np.tile(np.eye(4), (len(links), 1, 1))  # the pose of each link in the frame that moves it
        self._fixed = any(link.fixed_to is not None for link in links)
        for k, joint in enumerate(joints):
            self._fix(links, joint.parent)
            self._previous.append(int(self.of_link[joint.parent]) if joint.first else k)
            self.of_link[joint.child] = k + 1
            if joint.first:
                self._mask[joint.child] = self._mask[joint.parent]
            self._mask[joint.child, 6 + k] = 1.0
        for number in range(len(links)):
            self._fix(links, number)
        moves = [np.zeros((3, 4, 4)) if joint.ball else generators(joint.twist) for joint in joints]
        self._X_PJ = [self._place[joint.parent] @ joint.X_PJ if joint.first else joint.X_PJ for joint in joints]
        X_PJ, X_JL = (np.array(poses).reshape(-1, 1, 4, 4) for poses in (self._X_PJ, [joint.X_JL for joint in joints]))
        self._motion = np.moveaxis(X_PJ @ np.array([[np.eye(4), *terms] for terms in moves]).reshape(-1, 4, 4, 4) @ X_JL, 0, 1)
        self._offset = np.array([joint.offset for joint in joints])
        self._balls = [
            (np.arange(count).reshape(-1, 1, 1) == k, [column[name] for name in joint.ball.coordinates], joint, self._X_PJ[k])
            for k, joint in enumerate(joints) if joint.ball is not None and joint.name == joint.ball.coordinates[0]
        ]
        # The axes of a reversed ball are fixed in the frame before it. The axes of other joints are fixed in the frame after it.
        self._carrier = np.array([self._previous[k] if joint.reversed else k + 1 for k, joint in enumerate(joints)], dtype=int)
        axes = [moved_twist(X if joint.reversed else inverse(joint.X_JL), joint.twist) for X, joint in zip(self._X_PJ, joints, strict=True)]
        self._axes = np.array(axes).reshape(-1, 2, 3)
        self._coupled = np.zeros((6 + count, 6 + count))  # the inertia of tendons in the mass matrix
        for inertia, factors in mode.tendons:
            row = np.array([0.0] * 6 + [factors.get(joint.name, 0.0) for joint in joints])
            self._coupled += inertia * np.outer(row, row)
        self._later = np.triu(self._mask.T @ self._mask > 0.0)  # pairs of coordinates, of which the second moves only links of the first
        self._find_leaders(mode, column)

    def _fix(self, links: Sequence[Link], number: int) -> None:
        """Place a link without joints in the frame of its parent. For any other link, do nothing."""
        parent = links[number].fixed_to
        if parent is not None:
            self._fix(links, parent)
            self.of_link[number], self._mask[number] = self.of_link[parent], self._mask[parent]
            self._place[number] = self._place[parent] @ inverse(links[parent].X_root_link) @ links[number].X_root_link

    def _find_leaders(self, mode: Mode, column: dict[str, int]) -> None:
        """For the method `coupling`, find the coordinate that each mimic joint follows, directly or through other mimic joints."""
        chains: list[list[Any]] = [[] for _ in range(6)]
        columns = [*range(6)]
        for joint in mode.joints:
            chain = []
            while joint.mimic is not None and joint.mimic.joint in column:
                chain.append((joint.mimic, column[joint.mimic.joint]))
                joint = mode.joints[column[joint.mimic.joint]]
            chains.append(chain)
            columns.append(6 + column[joint.name])
        free = [k for k, chain in enumerate(chains) if not chain]
        self._chains = chains
        self.is_coupled = any(chains)
        self._pattern = np.array([[float(k == f) for f in free] for k in columns]).reshape(len(columns), len(free))

    def link_motion(self, state: State[Any], xp: Any) -> tuple[Array, Array]:
        """Return the poses (n, 4, 4) and the twists (n, 6) of all links in a state of the robot, as the methods `poses` and `twists`."""
        frames = self.frames(state.base, state.q[self.rows], xp)
        return self.poses(frames), self.twists(frames, xp.concatenate([state.twist, state.v[self.rows]]), xp)

    def frames(self, base: Array, q: Array, xp: Any) -> Array:
        """Return the poses (m + 1, 4, 4) of all frames in the world, for a root link with the pose `base` and joint coordinates `q` (m,).

        The pose of each frame is `X_WL = X_WP X_PJ exp(twist (q + offset)) X_JL`, where `X_WP` is the pose of the previous frame.
        """
        constant, turn, versine, slide = self._motion
        angle = (q + self._offset)[:, None, None]
        motions = constant + xp.sin(angle) * turn + xp.sin(angle / 2.0) ** 2 * versine + angle * slide
        for is_ball, rows, joint, X_PJ in self._balls:
            vector = xp.stack([q[row] for row in rows])
            turned = rotation(-vector if joint.reversed else vector, xp)
            motion = xp.concatenate([xp.concatenate([turned, np.zeros((3, 1))], axis=1), np.eye(4)[3:]])
            motions = xp.where(is_ball, X_PJ @ motion @ joint.X_JL, motions)
        poses = [base]
        for k, previous in enumerate(self._previous):
            poses.append(product(poses[previous], motions[k], xp))
        frames: Array = xp.asarray(poses)
        return frames

    def poses(self, frames: Array) -> Array:
        """Return the poses (n, 4, 4) of all links in the world. `frames` contains the poses of all frames."""
        poses: Array = frames[self.of_link] @ self._place if self._fixed else frames[self.of_link]
        return poses

    def axes(self, frames: Array, xp: Any) -> tuple[Array, Array]:
        """Return the angular velocity (m, 3) and the linear velocity (m, 3) that each coordinate causes per unit of its velocity.

        The linear velocity is the velocity of the point at the origin of the root link. Both velocities are in world axes.
        """
        carrier = frames[self._carrier]
        velocities = self._axes @ carrier[:, :3, :3].swapaxes(1, 2)
        spin = velocities[:, 0]
        return spin, velocities[:, 1] + cross(carrier[:, :3, 3] - frames[0, :3, 3], spin, xp)

    def twists(self, frames: Array, u: Array, xp: Any) -> Array:
        """Return the twists (n, 6) of all links.

        The velocity `u` (6 + m,) is the twist of the base, followed by the velocities of the coordinates. A twist is the velocity of the
        origin of the link in world axes, followed by the angular velocity in the axes of the link.
        """
        X, spins = self.poses(frames), self.axes(frames, xp)
        root, path = frames[0], self._mask[:, 6:]
        spin = root[:3, :3] @ u[3:6] + path @ (spins[0] * u[6:, None])
        linear = u[:3] + path @ (spins[1] * u[6:, None]) + cross(spin, X[:, :3, 3] - root[:3, 3], xp)
        twists: Array = xp.concatenate([linear, (spin[:, None] @ X[:, :3, :3])[:, 0]], axis=1)
        return twists

    def jacobians(self, frames: Array, xp: Any) -> Array:
        """Return the Jacobians (n, 6, 6 + m) of all links. Each Jacobian maps the velocity of the robot to the velocity of the link.

        The velocity of a link is the velocity of its origin, followed by its angular velocity, both in world axes.
        """
        spin, linear = self.axes(frames, xp)
        moved = [
            xp.concatenate([np.eye(3), np.zeros((3, 3)), linear.T], axis=1),
            xp.concatenate([np.zeros((3, 3)), frames[0, :3, :3], spin.T], axis=1),
        ]
        at_root, angular = (part * self._mask[:, None] for part in moved)
        offset = self.poses(frames)[:, :3, 3] - frames[0, :3, 3]
        jacobians: Array = xp.concatenate([at_root - cross_columns(offset, angular, xp), angular], axis=1)
        return jacobians

    def mass_matrix(self, frames: Array, inertias: Inertias, xp: Any) -> Array:
        """Return the mass matrix (6 + m, 6 + m) of the robot, as if its base were free.

        The matrix includes armatures of joints, and inertias of tendons over joints. For each coordinate, the method adds up the inertias
        of all links that the coordinate moves, about the origin of the root link in world axes (composite-rigid-body algorithm, see
        Featherstone, Rigid Body Dynamics Algorithms, 2008).
        """
        X = self.poses(frames)
        R = X[:, :3, :3]
        centre = X[:, :3, 3] - frames[0, :3, 3] + product(R, inertias.centre[:, :, None], xp)[:, :, 0]
        moment = inertias.mass[:, None] * centre
        about_centre = product(product(R, inertias.inertia, xp), R.swapaxes(1, 2), xp)
        about_root = about_centre - cross_columns(moment, cross_matrix(centre), xp)
        links = xp.concatenate([xp.asarray(inertias.mass)[:, None], moment, about_root.reshape(-1, 9)], axis=1)
        mass, moment, inertia = xp.split(product(self._mask.T, links, xp), [1, 4], axis=1)
        spin, linear = self.axes(frames, xp)
        w = xp.concatenate([np.zeros((3, 3)), frames[0, :3, :3].T, spin])
        v = xp.concatenate([np.eye(3), np.zeros((3, 3)), linear])
        momentum = mass * v + cross(w, moment, xp)
        about = product(inertia.reshape(-1, 3, 3), w[:, :, None], xp)[:, :, 0] + cross(moment, v, xp)
        upper = product(xp.concatenate([v, w], axis=1), xp.concatenate([momentum, about], axis=1).T, xp) * self._later
        added = xp.diag(xp.concatenate([np.zeros(6), inertias.armature])) + self._coupled
        matrix: Array = upper + (upper * (1.0 - np.eye(len(upper)))).T + added
        return matrix

    def coupling(self, q: Array, xp: Any) -> Array:
        """Return the matrix (6 + m, 6 + k) that maps the velocity of the k independent coordinates to the velocity of all m coordinates.

        Both velocities start with the twist of the base. A coordinate is independent if its joint does not mimic another joint of this
        tree.
        """
        if not self.is_coupled:
            return self._pattern
        rates = [prod(mimic.rate(q[leader]) for mimic, leader in chain) for chain in self._chains]
        matrix: Array = xp.asarray(rates)[:, None] * self._pattern
        return matrix


@lru_cache(maxsize=256)
def kinematics(mode: Mode) -> Kinematics:
    """Return the `Kinematics` of a mode. The result is cached for each mode."""
    return Kinematics(mode)
