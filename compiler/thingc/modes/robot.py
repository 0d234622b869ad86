"""All modes of a robot, and methods to switch between them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, get_args

import numpy as np

from thingc.base.one_line_repr import OneLineRepr
from thingc.base.suggestions import did_you_mean
from thingc.modes import mjdata, modes_file
from thingc.modes.cut_joints import coordinates, freedoms, usual
from thingc.modes.errors import BaseElsewhere, BaseMoves, ModesError, UnknownMode
from thingc.modes.frames import Array, angle_between, inverse, pose
from thingc.modes.impact import Impact, at_point, caught
from thingc.modes.partial_bases import PartBase
from thingc.modes.state import RobotState
from thingc.modes.tree import Cut, Inertias, Mode

OnMotion = Literal["raise", "drop", "impact"]
CHOICES: tuple[OnMotion, ...] = get_args(OnMotion)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class SwitchResult(OneLineRepr):
    """The result of a switch.

    Attributes:
        state: The state in the new mode.
        removed: The removed part (6,) [m/s, rad/s] of the twist of the new root link, or 0.
        impulse: The impulse (6,) of the impact on the root link: linear [N s] in world axes, and angular [N m s] about its frame's origin
            in its own axes. It is 0 unless `on_motion="impact"` removed a motion.
        holds: The values `removed` and `impulse` of the other held mounts, by path of the mount.
        uncommanded: The actuators that only the new mode has. Their controls do not change.
    """

    state: RobotState
    removed: Array
    impulse: Array
    holds: Mapping[str, Impact]
    uncommanded: tuple[str, ...] = ()


class Modes(Mapping[str, Mode]):
    """The modes of a robot by name, in the order of the document: `robot["bench"]`. Unknown names raise `UnknownMode`."""

    def __init__(self, modes: Mapping[str, Mode]) -> None:
        self._modes = dict(modes)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Modes:
        """Load the modes of a robot from its build folder (`build/arm`) or its `modes.json`.

        Raises `FileNotFoundError` if the file does not exist, and `ModesError` if it is not a valid `modes.json`.
        """
        return cls(modes_file.load_modes(path))

    @classmethod
    def parse(cls, text: str | bytes) -> Modes:
        """Parse the content of a `modes.json`. Raises `ModesError`."""
        return cls(modes_file.parse(text))

    def __getitem__(self, name: str) -> Mode:
        if name not in self._modes:
            raise UnknownMode(f"the robot has no mode `{name}`: {did_you_mean(str(name), self._modes, what='modes')}")
        return self._modes[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._modes)

    def __len__(self) -> int:
        return len(self._modes)

    def __repr__(self) -> str:
        return f"Modes({', '.join(self._modes)})"

    def read(self, mode: str, data: Any) -> RobotState:
        """Return the state in a `mujoco.MjData` of a mode's model. Raises `UnknownMode`, and `WrongData` for data of another model."""
        return mjdata.read_state(self[mode], data)

    def write(self, state: RobotState, data: Any) -> None:
        """Write a state to a `mujoco.MjData` of its mode's model. Only qpos, qvel and the mocap pose of the robot are changed.

        If the base is fixed, only the joints are written, because the model defines the pose of the base. Raises `WrongData` for data of
        another model.
        """
        mjdata.write_state(self[state.mode], state, data)

    def inertias(self, mode: str, data: Any) -> Inertias:
        """Return the current inertias in the model of `data`, which can belong to any mode, in the order of the tree of `mode`."""
        return mjdata.inertias(self[mode], data)

    def switch(
        self,
        source: RobotState | tuple[str, Any],
        target: str | tuple[str, Any],
        *,
        on_motion: OnMotion = "raise",
        at_rest: float = 1e-9,
        tolerance: float = 1e-6,
        inertias: Inertias | None = None,
    ) -> SwitchResult:
        """Convert the state of `source` to a state of the mode `target`.

        `source` is a state, or the name of a mode and its `mujoco.MjData`. `target` is the name of a mode, or the name and the `MjData` to
        fill. If `target` includes `MjData`, this method writes qpos, qvel and the mocap pose of the robot. If `source` also includes
        `MjData`, this method copies the time, and the controls and activations by actuator name. Other elements of the scene do not change.
        Call `mj_forward` on the `MjData` of `target` afterwards.

        q and v of the joints do not change. Forward kinematics gives the pose and twist of the new root link. If the new base is held or
        fixed while its link moves faster than `at_rest` [m/s and rad/s], `on_motion` selects the behaviour: `"raise"` raises `BaseMoves`,
        `"drop"` stops the link and preserves v of the joints, and `"impact"` computes v after a perfectly inelastic impact (see `caught`).
        The impact uses `inertias`. By default, these are the inertias of the target's model, else of the source's model, else of the build.
        A fixed base must be at its pose within `tolerance` [m and rad], else `BaseElsewhere` is raised.

        `on_motion` also applies to the links of other holds, or to the held point if the hold allows rotation. The mode holds these links
        at their current poses, and the anchors (mocap bodies) move to these poses. If the base is fixed, these links must be at the poses
        specified in the document. This method does not modify models. If it raises an exception (`ModesError`), it modifies no data.
        """
        if on_motion not in CHOICES:
            raise ModesError(f"expected on_motion \"raise\", \"drop\" or \"impact\", found `{on_motion}`")
        state = source if isinstance(source, RobotState) else self.read(*source)
        from_data = None if isinstance(source, RobotState) else source[1]
        name, into_data = (target, None) if isinstance(target, str) else target
        old, new = self[state.mode], self[name]
        if into_data is not None:
            mjdata.check(new, into_data)
        moving = _placed(_seen_from(state, old, new), new, into_data, tolerance)
        known = partial(_known_inertias, new, inertias, into_data, from_data)
        switched = _stopped(moving, new, on_motion, at_rest, known)
        if into_data is None:
            return switched
        mjdata.write_state(new, switched.state, into_data)
        mjdata.hold_here(new, switched.state, into_data)
        return switched if from_data is None else replace(switched, uncommanded=mjdata.carry((old, new), from_data, into_data))


