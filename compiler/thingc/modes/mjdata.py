"""Read and write the state of a mode in a `mujoco.MjData` by element name. The scene can contain elements of other models, too.

This module does not import MuJoCo. `MjData` provides its model, and access to elements by name.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from thingc.modes.addresses import Addresses
from thingc.modes.errors import ModesError, WrongData
from thingc.modes.frames import Array, pose, quaternion_of, rotation_of
from thingc.modes.placements import find_displaced
from thingc.modes.state import State
from thingc.modes.tree import Inertias, Mode

FREE = 0
"""MuJoCo's type number of free joints."""
STRUCTURE = (
    "names", "body_parentid", "body_mocapid", "body_pos", "body_quat", "jnt_type", "jnt_bodyid", "jnt_pos", "jnt_axis", "site_pos",
    "site_quat", "actuator_actadr", "actuator_actnum",
)
"""Fields of a model that determine its `ModelMap`."""
RESULTS = 8
"""Number of models of a mode to cache maps of."""


@dataclass(frozen=True, slots=True, eq=False)
class ModelMap:
    """The indices of the links and coordinates of a mode in a MuJoCo model.

    Attributes:
        addresses: The coordinates of joints.
        joints: The first addresses in `qpos` and `qvel` of all joints of the model with a name.
        base: The addresses in `qpos` and `qvel` of the base, which are empty for a fixed or held base.
        mocap: The number of the mocap body of a held base, or -1.
        anchors: The numbers of the mocap bodies of the other holds.
        actuators: The number and the address and size of the activation of each actuator with a name.
    """

    addresses: Addresses
    joints: Mapping[str, tuple[int, int]]
    base: tuple[Any, Any]
    mocap: int
    anchors: list[int]
    actuators: Mapping[str, tuple[int, int, int]]


def map_model(mode: Mode, model: Any) -> ModelMap:
    """Create the `ModelMap` of a MuJoCo model of `mode`.

    Raises `WrongData` if the model differs from the mode in its links, their parents, its base, or the poses of links, joints or mounts.
    """
    found: ModelMap = _cached(_new_map, mode, model)
    return found


def _cached(make: Callable[[Mode, Any], Any], mode: Mode, model: Any) -> Any:
    """Return `make(mode, model)`, or its cached result for a model with the same structure."""
    key = tuple([model.names if name == "names" else getattr(model, name).tobytes() for name in STRUCTURE])
    results = _results(make, mode)
    if key not in results:
        result = make(mode, model)
        while len(results) >= RESULTS:
            del results[next(iter(results))]
        results[key] = result
    return results[key]


@lru_cache(maxsize=128)
def _results(make: Callable[[Mode, Any], Any], mode: Mode) -> dict[tuple[bytes, ...], Any]:
    """Return the cached results of `make` for models of a mode."""
    return {}


def _new_map(mode: Mode, model: Any) -> ModelMap:
    check(mode, model)
    body_of = _bodies(mode, model)
    joints = {
        name: (int(model.jnt_qposadr[number]), int(model.jnt_dofadr[number]))
        for number in range(model.njnt) if (name := model.joint(number).name)
    }
    root = body_of[mode.root_link]
    base: Iterable[Iterable[int]] = ((), ())
    if mode.base == "free":  # the joint can have any name
        number = int(model.body_jntadr[root])
        base = (range(first, first + size) for first, size in ((model.jnt_qposadr[number], 7), (model.jnt_dofadr[number], 6)))
    elif mode.base == "ball":
        base = (range(first, first + size) for first, size in zip(joints["root"], (4, 3), strict=True))
    elif mode.part is not None:
        base = zip(*(joints[name] for name in mode.part.joints), strict=True)
    positions, speeds = (np.array(list(own), dtype=int) for own in base)
    actuators = [(model.actuator(number).name, number) for number in range(model.nu)]
    return ModelMap(
        addresses=Addresses(mode, joints), joints=joints, base=(positions, speeds),
        mocap=int(model.body_mocapid[root]), anchors=[int(model.body_mocapid[body_of[hold.anchor]]) for hold in mode.holds],
        actuators={name: (number, *_activation(model, number)) for name, number in actuators if name},
    )


