"""Read the state of a robot from a `mujoco.MjData`, and write states to a `mujoco.MjData`.

Bodies, joints and actuators of the robot are found by name. The MuJoCo model can also contain other robots and objects. This module does
not import MuJoCo, because a `MjData` provides its own model.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.modes import free_joints
from thingc.modes.addresses import Addresses
from thingc.modes.errors import ModesError, WrongData
from thingc.modes.frames import Array, pose, quaternion_of, rotation_of
from thingc.modes.placements import find_displaced
from thingc.modes.state import State
from thingc.modes.tree import Inertias, Mode, base_values

Result = TypeVar("Result")

FREE = 0
"""The number of the type `free` in MuJoCo's `mjtJoint`."""
STRUCTURE = (
    "names", "body_parentid", "body_mocapid", "body_pos", "body_quat", "jnt_type", "jnt_bodyid", "jnt_pos", "jnt_axis", "site_pos",
    "site_quat", "actuator_actadr", "actuator_actnum",
)
"""Fields of a MuJoCo model on which its `ModelMap` depends."""
RESULTS = 8
"""Maximum number of MuJoCo models per mode for which results are cached."""


class ModelMap(FrozenStruct, eq=False):
    """The indices of the elements of a robot in a MuJoCo model of one of its modes.

    Attributes:
        addresses: The addresses of the joint coordinates in `qpos` and `qvel`.
        joints: The first addresses in `qpos` and `qvel` of each joint with a name.
        base: The addresses of the base in `qpos` and in `qvel`, which are empty for a fixed or held base.
        mocap: The number of the mocap body to which a held base is attached, or -1.
        anchors: The numbers of the mocap bodies to which other held mounts are attached.
        actuators: For each actuator with a name, its number, and the address and size of its activation.
    """

    addresses: Addresses
    joints: Mapping[str, tuple[int, int]]
    base: tuple[Any, Any]
    mocap: int
    anchors: list[int]
    actuators: Mapping[str, tuple[int, int, int]]


def map_model(mode: Mode, model: Any) -> ModelMap:
    """Find the elements of a robot in a MuJoCo model of the mode `mode`.

    Raises `WrongData` if the model differs from the mode in its links, their parents, its base, or the poses of links, joints or mounts.
    """
    return _from_cache(_new_map, mode, model)


def _from_cache(make: Callable[[Mode, Any], Result], mode: Mode, model: Any) -> Result:
    """Return the result of `make(mode, model)`, from the cache if possible.

    All MuJoCo models with the same structure share a cached result.
    """
    key = tuple([model.names if name == "names" else getattr(model, name).tobytes() for name in STRUCTURE])
    results: dict[tuple[bytes, ...], Result] = _results(make, mode)
    if key not in results:
        result = make(mode, model)
        while len(results) >= RESULTS:
            del results[next(iter(results))]
        results[key] = result
    return results[key]


@lru_cache(maxsize=128)
def _results(make: Callable[[Mode, Any], Any], mode: Mode) -> dict[Any, Any]:
    """Return the cached results of the function `make` for a mode, keyed by the structure of the MuJoCo model."""
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
    positions, speeds = (np.array(list(addresses), dtype=int) for addresses in base)
    actuators = [(model.actuator(number).name, number) for number in range(model.nu)]
    return ModelMap(
        addresses=Addresses(mode, joints), joints=joints, base=(positions, speeds),
        mocap=int(model.body_mocapid[root]), anchors=[int(model.body_mocapid[body_of[hold.anchor]]) for hold in mode.holds],
        actuators={name: (number, *_activation(model, number)) for name, number in actuators if name},
    )


def check(mode: Mode, model: Any) -> None:
    """Check that a MuJoCo model is a model of the robot in the given mode.

    Raises `WrongData` if the model differs from the mode in its links, their parents, its base, or the poses of links, joints or mounts.
    """
    body_of = _bodies(mode, model)
    names = [*(link.name for link in mode.links), *(hold.anchor for hold in mode.holds)]
    missing = next((name for name in names if name not in body_of), None)
    if missing is not None:
        raise WrongData(f"the model of the data for mode `{mode.name}` has no link `{missing}`")
    root, links = body_of[mode.root_link], {body_of[link.name] for link in mode.links}
    joints = {model.joint(number).name: number for number in range(model.njnt)}
    free = "ball" if model.body_dofnum[root] == 3 else "free"
    base = "held" if model.body_mocapid[root] >= 0 else "fixed" if model.body_dofnum[root] == 0 else (
        "planar" if "root_0" in joints else free)
    same_tree = all(
        joint.in_data in joints and model.jnt_bodyid[joints[joint.in_data]] == body_of[mode.links[joint.child].name]
        and (0 if joint.kind == "free" else body_of[mode.links[joint.parent].name]) in (
            _link_above(model, body_of[mode.links[joint.child].name], links), body_of[mode.links[joint.child].name],
        )
        for joint in mode.joints
    )
    if base != mode.base or not same_tree or (base == "free" and model.jnt_type[model.body_jntadr[root]] != FREE):
        root_found = next((name for name, number in body_of.items() if number and model.body_parentid[number] == 0), "nothing")
        raise WrongData(
            f"expected data of mode `{mode.name}` with a {mode.base} base `{mode.root_link}`, found data of another mode with the base "
            f"`{root_found}`"
        )
    if (displaced := find_displaced(mode, model, body_of)) is not None:
        raise WrongData(
            f"the data for mode `{mode.name}` belongs to another variant ({displaced[0]} differs by {displaced[1]:.3g}): read the "
            "`modes.json` of this variant, or use `family.modes(settings)`"
        )