def _placed(state: RobotState, mode: Mode, data: Any, tolerance: float) -> RobotState:
    """Return the state with a base pose that `mode` allows.

    The pose of a fixed base is read from the model of `data` if given, else from the build.
    """
    if mode.base == "fixed":
        return _bolted(state, mode, mode.X_world_root if data is None else mjdata.bolted(mode, data), tolerance)
    return state if mode.part is None else _in_part(state, mode, mode.part, tolerance)


def _stopped(state: RobotState, mode: Mode, on_motion: OnMotion, at_rest: float, inertias: Callable[[], Inertias]) -> SwitchResult:
    """Return the state with the held links of `mode` at rest. Raises `BaseMoves` if one moves and `on_motion` is `"raise"`."""
    removed = _removed(state, mode)
    impulse: Array = np.zeros(6)
    impulses: Mapping[str, Array] = {hold.path: np.zeros(6) for hold in mode.holds}
    moving = next(((link, twist) for link, twist in removed.values() if _speed(twist) > at_rest), None)
    if moving is not None and on_motion == "raise":
        raise BaseMoves(mode.name, *moving)
    if moving is not None and on_motion == "impact":
        state, impulse, impulses = caught(mode, state, inertias())
    return SwitchResult(
        state=state if mode.base == "free" else replace(state, base_twist=_kept(state, mode)),
        removed=np.zeros(6) if mode.base == "free" else removed[mode.root][1],
        impulse=impulse,
        holds={hold.path: Impact(removed=removed[hold.path][1], impulse=impulses[hold.path]) for hold in mode.holds},
    )


def _known_inertias(mode: Mode, given: Inertias | None, *sources: Any) -> Inertias:
    """Return `given`, or the inertias in the first `MjData` that is not None, or else the inertias of the build."""
    if given is not None:
        return given
    data = next((data for data in sources if data is not None), None)
    return mode.inertias if data is None else mjdata.inertias(mode, data)