def check(mode: Mode, model: Any) -> None:
    """Check that a MuJoCo model belongs to a mode.

    Raises `WrongData` if the model differs from the mode in its links, their parents, its base, or the poses of links, joints or mounts.
    """
    body_of = _bodies(mode, model)
    wanted = [*(link.name for link in mode.links), *(hold.anchor for hold in mode.holds)]
    missing = next((name for name in wanted if name not in body_of), None)
    if missing is not None:
        raise WrongData(f"the data for mode `{mode.name}` belongs to a model without a link `{missing}`")
    root, links = body_of[mode.root_link], {body_of[link.name] for link in mode.links}
    joints = {model.joint(number).name: number for number in range(model.njnt)}
    free = "ball" if model.body_dofnum[root] == 3 else "free"
    base = "held" if model.body_mocapid[root] >= 0 else "fixed" if model.body_dofnum[root] == 0 else (
        "planar" if "root_0" in joints else free)
    trees = all(
        joint.in_data in joints and model.jnt_bodyid[joints[joint.in_data]] == body_of[mode.links[joint.child].name]
        and body_of[mode.links[joint.parent].name] in (
            _link_above(model, body_of[mode.links[joint.child].name], links), body_of[mode.links[joint.child].name],
        )
        for joint in mode.joints
    )
    if base != mode.base or not trees or (base == "free" and model.jnt_type[model.body_jntadr[root]] != FREE):
        stands = next((name for name, number in body_of.items() if number and model.body_parentid[number] == 0), "nothing")
        raise WrongData(
            f"the data for mode `{mode.name}` belongs to the model of another mode: expected a {mode.base} `{mode.root_link}`, found "
            f"`{stands}` under the world"
        )
    if (elsewhere := find_displaced(mode, model, body_of)) is not None:
        raise WrongData(
            f"the data for mode `{mode.name}` belongs to another variant: its {elsewhere[0]} is {elsewhere[1]:.3g} m (or rad) from that in "
            "`modes.json`; read the `modes.json` of that variant, or use `family.modes(settings)`"
        )


def _link_above(model: Any, body: int, links: Collection[int]) -> int:
    """Return the body of the parent link of `body`, or 0 for the world.

    `--compat drake` adds bodies that are not links. This function skips them.
    """
    above = int(model.body_parentid[body])
    while above and above not in links:
        above = int(model.body_parentid[above])
    return above


def read_state(mode: Mode, found: ModelMap, data: Any) -> State:
    """Read the state of a mode from `data`. Raises `ModesError` for numbers that are not finite.

    The pose of a fixed base is read from the model. The twist of a fixed or held base is zero.
    """
    twist: Array = np.zeros(6)
    qpos, qvel = data.qpos, data.qvel
    positions, speeds = (values[own] for values, own in zip((qpos, qvel), found.base, strict=True))
    if mode.base == "free":
        X, twist = pose(rotation_of(positions[3:]), positions[:3]), speeds
    elif mode.part is not None:
        X = mode.part.pose(positions)
        twist = mode.part.twist(X, speeds)
    elif mode.base == "held":
        X = pose(rotation_of(data.mocap_quat[found.mocap]), data.mocap_pos[found.mocap])
    else:
        X = bolted(mode, data)
    q, v = found.addresses.read(qpos, qvel)
    for name, values in (("base_pose", X), ("base_twist", twist), ("q", q), ("v", v)):
        if not np.isfinite(values).all():
            raise ModesError(f"`{name}` has numbers that are not finite")
    return State(X, twist, q, v)


def write_state(mode: Mode, state: State, found: ModelMap, data: Any) -> None:
    """Write a state of `mode` to `data`: only qpos, qvel and the mocap pose of the robot."""
    position, quaternion = state.base[:3, 3], quaternion_of(state.base[:3, :3])
    qpos, qvel = data.qpos, data.qvel
    if mode.base == "free":
        qpos[found.base[0]], qvel[found.base[1]] = np.concatenate([position, quaternion]), state.twist
    elif mode.part is not None:
        qpos[found.base[0]], qvel[found.base[1]] = mode.part.qpos(state.base), mode.part.qvel(state.base, state.twist)
    elif mode.base == "held":
        data.mocap_pos[found.mocap], data.mocap_quat[found.mocap] = position, quaternion
    found.addresses.write(state.q, state.v, qpos, qvel)


