"""Resolve the joints of a document: type, parent and child mount, limits, dynamics and drives.

Mimics are resolved by the module `mimics`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, get_args

from msgspec.structs import replace

from thingc.base.diagnostics import Code
from thingc.base.joints.kinds import KINDS, JointKind
from thingc.base.joints.twist import SLIDE, TURN, Twist, dimensions_of
from thingc.base.pose import IDENTITY, Vector
from thingc.base.source import MappingNode, Node, Path, ScalarNode, SequenceNode, node_at
from thingc.base.units import ANGLE, LENGTH, Dimension, Quantity
from thingc.documents.spec.assembly import JointSpec
from thingc.documents.spec.drives import DriveKind, DriveSpec
from thingc.geometry.record import PartDefinition
from thingc.model.resolve import references
from thingc.model.resolve.coordinates import CoordinateName, Dynamics, Limit
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.placement import Places
from thingc.model.resolve.repeats import Unrolled
from thingc.model.resolve.scope import DefaultLayers, LayeredValue, Scope
from thingc.model.resolve.types import Drive, Joint, Reference

DRIVE_KINDS: tuple[str, ...] = get_args(DriveKind)
"""The possible kinds of an inline drive."""

DRIVE_VALUES: Mapping[str, Mapping[str, Any]] = {
    **dict.fromkeys(("kp", "kv", "effort", "velocity", "armature", "deadband", "noise"), {"least": 0.0}),
    "stall": {"above": 0.0}, "delay": {"least": 0.0, "most": 1.0},
}
"""The values of a drive by key, with their bounds."""

NO_LIMIT = Limit()
NO_DYNAMICS = Dynamics()


def _setting(scope: Scope, layers: DefaultLayers, key: str, coordinate: Dimension) -> LayeredValue:
    """Return the value of the key `key` in the document or in its defaults.

    A default value with a unit of rotation is not used for a translation, and vice versa.
    """
    setting = layers.pick(key)
    return LayeredValue() if setting and not setting.own and _of_others(scope, *setting, key, coordinate) else setting


def _of_others(scope: Scope, raw: Any, path: Path, key: str, coordinate: Dimension) -> bool:
    """Return whether a value has a unit of rotation although the joint translates, or a unit of translation although the joint rotates."""
    dimensions, other_dimensions = (TURN, SLIDE) if coordinate == ANGLE else (SLIDE, TURN)
    value = scope.value(raw, path)
    return isinstance(value, Quantity) and key in dimensions and not value.fits(dimensions[key]) and value.fits(other_dimensions[key])


def values(scope: Scope, owner: str, coordinate: Dimension, section: str, layers: DefaultLayers, keys: Iterable[str]) -> dict[str, Any]:
    """Return the values [SI] of settings that must not be negative, such as `damping`. `owner` is the name of the joint or tendon.

    Missing and invalid values are None. Invalid values are reported.
    """
    dimensions = dimensions_of(coordinate)
    settings = {key: _setting(scope, layers, key, coordinate) for key in keys}
    return {key: scope.number(*value, dimensions[key], f"`{section}.{key}` of {owner}", least=0.0) for key, value in settings.items()}


def _refuse(item: Unrolled[JointSpec], key: str | Path, text: str, help: str, *, code: Code = Code.JOINT_FIELD, typed: bool = True) -> None:
    """Report an error for a key that the type of a joint does not allow.

    `key` is the key, or its path in the document. In the message, `text` follows the name of the joint. With `typed`, a note shows the
    location of the type.
    """
    scope, path = item.scope, (*item.path, key) if isinstance(key, str) else key
    notes = scope.second_note("the type of the joint is set here", (*item.path, "type"), path) if typed else ()
    scope.error(code, f"joint `{item.name}` {text}", path, key=True, help=help, notes=notes)


def joints(table: DocumentScope, items: Iterable[Unrolled[JointSpec]], places: Places) -> bool:
    """Resolve the joints of a document, except for their mimics, and store them in `table.joints`.

    For each joint, `places` records the component that the joint places.

    If the type or a reference of a joint is invalid, None is stored for the joint, and its child component remains unplaced. Return whether
    the reference to the child of any joint could not be read.
    """
    defaults = table.spec.defaults.joint if table.spec.defaults is not None else None
    default_layers = ((defaults, ("defaults", "joint")),) if defaults is not None else ()
    unknown_child = False
    for item in items:
        spec, scope, path = item.spec, item.scope, item.path
        layers = DefaultLayers(((spec, path), *default_layers))
        is_incomplete = bool(table.doubts) and (table.doubts.touch(path) or table.doubts.touch(("defaults", "joint")))
        child = references.mount(table, scope, spec.child, (*path, "child"))
        parent = references.mount(table, scope, spec.parent, (*path, "parent"))
        kind = KINDS[spec.type]
        placed = None if spec.loop else child.path[0] if child is not None else _component_of(table, scope, spec.child)
        if is_incomplete and table.doubts.touch((*path, "loop")):
            placed, unknown_child = None, True
        elif placed is None:
            unknown_child = unknown_child or not spec.loop
        else:
            places.setdefault(placed, []).append((f"{'free ' if kind.free else ''}joint `{item.name}`", scope.span(path, key=True)))
        coordinates: tuple[Joint, ...] = ()
        if parent is not None and child is not None:
            coordinates = _coordinates(table, item, kind, parent, child, layers)
        else:
            table.loose.extend(end for end in (parent, child) if end is not None)
        if coordinates and not is_incomplete:
            table.joints.update((joint.name, joint) for joint in coordinates)
        else:
            table.joints[CoordinateName(item.name)] = None
            if placed is not None:
                table.nodes[placed].unplaced = True
    joints_missing = bool(table.doubts) and (table.doubts.lacks("joints") or any(True for _ in table.doubts.names("joints")))
    return unknown_child or joints_missing or any(table.doubts.touch(("joints", name, "repeat")) for name in table.spec.joints)


def _component_of(table: DocumentScope, scope: Scope, text: str) -> str | None:
    """Return the name of the component at the beginning of an invalid reference, or None if this component does not exist."""
    first = text.split(".")[0]
    if scope.index is not None:
        first = first.replace("${" + scope.index[0] + "}", scope.index[1]).replace("$" + scope.index[0], scope.index[1])
    return first if first in table.nodes else None


def _coordinates(
    table: DocumentScope, item: Unrolled[JointSpec], kind: JointKind, parent: Reference, child: Reference, layers: DefaultLayers,
) -> tuple[Joint, ...]:
    """Resolve a joint and return a tuple with one element per coordinate of the joint."""
    count = len(kind.twists)
    lead, axis = _lead(item, kind), _axis(item, kind)
    twists = kind.twists_about(axis, lead or 0.0) if axis is not None else kind.twists if lead is None else kind.with_lead(lead)
    if item.spec.reverse and kind.axial:
        twists = tuple(twist.inverse() for twist in twists)
    elif item.spec.reverse:
        _refuse(item, "reverse", f"is {kind.words} and cannot have `reverse`", "remove `reverse`", typed=False)
    if item.spec.keep and (kind.moves or item.spec.loop):
        reason = f"is {kind.words}" if kind.moves else "closes a loop"
        _refuse(item, "keep", f"{reason} and cannot have `keep`", "remove `keep`", typed=False)
    if kind.free:
        return _free(table, item, kind, (parent, child), layers)
    if kind.at_once:
        return _ball(table, item, kind, (parent, child), layers)
    for key in ("limit", "dynamics", "drive", "offset", "mimic"):
        setting = getattr(item.spec, key)
        is_list = isinstance(setting, (list, dict))
        indices: Iterable[int] = map(int, setting) if isinstance(setting, dict) else range(len(setting) if is_list else 0)
        if setting is None or key not in item.spec.model_fields_set or (is_list == (count > 1) and all(n < count for n in indices)):
            continue
        if count > 1:
            text = f"is {kind.words} and requires a list of {count} items for `{key}`"
            help = "write, for example, `[" + ", ".join("..." for _ in range(count)) + "]`, or `{0: ...}` to set only some coordinates"
        else:
            text, help = f"is {kind.words} and cannot have a list for `{key}`", "write the value without a list"
        _refuse(item, key, text, help, code=Code.COORDINATES)
    numbered_twists: Sequence[tuple[int | None, Twist | None]] = [*enumerate(twists)] if count > 1 else [(None, next(iter(twists), None))]
    resolved = (_resolve_joint(table, item, kind, twist, (parent, child), layers, number) for number, twist in numbered_twists)
    return tuple(replace(joint, axis=axis, reverse=item.spec.reverse) for joint in resolved)


def _free(
    table: DocumentScope, item: Unrolled[JointSpec], kind: JointKind, mounts: tuple[Reference, Reference], layers: DefaultLayers,
) -> tuple[Joint, ...]:
    """Resolve the coordinates of a free joint, which has no limits, dynamics and drives."""
    for key in ("limit", "dynamics", "drive", "offset", "loop"):
        if getattr(item.spec, key):
            _refuse(item, key, f"is free and cannot have `{key}`", f"remove `{key}`")
    joint = _resolve_joint(table, item, kind, None, mounts, layers, None)
    return tuple(replace(joint, name=CoordinateName(item.name).with_number(k), twist=twist) for k, twist in enumerate(kind.twists))


def _ball(
    table: DocumentScope, item: Unrolled[JointSpec], kind: JointKind, mounts: tuple[Reference, Reference], layers: DefaultLayers,
) -> tuple[Joint, ...]:
    """Resolve the coordinates of a ball joint.

    The limit and the dynamics apply to all coordinates. A ball joint can have up to three drives. Each drive acts about its own axis and is
    stored with one of the coordinates.
    """
    scope, spec, name = item.scope, item.spec, item.name
    for key in ("limit", "dynamics"):
        if isinstance(getattr(spec, key), (list, dict)):
            text = f"is a ball joint and cannot have a list for `{key}`"
            _refuse(item, key, text, "write the value without a list", code=Code.COORDINATES, typed=False)
    if spec.offset is not None:
        _refuse(item, "offset", "is a ball joint and cannot have an `offset`", "rotate a mount of the joint, or use `turn`", typed=False)
    joint = _resolve_joint(table, item, kind, None, mounts, layers, None)
    passive = replace(dynamics(scope, f"joint `{name}`", ANGLE, layers.sub("dynamics")), rest=None)
    if (rest := layers.sub("dynamics").pick("rest")).own:
        help = "rotate a mount of the joint instead"
        _refuse(item, rest.path, "is a ball joint and cannot have `dynamics.rest`", help, typed=False)
    limit, drives = _cone(item, layers.sub("limit")), _drives_of_ball(table, item)
    return tuple(
        replace(joint, name=CoordinateName(name).with_number(k), twist=twist, limit=limit, dynamics=passive, drive=drives.get(k))
        for k, twist in enumerate(kind.twists)
    )


def _drives_of_ball(table: DocumentScope, item: Unrolled[JointSpec]) -> dict[int, Drive]:
    """Return the drives of a ball joint, keyed by the index of the coordinate. Invalid drives are reported and omitted."""
    scope, specs, path, name = item.scope, item.spec.drive, (*item.path, "drive"), item.name
    if specs is None:
        return {}
    if not isinstance(specs, list) or len(specs) > 3:
        scope.error(
            Code.DRIVE, f"joint `{name}` is a ball joint and requires a list of one to three drives", path, key=True,
            help="write, for example, `[{axis: [1, 0, 0], kind: motor, effort: 2 N*m}]`",
        )
        return {}
    drives: dict[int, Drive] = {}
    for number, spec in enumerate(specs):
        if not isinstance(spec, DriveSpec) or spec.axis is None:
            scope.error(
                Code.DRIVE, f"drive {number} of ball joint `{name}` requires an `axis`", (*path, number),
                help="write, for example, `{axis: [1, 0, 0], kind: motor, effort: 2 N*m}`",
            )
            continue
        axis_path = (*path, number, "axis")
        drive = drive_of(table, scope, f"joint `{name}[{number}]`", ANGLE, LayeredValue(spec, axis_path[:-1]))
        if spec.armature is not None:
            scope.error(
                Code.DRIVE, f"drive {number} of ball joint `{name}` cannot have an `armature`",
                (*axis_path[:-1], "armature"), key=True, help="set `armature` under `dynamics` of the joint",
            )
        axis = scope.direction(spec.axis, axis_path, f"the axis of drive {number} of joint `{name}`", Code.DRIVE)
        if axis is not None and drive is not None:
            drives[number] = replace(drive, axis=axis)
    return drives


def _resolve_joint(
    table: DocumentScope, item: Unrolled[JointSpec], kind: JointKind, twist: Twist | None, mounts: tuple[Reference, Reference],
    layers: DefaultLayers, number: int | None,
) -> Joint:
    """Resolve a joint with one coordinate, or the coordinate `number` of a joint with several coordinates."""
    scope, spec, path, name = item.scope, item.spec, item.path, CoordinateName(item.name)
    if number is not None:
        name = name.with_number(number)
        item = replace(item, name=name)
    limit, passive, drive, offset = NO_LIMIT, NO_DYNAMICS, None, None
    nodes = _nodes_of(table, layers, number)
    if kind.at_once:
        pass  # read the values of a ball joint once for all coordinates
    elif twist is None:
        for key in ("limit", "dynamics", "offset", "drive"):
            if key in spec.model_fields_set and getattr(spec, key) is not None:
                text = f"is {spec.type} and cannot have `{key}`"
                code = Code.DRIVE if key == "drive" else Code.JOINT_FIELD
                _refuse(item, key, text, "remove the key, or choose another `type`", code=code)
    else:
        limit = _limit(scope, item, kind, twist.coordinate, layers.sub("limit", number))
        passive = dynamics(scope, f"joint `{name}`", twist.coordinate, layers.sub("dynamics", number))
        drive = drive_of(table, scope, f"joint `{name}`", twist.coordinate, layers.pick("drive", number))
        _no_axis(scope, name, kind, layers.pick("drive", number))
        offset_setting = layers.pick("offset", number)
        if not isinstance(offset_setting.value, (list, dict)):
            offset = scope.number(*offset_setting, twist.coordinate, f"`offset` of joint `{name}`")
    return Joint(
        name=name, kind=kind, twist=twist, parent=mounts[0], child=mounts[1], limit=limit, dynamics=passive, offset=offset or 0.0,
        turn=scope.number(*layers.pick("turn"), ANGLE, f"`turn` of joint `{name}`") or 0.0,
        gap=scope.number(*layers.pick("gap"), LENGTH, f"`gap` of joint `{name}`") or 0.0, drive=drive, mimic=None,
        origin=scope.origin(path, key=True), loop=spec.loop, keep=spec.keep, spans={key: node.span for key, node in nodes.items()},
        written={key: node.text for key, node in nodes.items() if isinstance(node, ScalarNode)},
    )


def _nodes_of(table: DocumentScope, layers: DefaultLayers, number: int | None) -> dict[str, Node]:
    """Return the nodes of the values of a joint or coordinate, keyed by path (`limit.lower`).

    If the joint does not specify a value, the node of the default value is returned.
    """
    nodes: dict[str, Node] = {}
    for _, base in reversed(layers.items):
        _collect(node_at(table.document.tree, base), "", nodes, number)
    return nodes


def _collect(node: Node | None, prefix: str, nodes: dict[str, Node], number: int | None) -> None:
    if isinstance(node, MappingNode):
        for key, child in node.entries.items():
            selected: Node | None = child
            if number is not None and isinstance(child, SequenceNode) and key != "axis":
                selected = child.items[number] if number < len(child.items) else None
            elif number is not None and isinstance(child, MappingNode) and all(index.isdigit() for index in child.entries):
                selected = child.entries.get(str(number))
            if selected is not None:
                nodes[prefix + key] = selected
                _collect(selected, f"{prefix}{key}.", nodes, number)


def _no_axis(scope: Scope, name: str, kind: JointKind, setting: LayeredValue) -> None:
    """Report an error for a drive with an axis if its joint is not a ball joint."""
    if setting.own and isinstance(setting.value, DriveSpec) and setting.value.axis is not None:
        scope.error(
            Code.JOINT_FIELD, f"the drive of joint `{name}` cannot have an `axis`", (*setting.path, "axis"), key=True,
            help="remove `axis`",
        )


def _axis(item: Unrolled[JointSpec], kind: JointKind) -> Vector | None:
    """Return the joint axis as a unit vector. Return None if the document does not specify an axis, or if the axis is invalid.

    An invalid axis is reported. If the document does not specify an axis, the joint moves about the z axis of its parent mount.
    """
    if item.spec.axis is None:
        return None
    if not kind.axial:
        _refuse(item, "axis", f"is {kind.words} and cannot have an `axis`", "remove `axis`")
        return None
    axis = item.scope.direction(item.spec.axis, (*item.path, "axis"), f"the axis of joint `{item.name}`", Code.OUT_OF_RANGE)
    return next((unit for unit in IDENTITY if unit == axis), axis)  # `Twist` detects exact vectors


def _lead(item: Unrolled[JointSpec], kind: JointKind) -> float | None:
    """Return the lead of a screw joint, which is its advance per turn [m].

    Return None for other joints. If the lead is invalid, report an error and return None.
    """
    scope, path, name = item.scope, item.path, item.name
    if item.spec.lead is None:
        if kind.leads and not scope.doubts.touch(path):
            scope.error(
                Code.LEAD, f"joint `{name}` is a {kind.name} and requires a `lead`", path, key=True,
                help="write the advance per turn, for example `lead: 8 mm`",
            )
        return None
    if not kind.leads:
        _refuse(item, "lead", f"is {kind.words} and cannot have a `lead`", "remove `lead`, or use `type: screw`")
        return None
    lead = scope.number(item.spec.lead, (*path, "lead"), LENGTH, f"`lead` of joint `{name}`")
    if lead == 0.0:
        scope.error(
            Code.LEAD, f"the `lead` of joint `{name}` must not be 0", (*path, "lead"),
            help="write the advance per turn, or use `type: revolute` or `continuous`",
        )
    return lead or None


def _limit(scope: Scope, item: Unrolled[JointSpec], kind: JointKind, coordinate: Dimension, layers: DefaultLayers) -> Limit:
    name, path = item.name, item.path
    ends = {key: _setting(scope, layers, key, coordinate) for key in ("lower", "upper")}
    low = high = None
    cone = layers.pick("cone")
    if cone.own:
        help = "use `lower` and `upper`"
        _refuse(item, cone.path, f"is {kind.words} and cannot have a `limit.cone`", help, code=Code.LIMIT, typed=False)
    if not kind.may_stop:
        unsupported = {f"`limit.{key}`": setting for key, setting in ends.items() if setting.own}
        for first in [*unsupported.values()][:1]:
            text = f"is {kind.words} and cannot have {' or '.join(unsupported)}"
            _refuse(item, first.path, text, "use `type: revolute` for a joint with limits", code=Code.LIMIT)
    else:
        low, high = (
            scope.number(*setting, coordinate, f"`limit.{key}` of joint `{name}`", notes=[] if not setting else scope.second_note(
                f"the type of `{name}` is set here", (*path, "type"), setting.path)) for key, setting in ends.items()
        )
        missing = [f"`limit.{key}`" for key, setting in ends.items() if not setting]
        in_doubt = scope.doubts.touch(path) or scope.doubts.touch(("defaults", "joint"))
        if missing and kind.limits == "required" and item.spec.mimic is None and not in_doubt:
            help = "write, for example, `limit: {lower: 0, upper: 20 mm}`"
            if coordinate == ANGLE:
                help = "write, for example, `limit: {lower: -90 deg, upper: 90 deg}`, or use `type: continuous`"
            place = (*path, "limit") if item.spec.limit is not None else path
            scope.error(Code.LIMIT, f"joint `{name}` is {kind.words} and requires {' and '.join(missing)}", place, key=True, help=help)
        if low is not None and high is not None and not low < high:
            lower, upper = ends.values()
            texts = [scope.format_value(Quantity(q, coordinate), setting.path) for q, setting in ((low, lower), (high, upper))]
            scope.error(
                Code.LIMIT, f"expected lower < upper in the limits of joint `{name}`, found {' and '.join(texts)}", lower.path,
                help="swap the limits" if low > high else "widen the limits, or use `type: fixed`",
                notes=scope.second_note("the upper limit is set here", upper.path, lower.path),
            )
            low = high = None
    return Limit(lower=low, upper=high, **values(scope, f"joint `{name}`", coordinate, "limit", layers, ("effort", "velocity")))


def _cone(item: Unrolled[JointSpec], layers: DefaultLayers) -> Limit:
    """Return the limit of a ball joint. Its `cone` is the largest rotation angle [rad] from q = 0, or None without a limit."""
    unsupported = [key for key in ("lower", "upper", "effort", "velocity") if layers.pick(key).own]
    if unsupported:
        text, path = f"is a ball joint and cannot have `limit.{unsupported[0]}`", layers.pick(unsupported[0]).path
        help = "set `limit.cone` for the angle, and limits of effort and velocity in the drives"
        _refuse(item, path, text, help, code=Code.LIMIT, typed=False)
    return Limit(cone=item.scope.number(*layers.pick("cone"), ANGLE, f"`limit.cone` of joint `{item.name}`", above=0.0))


def dynamics(scope: Scope, owner: str, coordinate: Dimension, layers: DefaultLayers, *, least: float | None = None) -> Dynamics:
    """Return the passive dynamics of `owner`, a joint or tendon. `least` is the smallest valid rest position of its spring."""
    if not layers:
        return NO_DYNAMICS
    rest = _setting(scope, layers, "rest", coordinate)
    if rest.own and not layers.pick("stiffness") and not scope.doubts.touch(rest.path[:-1]):
        scope.error(
            Code.JOINT_FIELD, f"`dynamics.rest` of {owner} requires `stiffness`",
            rest.path, key=True, help="add `stiffness`, or remove `rest`",
        )
    return Dynamics(
        **values(scope, owner, coordinate, "dynamics", layers, [key for key in Dynamics.__struct_fields__ if key != "rest"]),
        rest=scope.number(*rest, coordinate, f"`dynamics.rest` of {owner}", least=least),
    )


def drive_of(table: DocumentScope, scope: Scope, owner: str, coordinate: Dimension, setting: LayeredValue) -> Drive | None:
    """Resolve a drive of a joint or transmission `owner`. Return None without a drive, and for an invalid drive, which is reported.

    `coordinate` is the physical dimension of the coordinate along which the drive acts. `setting` contains the drive and its path.
    """
    if not setting or isinstance(setting.value, (list, dict)):
        return None
    spec, path = setting
    key = "actuator" if path[0] == "transmissions" else "drive"
    if isinstance(spec, DriveSpec):
        if path[0] == "defaults" and any(
            _of_others(scope, raw, (*path, key), key, coordinate) for key in ("kp", "kv") if (raw := getattr(spec, key)) is not None
        ):
            return None  # a drive with gains for rotations cannot move a slide
        reference = None if spec.component is None else _driving_part(table, scope, owner, spec.component, (*path, "component"))
        if spec.component is not None and reference is None:
            return None
        fields = drive_values(scope, owner, coordinate, key, spec, path)
        if spec.kp is not None and fields["kp"] is None:
            fields["kp"] = 1.0  # placeholder, so that no later pass reports the value as missing
        return Drive(component=reference, kind=spec.kind, origin=scope.origin(path), **fields)
    is_component = spec in table.nodes or table.unbuilt or table.doubts.lacks("components") or table.doubts.touch(("components", spec))
    if not is_component and (spec in DRIVE_KINDS or spec == "servo"):
        kind = spec if spec in DRIVE_KINDS else "position"
        gain = f", kp: {'20 N*m/rad' if coordinate == ANGLE else '200 N/m'}" if kind == "position" else ""
        scope.error(
            Code.DRIVE, f"expected a component or a mapping in `{key}`, found `{spec}`", path,
            help=f"write `{{kind: {kind}{gain}}}`",
        )
        return None
    reference = _driving_part(table, scope, owner, spec, path)
    return None if reference is None else Drive(component=reference, origin=scope.origin(path))


def drive_values(
    scope: Scope, owner: str, coordinate: Dimension, section: str, spec: DriveSpec, path: Path, keys: Iterable[str] = DRIVE_VALUES,
) -> dict[str, Any]:
    """Return the values of a drive [SI] and their `spans`, keyed by the names of the fields of `Drive`.

    Missing and invalid values are None. Invalid values are reported.
    """
    dimensions, layers = dimensions_of(coordinate), DefaultLayers(((spec, path),))
    command = coordinate if spec.kind == "position" else dimensions["velocity" if spec.kind == "velocity" else "effort"]
    settings = {key: _setting(scope, layers, key, coordinate) for key in keys}
    return {
        **{
            key: scope.number(*raw, dimensions.get(key, command), f"`{section}.{key}` of {owner}", **DRIVE_VALUES[key])
            for key, raw in settings.items()
        },
        "spans": {key: scope.span(setting.path) for key, setting in settings.items() if setting},
    }


def _driving_part(table: DocumentScope, scope: Scope, owner: str, text: str, path: Path) -> Reference | None:
    """Resolve the reference to the part whose actuator drives `owner`.

    If the reference does not lead to a part, report an error and return None.
    """
    component = references.component(table, scope, text, path)
    if component is None:
        return None
    reference, node = component
    if node.bare is not None or node.spec.assembly is not None:
        kind = f"a {node.bare}" if node.bare is not None else "an assembly"
        scope.error(
            Code.DRIVE, f"`{reference.text}` is {kind} and cannot drive {owner}", path,
            help=f"use a part inside the assembly, for example `{reference.text}.servo`" if node.spec.assembly is not None
            else "use a component whose part has an actuator",
            notes=references.declaration_note(node),
        )
        return None
    if node.definition is not None and not isinstance(node.definition, PartDefinition):
        return None
    return reference
