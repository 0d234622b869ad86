"""Resolve the modes of a document: merge extended modes, look up names, and convert numbers to SI units.

The module `model/assembly/modes.py` finds the link that is the root of each mode.

Nested assemblies that are robots and other objects in a scene are placed in one of their modes. The root of the mode is placed, and the
base of the mode becomes a joint: a fixed joint, or a joint of the kinds `free`, `planar` or `ball`. Poses, actuators, contacts and cuts of
the mode apply to the modes of the enclosing document.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from itertools import groupby
from typing import Any, cast

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note
from thingc.base.graphs import MAX_CYCLE, find_cycles, format_cycle
from thingc.base.joints.kinds import KINDS, BaseType
from thingc.base.pose import IDENTITY, NO_POSE, Pose, Vector
from thingc.base.source import Origin, Path
from thingc.base.units import ACCELERATION, LENGTH, NUMBER, TIME, Quantity
from thingc.documents.spec.modes import HoldSpec, ModeSpec, StandingSpec, StandsOn
from thingc.model.resolve import contacts, references
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.document_scope import ComponentScope, DocumentScope
from thingc.model.resolve.joints import NO_DYNAMICS, NO_LIMIT
from thingc.model.resolve.references import GLOB, report_unmatched, suggest
from thingc.model.resolve.scope import DefaultLayers, Scope
from thingc.model.resolve.transmissions import coupled_drives, undriven_reported
from thingc.model.resolve.types import OTHERS, At, Attach, Cut, Hold, Joint, Mode, Reference, Standing


def holds(table: DocumentScope, scope: Scope, layers: DefaultLayers) -> Iterator[Hold[Reference]]:
    """Yield the mounts that a mode holds to the world.

    The result includes the holds of the modes that the mode extends. Invalid holds are reported and omitted.
    """
    for text, (spec, path) in layers.entries("hold").items():
        reference = references.root(table, scope, text, path, key=True)
        has_pose = isinstance(spec, HoldSpec) and spec.at is None
        pose = scope.pose(spec, path) if has_pose else None
        if reference is not None and (pose is not None or not has_pose):
            turns = isinstance(spec, HoldSpec) and spec.carries == "force"
            yield Hold(mount=reference, pose=pose, origin=scope.origin(path, key=True), turns=turns)


def cuts(table: DocumentScope, scope: Scope, layers: DefaultLayers) -> tuple[Cut, ...]:
    """Return the joints at which a mode should cut kinematic loops, in the order of the document.

    A fixed joint can be cut only if it closes a loop.

    Invalid joints are reported and omitted.
    """
    patterns, path = layers.pick("cut")
    joints = dict(table.all_joints()) if patterns else {}
    chosen: dict[str, Path] = {}
    for index, pattern in enumerate(patterns or ()):
        entry_path = (*path, index)
        if pattern in patterns[:index]:
            scope.error(Code.CUT, f"`{pattern}` is listed twice in `cut`", entry_path, help="remove one of the two entries from `cut`")
            continue
        matches = [CoordinateName(pattern)] if pattern in joints else [name for name in joints if fnmatchcase(name.joint, pattern)]
        resolved = [(name.joint, joint) for name in matches if (joint := joints[name]) is not None]
        cuttable = [name for name, joint in resolved if joint.twist is not None or joint.loop]
        for name in cuttable:
            chosen.setdefault(name, entry_path)
        moving = [name for name, joint in joints.items() if joint is not None and joint.twist is not None]
        if resolved and not cuttable:
            fixed = "is a fixed joint" if pattern in joints else "matches only fixed joints"
            message = f"`{pattern}` in `cut` {fixed}"
            scope.error(Code.CUT, message, entry_path, help=suggest(pattern, moving, what="joints"))
        elif not matches and not table.may_lack_joints():
            report_unmatched(scope, pattern, moving, entry_path, "joint")
    return tuple(Cut(joint=CoordinateName(name).path, origin=scope.origin(entry_path)) for name, entry_path in chosen.items())


def standing(table: DocumentScope, scope: Scope, name: str, layers: DefaultLayers, base: BaseType) -> Standing | None:
    """Return the mounts in the key `standing_on` of a mode, and the friction of these mounts, if specified.

    If there are no valid mounts, return None.

    Invalid mounts are reported.
    """
    setting, path = layers.pick("standing_on")
    if not setting:
        return None
    if base != "free":
        scope.error(
            Code.STANDING, f"`standing_on` of mode `{name}` cannot be used with `base: {base}`", path,
            help="write `base: free`, or remove `standing_on`",
        )
        return None
    texts, friction = setting, None
    if isinstance(setting, StandingSpec):
        texts, friction = setting.mounts, scope.number(setting.friction, (*path, "friction"), NUMBER, "the friction", least=0.0)
        path = (*path, "mounts")
    mounts: dict[tuple[tuple[str, ...], str | None], Reference] = {}
    for index, text in enumerate(texts):
        for reference in mounts_fitting(table, scope, text, (*path, index)):
            mounts.setdefault((reference.path, reference.mount), reference)
    return Standing(mounts=tuple(mounts.values()), friction=friction, origin=scope.origin(path))


def mounts_fitting(table: DocumentScope, scope: Scope, text: str, path: Path) -> list[Reference]:
    """Return the mounts that match a pattern or a name.

    The name can be an exported mount of the document, or have the form `component.mount`.
    """
    if not GLOB.search(text):
        reference = references.shown_mount(table, scope, text, path)
        return [reference] if reference is not None else []
    components, _, mount = text.rpartition(".")
    matches = [f"{name}.{mount}" for name, _ in references.matching(table, components)]
    if not matches and not table.unbuilt:
        scope.error(
            Code.NO_MATCH, f"pattern `{text}` matches no mount", path,
            help=suggest(components, table.nodes, what="components") if components else "write, for example, `leg_*.sole`",
        )
    resolved = (references.shown_mount(table, scope, match, path) for match in matches)
    return [match for match in resolved if match is not None]


ROOT = "root"
"""Name of the joint of the base of a nested assembly. Joints in documents cannot have this name."""

MAX_EXTENDED = 20
GRAVITY: Mapping[StandsOn, Vector] = {"floor": (0.0, 0.0, -9.81), "wall": (-9.81, 0.0, 0.0), "ceiling": (0.0, 0.0, 9.81)}
"""Gravity [m/s^2] in the world frame, keyed by the surface that supports the robot."""


def modes(table: DocumentScope, scope: Scope) -> tuple[Mode, ...]:
    """Return the modes of a document.

    If the document does not define modes, return the default mode. Invalid modes are reported and omitted.
    """
    spec = table.spec
    if not spec.modes:
        return () if table.base is None or any(doubt[:1] == ("modes",) for doubt in scope.doubts.paths) else (_default(table, table.base),)
    in_cycle = _names_in_cycles(scope, spec.modes)
    resolved = [_mode(table, scope, name, in_cycle) for name in spec.modes]
    return tuple(mode for mode in resolved if mode is not None)


def _default(table: DocumentScope, base: str) -> Mode:
    """Return the mode of a document without modes, in which the component `base` is fixed."""
    origin = table.nodes[base].scope.origin(table.nodes[base].path, key=True)
    return Mode(
        name="default", root=Reference(path=(base,), mount=None, origin=origin), base="fixed", at=NO_POSE, gravity=GRAVITY["floor"],
        pose=None, poses=tuple(table.poses), actuators=None, exclude=(), adhesion=(), simulation={}, origin=origin, stated=False,
    )


def rigid_mode(node: ComponentScope, inner: DocumentScope) -> Mode | None:
    """Return the mode in which a nested assembly with `as: lump` is one rigid body. Its start pose is the pose of the body.

    By default, this pose is the start pose of the first mode. If the pose does not exist, report an error and return None.
    """
    pose, specs = node.spec.pose, inner.spec.modes
    if pose is None and specs:
        layers = _layers(inner.scope, specs, next(iter(specs)), _names_in_cycles(inner.scope, specs))
        pose = layers.pick("pose").value if layers is not None else None
    if inner.base is None or pose is not None and inner.poses.get(pose) is None:
        if pose not in inner.spec.poses and inner.base is not None and not inner.doubts.lacks("poses"):
            node.scope.error(
                Code.UNKNOWN_POSE, f"`{node.name}` (`{inner.document.relative}`) has no pose `{pose}`", (*node.path, "pose"),
                help=suggest(pose or "", inner.spec.poses, what="poses"), notes=references.definition_note(inner),
            )
        return None
    return replace(_default(inner, inner.base), pose=pose, poses=() if pose is None else (pose,))


def _names_in_cycles(scope: Scope, specs: dict[str, ModeSpec]) -> set[str]:
    """Return the names of modes that extend themselves directly or indirectly. Each cycle is reported once."""
    in_cycle: set[str] = set()
    for cycle in find_cycles(specs, lambda name: specs[name].extends if name in specs else None):
        in_cycle.update(cycle)
        is_long = len(cycle) > 1
        scope.error(
            Code.EXTENDS_CYCLE,
            f"modes extend each other in a cycle: {format_cycle(cycle)}" if is_long else f"mode `{cycle[0]}` extends itself",
            ("modes", cycle[0], "extends"), help="remove `extends` from one of these modes" if is_long else "remove `extends`",
            notes=[
                Note(message=f"`{step}` sets `extends` here", span=scope.span(("modes", step, "extends"))) for step in cycle[1:MAX_CYCLE]
            ],
        )
    return in_cycle


def _layers(scope: Scope, specs: dict[str, ModeSpec], name: str, in_cycle: set[str]) -> DefaultLayers | None:
    """Return the settings of a mode, followed by the settings of the modes that the mode extends.

    If the mode is invalid, report an error and return None.
    """
    items: list[tuple[ModeSpec, Path]] = []
    step: str | None = name
    while step is not None:
        if step in in_cycle:
            return None
        if len(items) == MAX_EXTENDED:
            scope.error(Code.TOO_MANY, f"mode `{name}` extends a chain of more than {MAX_EXTENDED} modes", ("modes", name, "extends"))
            return None
        if step not in specs:
            if scope.doubts.at(("modes", step)) or scope.doubts.lacks("modes"):
                return None
            path = items[-1][1]
            if len(items) == 1:
                modes = [mode for mode in specs if mode != name]
                scope.error(Code.UNKNOWN_MODE, f"there is no mode `{step}`", (*path, "extends"), help=suggest(step, modes, what="modes"))
            return None
        items.append((specs[step], ("modes", step)))
        step = specs[step].extends
    return DefaultLayers(tuple(items))


def _mode(table: DocumentScope, scope: Scope, name: str, in_cycle: set[str]) -> Mode | None:
    """Resolve a mode. If the mode is invalid or its name is in `in_cycle`, which has been reported, return None."""
    layers = _layers(scope, table.spec.modes, name, in_cycle)
    if layers is None:
        return None
    kind: BaseType = layers.pick("base").value or "fixed"
    at, on_floor = _at(scope, name, layers)
    gravity, gravity_origin = _gravity(scope, layers)
    pose = _pose(table, scope, layers)
    poses = _poses(table, scope, layers)
    actuators = _actuators(table, scope, layers)
    stepped = layers.sub("simulation")
    mode_holds, cut = tuple(holds(table, scope, layers)), cuts(table, scope, layers)
    cut += tuple(replace(c, joint=f"{path.replace('.', '/')}/{c.joint}") for path, _, inner in table.all_modes() for c in inner.cut)
    feet = standing(table, scope, name, layers, kind)
    if on_floor:
        _check_holds_on_floor(scope, name, layers, mode_holds)
    root = layers.pick("root")
    if not root:
        if any(scope.doubts.touch(path) for _, path in layers.items):
            return None
        scope.error(
            Code.NO_ROOT, f"mode `{name}` requires a `root`", ("modes", name), key=True,
            help=f"write, for example, `root: {table.base or next(iter(table.nodes), 'plate')}`",
        )
        return None
    reference = references.root(table, scope, *root)
    if reference is None:
        return None
    return Mode(
        name=name, root=reference, base=kind, at=at, gravity=gravity, pose=pose,
        poses=((pose,) if pose else ()) + tuple(name for name in poses if name != pose), actuators=actuators,
        **_contacts(table, scope, name, layers.sub("contacts")), simulation=simulation(scope, stepped),
        origin=scope.origin(("modes", name), key=True), holds=mode_holds, cut=cut, on_floor=on_floor, standing=feet,
        step_origin=step_origin(scope, stepped), gravity_origin=gravity_origin,
        has_expressions=any(scope.has_expression(path) for _, path in layers.items), at_in=_at_in(table, scope, layers, kind),
    )


def _contacts(table: DocumentScope, scope: Scope, name: str, settings: DefaultLayers) -> dict[str, Any]:
    """Return the contact settings of a mode by field of `Mode`, with those of the modes of nested assemblies."""
    exclude, adhesion = list(contacts.excluded_pairs(table, scope, settings)), list(contacts.adhesions(table, scope, settings))
    pairs, groups = list(contacts.pairs(table, scope, settings, exclude)), list(contacts.groups(table, scope, settings))
    for component, _, mode in table.all_modes():
        exclude += ((_below(component, a), _below(component, b)) for a, b in mode.exclude)
        adhesion += ((_below(component, mount), force) for mount, force in mode.adhesion)
        pairs += (replace(pair, one=_below(component, pair.one), other=_below(component, pair.other)) for pair in mode.pairs)
        groups += (
            replace(
                group, name=f"{component}.{group.name}", members=tuple(_below(component, member) for member in group.members),
                collides=tuple(name if name == OTHERS else f"{component}.{name}" for name in group.collides),
            ) for group in mode.groups
        )
    if len(groups) > contacts.MOST_GROUPS:
        message = f"mode `{name}` has {len(groups)} contact groups (at most {contacts.MOST_GROUPS} are supported)"
        scope.error(Code.TOO_MANY, message, ("modes", name), key=True, help="combine some of the groups")
    return {"exclude": tuple(exclude), "adhesion": tuple(adhesion), "pairs": tuple(pairs), "groups": tuple(groups)}


def _at_in(table: DocumentScope, scope: Scope, layers: DefaultLayers, base: BaseType) -> dict[str, Pose]:
    """Return the pose of the root in the world by named pose of the robot, for poses with a different root placement than the mode."""
    specs, path = layers.pick("at_in")
    poses: dict[str, Pose] = {}
    if specs and base not in ("free", "held"):
        scope.error(Code.STANDING, f"`at_in` cannot be used with `base: {base}`", path, help="remove `at_in`")
    for name, spec in (specs or {}).items():
        place = (*path, name)
        pose = scope.pose(spec, place)
        if name not in table.poses:
            scope.error(Code.UNKNOWN_POSE, f"there is no pose `{name}`", place, key=True, help=suggest(name, table.poses, what="poses"))
        elif pose is not None:
            poses[name] = pose
    return poses


def _at(scope: Scope, name: str, layers: DefaultLayers) -> tuple[Pose, bool]:
    """Return the pose of the root in the world, and True if `on: floor` determines its height.

    If a mode sets `xyz` and an extended mode sets `on: floor`, `xyz` determines the height.
    """
    at = layers.sub("at")
    if not at:
        return NO_POSE, False
    on, xyz = at.pick("on"), at.pick("xyz")
    rotation_layer = next((layer for layer in at.items if layer[0].model_fields_set & {"rpy", "quat"}), None)
    translation = scope.vector(*xyz, LENGTH, "`xyz`") or NO_POSE.translation
    rotation = scope.rotation(*rotation_layer) if rotation_layer is not None else None  # type: ignore[arg-type]
    pose = Pose(rotation=rotation or IDENTITY, translation=translation)
    if not on:
        return pose, False
    x, y, z = pose.translation
    order = [path for _, path in at.items]
    floor_layer, xyz_layer = order.index(on.path[:-1]), order.index(xyz.path[:-1]) if xyz else len(order)
    if z != 0.0 and xyz_layer < floor_layer:
        return pose, False
    if z != 0.0 and xyz_layer == floor_layer:
        scope.error(
            Code.HEIGHT, f"mode `{name}` has both `on: floor` and a height of {Quantity(z, LENGTH)}",
            (*xyz.path, 2), help="set z of `at` to `0`, or remove `on: floor`",
        )
    return replace(pose, translation=(x, y, 0.0)), True


def _check_holds_on_floor(scope: Scope, name: str, layers: DefaultLayers, mode_holds: Sequence[Hold[Reference]]) -> None:
    """Report an error for a hold with a position in a mode with `on: floor`, because both would determine the height."""
    on = layers.sub("at").pick("on")
    for hold in mode_holds:
        if hold.pose is not None and on:
            scope.error(
                Code.HEIGHT, f"mode `{name}` has both `on: floor` and a fixed height of `{hold.mount.text}` under `hold`",
                ("modes", name, "hold"), span=hold.origin[0],
                help=f"write `{hold.mount.text}: here`, or replace `on: floor` with a height in `at`",
                notes=[Note(message="`on: floor` is set here", span=scope.span(on.path))],
            )


def _gravity(scope: Scope, layers: DefaultLayers) -> tuple[Vector, Origin]:
    """Return the gravity vector [m/s^2] of a mode and its location in the document.

    If gravity is a keyword or the default, the location is empty.
    """
    setting, path = layers.pick("gravity")
    if isinstance(setting, str):
        return GRAVITY[cast("StandsOn", setting)], ()
    gravity = scope.vector(setting, path, ACCELERATION, "`gravity`")
    return (GRAVITY["floor"], ()) if gravity is None else (gravity, scope.origin(path))


def _pose(table: DocumentScope, scope: Scope, layers: DefaultLayers) -> str | None:
    name, path = layers.pick("pose")
    if name is not None and name not in table.poses and not scope.doubts.lacks("poses"):
        report_unmatched(scope, name, table.poses, path, "pose")
    return name if name in table.poses else None


def _poses(table: DocumentScope, scope: Scope, layers: DefaultLayers) -> tuple[str, ...]:
    names, path = layers.pick("poses")
    for index, name in enumerate(names or ()):
        if name not in table.poses and not scope.doubts.lacks("poses"):
            report_unmatched(scope, name, table.poses, (*path, index), "pose")
    return tuple(table.poses) if names is None else tuple(dict.fromkeys(name for name in names if name in table.poses))


def _actuators(table: DocumentScope, scope: Scope, layers: DefaultLayers) -> tuple[str, ...] | None:
    """Return the paths (with `/`) of the driven joints of the mode, in document order."""
    patterns, path = layers.pick("actuators")
    if patterns is None:
        return _actuators_of_nested(table)
    chosen = driven_joints(table, scope, [(pattern, (*path, index)) for index, pattern in enumerate(patterns)])
    for _, group in groupby(coupled_drives(table), lambda one: (one[0].removesuffix(one[1].name), [joint for joint, _ in one[1].moves])):
        names = [name for name, _ in group]
        missing = [f"`{name}`" for name in names if name.path not in chosen]
        if 0 < len(missing) < len(names):
            message = f"the mode does not use all drives of a differential (missing: {', '.join(missing)})"
            help = "use all drives of the differential"
            scope.report.warn(Code.TRANSMISSION, message, scope.origin(path), help=help, allow=True)
    return chosen


def _actuators_of_nested(table: DocumentScope) -> tuple[str, ...] | None:
    """Return the paths of the driven joints whose drives the modes of nested assemblies do not exclude, or None for all joints."""
    chosen = {f"{path.replace('.', '/')}/": mode.actuators for path, _, mode in table.all_modes() if mode.actuators is not None}
    if not chosen:
        return None
    paths = [name.path for name, joint in table.all_joints() if joint is not None and joint.drive is not None]
    paths += [name.path for name, _ in coupled_drives(table)]
    return tuple(path for path in paths if all(path.removeprefix(top) in driven for top, driven in chosen.items() if path.startswith(top)))


def _below(component: str, reference: Reference) -> Reference:
    """Return a reference in a nested assembly as a reference in the enclosing document."""
    return replace(reference, path=(*component.split("."), *reference.path))


def driven_joints(table: DocumentScope, scope: Scope, patterns: Sequence[tuple[str, Path]]) -> tuple[str, ...]:
    """Return the paths (with `/`) of driven joints that match names or patterns, in document order.

    `patterns` contains pairs of a name or pattern and its path in the document.
    """
    joints = dict(table.all_joints())
    coupled = [name for name, _ in coupled_drives(table)]
    driven = [*(name for name, joint in joints.items() if joint is not None and joint.drive is not None), *coupled]
    chosen: set[str] = set()
    for pattern, entry_path in patterns:
        if pattern in joints:
            joint = joints[CoordinateName(pattern)]
            if joint is not None and joint.drive is None and not undriven_reported(table, joint):
                scope.error(
                    Code.DRIVE, f"joint `{pattern}` has no `drive`", entry_path,
                    help=f"use the drives of its differential, such as `{coupled[0]}`" if joint.geared else "add `drive` to the joint",
                    notes=joint.definition_note(pattern),
                )
            chosen.add(pattern)
            continue
        matches = [name for name in driven if fnmatchcase(name, pattern) or fnmatchcase(name.joint, pattern)]
        chosen.update(matches)
        if not matches and not table.may_lack_joints():
            report_unmatched(scope, pattern, driven, entry_path, "joint", fits="driven joint")
    return tuple(name.path for name in driven if name in chosen)


def simulation(scope: Scope, layers: DefaultLayers) -> dict[str, float | str]:
    """Return the settings `timestep` [s], `integrator`, `cone` and `impratio` that the document specifies."""
    settings: dict[str, float | str | None] = {
        "timestep": scope.number(*layers.pick("timestep"), TIME, "`timestep`", above=0.0),
        "integrator": layers.pick("integrator").value, "cone": layers.pick("cone").value,
        "impratio": scope.number(*layers.pick("impratio"), NUMBER, "`impratio`", above=0.0),
    }
    return {key: value for key, value in settings.items() if value is not None}


def step_origin(scope: Scope, layers: DefaultLayers) -> Origin:
    """Return the location of the setting `timestep` in the document.

    If the document does not specify `timestep`, return an empty origin.
    """
    setting = layers.pick("timestep")
    return scope.origin(setting.path) if setting else ()


def place_in_modes(table: DocumentScope, placements: dict[str, Attach | At | None]) -> bool:
    """Replace the placement of each component with a `mode` by the joint of the base of the mode.

    Invalid modes are reported, and their components remain unplaced. Return whether a component has a `mode` without a pose.
    """
    missing_pose = False
    for node in table.nodes.values():
        at, scope, path = placements.get(node.name), node.scope, (*node.path, "mode")
        if node.spec.mode is None or node.table is None or node.unplaced:
            continue
        if not isinstance(at, At):
            scope.error(
                Code.BROKEN_RULE, f"`mode` of component `{node.name}` requires `at`", path, key=True,
                help="add a component such as `room: {frame: true}`, and write `at: {in: room.origin}`",
            )
            missing_pose = node.unplaced = True
            continue
        placements[node.name] = None
        mode = _mode_of(node, node.table, node.spec.mode)
        if mode is None:
            node.unplaced = True
            continue
        table.by_mode[node.name] = mode
        kind, root, origin = KINDS[mode.base], mode.root, scope.origin(path)
        child = Reference(path=(node.name, *root.path), mount=root.mount or references.ORIGIN, origin=origin)
        name = CoordinateName(f"{node.name}.{ROOT}")
        for number, twist in enumerate(kind.twists or (None,)):
            coordinate = name.with_number(number) if len(kind.twists) > 1 else name
            table.joints[coordinate] = Joint(
                name=coordinate, kind=kind, twist=twist, parent=at.to, child=child, limit=NO_LIMIT, dynamics=NO_DYNAMICS, turn=0.0, gap=0.0,
                offset=0.0, drive=None, mimic=None, origin=at.origin, spans={}, keep=not kind.moves, base=True,
                axis=IDENTITY[2] if root.mount is None else None, pose=at.pose @ mode.at,
            )
    return missing_pose


def _mode_of(node: ComponentScope, inner: DocumentScope, name: str) -> Mode | None:
    """Return a mode of a nested assembly. If a scene does not support the mode, report an error and return None."""
    scope, path = node.scope, (*node.path, "mode")
    if name not in inner.spec.modes:
        if not inner.doubts.lacks("modes"):
            scope.error(
                Code.UNKNOWN_MODE, f"`{node.name}` (`{inner.document.relative}`) has no mode `{name}`", path,
                help=suggest(name, inner.spec.modes, what="modes"), notes=references.definition_note(inner),
            )
        return None
    mode = _mode(inner, inner.scope, name, _names_in_cycles(inner.scope, inner.spec.modes))
    if mode is None:
        return None
    unsupported: Mapping[str, bool] = {
        "`base: held`": mode.base == "held", "`hold`": bool(mode.holds), "`at: {on: floor}`": mode.on_floor, "`at_in`": bool(mode.at_in),
    }
    feature = next((key for key, is_used in unsupported.items() if is_used), None)
    if feature is not None:
        scope.error(
            Code.REFERENCE, f"mode `{name}` of `{node.name}` has {feature}, which a nested assembly does not support", path,
            help="use a mode with another base, and set the height of the mode in `at` of the component",
        )
    return mode if feature is None else None
