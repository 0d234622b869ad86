"""Import the simulation options, the contact exclusions and the keyframes of a MuJoCo model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from thingc.base.grouping import group_by
from thingc.base.numeric import hypot
from thingc.base.pose import Pose, Quaternion
from thingc.tools.importing.mjcf.adding import Added
from thingc.tools.importing.mjcf.compiled_source import CompiledSource, floats, numbers, pose_of
from thingc.tools.importing.source_model import SourceBase, SourceJoint, SourcePose

INTEGRATORS = ("euler", "rk4", "implicit", "implicitfast")
CONES = ("pyramidal", "elliptic")
WORDS = {"solver": ("PGS", "CG", "Newton"), "jacobian": ("dense", "sparse", "auto")}
OPTIONS = (
    "density", "viscosity", "wind", "magnetic", "solver", "jacobian", "tolerance", "ls_tolerance", "noslip_tolerance", "ccd_tolerance",
    "iterations", "ls_iterations", "noslip_iterations", "ccd_iterations", "sdf_iterations", "sdf_initpoints", "o_margin", "o_solref",
    "o_solimp", "o_friction",
)
_ALIKE = 1e-9
_OPEN = 1e-4
"""Maximum gap [m] of a closed loop in a keyframe. Larger gaps are recorded as losses."""


def simulation(original: CompiledSource) -> tuple[tuple[str, float | str], ...]:
    """Return the supported simulation options that differ from MuJoCo's defaults.

    The possible keys are `timestep` [s], `integrator`, `cone` and `impratio`.
    """
    option, changed = original.model.opt, list[tuple[str, float | str]]()
    settings: tuple[tuple[str, float | str, float | str], ...] = (
        ("timestep", float(option.timestep), 0.002), ("integrator", INTEGRATORS[int(option.integrator)], "euler"),
        ("cone", CONES[int(option.cone)], "pyramidal"), ("impratio", float(option.impratio), 1.0),
    )
    for name, value, usual in settings:
        if isinstance(value, float) and value <= 0.0:
            original.losses.note(f"a `{name}` of {value:g}", "the value must be above 0 in a document", original.flat.root.where)
        elif value != usual:
            changed.append((name, value))
    return tuple(changed)


def options(original: CompiledSource) -> tuple[tuple[tuple[str, ...], str], ...]:
    """Return the MuJoCo options that differ from MuJoCo's defaults, except the supported simulation options.

    The result contains the path, such as `("option", "flag", "contact")`, and the value of each option.
    """
    import mujoco

    ours, usual = original.model.opt, mujoco.MjSpec().option
    entries: list[tuple[tuple[str, ...], str]] = []
    for name in OPTIONS:
        value, other = (getattr(one, name, None) for one in (ours, usual))
        if value is not None and _format_setting(name, value) != _format_setting(name, other):
            entries.append((("option", name), _format_setting(name, value)))
    for enum, field, prefix, word in (
        (mujoco.mjtDisableBit, "disableflags", "mjDSBL_", "disable"), (mujoco.mjtEnableBit, "enableflags", "mjENBL_", "enable"),
    ):
        for name, bit in enum.__members__.items():
            if name.startswith(prefix) and int(getattr(ours, field)) & int(bit):
                entries.append((("option", "flag", name.removeprefix(prefix).lower()), word))
    if int(ours.disableactuator):
        why = "documents use the key `actuators` of modes instead"
        original.losses.note("disabled groups of actuators", why, original.flat.root.where)
    return tuple(entries)


def _format_setting(name: str, value: Any) -> str:
    return WORDS[name][int(value)] if name in WORDS else numbers(value)


def touching(
    original: CompiledSource, on: Mapping[int, tuple[int, Pose]], groups: Mapping[int, int], heads: Mapping[int, int], still: int | None,
    added: Added,
) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links between which the MuJoCo model excludes contacts. Pairs of links that are connected by a joint are omitted.

    `groups` maps each body to the first body of its group of rigidly connected bodies, and `heads` to the first body of its link. Documents
    always exclude contacts between links that are connected by a joint. In MuJoCo, an option controls these contacts, and the children of
    the static body `still` can touch this body. Such contacts are recorded as losses.
    """
    import mujoco

    model = original.model
    for pair in (pair for number, pair in enumerate(original.spec.pairs) if not added.pair(number)):
        what = f"a contact pair, `{pair.geomname1}` and `{pair.geomname2}`"
        original.losses.note(what, "a body of the pair is not in the document", original.flat.place(pair.info))
    parents = {
        head: groups[parent] for head in set(groups.values()) if (parent := int(model.body_parentid[head])) in groups and parent != head
    }
    near = {_pair(head, parent) for head, parent in parents.items()}
    excluded = list(_excluded_pairs(original, on))
    written = {_pair(first, second) for first, second in excluded}
    apart = {
        _pair(heads[first], heads[second]): (first, second) for first, second in excluded
        if groups[first] != groups[second] and _pair(groups[first], groups[second]) not in near
    }
    filtered = not int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
    members, bodies_of = group_by(groups, groups.__getitem__), group_by(heads, heads.__getitem__)
    masks = {body: _masks(original, body) for body in groups}

    def meet(bodies: Sequence[int], others: Sequence[int]) -> bool:
        """Return whether the contact masks of two groups of bodies allow contacts. Excluded pairs of bodies are ignored."""
        pairs = ((one, two) for one in bodies for two in others if _pair(one, two) not in written)
        return any(masks[one][0] & masks[two][1] or masks[two][0] & masks[one][1] for one, two in pairs)

    for head, parent in sorted(parents.items()):
        if (parent == still or not filtered) and meet(members[head], members[parent]):
            what = f"contacts of `{original.bodies[head]}` with `{original.bodies[parent]}`"
            original.lose("body", head, what, "documents exclude contacts of links with a common joint")
    for head, other in sorted(apart):
        if meet(bodies_of[head], bodies_of[other]):
            what = f"contacts of `{original.bodies[other]}` with `{original.bodies[head]}`"
            original.lose("body", other, what, "a pair of bodies is excluded from contact")
    _lose_parts(original, {head: bodies for head, bodies in bodies_of.items() if groups[head] != still}, masks)
    return tuple((original.bodies[on[first][0]], original.bodies[on[second][0]]) for first, second in apart.values())


