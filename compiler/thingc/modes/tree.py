"""The tree of links and joints of one mode, as in `modes.json`, with kinematics and the mass matrix in numpy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from thingc.base.numeric import sum_of
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.suggestions import did_you_mean
from thingc.modes.errors import ModesError
from thingc.modes.frames import Array, cross_matrix, exponential, pose, quaternion_of, rotation_of, rotation_vector, turned
from thingc.modes.partial_bases import PartBase
from thingc.modes.state import RobotState


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Ball(OneLineRepr):
    """A ball joint in the tree.

    `name` is its name in the model, and `coordinates` are its three coordinates in the order of the document. If `reversed` is true, the
    tree traverses the joint from child to parent. `R` (3, 3) converts q of the joint to MuJoCo's axes.
    """

    name: str
    coordinates: tuple[str, ...]
    reversed: bool
    R: Array

    def vector(self, values: Mapping[str, float]) -> Array:
        """Return the entries (3,) of the joint from the values of all coordinates."""
        return np.array([values[name] for name in self.coordinates])

    def step(self, coordinate: str, q: Mapping[str, float]) -> Array:
        """Return the rotation (3, 3) of the joint for its first coordinate in the tree, and the identity for its other coordinates."""
        if coordinate != self.coordinates[0]:
            return np.eye(3)
        turn = rotation(self.vector(q))
        return turn.T if self.reversed else turn

    def qpos(self, q: Mapping[str, float]) -> Array:
        """Return MuJoCo's quaternion (4,)."""
        return quaternion_of(rotation(self.R @ self.vector(q)))

    def qvel(self, q: Mapping[str, float], v: Mapping[str, float]) -> Array:
        """Return MuJoCo's velocity (3,)."""
        spin = self.vector(v)
        qvel: Array = self.R @ (rotation(self.vector(q)) @ spin if self.reversed else spin)
        return qvel

    def read(self, qpos: Array, qvel: Array) -> tuple[dict[str, float], dict[str, float]]:
        """Convert MuJoCo's values to (q, v) by coordinate. The norm of q is at most pi."""
        r = self.R.T @ rotation_vector(rotation_of(qpos))
        spin = self.R.T @ np.asarray(qvel)
        if self.reversed:
            spin = rotation(r).T @ spin
        q, v = (dict(zip(self.coordinates, map(float, one), strict=True)) for one in (r, spin))
        return q, v