def _link_above(model: Any, body: int, links: Collection[int]) -> int:
    """Return the number of the nearest ancestor of a body that is a link of the robot, or 0 for the world.

    The function skips bodies that are not links, such as the bodies that `--compat drake` adds.
    """
    ancestor = int(model.body_parentid[body])
    while ancestor and ancestor not in links:
        ancestor = int(model.body_parentid[ancestor])
    return ancestor


def read_state(mode: Mode, model_map: ModelMap, data: Any) -> State[Array]:
    """Read the state of a robot in the given mode from a `mujoco.MjData`.

    Raises `ModesError` if the state contains NaN or infinite numbers.
    """
    twist: Array = np.zeros(6)
    qpos, qvel = data.qpos, data.qvel
    positions, speeds = (values[addresses] for values, addresses in zip((qpos, qvel), model_map.base, strict=True))
    if mode.base == "free":
        X, twist = pose(rotation_of(positions[3:]), positions[:3]), speeds
    elif mode.part is not None:
        X = mode.part.pose(positions)
        twist = mode.part.twist(X, speeds)
    elif mode.base == "held":
        X = pose(rotation_of(data.mocap_quat[model_map.mocap]), data.mocap_pos[model_map.mocap])
    else:
        X = fixed_root_pose(mode, data)
    q, v = model_map.addresses.read(qpos, qvel)
    free_joints.read(mode, State(X, twist, q, v), qpos, qvel, model_map.joints)
    for name, values in (("base_pose", X), ("base_twist", twist), ("q", q), ("v", v)):
        if not np.isfinite(values).all():
            raise ModesError(f"`{name}` has numbers that are not finite")
    return State(X, twist, q, v)


def write_state(mode: Mode, state: State[Array], model_map: ModelMap, data: Any) -> None:
    """Write a state of a robot in the given mode to a `mujoco.MjData`.

    The function changes only `qpos`, `qvel` and the mocap pose of the robot.
    """
    qpos, qvel = data.qpos, data.qvel
    qpos[model_map.base[0]], qvel[model_map.base[1]] = base_values(mode, state)
    if mode.base == "held":
        data.mocap_pos[model_map.mocap], data.mocap_quat[model_map.mocap] = state.base[:3, 3], quaternion_of(state.base[:3, :3])
    model_map.addresses.write(state.q, state.v, qpos, qvel)
    free_joints.write(mode, state, qpos, qvel, model_map.joints)


def carry(modes: tuple[Mode, Mode], maps: tuple[ModelMap, ModelMap], source: Any, target: Any) -> tuple[str, ...]:
    """Copy the time, the current and past controls, and the actuator activations from the `MjData` of one mode to that of another mode.

    Return the names of the actuators that only the new mode has. The controls of these actuators do not change. Joint accelerations are
    also copied, for the warm start of MuJoCo's solver.
    """
    target.time = source.time
    old, new = maps
    _warm_start(modes, maps, source, target)
    common = [(old.actuators[name], entry) for name, entry in new.actuators.items() if name in old.actuators]
    if common:
        target.ctrl[[new_entry[0] for _, new_entry in common]] = source.ctrl[[old_entry[0] for old_entry, _ in common]]
    for (_, old_entry, size), (_, new_entry, count) in common:
        if size == count:
            target.act[new_entry : new_entry + size] = source.act[old_entry : old_entry + size]
    for name, (new_entry, _, _) in new.actuators.items():
        _carry_history(old.actuators.get(name, (-1, 0, 0))[0], new_entry, source, target)
    return tuple([name for name in new.actuators if name not in old.actuators])


def _carry_history(old_number: int, new_number: int, source: Any, target: Any) -> None:
    """Copy the past controls of a delayed actuator, whose numbers in the two models are `old_number` and `new_number`.

    For an actuator that only the new mode has (`old_number` is -1), the past controls are the current control. Times are those of the new
    time step.
    """
    (count, _), first = target.model.actuator_history[new_number], int(target.model.actuator_historyadr[new_number]) + 1
    if not count:
        return
    times, values = target.time - target.model.opt.timestep * np.arange(count, 0, -1), np.full(count, target.ctrl[new_number])
    if old_number >= 0 and (size := int(source.model.actuator_history[old_number, 0])):
        past_times, past_values = np.split(source.history[int(source.model.actuator_historyadr[old_number]) + 2 :][: 2 * size], 2)
        order = np.argsort(past_times)
        values = past_values[order][np.maximum(np.searchsorted(past_times[order], times + 1e-9, side="right") - 1, 0)]
    target.history[first : first + 1 + 2 * count] = [count - 1, *times, *values]