def _seen_from(state: RobotState, old: Mode, new: Mode) -> RobotState:
    """Return the same motion relative to another root.

    Coordinates of joints that are cut in `old` are computed from the motion of their ends.
    """
    poses, twists = old.poses(state), old.twists(state)
    q, v = dict(state.q), dict(state.v)
    for cut in old.cuts:
        for name, *values in zip(cut.coordinates, *_across(old, cut, poses, twists), strict=True):
            q[name], v[name] = map(float, values)
    return RobotState(
        mode=new.name, base_pose=poses[new.root_link], base_twist=twists[new.root_link],
        q={joint.name: q[joint.name] for joint in new.joints}, v={joint.name: v[joint.name] for joint in new.joints},
    )


def _across(mode: Mode, cut: Cut, poses: Mapping[str, Array], twists: Mapping[str, Array]) -> tuple[Array, Array]:
    """Return (q, v) of a cut joint from the motion of its ends. Angles differ from the mode's first pose by at most half a turn."""
    parent, child = mode.links[cut.parent].name, mode.links[cut.child].name
    X_WA, X_WB = poses[parent] @ cut.X_PA, poses[child] @ cut.X_CB
    q = coordinates(cut, inverse(X_WA) @ X_WB, usual(mode, cut))
    spins = [poses[link][:3, :3] @ twists[link][3:] for link in (parent, child)]
    ends = [twists[link][:3] + np.cross(spin, X_WB[:3, 3] - poses[link][:3, 3]) for link, spin in zip((parent, child), spins, strict=True)]
    relative = np.concatenate([ends[1] - ends[0], spins[1] - spins[0]])
    return q, np.linalg.lstsq(freedoms(cut, q, X_WB).T, relative, rcond=None)[0]


def _removed(state: RobotState, mode: Mode) -> dict[str, tuple[str, Array]]:
    """Return the motions that `mode` stops by mount path, starting with the root.

    Each value is the name of the link and its twist. If a hold allows rotation, the twist is replaced by the velocity of the mount's
    origin, followed by zeros.
    """
    twists = mode.twists(state)
    poses = mode.poses(state)
    removed = {} if mode.base == "free" else {mode.root: (mode.root_link, twists[mode.root_link] - _kept(state, mode))}
    for hold in mode.holds:
        link = mode.links[hold.link].name
        removed[hold.path] = (link, at_point(hold, poses[link], twists[link]) if hold.turns else twists[link])
    return removed


def _kept(state: RobotState, mode: Mode) -> Array:
    """Return the part (6,) of the root link's twist that the base of `mode` allows. The base must not be free."""
    if mode.part is None:
        return np.zeros(6)
    return mode.part.twist(state.base_pose, mode.part.qvel(state.base_pose, state.base_twist))


def _in_part(state: RobotState, mode: Mode, part: PartBase, tolerance: float) -> RobotState:
    """Return the state with the base exactly at a pose that its partial mobility allows. Raises `BaseElsewhere` if it is too far from one.
    """
    place = part.pose(part.qpos(state.base_pose))
    _compare(mode, mode.root_link, state.base_pose, place, tolerance)
    return replace(state, base_pose=place)


def _speed(twist: Array) -> float:
    """Return the larger of the linear [m/s] and the angular speed [rad/s]."""
    return max(float(np.linalg.norm(twist[:3])), float(np.linalg.norm(twist[3:])))


def _bolted(state: RobotState, mode: Mode, place: Array, tolerance: float) -> RobotState:
    """Return the state with the base exactly at `place`.

    Raises `BaseElsewhere` if the distance of the base or of another hold from its specified pose is larger than `tolerance`.
    """
    _compare(mode, mode.root_link, state.base_pose, place, tolerance)
    poses = mode.poses(state)
    for hold in mode.holds:
        link = mode.links[hold.link].name
        there = pose(poses[link][:3, :3] @ hold.X_LM[:3, :3], hold.X_WM[:3, 3]) if hold.turns else hold.X_WM
        _compare(mode, link, poses[link], there @ inverse(hold.X_LM), tolerance)
    return replace(state, base_pose=place)


def _compare(mode: Mode, link: str, X: Array, place: Array, tolerance: float) -> None:
    distance = float(np.linalg.norm(X[:3, 3] - place[:3, 3]))
    angle = angle_between(place[:3, :3], X[:3, :3])
    if max(distance, angle) > tolerance:
        raise BaseElsewhere(mode.name, link, distance, angle, tolerance)
