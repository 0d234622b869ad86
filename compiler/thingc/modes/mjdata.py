"""Read and write the state of a mode in a `mujoco.MjData` by element name. The scene can contain elements of other models, too.

This module does not import MuJoCo. `MjData` provides its model, and access to elements by name.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from thingc.modes.errors import WrongData
from thingc.modes.frames import Array, pose, quaternion_of, rotation_of
from thingc.modes.placements import find_displaced
from thingc.modes.state import RobotState
from thingc.modes.tree import Inertias, Mode

FREE = 0
"""MuJoCo's type number of free joints."""


def check(mode: Mode, data: Any) -> None:
    """Check that `data` belongs to a model of `mode`.

    Raises `WrongData` if the model differs from the mode in its links, their parents, its base, or the poses of links, joints or mounts.
    """
    model = data.model
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


def _free_joint(mode: Mode, data: Any) -> Any:
    """Return the free joint of the base. The joint can have any name."""
    return data.joint(int(data.model.body_jntadr[_bodies(mode, data.model)[mode.root_link]]))


def read_state(mode: Mode, data: Any) -> RobotState:
    """Return the state in `data`. Raises `WrongData`.

    The pose of a fixed base is read from the model. The twist of a fixed or held base is zero.
    """
    check(mode, data)
    twist = np.zeros(6)
    if mode.base == "free":
        free = _free_joint(mode, data)
        X, twist = pose(rotation_of(free.qpos[3:]), free.qpos[:3]), np.array(free.qvel)
    elif mode.part is not None:
        here = [data.joint(name) for name in mode.part.joints]
        X = mode.part.pose(np.concatenate([joint.qpos for joint in here]))
        twist = mode.part.twist(X, np.concatenate([joint.qvel for joint in here]))
    elif mode.base == "held":
        number = data.model.body(mode.root_link).mocapid[0]
        X = pose(rotation_of(data.mocap_quat[number]), data.mocap_pos[number])
    else:
        X = bolted(mode, data)
    q: dict[str, float] = {}
    v: dict[str, float] = {}
    for joint in mode.joints:
        here = data.joint(joint.in_data)
        if joint.ball is None:
            q[joint.name], v[joint.name] = float(here.qpos[0]), float(here.qvel[0])
        elif joint.first:
            own = joint.ball.read(here.qpos, here.qvel)
            q |= own[0]
            v |= own[1]
    return RobotState(mode=mode.name, base_pose=X, base_twist=twist, q=q, v=v)


def write_state(mode: Mode, state: RobotState, data: Any) -> None:
    """Write a state of `mode` to `data`: only qpos, qvel and the mocap pose of the robot. Raises `WrongData`."""
    check(mode, data)
    position, quaternion = state.base_pose[:3, 3], quaternion_of(state.base_pose[:3, :3])
    if mode.base == "free":
        free = _free_joint(mode, data)
        free.qpos, free.qvel = np.concatenate([position, quaternion]), state.base_twist
    elif mode.part is not None:
        positions, speeds = mode.part.qpos(state.base_pose), mode.part.qvel(state.base_pose, state.base_twist)
        for number, name in enumerate(mode.part.joints):
            own = slice(None) if len(mode.part.joints) == 1 else slice(number, number + 1)
            data.joint(name).qpos, data.joint(name).qvel = positions[own], speeds[own]
    elif mode.base == "held":
        number = data.model.body(mode.root_link).mocapid[0]
        data.mocap_pos[number], data.mocap_quat[number] = position, quaternion
    for joint in mode.joints:
        if joint.ball is not None:
            here = data.joint(joint.in_data)
            here.qpos, here.qvel = joint.ball.qpos(state.q), joint.ball.qvel(state.q, state.v)
            continue
        for name, ratio in joint.in_model.items():
            here = data.joint(name)
            here.qpos, here.qvel = ratio * state.q[joint.name], ratio * state.v[joint.name]


