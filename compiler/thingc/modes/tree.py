"""The links, joints and held mounts of a robot in one mode, as read from `modes.json`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from thingc.base.numeric import sum_of
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.suggestions import did_you_mean
from thingc.modes import free_joints
from thingc.modes.addresses import Addresses
from thingc.modes.errors import ModesError
from thingc.modes.frames import Array, quaternion_of, rotation, rotation_of, rotation_vector
from thingc.modes.kinematics import Kinematics, kinematics
from thingc.modes.partial_bases import PartBase
from thingc.modes.state import RobotState, State


class Ball(OneLineStruct, eq=False):
    """A ball joint, or the rotations of a free joint, in the kinematic tree of a mode.

    `name` is the name of the joint in the MuJoCo model, and `coordinates` lists the names of the three coordinates in document order. If
    `reversed` is true, the tree traverses the joint from child to parent. The matrix `R` (3, 3) rotates the coordinates to the axes of the
    MuJoCo joint.
    """

    name: str
    coordinates: tuple[str, ...]
    reversed: bool
    R: Array

    def qpos(self, q: Array) -> Array:
        """Convert the coordinates q (3,) of this ball joint to a quaternion (4,) for MuJoCo's `qpos`."""
        return quaternion_of(rotation(self.R @ q))

    def qvel(self, q: Array, v: Array) -> Array:
        """Convert the coordinates q (3,) and velocities v (3,) of this ball joint to the angular velocity (3,) for MuJoCo's `qvel`."""
        qvel: Array = self.R @ (rotation(q) @ v if self.reversed else v)
        return qvel

    def read(self, qpos: Array, qvel: Array) -> tuple[Array, Array]:
        """Convert the values of this ball joint in MuJoCo's `qpos` (4,) and `qvel` (3,) to coordinates q (3,) and velocities v (3,).

        The norm of the returned q is at most pi.
        """
        q = self.R.T @ rotation_vector(rotation_of(qpos))
        v = self.R.T @ qvel
        return q, rotation(q).T @ v if self.reversed else v


class Inertias(OneLineStruct, eq=False):
    """The mass properties of the n links of a robot, and the armatures of its m joint coordinates.

    `mass` (n,) [kg], `centre` (n, 3) [m] and `inertia` (n, 3, 3) [kg m^2] have one row for each link. The centre of mass is in the link
    frame, and the inertia is about the centre of mass, in link axes. `armature` (m,) [kg m^2, or kg for slides] is the reflected rotor
    inertia of the actuator at each joint coordinate.
    """

    mass: Array
    centre: Array
    inertia: Array
    armature: Array


class Link(OneLineStruct, eq=False):
    """A rigid body of the robot, with its mass properties and its pose at q = 0.

    `X_root_link` (4, 4) is the pose of the link relative to the root link when all joint coordinates are 0. `mass` [kg], the centre of mass
    `centre` (3,) [m] and `inertia` (3, 3) [kg m^2] about the centre of mass are given in the frame of the link. `fixed_to` is the index of
    the parent of a link without joints in `Mode.links`.
    """

    name: str
    X_root_link: Array
    mass: float
    centre: Array
    inertia: Array
    fixed_to: int | None = None


class Mimic(OneLineStruct):
    """A coupling of a joint to another joint, as in URDF's `<mimic>`, with an optional polynomial.

    The coordinate of the joint is q = offset + multiplier x + higher[0] x^2 + ..., where x is the coordinate of the leading joint `joint`.
    """

    joint: str
    multiplier: float
    offset: float
    higher: tuple[float, ...] = ()

    def at(self, x: float) -> float:
        """Return the coordinate of the joint, where x is the coordinate of the leading joint."""
        return self.offset + self.multiplier * x + sum_of(c * x**k for k, c in enumerate(self.higher, start=2))

    def rate(self, x: float) -> float:
        """Return the derivative dq/dx of the coupling, where x is the coordinate of the leading joint."""
        return self.multiplier + sum_of(k * c * x ** (k - 1) for k, c in enumerate(self.higher, start=2))


