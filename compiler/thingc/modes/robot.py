"""The class `Modes`, which contains the modes of a robot and switches between them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
from msgspec.structs import replace

from thingc.base.one_line_repr import OneLineStruct
from thingc.base.suggestions import did_you_mean
from thingc.modes import mjdata, modes_file
from thingc.modes.errors import BaseElsewhere, BaseMoves, ModesError, UnknownMode
from thingc.modes.frames import Array, difference
from thingc.modes.impact import Impact, at_point, stop
from thingc.modes.kinematics import kinematics
from thingc.modes.state import RobotState, State
from thingc.modes.switching import change_root, keep_free_twist, put_base
from thingc.modes.tree import Inertias, Mode

OnMotion = Literal["raise", "drop", "impact"]
CHOICES: tuple[OnMotion, ...] = get_args(OnMotion)


class SwitchResult(OneLineStruct, eq=False):
    """The result of switching a robot from one mode to another.

    Attributes:
        state: The state of the robot in the new mode.
        removed: The part (6,) [m/s, rad/s] of the twist of the new root link that was removed, or 0.
        impulse: The impulse (6,) on the root link: the linear impulse [N s] in world axes, then the angular impulse [N m s] about the
            origin of the link frame in link axes. The impulse is 0 unless `on_motion="impact"` stopped a moving link.
        holds: For each other held mount, by its path, the values `removed` and `impulse` of its link.
        uncommanded: The names of the actuators that only the new mode has, and whose controls do not change.
    """

    state: RobotState
    removed: Array
    impulse: Array
    holds: Mapping[str, Impact]
    uncommanded: tuple[str, ...] = ()


class Modes(Mapping[str, Mode]):
    """The modes of a robot, in the order of the document.

    For example, `robot["bench"]` returns the mode `bench`. An unknown name raises the exception `UnknownMode`.
    """

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
        """Create the modes from the content of a file `modes.json`. Raises `ModesError` if the content is invalid."""
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
        """Return the state of the robot that a `mujoco.MjData` contains. `mode` is the name of the mode to which the MuJoCo model belongs.

        Raises `UnknownMode` for an unknown mode, and `WrongData` if `data` belongs to another model.
        """
        read_mode = self[mode]
        return read_mode.robot_state(mjdata.read_state(read_mode, mjdata.map_model(read_mode, data.model), data))

    def write(self, state: RobotState, data: Any) -> None:
        """Write a state of the robot to a `mujoco.MjData` of the same mode.

        The method changes only `qpos`, `qvel` and the mocap pose of the robot. If the base is fixed, the method writes only the joints,
        because the model defines the pose of the base. Raises `WrongData` if `data` belongs to another model.
        """
        mode = self[state.mode]
        mjdata.write_state(mode, mode.arrays(state), mjdata.map_model(mode, data.model), data)

    def inertias(self, mode: str, data: Any) -> Inertias:
        """Return the current inertias of all links in the MuJoCo model of `data`, in the order of the tree of `mode`.

        The model can be a model of any mode of the robot.
        """
        return mjdata.inertias(self[mode], data)

    def switch(
        self, source: RobotState | tuple[str, Any], target: str | tuple[str, Any], *, on_motion: OnMotion = "raise",
        at_rest: float = 1e-9, tolerance: float = 1e-6, inertias: Inertias | None = None,
    ) -> SwitchResult:
        """Switch the robot from its current mode to the mode `target`, and return its state in the new mode.

        `source` is a `RobotState`, or a tuple of the name of a mode and its `mujoco.MjData`. `target` is the name of the new mode, or a
        tuple of its name and the `mujoco.MjData` to fill. If `target` includes an `MjData`, this method writes `qpos`, `qvel` and the mocap
        pose of the robot to it. If `source` also includes an `MjData`, the method also copies the time, and the controls and activations of
        actuators by name. Other robots and objects in the `MjData` do not change. After the switch, call `mujoco.mj_forward` with the
        `MjData` of `target`.

        The coordinates q and velocities v of the joints do not change. Forward kinematics gives the pose and the twist of the new root
        link. If the new mode holds or fixes the root link while the link moves faster than `at_rest` [m/s and rad/s], `on_motion` selects
        the behaviour. The value `"raise"` raises `BaseMoves`. The value `"drop"` stops the link and preserves the joint velocities.
        The value `"impact"` computes the joint velocities after a perfectly inelastic impact (see `caught`). The computation of the impact
        uses `inertias`. By default, `inertias` is read from the MuJoCo model of `target`, else from the model of `source`, else from
        `modes.json`. If a fixed base is farther than `tolerance` [m and rad] from its pose in the new mode, the method raises
        `BaseElsewhere`.

        `on_motion` also applies to all other links that the new mode holds. If a hold allows rotation, `on_motion` applies to the velocity
        of the held point. The new mode holds these links at their current poses, so their mocap bodies move to these poses. If the base is
        fixed, the held links must be at the poses that the document specifies. This method does not modify any MuJoCo model. If this method
        raises `ModesError` or a subclass, it does not modify any `MjData`.
        """
        if on_motion not in CHOICES:
            raise ModesError(f"expected on_motion \"raise\", \"drop\" or \"impact\", found `{on_motion}`")
        old = self[source.mode if isinstance(source, RobotState) else source[0]]
        name, into_data = (target, None) if isinstance(target, str) else target
        from_data = old_map = None
        if isinstance(source, RobotState):
            state = old.arrays(source)
        else:
            from_data = source[1]
            old_map = mjdata.map_model(old, from_data.model)
            state = mjdata.read_state(old, old_map, from_data)
        new = self[name]
        new_map = None if into_data is None else mjdata.map_model(new, into_data.model)
        placed = _place_root(change_root(state, old, new, np), new, into_data, tolerance)
        stopped, poses, result = _stop_held(placed, new, on_motion, at_rest, partial(_known_inertias, new, inertias, into_data, from_data))
        if new_map is None:
            return result
        mjdata.write_state(new, stopped, new_map, into_data)
        mjdata.hold_here(new, poses, new_map, into_data)
        if old_map is None:
            return result
        return replace(result, uncommanded=mjdata.carry((old, new), (old_map, new_map), from_data, into_data))


def _place_root(state: State[Array], mode: Mode, data: Any, tolerance: float) -> State[Array]:
    """Return a copy of the state in which the root link is at a pose that the mode allows.

    The MuJoCo model of `data`, if given, defines the pose of a fixed base; otherwise, the pose at the time of the build is used. Raises
    `BaseElsewhere` if the root link, or another link that a mode with a fixed base holds, is too far from a pose that the mode allows.
    """
    fixed_pose = mjdata.fixed_root_pose(mode, data) if mode.base == "fixed" and data is not None else None
    state, placed = put_base(state, mode, fixed_pose, np)
    for link, X, allowed in placed:
        distance, angle = map(float, difference(X, allowed))
        if max(distance, angle) > tolerance:
            raise BaseElsewhere(mode.name, mode.links[link].name, distance, angle, tolerance)
    return state


def _stop_held(
    state: State[Array], mode: Mode, on_motion: OnMotion, at_rest: float, inertias: Callable[[], Inertias],
) -> tuple[State[Array], Array, SwitchResult]:
    """Stop all links that the mode `mode` holds. Return the new state, the poses of all links, and the result of the switch.

    If the mode holds only its root link, the array of poses is empty. Raises `BaseMoves` if a held link moves and `on_motion` is `"raise"`.
    """
    removed, poses = [state.twist - keep_free_twist(mode, state.base, state.twist, np)], np.zeros((0, 4, 4))
    if mode.holds:
        poses, twists = kinematics(mode).link_motion(state, np)
        for hold in mode.holds:
            twist = twists[hold.link]
            removed.append(at_point(hold, poses[hold.link], twist) if hold.turns else twist)
    impulse: Array = np.zeros(6)
    impulses: Sequence[Array] = [np.zeros(6) for _ in mode.holds]
    moving = next((k for k, twist in enumerate(removed) if _speed(twist) > at_rest), None)
    if moving is not None and on_motion == "raise":
        raise BaseMoves(mode.name, mode.links[mode.holds[moving - 1].link if moving else 0].name, removed[moving])
    if moving is not None and on_motion == "impact":
        state, impulse, impulses = stop(mode, state, inertias(), np)
    state = state._replace(twist=keep_free_twist(mode, state.base, state.twist, np))
    holds = zip(mode.holds, removed[1:], impulses, strict=True)
    return state, poses, SwitchResult(
        state=mode.robot_state(state), removed=removed[0], impulse=impulse,
        holds={hold.path: Impact(removed=twist_removed, impulse=impulse_) for hold, twist_removed, impulse_ in holds},
    )


def _known_inertias(mode: Mode, inertias: Inertias | None, *sources: Any) -> Inertias:
    """Return `inertias`, if not None, else the inertias in the first `MjData` that is not None, else those in `modes.json`."""
    if inertias is not None:
        return inertias
    data = next((data for data in sources if data is not None), None)
    return mode.inertias if data is None else mjdata.inertias(mode, data)


def _speed(twist: Array) -> float:
    """Return the linear speed [m/s] or the angular speed [rad/s] of a twist, whichever number is larger."""
    return max(float(np.linalg.norm(twist[:3])), float(np.linalg.norm(twist[3:])))
