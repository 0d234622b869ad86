"""Resolve the joints of a document: type, parent and child mount, limits, dynamics and drives.

Mimics are resolved by the module `mimics`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, get_args

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note
from thingc.base.joints.kinds import KINDS, JointKind
from thingc.base.joints.twist import SLIDE, TURN, Twist, dimensions_of
from thingc.base.numeric import hypot
from thingc.base.pose import IDENTITY, Vector
from thingc.base.source import Path, ScalarNode
from thingc.base.units import ANGLE, LENGTH, NUMBER, Dimension, Quantity
from thingc.documents.spec.assembly import JointSpec
from thingc.documents.spec.drives import DriveKind, DriveSpec
from thingc.geometry.record import PartDefinition
from thingc.model.resolve import references
from thingc.model.resolve.coordinates import CoordinateName, Dynamics, Limit
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.joint_nodes import nodes_of
from thingc.model.resolve.placement import Places
from thingc.model.resolve.repeats import Unrolled
from thingc.model.resolve.scope import DefaultLayers, Scope
from thingc.model.resolve.types import Drive, Joint, Reference

_ENDLESS = "; use `type: continuous` for a joint without limits"

DRIVE_KINDS: tuple[str, ...] = get_args(DriveKind)
"""The possible kinds of an inline drive."""

NO_LIMIT = Limit()
NO_DYNAMICS = Dynamics()


def _said(scope: Scope, layers: DefaultLayers, key: str, coordinate: Dimension) -> tuple[Any, Path] | None:
    """Return the value that a document specifies for a setting of a joint.

    A default value for rotations is not used for translations, and vice versa.
    """
    said = layers.pick(key)
    if said is not None and said[1][0] == "defaults":
        return None if _of_others(scope, *said, key, coordinate) else said
    return said


def _of_others(scope: Scope, raw: Any, path: Path, key: str, coordinate: Dimension) -> bool:
    """Return whether a value has a unit of rotation although the joint translates, or a unit of translation although the joint rotates."""
    own, other = (TURN, SLIDE) if coordinate == ANGLE else (SLIDE, TURN)
    value = scope.value(raw, path)
    return isinstance(value, Quantity) and not value.fits(own[key]) and value.fits(other[key])


def _values(
    scope: Scope, owner: str, coordinate: Dimension, section: str, layers: DefaultLayers, keys: tuple[str, ...],
) -> dict[str, float | None]:
    """Return the values of settings of `owner`, such as a joint, that must not be negative, such as `damping`.

    Missing and invalid values are None. Invalid values are reported.
    """
    of = dimensions_of(coordinate)
    values: dict[str, float | None] = {}
    for key in keys:
        said = _said(scope, layers, key, coordinate)
        values[key] = scope.number(*said, of[key], f"`{section}.{key}` of {owner}", least=0.0) if said else None
    return values


def joints(table: DocumentScope, items: Iterable[Unrolled[JointSpec]], places: Places) -> bool:
    """Resolve the joints of a document, except for their mimics, and store them in `table.joints`.

    For each joint, `places` records the component that the joint places.

    If the type or a reference of a joint is invalid, None is stored for the joint, and its child component remains unplaced. Return whether
    the reference to the child of any joint could not be read.
    """
    defaults = table.spec.defaults.joint if table.spec.defaults is not None else None
    below = ((defaults, ("defaults", "joint")),) if defaults is not None else ()
    unsure = False
    for item in items:
        spec, scope, path = item.spec, item.scope, item.path
        layers = DefaultLayers(((spec, path), *below))
        doubtful = bool(table.doubts) and (table.doubts.touch(path) or table.doubts.touch(("defaults", "joint")))
        child = references.mount(table, scope, spec.child, (*path, "child"))
        parent = references.mount(table, scope, spec.parent, (*path, "parent"))
        kind = KINDS[spec.type]
        placed = None if spec.loop else child.path[0] if child is not None else _named(table, scope, spec.child)
        if doubtful and table.doubts.touch((*path, "loop")):
            placed, unsure = None, True
        elif placed is None:
            unsure = unsure or not spec.loop
        else:
            places.setdefault(placed, []).append((f"joint `{item.name}`", scope.span(path, key=True)))
        if parent is None or child is None:
            table.loose.extend(end for end in (parent, child) if end is not None)
            table.joints[CoordinateName(item.name)] = None
            if placed is not None:
                table.nodes[placed].unplaced = True
            continue
        coordinates = _coordinates(table, item, kind, parent, child, layers)
        table.joints.update((joint.name, joint) for joint in coordinates)
        if doubtful:
            for joint in coordinates:
                del table.joints[joint.name]
            table.joints[CoordinateName(item.name)] = None
            if placed is not None:
                table.nodes[placed].unplaced = True
    lost = bool(table.doubts) and (table.doubts.lacks("joints") or any(True for _ in table.doubts.names("joints")))
    return unsure or lost or any(table.doubts.touch(("joints", name, "repeat")) for name in table.spec.joints)


def _named(table: DocumentScope, scope: Scope, text: str) -> str | None:
    """Return the name of the component at the beginning of an invalid reference, or None if this component does not exist."""
    first = text.split(".")[0]
    if scope.index is not None:
        first = first.replace("${" + scope.index[0] + "}", scope.index[1]).replace("$" + scope.index[0], scope.index[1])
    return first if first in table.nodes else None


def _coordinates(
    table: DocumentScope, item: Unrolled[JointSpec], kind: JointKind, parent: Reference, child: Reference, layers: DefaultLayers,
) -> tuple[Joint, ...]:
    """Resolve a joint and return a tuple with one element per coordinate of the joint."""
    scope, path, count = item.scope, item.path, len(kind.twists)
    lead = _lead(scope, item.spec, kind, item.name, path)
    axis = _axis(scope, item.spec, kind, item.name, path)
    twists = kind.about(axis, lead or 0.0) if axis is not None else kind.twists if lead is None else kind.with_lead(lead)
    if item.spec.reverse and kind.axial:
        twists = tuple(twist.reversed() for twist in twists)
    elif item.spec.reverse:
        message = f"joint `{item.name}` is {kind.name} and cannot have `reverse`"
        scope.error(Code.JOINT_FIELD, message, (*path, "reverse"), key=True, help="remove `reverse`")
    if item.spec.keep and (kind.moves or item.spec.loop):
        why = f"is {kind.name}" if kind.moves else "closes a loop"
        message = f"joint `{item.name}` {why} and cannot have `keep`: its sides are always separate links"
        scope.error(Code.JOINT_FIELD, message, (*path, "keep"), key=True, help="remove `keep`")
    if kind.free:
        return _free(table, item, kind, (parent, child), layers)
    if kind.at_once:
        return _ball(table, item, kind, (parent, child), layers)
    for key in ("limit", "dynamics", "drive", "offset", "mimic"):
        said = getattr(item.spec, key)
        several = isinstance(said, (list, dict))
        numbers = [] if not several else [int(one) for one in said] if isinstance(said, dict) else list(range(len(said)))
        if said is None or key not in item.spec.model_fields_set or (several == (count > 1) and all(n < count for n in numbers)):
            continue
        if count > 1:
            words = f"joint `{item.name}` is {kind.name} and has {count} coordinates: `{key}` must be a list of {count} items"
            help = "write, for example, `[" + ", ".join("..." for _ in range(count)) + "]`, or `{0: ...}` to set only some coordinates"
        else:
            words, help = f"joint `{item.name}` is {kind.name}: `{key}` must not be a list", "write the value without a list"
        scope.error(
            Code.COORDINATES, words, (*path, key), key=True, help=help,
            notes=scope.beside("the type of the joint is set here", (*path, "type"), (*path, key)),
        )
    each: Sequence[tuple[int | None, Twist | None]] = [*enumerate(twists)] if count > 1 else [(None, next(iter(twists), None))]
    own = (_resolve_joint(table, item, kind, twist, (parent, child), layers, number) for number, twist in each)
    return tuple(replace(joint, axis=axis, reverse=item.spec.reverse) for joint in own)


def _free(
    table: DocumentScope, item: Unrolled[JointSpec], kind: JointKind, mounts: tuple[Reference, Reference], layers: DefaultLayers,
) -> tuple[Joint, ...]:
    """Resolve the coordinates of a free joint, which has no limits, dynamics and drives."""
    for key in ("limit", "dynamics", "drive", "offset", "loop"):
        if getattr(item.spec, key):
            item.scope.error(
                Code.JOINT_FIELD, f"joint `{item.name}` is free and cannot have `{key}`", (*item.path, key), key=True,
                help=f"remove `{key}`: a free joint does not constrain its child", notes=item.scope.beside(
                    "the type of the joint is set here", (*item.path, "type"), (*item.path, key)),
            )
    one = _resolve_joint(table, item, kind, None, mounts, layers, None)
    return tuple(replace(one, name=CoordinateName(item.name).numbered(k), twist=twist) for k, twist in enumerate(kind.twists))


def _ball(
    table: DocumentScope, item: Unrolled[JointSpec], kind: JointKind, mounts: tuple[Reference, Reference], layers: DefaultLayers,
) -> tuple[Joint, ...]:
    """Resolve the coordinates of a ball joint.

    The limit and the dynamics apply to all coordinates. A ball joint can have up to three drives. Each drive acts about its own axis and is
    stored with one of the coordinates.
    """
    scope, spec, path, name = item.scope, item.spec, item.path, item.name
    for key in ("limit", "dynamics"):
        if isinstance(getattr(spec, key), (list, dict)):
            scope.error(
                Code.COORDINATES, f"joint `{name}` is a ball: `{key}` must be a single value for all axes, not a list", (*path, key),
                key=True, help="write the value without a list",
            )
    if spec.offset is not None:
        scope.error(
            Code.JOINT_FIELD, f"joint `{name}` is a ball and cannot have an `offset`", (*path, "offset"), key=True,
            help="rotate a mount of the joint, or use `turn`",
        )
    one = _resolve_joint(table, item, kind, None, mounts, layers, None)
    limit, dynamics = _cone(scope, name, layers.sub("limit")), _dynamics(scope, name, ANGLE, layers.sub("dynamics"))
    rest = layers.sub("dynamics").pick("rest")
    if rest is not None and rest[1][0] == "joints":
        scope.error(
            Code.JOINT_FIELD, f"joint `{name}` is a ball: its `dynamics` cannot have a `rest`", rest[1], key=True,
            help="rotate a mount of the joint instead: the spring rests at q = 0",
        )
    drives = _drives_of_ball(table, item)
    return tuple(
        replace(one, name=CoordinateName(name).numbered(k), twist=twist, limit=limit, dynamics=replace(dynamics, rest=None),
                drive=drives.get(k))
        for k, twist in enumerate(kind.twists)
    )


def _drives_of_ball(table: DocumentScope, item: Unrolled[JointSpec]) -> dict[int, Drive]:
    """Return the drives of a ball joint, keyed by the index of the coordinate. Invalid drives are reported and omitted."""
    scope, written, path, name = item.scope, item.spec.drive, (*item.path, "drive"), item.name
    if written is None:
        return {}
    if not isinstance(written, list) or len(written) > 3:
        scope.error(
            Code.DRIVE, f"joint `{name}` is a ball: its `drive` must be a list of one to three drives, each with its own axis", path,
            key=True, help="write, for example, `[{axis: [1, 0, 0], kind: motor, effort: 2 N*m}]`",
        )
        return {}
    drives: dict[int, Drive] = {}
    for number, spec in enumerate(written):
        if not isinstance(spec, DriveSpec) or spec.axis is None:
            scope.error(
                Code.DRIVE, f"drive {number} of ball joint `{name}` needs an `axis`" if isinstance(spec, DriveSpec)
                else f"drive {number} of ball joint `{name}` is a component, which has no `axis`: it must be written inline",
                (*path, number),
                help=(
                    "write, for example, `{axis: [1, 0, 0], kind: motor, effort: 2 N*m}`; the axis is in the frame of the parent mount "
                    "at q = 0"
                ),
            )
            continue
        place = (*path, number, "axis")
        drive = drive_of(table, scope, f"joint `{name}[{number}]`", ANGLE, (spec, place[:-1]))
        if spec.armature is not None:
            scope.error(
                Code.DRIVE, f"drive {number} of ball joint `{name}` has an `armature`: a ball has one `armature` for all axes",
                (*place[:-1], "armature"), key=True, help="set it under `dynamics` of the joint",
            )
        axis = _direction(scope, spec.axis, place, f"the axis of drive {number} of joint `{name}`", Code.DRIVE)
        if axis is not None and drive is not None:
            drives[number] = replace(drive, axis=axis)
    return drives


def _direction(scope: Scope, written: Sequence[Any], place: Path, what: str, code: Code) -> Vector | None:
    """Normalize a vector from the document, such as an axis, to length 1.

    If the vector is invalid or zero, report an error and return None. `code` is the diagnostic code for a zero vector.
    """
    axis = scope.vector(written, place, NUMBER, what)
    size = 0.0 if axis is None else hypot(*axis)
    if axis is None or size > 0.0:
        return None if axis is None else (axis[0] / size, axis[1] / size, axis[2] / size)
    scope.error(code, f"{what} has length 0 and thus no direction", place, help="write, for example, `[1, 0, 0]`")
    return None


def _resolve_joint(
    table: DocumentScope, item: Unrolled[JointSpec], kind: JointKind, twist: Twist | None, mounts: tuple[Reference, Reference],
    layers: DefaultLayers, number: int | None,
) -> Joint:
    """Resolve a joint with one coordinate, or the coordinate `number` of a joint with several coordinates."""
    scope, spec, path, name = item.scope, item.spec, item.path, CoordinateName(item.name)
    if number is not None:
        name = name.numbered(number)
        item = replace(item, name=name)
    turn, gap = layers.pick("turn"), layers.pick("gap")
    offset = 0.0
    limit, dynamics, drive = NO_LIMIT, NO_DYNAMICS, None
    nodes = nodes_of(table, layers, number)
    if kind.at_once:
        pass  # read the values of a ball joint once for all coordinates
    elif twist is None:
        for key in ("limit", "dynamics", "offset", "drive"):
            if key in spec.model_fields_set and getattr(spec, key) is not None:
                code = Code.DRIVE if key == "drive" else Code.JOINT_FIELD
                scope.error(code, f"joint `{name}` is {spec.type} and does not move: it cannot have `{key}`", (*path, key), key=True,
                            help="remove the key, or choose another `type`",
                            notes=scope.beside("the type of the joint is set here", (*path, "type"), (*path, key)))
    else:
        limit = _limit(scope, item, kind, twist.coordinate, layers.sub("limit", number))
        dynamics = _dynamics(scope, name, twist.coordinate, layers.sub("dynamics", number))
        drive = drive_of(table, scope, f"joint `{name}`", twist.coordinate, layers.pick("drive", number))
        _no_axis(scope, name, kind, layers.pick("drive", number))
        said = layers.pick("offset", number)
        if said is not None and not isinstance(said[0], (list, dict)):
            offset = scope.number(*said, twist.coordinate, f"`offset` of joint `{name}`") or 0.0
    return Joint(
        name=name, kind=kind, twist=twist, parent=mounts[0], child=mounts[1], limit=limit, dynamics=dynamics,
        turn=(scope.number(*turn, ANGLE, f"`turn` of joint `{name}`") or 0.0) if turn else 0.0,
        gap=(scope.number(*gap, LENGTH, f"`gap` of joint `{name}`") or 0.0) if gap else 0.0, offset=offset, drive=drive, mimic=None,
        origin=scope.origin(path, key=True), loop=spec.loop, keep=spec.keep, spans={key: node.span for key, node in nodes.items()},
        written={key: node.text for key, node in nodes.items() if isinstance(node, ScalarNode)},
    )


def _no_axis(scope: Scope, name: str, kind: JointKind, said: tuple[Any, Path] | None) -> None:
    """Report an error for a drive with an axis if its joint is not a ball joint."""
    if said is not None and isinstance(said[0], DriveSpec) and said[0].axis is not None and said[1][0] == "joints":
        scope.error(
            Code.JOINT_FIELD, f"joint `{name}` is {kind.name}: its drive cannot have an `axis`", (*said[1], "axis"), key=True,
            help="remove `axis`: the drive acts along the coordinate of the joint",
        )


def _axis(scope: Scope, spec: JointSpec, kind: JointKind, name: str, path: Path) -> Vector | None:
    """Return the joint axis as a unit vector. Return None if the document does not specify an axis, or if the axis is invalid.

    An invalid axis is reported. If the document does not specify an axis, the joint moves about the z axis of its parent mount.
    """
    if spec.axis is None:
        return None
    place = (*path, "axis")
    if not kind.axial:
        scope.error(
            Code.JOINT_FIELD, f"joint `{name}` is {kind.name} and cannot have an `axis`", place, key=True,
            help="remove `axis`: the joint uses the axes of the parent mount" if kind.moves else "remove `axis`: the joint does not move",
            notes=scope.beside("the type of the joint is set here", (*path, "type"), place),
        )
        return None
    axis = _direction(scope, spec.axis, place, f"the axis of joint `{name}`", Code.OUT_OF_RANGE)
    return next((one for one in IDENTITY if one == axis), axis)  # `Twist` detects exact vectors


def _lead(scope: Scope, spec: JointSpec, kind: JointKind, name: str, path: Path) -> float | None:
    """Return the lead of a screw joint, which is its advance per turn [m].

    Return None for other joints. If the lead is invalid, report an error and return None.
    """
    if spec.lead is None:
        if kind.leads and not scope.doubts.touch(path):
            scope.error(
                Code.LEAD, f"joint `{name}` is a {kind.name} and needs a `lead`, the advance per turn", path, key=True,
                help="write, for example, `lead: 8 mm`; use a negative value for a left-hand thread",
            )
        return None
    if not kind.leads:
        scope.error(
            Code.JOINT_FIELD, f"joint `{name}` is {kind.name} and cannot have a `lead`", (*path, "lead"), key=True,
            help="remove `lead`, or use `type: screw`",
            notes=scope.beside("the type of the joint is set here", (*path, "type"), (*path, "lead")),
        )
        return None
    lead = scope.number(spec.lead, (*path, "lead"), LENGTH, f"`lead` of joint `{name}`")
    if lead == 0.0:
        scope.error(
            Code.LEAD, f"the `lead` of joint `{name}` is 0: the joint would not advance", (*path, "lead"),
            help="write the advance per turn, or use `type: revolute` or `continuous`",
        )
        return None
    return lead


def _limit(scope: Scope, item: Unrolled[JointSpec], kind: JointKind, coordinate: Dimension, layers: DefaultLayers) -> Limit:
    name, path = item.name, item.path
    lower, upper = (_said(scope, layers, key, coordinate) for key in ("lower", "upper"))
    low = high = None
    cone = layers.pick("cone")
    if cone is not None and cone[1][0] == "joints":
        scope.error(
            Code.LIMIT, f"joint `{name}` is {kind.name} and cannot have a `limit.cone`", cone[1], key=True,
            help="only a `ball` has a cone; use `lower` and `upper`",
        )
    if not kind.may_stop:
        own = [(key, said[1]) for key, said in (("lower", lower), ("upper", upper)) if said is not None and said[1][0] == "joints"]
        if own:
            named = " or ".join(f"`limit.{key}`" for key, _ in own)
            scope.error(
                Code.LIMIT, f"joint `{name}` is {kind.name} and cannot have {named}", own[0][1], key=True,
                help="use `type: revolute` for a joint with limits",
                notes=scope.beside("the type of the joint is set here", (*path, "type"), own[0][1]),
            )
    else:
        low = scope.number(*lower, coordinate, f"`limit.lower` of joint `{name}`", notes=_type(scope, item, lower)) if lower else None
        high = scope.number(*upper, coordinate, f"`limit.upper` of joint `{name}`", notes=_type(scope, item, upper)) if upper else None
        missing = [f"`limit.{key}`" for key, said in (("lower", lower), ("upper", upper)) if said is None]
        in_doubt = scope.doubts.touch(path) or scope.doubts.touch(("defaults", "joint"))
        if missing and kind.limits == "required" and item.spec.mimic is None and not in_doubt:
            example = "{lower: -90 deg, upper: 90 deg}" if coordinate == ANGLE else "{lower: 0, upper: 20 mm}"
            scope.error(
                Code.LIMIT, f"joint `{name}` is {kind.name} and needs {' and '.join(missing)}",
                (*path, "limit") if item.spec.limit is not None else path, key=True,
                help=f"write, for example, `limit: {example}`" + (_ENDLESS if coordinate == ANGLE else ""),
            )
        if low is not None and high is not None and lower is not None and upper is not None and not low < high:
            fault = "are reversed" if low > high else "are equal"
            shown = [scope.shown(Quantity(q, coordinate), said[1]) for q, said in ((low, lower), (high, upper))]
            scope.error(
                Code.LIMIT, f"limits of joint `{name}` {fault}: expected lower < upper, "
                f"found {(', and ' if any(',' in one for one in shown) else ' and ').join(shown)}",
                lower[1], help="swap the limits" if low > high else "widen the limits, or use `type: fixed`",
                notes=scope.beside("the upper limit is set here", upper[1], lower[1]),
            )
            low = high = None
    return Limit(lower=low, upper=high, **_values(scope, f"joint `{name}`", coordinate, "limit", layers, ("effort", "velocity")))


def _cone(scope: Scope, name: str, layers: DefaultLayers) -> Limit:
    """Return the cone limit of a ball joint, which is its largest rotation angle [rad] from q = 0. Return None if there is no limit."""
    own = [(key, said[1]) for key in ("lower", "upper", "effort", "velocity") if (said := layers.pick(key)) and said[1][0] == "joints"]
    if own:
        scope.error(
            Code.LIMIT, f"joint `{name}` is a ball and cannot have `limit.{own[0][0]}`", own[0][1], key=True,
            help="limit its angle by `cone`, and effort and velocity in its drives",
        )
    said = layers.pick("cone")
    return Limit(cone=None if said is None else scope.number(*said, ANGLE, f"`limit.cone` of joint `{name}`", above=0.0))


def _type(scope: Scope, item: Unrolled[JointSpec], said: tuple[Any, Path]) -> list[Note]:
    """Return a note that explains which physical dimension a value of the joint must have, and why."""
    return scope.beside(f"the type of `{item.name}` is set here", (*item.path, "type"), said[1])


def _dynamics(scope: Scope, name: str, coordinate: Dimension, layers: DefaultLayers) -> Dynamics:
    if not layers:
        return NO_DYNAMICS
    keys = ("damping", "friction", "armature", "stiffness")
    said, rest = _said(scope, layers, "rest", coordinate), None
    if said is not None:
        rest = scope.number(*said, coordinate, f"`dynamics.rest` of joint `{name}`")
        if said[1][0] == "joints" and layers.pick("stiffness") is None and not scope.doubts.touch(said[1][:-1]):
            scope.error(
                Code.JOINT_FIELD, f"joint `{name}` has a `dynamics.rest` but no `stiffness`: `rest` is the rest position of a spring",
                said[1], key=True, help="add `stiffness`, or remove `rest`",
            )
    return Dynamics(**_values(scope, f"joint `{name}`", coordinate, "dynamics", layers, keys), rest=rest)


def drive_of(table: DocumentScope, scope: Scope, owner: str, coordinate: Dimension, said: tuple[Any, Path] | None) -> Drive | None:
    """Resolve a drive of a joint or transmission `owner`. Return None without a drive, and for an invalid drive, which is reported.

    `coordinate` is the physical dimension of the coordinate along which the drive acts. `said` contains the drive and its path.
    """
    if said is None or isinstance(said[0], (list, dict)):
        return None
    spec, path = said
    key = "actuator" if path[0] == "transmissions" else "drive"
    if isinstance(spec, DriveSpec):
        if path[0] == "defaults" and any(
            _of_others(scope, raw, (*path, key), key, coordinate) for key in ("kp", "kv") if (raw := getattr(spec, key)) is not None
        ):
            return None  # a drive with gains for rotations cannot move a slide
        reference = None if spec.component is None else _driving_part(table, scope, owner, spec.component, (*path, "component"))
        if spec.component is not None and reference is None:
            return None
        written = DefaultLayers(((spec, path),))
        values = _values(scope, owner, coordinate, key, written, ("kp", "kv", "effort", "velocity", "armature"))
        if spec.kp is not None and values["kp"] is None:
            values["kp"] = 1.0  # placeholder, so that no later pass reports the value as missing
        return Drive(
            component=reference, kind=spec.kind, kp=values["kp"], kv=values["kv"], effort=values["effort"], velocity=values["velocity"],
            armature=values["armature"], origin=scope.origin(path),
        )
    known = spec in table.nodes or table.unbuilt or table.doubts.lacks("components") or table.doubts.touch(("components", spec))
    if not known and (spec in DRIVE_KINDS or spec == "servo"):
        kind = spec if spec in DRIVE_KINDS else "position"
        gain = f", kp: {'20 N*m/rad' if coordinate == ANGLE else '200 N/m'}" if kind == "position" else ""
        scope.error(
            Code.DRIVE, f"`{key}` must be a component with an actuator or a mapping; `{spec}` is not a component", path,
            help=f"write `{{kind: {kind}{gain}}}`",
        )
        return None
    reference = _driving_part(table, scope, owner, spec, path)
    return None if reference is None else Drive(component=reference, origin=scope.origin(path))


def _driving_part(table: DocumentScope, scope: Scope, owner: str, text: str, path: Path) -> Reference | None:
    """Resolve the reference to the part whose actuator drives `owner`.

    If the reference does not lead to a part, report an error and return None.
    """
    component = references.component(table, scope, text, path)
    if component is None:
        return None
    reference, node = component
    if node.bare is not None or node.spec.assembly is not None:
        what = f"a {node.bare}" if node.bare is not None else "an assembly"
        scope.error(
            Code.DRIVE, f"{owner} must be driven by a part with an actuator; `{reference.text}` is {what}", path,
            help=f"use a part inside the assembly, for example `{reference.text}.servo`" if node.spec.assembly is not None
            else "use a component whose part has an actuator",
            notes=references.declared(node),
        )
        return None
    if node.definition is not None and not isinstance(node.definition, PartDefinition):
        return None
    return reference