def _warm_start(modes: tuple[Mode, Mode], maps: tuple[ModelMap, ModelMap], source: Any, target: Any) -> None:
    (old, new), (old_map, new_map) = modes, maps
    accelerations, warm_start = source.qacc_warmstart, target.qacc_warmstart
    warm_start[new_map.base[1]] = 0.0
    names = {joint.name for joint in old.joints}
    for joint in new.joints:
        for name in joint.in_model:
            first = new_map.joints[name][1]
            if joint.ball is not None or joint.kind == "free":
                warm_start[first : first + 6 if joint.kind == "free" else first + 3] = 0.0
            else:
                warm_start[first] = accelerations[old_map.joints[name][1]] if joint.name in names else 0.0


def hold_here(mode: Mode, poses: Array, model_map: ModelMap, data: Any) -> None:
    """Move the mocap bodies of held mounts, so that the mode holds these mounts at their current poses.

    The mocap body of the root mount does not move. `poses` contains the poses (n, 4, 4) of all links in the world. If a hold allows
    rotation, its mocap body moves to the origin of the mount. If the base is fixed, the mocap bodies do not move.
    """
    if mode.base == "fixed":
        return
    for hold, number in zip(mode.holds, model_map.anchors, strict=True):
        X = poses[hold.link]
        data.mocap_pos[number] = (X @ hold.X_LM)[:3, 3] if hold.turns else X[:3, 3]
        data.mocap_quat[number] = (1.0, 0.0, 0.0, 0.0) if hold.turns else quaternion_of(X[:3, :3])


def fixed_root_pose(mode: Mode, data: Any) -> Array:
    """Return the pose (4, 4) of the root link of a mode with a fixed base, as in the MuJoCo model of `data`."""
    body = data.model.body(mode.root_link)
    return pose(rotation_of(body.quat), body.pos)


def inertias(mode: Mode, data: Any) -> Inertias:
    """Return the current inertias of all links in the MuJoCo model of `data`, in the order of the tree of `mode`.

    The model can be a model of any mode of the robot.
    """
    return inertias_in(data.model, inertia_rows(mode, data.model), np)


def inertias_in(arrays: Any, rows: tuple[Any, Any, Any], xp: Any) -> Inertias:
    """Return the inertias of all links from the arrays of a MuJoCo or MJX model. `rows` is the result of `inertia_rows`."""
    bodies, has_body, dofs = rows
    R = rotation_of(arrays.body_iquat[bodies], xp)
    return Inertias(
        mass=arrays.body_mass[bodies] * has_body,
        centre=arrays.body_ipos[bodies] * has_body[:, None],
        inertia=(R * arrays.body_inertia[bodies][:, None]) @ R.swapaxes(1, 2) * has_body[:, None, None],
        armature=arrays.dof_armature[dofs],
    )


def inertia_rows(mode: Mode, model: Any) -> tuple[Any, Any, Any]:
    """Return three arrays of indices and flags, from which `inertias_in` reads the inertias of all links.

    The first array contains the number of the body of each link. The second array contains flags, which are False for massless intermediate
    links. A massless intermediate link does not have a body of its own, so the array contains the number of the next body. The third array
    contains the number of the degree of freedom of each joint.
    """
    return _from_cache(_weights, mode, model)


def _weights(mode: Mode, model: Any) -> tuple[Any, Any, Any]:
    body_of = _bodies(mode, model)
    bodies = [body_of[link.name] for link in mode.links]
    has_body = [model.body(body).name == link.name for body, link in zip(bodies, mode.links, strict=True)]
    dofs = [int(model.joint(joint.in_data).dofadr[0]) for joint in mode.joints]
    return np.array(bodies), np.array(has_body), np.array(dofs, dtype=int)


def _bodies(mode: Mode, model: Any) -> dict[str, int]:
    """Return a mapping from the name of each link to the number of its body.

    A massless intermediate link has the number of the body that follows this link in the tree.
    """
    body_of = {model.body(number).name: number for number in range(model.nbody)}
    for joint in reversed(mode.joints):
        parent, child = mode.links[joint.parent], mode.links[joint.child]
        if parent.mass == 0.0 and child.name in body_of:
            body_of.setdefault(parent.name, body_of[child.name])
    return body_of


def _activation(model: Any, actuator: int) -> tuple[int, int]:
    """Return the address and the size of the activation of an actuator in `MjData.act`.

    The size is 0 for an actuator without activation.
    """
    first, count = int(model.actuator_actadr[actuator]), int(model.actuator_actnum[actuator])
    return (first, count) if first >= 0 else (0, 0)