class Joint(OneLineStruct, eq=False):
    """A single coordinate of a joint between two links. `parent` and `child` are indices into `Mode.links`.

    `first` is True for the first coordinate of a joint. `X_PJ` (4, 4) is the pose of the coordinate's frame in the previous frame. The
    previous frame is the parent link, or belongs to the previous coordinate. `twist` (6,) is the motion in the coordinate's frame per unit
    of q, with the angular part first. The coordinate moves a second frame, which is the frame of the child link or of the next coordinate.
    `X_JL` (4, 4) is the pose of the second frame in the coordinate's frame when q is -`offset`.

    `in_model` lists the joints of the mode's MuJoCo model that move with this coordinate, with their motion per unit of q. `qpos` and `dof`
    are the addresses of the MuJoCo joints. If `reversed` is true, the document exchanges parent and child. `kind` is the kind of the joint
    in the document. The coordinates of a `ball` are exponential coordinates, and each of them has the addresses `qpos` and `dof` of the
    whole ball.
    """

    name: str
    kind: str
    parent: int
    child: int
    first: bool
    X_PJ: Array
    twist: Array
    X_JL: Array
    offset: float
    reversed: bool
    armature: float
    mimic: Mimic | None
    in_model: Mapping[str, float]
    qpos: tuple[int, ...]
    dof: tuple[int, ...]
    ball: Ball | None = None

    @property
    def in_data(self) -> str:
        """The name of the MuJoCo joint from which the value of this coordinate is read."""
        return next(iter(self.in_model))


class Hold(OneLineStruct, eq=False):
    """A mount that a mode holds in the world, in addition to its root mount.

    `path` is the path of the mount, and `link` is the index of the link to which the mount belongs. `X_LM` (4, 4) is the pose of the mount
    in the link. `X_WM` (4, 4) is the pose in the world at which the document holds the mount. `anchor` is the mocap body of the MuJoCo
    model that holds the mount. If `turns` is true, the hold fixes only the origin of the mount, and the link can rotate about this point.
    """

    path: str
    link: int
    anchor: str
    X_LM: Array
    X_WM: Array
    turns: bool = False


class Cut(OneLineStruct, eq=False):
    """A joint that closes a loop, and is therefore not part of the kinematic tree of the mode.

    The joint connects a frame A on the link `parent` to a frame B on the link `child`. `parent` and `child` are indices of links, and
    `X_PA` and `X_CB` are the poses of frames A and B in these links. The joint moves frame A by its `coordinates` (names) in sequence, with
    their `twists` (n, 6; angular part first). After the motion of the joint, frame A coincides with frame B.
    """

    name: str
    kind: str
    parent: int
    child: int
    X_PA: Array
    X_CB: Array
    coordinates: tuple[str, ...]
    twists: Array