def rotation(vector: Array) -> Array:
    """Return the matrix (3, 3) of a rotation vector (3,)."""
    angle = float(np.linalg.norm(vector))
    return np.eye(3) if angle == 0.0 else turned(vector / angle, angle)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Inertias(OneLineRepr):
    """Inertias of n links and of m joints.

    The fields of links are `mass` (n,) [kg], `centre` (n, 3) [m] in the link's frame, and `inertia` (n, 3, 3) [kg m^2] about the centre in
    the link's axes. The field of joints is `armature` (m,) [kg m^2; kg for slides], the reflected inertia of the rotor.
    """

    mass: Array
    centre: Array
    inertia: Array
    armature: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Link(OneLineRepr):
    """A rigid body of the robot.

    `X_root_link` (4, 4) is the pose of the link in the root link at q = 0. `mass` [kg], `centre` (3,) [m] and `inertia` (3, 3) [kg m^2,
    about the centre] are given in the frame of the link.
    """

    name: str
    X_root_link: Array
    mass: float
    centre: Array
    inertia: Array


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Mimic(OneLineRepr):
    """A coupling to another joint: q = offset + multiplier x + higher[0] x^2 + ..., where x is q of `joint`."""

    joint: str
    multiplier: float
    offset: float
    higher: tuple[float, ...] = ()

    def rate(self, x: float) -> float:
        """Return dq/dx at `x`."""
        return self.multiplier + sum_of(k * c * x ** (k - 1) for k, c in enumerate(self.higher, start=2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Joint(OneLineRepr):
    """A coordinate of a joint from link `parent` to link `child` (indices into `Mode.links`).

    `first` marks the first coordinate of a joint. `X_PJ` (4, 4) is the frame of the coordinate in the parent, or in the frame that the
    previous coordinate moves. `twist` (6,) is the motion in this frame per unit of q, angular then linear. `X_JL` (4, 4) is the pose of the
    moved frame (of the child or of the next coordinate) in the frame of the coordinate when q is -`offset`. `in_model` maps joints of the
    mode's own model to their motion per unit of q; `qpos` and `dof` are the addresses of these joints. If `reversed` is true, parent and
    child are exchanged in the document. `kind` is the kind in the document. The coordinates of a `ball` are exponential coordinates, and
    each of them has the addresses `qpos` and `dof` of the whole ball.
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
        """The MuJoCo joint that provides the values of this coordinate."""
        return next(iter(self.in_model))

    def step(self, q: Mapping[str, float]) -> Array:
        """Return the motion (4, 4) of this coordinate in its frame. `q` contains all joints."""
        if self.ball is not None:
            return pose(self.ball.step(self.name, q), np.zeros(3))
        return exponential(self.twist, q[self.name] + self.offset)

    def in_qpos(self, q: Mapping[str, float]) -> Array:
        """Return the entries in `MjData.qpos`. The entries of a ball joint belong to its first coordinate in the tree."""
        if self.ball is None:
            return np.array([ratio * q[self.name] for ratio in self.in_model.values()])
        return self.ball.qpos(q) if self.first else np.zeros(0)

    def in_qvel(self, q: Mapping[str, float], v: Mapping[str, float]) -> Array:
        """Return the entries in `MjData.qvel`. The entries of a ball joint belong to its first coordinate in the tree."""
        if self.ball is None:
            return np.array([ratio * v[self.name] for ratio in self.in_model.values()])
        return self.ball.qvel(q, v) if self.first else np.zeros(0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Hold(OneLineRepr):
    """A mount `path` on `link` (an index) that the mode holds in addition to its root.

    `X_LM` (4, 4) is its pose in the link, and `X_WM` (4, 4) its pose in the world as specified in the document. `anchor` is the mocap body
    of the model that holds the mount. If `turns` is true, the hold transmits only force: the mode holds the origin of the mount, and the
    link can rotate about the origin.
    """

    path: str
    link: int
    anchor: str
    X_LM: Array
    X_WM: Array
    turns: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Cut(OneLineRepr):
    """A joint that closes a loop and is not part of this mode's tree.

    Frame A on link `parent` (index, `X_PA`) is moved by its `coordinates` (names) in sequence with their `twists` (n, 6; angular, then
    linear). After this motion, frame A coincides with frame B on link `child` (`X_CB`).
    """

    name: str
    kind: str
    parent: int
    child: int
    X_PA: Array
    X_CB: Array
    coordinates: tuple[str, ...]
    twists: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Mode(OneLineRepr):
    """A mode of a robot.

    Attributes:
        root: The path of the root mount, which is a site of the model.
        base: `fixed`, `held`, `free`, `planar` or `ball`. `part` describes the mobility of a `planar` or `ball` base.
        gravity: The gravitational acceleration (3,) in the world [m/s^2].
        X_world_root: The initial pose (4, 4) of the root link.
        links: The links, the root first and parents before children.
        joints: The joints in the order of the model.
        named: The poses of the mode by name, starting with the initial pose. Each pose contains q by joint path.
        holds: Other mounts that are held in the world.
        cuts: The joints that close loops.
        bases: The poses of a free root link that differ from `X_world_root`, by name of the pose.
        standing_on: The paths of the contact mounts of a free base.
    """

    name: str
    root: str
    base: str
    gravity: Array
    X_world_root: Array
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    named: Mapping[str, Mapping[str, float]]
    holds: tuple[Hold, ...] = ()
    cuts: tuple[Cut, ...] = ()
    bases: Mapping[str, Array] = field(default_factory=dict)
    standing_on: tuple[str, ...] = ()
    part: PartBase | None = None

    @property
    def root_link(self) -> str:
        """The name of the root link of the tree."""
        return self.links[0].name

    @property
    def inertias(self) -> Inertias:
        """The inertias at the time of the build. `Modes.inertias` returns the current inertias of a model."""
        return Inertias(
            mass=np.array([link.mass for link in self.links]),
            centre=np.array([link.centre for link in self.links]),
            inertia=np.array([link.inertia for link in self.links]),
            armature=np.array([joint.armature for joint in self.joints]),
        )

    def state(
        self,
        named: str | None = None,
        *,
        q: Mapping[str, float] | None = None,
        v: Mapping[str, float] | None = None,
        base_pose: ArrayLike | None = None,
        base_twist: ArrayLike | None = None,
    ) -> RobotState:
        """Return a state of this mode: the pose `named` (None: every joint at 0), with the values in `q` instead of the pose's values.

        The robot is at rest except for `v` and `base_twist`. The base is at its initial pose unless `base_pose` is given. Raises
        `ModesError` for an unknown pose or joint.
        """
        if named is not None and named not in self.named:
            raise ModesError(f"mode `{self.name}` has no pose `{named}`: {did_you_mean(named, self.named, what='poses')}")
        start = self.named[named] if named is not None else {}
        for path in {**(q or {}), **(v or {})}:
            self._index(path)
        return RobotState(
            mode=self.name,
            base_pose=np.asarray(self.bases.get(named or "", self.X_world_root) if base_pose is None else base_pose, dtype=float),
            base_twist=np.asarray(np.zeros(6) if base_twist is None else base_twist, dtype=float),
            q={joint.name: (q or {}).get(joint.name, start.get(joint.name, 0.0)) for joint in self.joints},
            v={joint.name: (v or {}).get(joint.name, 0.0) for joint in self.joints},
        )

    def poses(self, state: RobotState) -> dict[str, Array]:
        """Return the pose (4, 4) of every link's frame in the world by name, the root first."""
        return dict(zip((link.name for link in self.links), self._placed(state), strict=True))

    def twists(self, state: RobotState) -> dict[str, Array]:
        """Return the twist (6,) of every link by name.

        A twist is the velocity [m/s] of the origin of the link's frame in world axes, followed by the angular velocity [rad/s] in the
        link's axes.
        """
        placed = self._placed(state)
        u = self.velocity(state)
        twists = {}
        for link, X, J in zip(self.links, placed, self._jacobians(state, placed), strict=True):
            twist = J @ u
            twists[link.name] = np.concatenate([twist[:3], X[:3, :3].T @ twist[3:]])
        return twists

    def velocity(self, state: RobotState) -> Array:
        """Return the generalized velocity (6 + m,) of the robot with a free base: `base_twist`, then v in the order of the joints."""
        self._check(state)
        return np.concatenate([state.base_twist, [state.v[joint.name] for joint in self.joints]])

    def jacobians(self, state: RobotState) -> tuple[Array, ...]:
        """Return the Jacobian (6, 6 + m) of every link.

        The Jacobian maps `velocity` to the velocity of the origin of the link's frame and to the angular velocity, both in world axes.
        """
        return tuple(self._jacobians(state, self._placed(state)))

    def mass_matrix(self, state: RobotState, inertias: Inertias | None = None) -> Array:
        """Return the mass matrix (6 + m, 6 + m) of the robot with a free base, for velocities as in `velocity`. The base of the mode is
        ignored.

        The matrix is `M = sum J^T diag(m 1, R I R^T) J + diag(0, armature)` over the links, where J is the Jacobian of a link's centre.
        `inertias` must be in the order of this mode's tree. The default is the inertias at the time of the build.
        """
        known = self.inertias if inertias is None else inertias
        placed = self._placed(state)
        matrix = np.diag(np.concatenate([np.zeros(6), known.armature]))
        for index, (X, J) in enumerate(zip(placed, self._jacobians(state, placed), strict=True)):
            angular = J[3:]
            linear = J[:3] - cross_matrix(X[:3, :3] @ known.centre[index]) @ angular
            spin = X[:3, :3] @ known.inertia[index] @ X[:3, :3].T
            matrix += known.mass[index] * linear.T @ linear + angular.T @ spin @ angular
        return matrix

    def qpos(self, state: RobotState) -> Array:
        """Return `MjData.qpos` of the mode's own model: the coordinates of a free, planar or ball base, then q."""
        self._check(state)
        X = state.base_pose
        base = [*X[:3, 3], *quaternion_of(X[:3, :3])] if self.base == "free" else []
        if self.part is not None:
            base = [*self.part.qpos(X)]
        return np.concatenate([base, *(joint.in_qpos(state.q) for joint in self.joints)])

    def qvel(self, state: RobotState) -> Array:
        """Return `MjData.qvel` of the mode's own model: the velocity of a free, planar or ball base, then v."""
        self._check(state)
        base = [*state.base_twist] if self.base == "free" else []
        if self.part is not None:
            base = [*self.part.qvel(state.base_pose, state.base_twist)]
        return np.concatenate([base, *(joint.in_qvel(state.q, state.v) for joint in self.joints)])

    def coupling(self, q: Mapping[str, float]) -> Array:
        """Return the matrix (m, k) at `q` (by joint) that maps v of the k independent joints to v of all m joints.

        A joint is independent if it does not mimic another joint of this tree. Rows and columns are in the order of the model.
        """
        by_name = {joint.name: joint for joint in self.joints}
        free = [joint.name for joint in self.joints if joint.mimic is None or joint.mimic.joint not in by_name]
        matrix = np.zeros((len(self.joints), len(free)))
        for row, joint in enumerate(self.joints):
            ratio, leader = 1.0, joint
            while leader.mimic is not None and leader.name not in free:
                ratio, leader = ratio * leader.mimic.rate(q[leader.mimic.joint]), by_name[leader.mimic.joint]
            matrix[row, free.index(leader.name)] = ratio
        return matrix

    def _index(self, path: str) -> int:
        for index, joint in enumerate(self.joints):
            if joint.name == path:
                return index
        names = [joint.name for joint in self.joints]
        raise ModesError(f"the robot has no joint `{path}`: {did_you_mean(path, names, what='joints')}")

    def _check(self, state: RobotState) -> None:
        if state.mode != self.name:
            raise ModesError(f"expected a state of mode `{self.name}`, found one of mode `{state.mode}`: `switch` it first")
        for what, values in (("q", state.q), ("v", state.v)):
            missing = next((joint.name for joint in self.joints if joint.name not in values), None)
            if missing is not None:
                raise ModesError(f"the state has no `{what}` of joint `{missing}`")

    def _placed(self, state: RobotState) -> list[Array]:
        """Return the poses of links in the world: `X_WL = X_WP X_PJ exp(twist (q + offset)) X_JL` for each coordinate in sequence."""
        self._check(state)
        poses = [state.base_pose] * len(self.links)
        for joint in self.joints:
            start = poses[joint.parent if joint.first else joint.child]
            poses[joint.child] = start @ joint.X_PJ @ joint.step(state.q) @ joint.X_JL
        return poses

    def _jacobians(self, state: RobotState, placed: list[Array]) -> list[Array]:
        """Return the result of `jacobians` for given poses of the links."""
        count = 6 + len(self.joints)
        root, here = np.zeros((6, count)), np.zeros(3)
        root[:3, :3], root[3:, 3:6] = np.eye(3), state.base_pose[:3, :3]
        jacobians, J = [root] * len(self.links), root
        frame = state.base_pose
        for column, joint in enumerate(self.joints, start=6):
            if joint.first:
                frame, J = placed[joint.parent], jacobians[joint.parent].copy()
                here = placed[joint.child][:3, 3]
                J[:3] -= cross_matrix(here - frame[:3, 3]) @ J[3:]
                jacobians[joint.child] = J
            X_WJ, step = frame @ joint.X_PJ, joint.step(state.q)
            if joint.ball is not None and not joint.reversed:  # about axes of the document's child, which rotate with it
                X_WJ, step = X_WJ @ step, np.eye(4)
            angular, linear = X_WJ[:3, :3] @ joint.twist[:3], X_WJ[:3, :3] @ joint.twist[3:]
            J[:3, column], J[3:, column] = linear + np.cross(angular, here - X_WJ[:3, 3]), angular
            frame = X_WJ @ step @ joint.X_JL
        return jacobians