def _excluded_pairs(original: CompiledSource, on: Mapping[int, tuple[int, Pose]]) -> Iterator[tuple[int, int]]:
    """Yield the pairs of bodies between which the model excludes contacts. If one body of a pair is not imported, record a loss."""
    numbers_of = {name: number for number, name in original.bodies.items()}
    for one in original.spec.excludes:
        first, second = (numbers_of[name] for name in (one.bodyname1, one.bodyname2))
        if one.name:
            what = f"the name of exclude `{one.name}`"
            original.losses.note(what, "excluded pairs in a document have no names", original.flat.place(one.info))
        if first in on and second in on:
            yield first, second
        else:
            what = f"the excluded contact of `{one.bodyname1}` and `{one.bodyname2}`"
            original.losses.note(what, "a body of the pair is not part of the robot", original.flat.place(one.info))


def _lose_parts(original: CompiledSource, members: Mapping[int, list[int]], masks: Mapping[int, tuple[int, int]]) -> None:
    """Record losses in the drag of links, and in the softness of contacts of links of several bodies, which MuJoCo computes for each body.

    `members` contains the bodies of each moving link, and `masks` the contact masks of each body.
    """
    model = original.model
    fluid = bool(model.opt.density or model.opt.viscosity)
    for head, bodies in sorted(members.items()):
        for geom in (geom for body in bodies for geom in original.geoms_of[body] if fluid and model.geom_fluid[geom][0]):
            what = f"drag of a geom of `{original.bodies[int(model.geom_bodyid[geom])]}` as an ellipsoid"
            original.lose("geom", geom, what, "documents support drag only for whole links")
        heavy = [body for body in bodies if model.body_mass[body] > 0.0]
        why = "bodies that are fixed to each other are one link"
        if len(heavy) == 1 and model.opt.density and _has_other_axes(original, heavy[0]):
            what = f"the orientation of the drag of `{original.bodies[head]}`"
            original.lose("body", head, what, "the axes of equal moments of inertia are arbitrary")
        if len(heavy) > 1 and fluid:
            original.lose("body", head, f"drag of `{original.bodies[head]}`, computed for each body", why)
        if len(heavy) > 1 and any(any(masks[body]) for body in bodies):
            original.lose("body", head, f"the softness of contacts of `{original.bodies[head]}`", why)


def _has_other_axes(original: CompiledSource, body: int) -> bool:
    """Return whether MuJoCo computes other principal axes from the inertia of a body than those of the model.

    This is possible if two moments of inertia are equal. MuJoCo computes the drag of a body for a box along the principal axes, unless the
    drag of a geom of the body is computed for an ellipsoid.
    """
    import mujoco
    import numpy as np

    model, axes = original.model, np.zeros(9)
    if any(model.geom_fluid[geom][0] for geom in original.geoms_of[body]):
        return False
    mujoco.mju_eig3(np.zeros(3), axes, np.zeros(4), np.array(original.mass_properties(body).inertia).ravel())
    cosines = np.abs(np.array(pose_of(model.body_ipos[body], model.body_iquat[body]).rotation).T @ axes.reshape(3, 3))
    return bool(cosines.max(axis=0).min() < 1.0 - _ALIKE)


def _pair(one: int, other: int) -> tuple[int, int]:
    return min(one, other), max(one, other)