def carry(modes: tuple[Mode, Mode], maps: tuple[ModelMap, ModelMap], source: Any, target: Any) -> tuple[str, ...]:
    """Copy values other than the motion, such as controls, from one mode to `target`. Return the actuators that only `target` has.

    These values are the time, the controls and activations by actuator, and the joint accelerations for the solver's warm start. The
    controls of the returned actuators do not change.
    """
    target.time = source.time
    old, new = maps
    _warm_start(modes, maps, source, target)
    common = [(old.actuators[name], own) for name, own in new.actuators.items() if name in old.actuators]
    if common:
        target.ctrl[[there[0] for _, there in common]] = source.ctrl[[here[0] for here, _ in common]]
    for (_, here, size), (_, there, count) in common:
        if size == count:
            target.act[there : there + size] = source.act[here : here + size]
    return tuple([name for name in new.actuators if name not in old.actuators])


def _warm_start(modes: tuple[Mode, Mode], maps: tuple[ModelMap, ModelMap], source: Any, target: Any) -> None:
    (old, new), (here, there) = modes, maps
    accelerations, started = source.qacc_warmstart, target.qacc_warmstart
    started[there.base[1]] = 0.0
    names = {joint.name for joint in old.joints}
    for joint in new.joints:
        for name in joint.in_model:
            first = there.joints[name][1]
            if joint.ball is not None:
                started[first : first + 3] = 0.0
            else:
                started[first] = accelerations[here.joints[name][1]] if joint.name in names else 0.0


def hold_here(mode: Mode, poses: Array, found: ModelMap, data: Any) -> None:
    """Move the anchors of a mode's other holds to the held links at `poses`, or to the mount's origin if a hold allows rotation.

    If the base is fixed, the anchors do not move.
    """
    if mode.base == "fixed":
        return
    for hold, number in zip(mode.holds, found.anchors, strict=True):
        X = poses[hold.link]
        data.mocap_pos[number] = (X @ hold.X_LM)[:3, 3] if hold.turns else X[:3, 3]
        data.mocap_quat[number] = (1.0, 0.0, 0.0, 0.0) if hold.turns else quaternion_of(X[:3, :3])


def bolted(mode: Mode, data: Any) -> Array:
    """Return the pose (4, 4) of the fixed root link of `mode` in the model of `data`."""
    body = data.model.body(mode.root_link)
    return pose(rotation_of(body.quat), body.pos)


def inertias(mode: Mode, data: Any) -> Inertias:
    """Return the current inertias in the model of `data`, which can belong to any mode, in the order of `mode`'s tree."""
    return inertias_in(data.model, inertia_rows(mode, data.model), np)


def inertias_in(arrays: Any, rows: tuple[Any, Any, Any], xp: Any) -> Inertias:
    """Return the inertias in the arrays of a model, of MuJoCo or MJX, at `inertia_rows`."""
    bodies, own, dofs = rows
    R = rotation_of(arrays.body_iquat[bodies], xp)
    return Inertias(
        mass=arrays.body_mass[bodies] * own,
        centre=arrays.body_ipos[bodies] * own[:, None],
        inertia=(R * arrays.body_inertia[bodies][:, None]) @ R.swapaxes(1, 2) * own[:, None, None],
        armature=arrays.dof_armature[dofs],
    )


def inertia_rows(mode: Mode, model: Any) -> tuple[Any, Any, Any]:
    """Return the body of each link, whether it has the link's name (a massless intermediate link has no body), and the DOF of each
    joint."""
    found: tuple[Any, Any, Any] = _cached(_weights, mode, model)
    return found


def _weights(mode: Mode, model: Any) -> tuple[Any, Any, Any]:
    body_of = _bodies(mode, model)
    bodies = [body_of[link.name] for link in mode.links]
    own = [model.body(body).name == link.name for body, link in zip(bodies, mode.links, strict=True)]
    dofs = [int(model.joint(joint.in_data).dofadr[0]) for joint in mode.joints]
    return np.array(bodies), np.array(own), np.array(dofs, dtype=int)


def _bodies(mode: Mode, model: Any) -> dict[str, int]:
    """Return the bodies by link name. A massless intermediate link has no body and is mapped to the body that follows it."""
    body_of = {model.body(number).name: number for number in range(model.nbody)}
    for joint in reversed(mode.joints):
        parent, child = mode.links[joint.parent], mode.links[joint.child]
        if parent.mass == 0.0 and child.name in body_of:
            body_of.setdefault(parent.name, body_of[child.name])
    return body_of


def _activation(model: Any, actuator: int) -> tuple[int, int]:
    """Return the address and the size of an actuator's activation in `act`. The size is 0 if it has none."""
    first, count = int(model.actuator_actadr[actuator]), int(model.actuator_actnum[actuator])
    return (first, count) if first >= 0 else (0, 0)