def carry(modes: tuple[Mode, Mode], source: Any, target: Any) -> tuple[str, ...]:
    """Copy the values that a switch preserves besides the motion to `target`. Return the actuators that only `target` has.

    These values are the time, the controls and activations by actuator, and the joint accelerations for the solver's warm start. The
    controls of the returned actuators do not change.
    """
    target.time = source.time
    _warm_start(modes, source, target)
    here, there = _actuators(source.model), _actuators(target.model)
    for name in here.keys() & there.keys():
        target.ctrl[there[name]] = source.ctrl[here[name]]
        old, new = source.act[_activation(source.model, here[name])], _activation(target.model, there[name])
        if len(old) == new.stop - new.start:
            target.act[new] = old
    return tuple(name for name in there if name not in here)


def _warm_start(modes: tuple[Mode, Mode], source: Any, target: Any) -> None:
    old, new = modes
    if new.base == "free":
        _free_joint(new, target).qacc_warmstart = np.zeros(6)
    for name in () if new.part is None else new.part.joints:
        target.joint(name).qacc_warmstart = 0.0
    names = {joint.name for joint in old.joints}
    for joint in new.joints:
        for name in joint.in_model:
            here = source.joint(name).qacc_warmstart if joint.name in names and joint.ball is None else 0.0
            target.joint(name).qacc_warmstart = here


def hold_here(mode: Mode, state: RobotState, data: Any) -> None:
    """Move the anchors of a mode's other holds to the held links in `state`, or to the mount's origin if a hold allows rotation.

    If the base is fixed, the anchors do not move.
    """
    if mode.base == "fixed":
        return
    poses = mode.poses(state)
    for hold in mode.holds:
        X = poses[mode.links[hold.link].name]
        number = data.model.body(hold.anchor).mocapid[0]
        data.mocap_pos[number] = (X @ hold.X_LM)[:3, 3] if hold.turns else X[:3, 3]
        data.mocap_quat[number] = (1.0, 0.0, 0.0, 0.0) if hold.turns else quaternion_of(X[:3, :3])


def bolted(mode: Mode, data: Any) -> Array:
    """Return the pose (4, 4) of the fixed root link of `mode` in the model of `data`."""
    body = data.model.body(mode.root_link)
    return pose(rotation_of(body.quat), body.pos)


def inertias(mode: Mode, data: Any) -> Inertias:
    """Return the current inertias in the model of `data`, which can belong to any mode, in the order of `mode`'s tree."""
    model = data.model
    body_of = _bodies(mode, model)
    bodies = [body_of[link.name] for link in mode.links]
    weigh = np.array([model.body(body).name == link.name for body, link in zip(bodies, mode.links, strict=True)])
    turns = [rotation_of(model.body_iquat[body]) for body in bodies]
    inertia = np.array([R @ np.diag(model.body_inertia[body]) @ R.T for R, body in zip(turns, bodies, strict=True)])
    return Inertias(
        mass=model.body_mass[bodies] * weigh,
        centre=model.body_ipos[bodies] * weigh[:, None],
        inertia=inertia * weigh[:, None, None],
        armature=np.array([model.dof_armature[model.joint(joint.in_data).dofadr[0]] for joint in mode.joints]),
    )


def _bodies(mode: Mode, model: Any) -> dict[str, int]:
    """Return the bodies by link name. A massless intermediate link has no body and is mapped to the body that follows it."""
    body_of = {model.body(number).name: number for number in range(model.nbody)}
    for joint in reversed(mode.joints):
        parent, child = mode.links[joint.parent], mode.links[joint.child]
        if parent.mass == 0.0 and child.name in body_of:
            body_of.setdefault(parent.name, body_of[child.name])
    return body_of


def _actuators(model: Any) -> dict[str, int]:
    names = ((model.actuator(number).name, number) for number in range(model.nu))
    return {name: number for name, number in names if name}


def _activation(model: Any, actuator: int) -> slice:
    """Return the slice of an actuator's activation in `act`, which is empty if it has none."""
    first, count = int(model.actuator_actadr[actuator]), int(model.actuator_actnum[actuator])
    return slice(first, first + count) if first >= 0 else slice(0, 0)