def _masks(original: CompiledSource, body: int) -> tuple[int, int]:
    """Return the bitwise OR of the masks `contype` and of the masks `conaffinity` of a body's geoms. Planes of the world are ignored."""
    model, kinds, affinities = original.model, 0, 0
    for geom in original.geoms_of[body]:
        if body or model.geom_type[geom]:
            kinds, affinities = kinds | int(model.geom_contype[geom]), affinities | int(model.geom_conaffinity[geom])
    return kinds, affinities


def poses(
    original: CompiledSource, on: Mapping[int, tuple[int, Pose]], root: int, base: SourceBase, joints: Mapping[str, SourceJoint],
    released: Mapping[int, Pose],
) -> tuple[SourcePose, ...]:
    """Convert the keyframes of a MuJoCo model to poses within the joint limits.

    `released` contains the initial poses of bodies with free joints in the frame of the root.

    Velocities and activations in keyframes are recorded as losses, and keyframes in which a mimic would be outside its limits.
    """
    model, poses = original.model, []
    places = [one.where for one in original.flat.lines if one.tag == "key"][::2]
    following = {joint.name: joint.follows for joint in joints.values() if joint.follows is not None}
    for number, key in enumerate(original.spec.keys):
        name, where = key.name or f"key_{number}", places[number] if number < len(places) else original.flat.root.where
        q: dict[str, float | Quaternion | Pose] = {}
        first = int(model.jnt_qposadr[model.body_jntadr[root]]) if base == "free" else 0
        here, usual = (floats(qpos[first : first + 7]) for qpos in (model.key_qpos[number], model.qpos0))
        X_WR = pose_of(here[:3], here[3:]) if base == "free" else pose_of(model.body_pos[root], model.body_quat[root])
        for joint in range(model.njnt):
            at, kind = int(model.jnt_qposadr[joint]), int(model.jnt_type[joint])
            if int(model.jnt_bodyid[joint]) in on and kind == 1:
                w, x, y, z = floats(model.key_qpos[number][at : at + 4])
                q[original.joints[joint]] = (w, x, y, z)
            elif (body := int(model.jnt_bodyid[joint])) in released:
                own = model.key_qpos[number][at : at + 7]
                q[original.joints[joint]] = released[body].inverse() @ X_WR.inverse() @ pose_of(own[:3], own[3:])
            elif int(model.jnt_bodyid[joint]) in on and kind > 1:
                name_of, value = original.joints[joint], float(model.key_qpos[number][at])
                q[name_of] = joints[name_of].ends.nearest(value)
                if abs(value - joints[name_of].ends.nearest(value)) > _ALIKE:
                    what = f"joint `{name_of}` at {value:g} in keyframe `{name}`"
                    original.losses.note(what, "the value is outside the limit (the limit is used)", where)
        impossible = []
        for name_of, follows in following.items():
            was, leader = q.pop(name_of), q[follows.joint]
            if isinstance(was, float) and isinstance(leader, float) and abs(was - (value := follows.at(leader))) > 1e-6:
                original.losses.note(f"joint `{name_of}` at {was:g} in keyframe `{name}`", f"the joint mimics `{follows.joint}`", where)
                impossible += [name_of] if abs(value - joints[name_of].ends.nearest(value)) > _ALIKE else []
        if impossible:
            why = f"joint `{impossible[0]}`, which mimics another joint, would be outside its limits"
            original.losses.note(f"keyframe `{name}`", why, where)
            continue
        moved = base == "free" and any(abs(a - b) > _ALIKE for a, b in zip(here, usual, strict=True))
        for loop, gap in _open_loops(original, number):
            what = f"the values of keyframe `{name}`: loop `{loop}` has a gap of {gap:.2g} m"
            original.losses.note(what, "a build uses the nearest values that close the loop", where)
        if any(floats(model.key_qvel[number])):
            original.losses.note(f"the velocities of keyframe `{name}`", "poses of a document have no velocities", where)
        if any(floats(model.key_act[number])):
            original.losses.note(f"the activations of keyframe `{name}`", "poses of a document have no activations", where)
        controls = floats(model.key_ctrl[number])
        poses.append(SourcePose(name=name, q=q, controls={original.actuators[k]: controls[k] for k in range(len(controls))}, where=where,
                                at=pose_of(here[:3], here[3:]) if moved else None))
    return tuple(poses)


def _open_loops(original: CompiledSource, key: int) -> Iterator[tuple[str, float]]:
    """Yield the name and the error [m] of each equality constraint between bodies that a keyframe violates by more than `_OPEN`."""
    import mujoco

    model, data = original.model, mujoco.MjData(original.model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_fwdPosition(model, data)
    between = {int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)}
    for number in (number for number in range(model.neq) if int(model.eq_type[number]) in between):
        rows = [k for k in range(data.ne) if data.efc_id[k] == number]  # equalities are first; positions precede rotations
        gap = hypot(*floats(data.efc_pos[rows[:3]]))
        if gap > _OPEN:
            yield original.equalities[number], gap
