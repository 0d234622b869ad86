"""All modes of a robot, and the way from one to another."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from thingc.diagnostics import did_you_mean
from thingc.modes import mjdata, reading
from thingc.modes.faults import BaseElsewhere, BaseMoves, ModesError, UnknownMode
from thingc.modes.frames import Array, angle_between
from thingc.modes.inertias import Inertias
from thingc.modes.state import State
from thingc.modes.tree import Mode

OnMotion = Literal["raise", "drop", "impact"]
CHOICES = ("raise", "drop", "impact")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Switched:
    """What a switch has come to.

    `state` is that of the new mode. `removed` (6,) is the twist [m/s, rad/s] of the new root link that a base held still could
    not keep (0 where nothing was lost). `impulse` (6,) is what the catch took: the linear impulse [N s] on the root link in world
    axes and the angular impulse [N m s] about its frame's origin in its own axes; 0 unless `on_motion="impact"` removed
    something. `uncommanded` are the actuators that only the new mode has: their controls are as they were in its data.
    """

    state: State
    removed: Array
    impulse: Array
    uncommanded: tuple[str, ...]


class Modes(Mapping[str, Mode]):
    """The modes of a robot by name, in the order of the document: `robot["bench"]`. Raises `UnknownMode` for another name."""

    def __init__(self, modes: Mapping[str, Mode]) -> None:
        self._modes = dict(modes)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Modes:
        """Of a robot that `thingc build` has built: its folder (`build/arm`) or its `modes.json`.

        Raises `FileNotFoundError` where there is none, and `ModesError` for a file that is no `modes.json`.
        """
        return cls(reading.read(path))

    @classmethod
    def parse(cls, text: str | bytes) -> Modes:
        """Of the text of a `modes.json`. Raises `ModesError`."""
        return cls(reading.parse(text))

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

    def read(self, mode: str, data: Any) -> State:
        """The state in a `mujoco.MjData` of a mode's model. Raises `UnknownMode`, and `WrongData` for data of another model."""
        return mjdata.read(self[mode], data)

    def write(self, state: State, data: Any) -> None:
        """Put a state into a `mujoco.MjData` of its mode's model: qpos, qvel and mocap pose of the robot, nothing else.

        Of a fixed base only the joints are written: where it stands is the model's. Raises `WrongData` for data of another model.
        """
        mjdata.write(self[state.mode], state, data)

    def inertias(self, mode: str, data: Any) -> Inertias:
        """The masses in the model of `data` (any mode's) as they are now, in the order of the tree of `mode`."""
        return mjdata.inertias(self[mode], data)

    def switch(
        self,
        source: State | tuple[str, Any],
        target: str | tuple[str, Any],
        *,
        on_motion: OnMotion = "raise",
        at_rest: float = 1e-9,
        tolerance: float = 1e-6,
        inertias: Inertias | None = None,
    ) -> Switched:
        """The state of `source` as a state of the mode `target`.

        `source` is a state, or a mode's name and its `mujoco.MjData`; `target` a mode's name, or a name and the `MjData` that is
        filled: qpos, qvel and mocap pose of the robot, and from a source with data also the time, controls and activations by
        actuator name (a magnet stays as strong as it was). Call `mj_forward` on it afterwards. What else a scene has is not
        touched.

        q and v of the joints stay the same; pose and twist of the new root link come from forward kinematics. If the new base is
        held or fixed while its link moves faster than `at_rest` [m/s and rad/s], `on_motion` decides: `"raise"` raises
        `BaseMoves`; `"drop"` keeps the joints' v; `"impact"` gives the v after a perfectly inelastic catch (see `caught`), with
        the masses `inertias`, else those in the target's model, else the source's, else the build's. A fixed base must be where
        it stands within `tolerance` [m and rad], else `BaseElsewhere`. Nothing is written when anything is raised (`ModesError`).
        """
        if on_motion not in CHOICES:
            raise ModesError(f"expected on_motion \"raise\", \"drop\" or \"impact\", found `{on_motion}`")
        state = source if isinstance(source, State) else self.read(*source)
        from_data = None if isinstance(source, State) else source[1]
        name, into_data = (target, None) if isinstance(target, str) else target
        old, new = self[state.mode], self[name]
        if into_data is not None:
            mjdata.check(new, into_data)
        found = _seen_from(state, old, new)
        removed = impulse = np.zeros(6)
        if new.base == "fixed":
            found = _bolted(found, new, new.X_world_root if into_data is None else mjdata.bolted(new, into_data), tolerance)
        if new.base != "free":
            removed = found.base_twist
            if max(np.linalg.norm(removed[:3]), np.linalg.norm(removed[3:])) <= at_rest:
                found = replace(found, base_twist=np.zeros(6))
            elif on_motion == "raise":
                raise BaseMoves(name, new.root_link, removed)
            elif on_motion == "drop":
                found = replace(found, base_twist=np.zeros(6))
            else:
                known = inertias
                if known is None:
                    data = into_data if into_data is not None else from_data
                    known = new.inertias if data is None else mjdata.inertias(new, data)
                found, impulse = caught(new, found, known)
        uncommanded: tuple[str, ...] = ()
        if into_data is not None:
            mjdata.write(new, found, into_data)
            if from_data is not None:
                uncommanded = mjdata.carry((old, new), from_data, into_data)
        return Switched(state=found, removed=removed, impulse=impulse, uncommanded=uncommanded)


def caught(mode: Mode, state: State, inertias: Inertias | None = None) -> tuple[State, Array]:
    """The state after the root link of `mode` has been stopped by a perfectly inelastic catch, and the impulse (6,) on it.

    An impulse p on the root link alone changes the velocity u = (twist V, v) by `M (u' - u) = (p, 0)` with V' = 0. The lower
    rows are `M_jj v' = M_jj v + M_jb V`; joints that mimic keep to their leaders (v = T w), which leaves `T^T M_jj T w' =
    T^T (M_jj v + M_jb V)`. It is the projection of u on the motions that the held base allows, orthogonal in the metric M: of
    all those it is the nearest, and it loses the kinetic energy of the difference (Carnot). p goes with `base_twist`.
    """
    M = mode.mass_matrix(state, inertias)
    T = mode.coupling()
    u = mode.velocity(state)
    after = np.zeros_like(u)
    after[6:] = T @ np.linalg.solve(T.T @ M[6:, 6:] @ T, T.T @ (M[6:] @ u))
    stopped = replace(
        state, base_twist=np.zeros(6), v={joint.name: value for joint, value in zip(mode.joints, after[6:], strict=True)}
    )
    return stopped, (M @ (after - u))[:6]


def _seen_from(state: State, old: Mode, new: Mode) -> State:
    """The same motion told from another root."""
    return State(
        mode=new.name, base_pose=old.poses(state)[new.root_link], base_twist=old.twists(state)[new.root_link],
        q={joint.name: state.q[joint.name] for joint in new.joints}, v={joint.name: state.v[joint.name] for joint in new.joints},
    )


def _bolted(state: State, mode: Mode, place: Array, tolerance: float) -> State:
    """The state with its base exactly at `place`. Raises `BaseElsewhere` where it is further away than `tolerance`."""
    distance = float(np.linalg.norm(state.base_pose[:3, 3] - place[:3, 3]))
    angle = angle_between(place[:3, :3], state.base_pose[:3, :3])
    if max(distance, angle) > tolerance:
        raise BaseElsewhere(mode.name, mode.root_link, distance, angle, tolerance)
    return replace(state, base_pose=place)