class Mode(OneLineStruct, eq=False):
    """A mode of a robot: its kinematic tree of links and joints, its base, and the mounts that are held in the world.

    Attributes:
        root: The path of the root mount, which is a site of the MuJoCo model.
        base: The type of the base: `fixed`, `held`, `free`, `planar` or `ball`. `part` describes the allowed motion of a `planar` or `ball`
            base.
        gravity: The gravitational acceleration (3,) in the world [m/s^2].
        X_world_root: The initial pose (4, 4) of the root link.
        links: The links of the tree. The list starts with the root link, and parents precede their children.
        joints: The joint coordinates of the tree in the order of the MuJoCo model.
        coordinates: The names of all joint coordinates of the robot, including those of joints that the mode cuts. All modes of the robot
            have the same order of coordinates.
        named: The poses of the mode by name, starting with the initial pose. Each pose maps joint paths to coordinates q.
        holds: The mounts that are held in the world in addition to the root mount.
        cuts: The joints that close loops.
        bases: The pose (4, 4) of a free root link in each named pose, if it differs from `X_world_root`.
        standing_on: The paths of the contact mounts on which a robot with a free base stands.
        tendons: The tendons over joints that have an inertia, such as the rotors of a differential: the inertia, and the factor of each
            coordinate.
    """

    name: str
    root: str
    base: str
    gravity: Array
    X_world_root: Array
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    coordinates: tuple[str, ...]
    named: Mapping[str, Mapping[str, float]]
    holds: tuple[Hold, ...] = ()
    cuts: tuple[Cut, ...] = ()
    bases: Mapping[str, Array] = {}
    standing_on: tuple[str, ...] = ()
    tendons: tuple[tuple[float, Mapping[str, float]], ...] = ()
    part: PartBase | None = None

    @property
    def root_link(self) -> str:
        """The name of the root link of the kinematic tree."""
        return self.links[0].name

    @property
    def inertias(self) -> Inertias:
        """The mass properties of all links at the time of the build.

        For the current mass properties in a MuJoCo model, use the method `Modes.inertias`.
        """
        return Inertias(
            mass=np.array([link.mass for link in self.links]),
            centre=np.array([link.centre for link in self.links]),
            inertia=np.array([link.inertia for link in self.links]),
            armature=np.array([joint.armature for joint in self.joints]),
        )

    def state(
        self, named: str | None = None, *, q: Mapping[str, float] | None = None, v: Mapping[str, float] | None = None,
        base_pose: ArrayLike | None = None, base_twist: ArrayLike | None = None,
    ) -> RobotState:
        """Return a state of the robot in this mode, in the pose `named`, or with all joint coordinates 0 if `named` is None.

        `q` maps joint paths to coordinates that differ from the pose. If `named` is None, joints that mimic others follow these joints. The
        robot is at rest except for the joint velocities `v` and the base twist `base_twist`. The base is at its initial pose, unless
        `base_pose` is given. Raises `ModesError` for an unknown pose or joint.
        """
        if named is not None and named not in self.named:
            raise ModesError(f"mode `{self.name}` has no pose `{named}`: {did_you_mean(named, self.named, what='poses')}")
        given = {**(self.named[named] if named is not None else {}), **(q or {})}
        names = {joint.name: joint for joint in self.joints}

        def coordinate(name: str) -> float:
            mimic = names[name].mimic if name in names and name not in given else None
            return given.get(name, 0.0) if mimic is None else mimic.at(coordinate(mimic.joint))

        for path in {**(q or {}), **(v or {})}:
            if path not in names:
                raise ModesError(f"the robot has no joint `{path}`: {did_you_mean(path, names, what='joints')}")
        return RobotState(
            mode=self.name,
            base_pose=np.asarray(self.bases.get(named or "", self.X_world_root) if base_pose is None else base_pose, dtype=float),
            base_twist=np.asarray(np.zeros(6) if base_twist is None else base_twist, dtype=float),
            q={name: coordinate(name) for name in names},
            v={joint.name: (v or {}).get(joint.name, 0.0) for joint in self.joints},
        )

    def poses(self, state: RobotState) -> dict[str, Array]:
        """Return a mapping from the name of each link to the pose (4, 4) of its frame in the world. The root link is the first key."""
        kin, frames, _ = self._moving(state)
        return dict(zip(kin.number, kin.poses(frames), strict=True))

    def twists(self, state: RobotState) -> dict[str, Array]:
        """Return a mapping from the name of each link to its twist (6,)."""
        kin, frames, u = self._moving(state)
        return dict(zip(kin.number, kin.twists(frames, u, np), strict=True))

    def velocity(self, state: RobotState) -> Array:
        """Return the generalized velocity (6 + m,) of the robot, as if its base were free.

        The generalized velocity consists of `base_twist`, followed by the joint velocities in the order of `joints`.
        """
        return self._moving(state)[2]

    def jacobians(self, state: RobotState) -> tuple[Array, ...]:
        """Return the Jacobian (6, 6 + m) of every link, in the order of `links`.

        The Jacobian of a link maps the generalized velocity of the robot (see `velocity`) to the velocity of the link. The first three rows
        of a Jacobian are the velocity of the link frame's origin, and the last three rows are the angular velocity, both in world axes.
        """
        kin, frames, _ = self._moving(state)
        return tuple(kin.jacobians(frames, np))

    def mass_matrix(self, state: RobotState, inertias: Inertias | None = None) -> Array:
        """Return the mass matrix (6 + m, 6 + m) of the robot, as if its base were free.

        Rows and columns of the matrix have the same order as the vector that `velocity` returns. `inertias` must list the links in the
        order of this mode's tree. By default, `inertias` contains the values at the time of the build.
        """
        kin, frames, _ = self._moving(state)
        return kin.mass_matrix(frames, self.inertias if inertias is None else inertias, np)

    def qpos(self, state: RobotState) -> Array:
        """Convert a state to an array for `MjData.qpos` of this mode's MuJoCo model.

        The array consists of the coordinates of a free, planar or ball base, followed by the joint coordinates.
        """
        return self._values(state)[0]

    def qvel(self, state: RobotState) -> Array:
        """Convert a state to an array for `MjData.qvel` of this mode's MuJoCo model.

        The array consists of the velocity of a free, planar or ball base, followed by the joint velocities.
        """
        return self._values(state)[1]

    def arrays(self, state: RobotState) -> State[Array]:
        """Convert a `RobotState` of this mode to a `State`, which contains arrays. The coordinates of joints that this mode cuts are 0."""
        if state.mode != self.name:
            raise ModesError(f"expected a state of mode `{self.name}`, found a state of mode `{state.mode}`: call `switch` first")
        for symbol, values in (("q", state.q), ("v", state.v)):
            missing = next((joint.name for joint in self.joints if joint.name not in values), None)
            if missing is not None:
                raise ModesError(f"the state has no `{symbol}` of joint `{missing}`")
        q, v = (np.array([values.get(name, 0.0) for name in self.coordinates]) for values in (state.q, state.v))
        return State(state.base_pose, state.base_twist, q, v)

    def robot_state(self, state: State[Array]) -> RobotState:
        """Convert a `State`, which contains arrays, to a `RobotState` of this mode, which maps joint paths to values."""
        q, v = (dict(zip(self.coordinates, np.asarray(values).tolist(), strict=True)) for values in (state.q, state.v))
        return RobotState(
            mode=self.name, base_pose=np.asarray(state.base), base_twist=np.asarray(state.twist),
            q={joint.name: q[joint.name] for joint in self.joints}, v={joint.name: v[joint.name] for joint in self.joints},
        )

    def _moving(self, state: RobotState) -> tuple[Kinematics, Array, Array]:
        """Return the kinematics of this mode, the poses of all frames, and the generalized velocity of the robot."""
        kin, arrays = kinematics(self), self.arrays(state)
        return kin, kin.frames(arrays.base, arrays.q[kin.rows], np), np.concatenate([arrays.twist, arrays.v[kin.rows]])

    def _values(self, state: RobotState) -> tuple[Array, Array]:
        """Return the arrays `qpos` and `qvel` of this mode's MuJoCo model for a state."""
        arrays = self.arrays(state)
        qpos, qvel = (
            np.concatenate([base, np.zeros(len({address for joint in self.joints for address in getattr(joint, field)}))])
            for base, field in zip(base_values(self, arrays), ("qpos", "dof"), strict=True)
        )
        addresses = {name: pair for joint in self.joints for name, *pair in zip(joint.in_model, joint.qpos, joint.dof)}
        Addresses(self, addresses).write(arrays.q, arrays.v, qpos, qvel)
        first = {joint.in_data: (joint.qpos[0], joint.dof[0]) for joint in self.joints}
        free_joints.write(self, arrays, qpos, qvel, first)
        return qpos, qvel


def base_values(mode: Mode, state: State[Array]) -> tuple[Array, Array]:
    """Return the values of MuJoCo's `qpos` and `qvel` for the base of a mode. Both arrays are empty for a fixed or held base."""
    if mode.base == "free":
        return np.concatenate([state.base[:3, 3], quaternion_of(state.base[:3, :3])]), state.twist
    if mode.part is not None:
        return mode.part.qpos(state.base), mode.part.qvel(state.base, state.twist)
    return np.zeros(0), np.zeros(0)
