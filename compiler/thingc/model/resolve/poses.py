"""Resolve the named poses of a document: joint names, patterns that match joints, positions of joints, and poses of nested documents.

If several keys match a joint, an exact joint name takes precedence over a pattern, and a pattern takes precedence over a pose of a nested
document. If several keys of the same kind match, the last key takes precedence.
"""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import Any

from thingc.base.diagnostics import Code, make_notes
from thingc.base.grouping import group_by
from thingc.base.pose import Pose, Quaternion, turn_of
from thingc.base.source import Origin, Path
from thingc.base.units import LENGTH, NUMBER
from thingc.documents.spec.assembly import TurnSpec
from thingc.model.resolve import references
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.modes import ROOT
from thingc.model.resolve.references import GLOB, suggest
from thingc.model.resolve.scope import Scope, find_item
from thingc.model.resolve.types import Joint, NamedPose

Joints = dict[CoordinateName, Joint | None]
_EXAMPLE = {False: "{rpy: 0 20 0 deg}", True: "{xyz: 0 0 100 mm}"}
"""Example of a value in a pose, for ball joints and for free joints."""
Settings = dict[str, tuple[float, Origin]]
"""Joint coordinates q and their locations in the document, keyed by joint path (with `/`)."""


def poses(table: DocumentScope, scope: Scope) -> None:
    """Resolve the named poses of a document, and store them in `table.poses`. Invalid keys are reported and omitted."""
    if not table.spec.poses:
        return
    joints: Joints = dict(table.all_joints())
    for name, entries in table.spec.poses.items():
        path: Path = ("poses", name)
        nested, layers = {"": _start_poses(table)}, (Settings(), Settings())  # in this order: nested poses, patterns, exact names
        for key, raw in entries.items():
            at = (*path, key)
            coordinates = [joint for joint in joints if joint.number is not None and joint.joint == key]
            if coordinates or (key in joints and isinstance(raw, (list, dict, TurnSpec))):
                _set_coordinates(scope, joints, key, coordinates, raw, at, layers[1])
            elif key in joints:
                _set(scope, joints, [CoordinateName(key)], raw, at, layers[1], exact=True)
            elif isinstance(raw, str):
                _apply_nested_pose(table, scope, key, raw, at, nested)
            elif GLOB.search(key) and isinstance(raw, (list, dict, TurnSpec)):
                _set_matching_coordinates(scope, joints, key, raw, at, layers[0])
            elif GLOB.search(key):
                _set_matching(table, scope, joints, key, raw, at, layers[0])
            else:
                _report_unknown(table, scope, joints, key, at)
        merged: Settings = {joint: q for layer in (*nested.values(), *layers) for joint, q in layer.items()}
        has_errors = any(document == scope.document.relative and place[:2] == path for document, _, place, _ in scope.reported)
        if has_errors or scope.doubts.touch(path):
            merged = {**_placeholders(joints, scope.origin(path, key=True)), **merged}
        in_order = {joint.path: merged[joint.path] for joint in joints if joint.path in merged}
        table.poses[name] = NamedPose(
            name=name, values={joint: q for joint, (q, _) in in_order.items()},
            origins={joint: origin for joint, (_, origin) in in_order.items()}, origin=scope.origin(path, key=True),
        )


def _start_poses(table: DocumentScope) -> Settings:
    """Return the positions of joints in the start poses of the modes in which nested assemblies are placed."""
    starts: Settings = {}
    for component, inner, mode in table.all_modes():
        pose = None if mode.pose is None else inner.poses.get(mode.pose)
        if pose is not None:
            top = component.replace(".", "/")
            starts.update((f"{top}/{path}", (q, pose.origins[path])) for path, q in pose.values.items())
    return starts


def _set_coordinates(scope: Scope, joints: Joints, key: str, names: list[CoordinateName], raw: Any, path: Path, settings: Settings) -> None:
    """Set the coordinates of a joint with several coordinates.

    The value in the document is a list, or a mapping whose keys are indices of coordinates.
    """
    ball = joints[names[0]] if names else None
    if ball is not None and ball.kind.at_once:
        _set_ball(scope, key, names, ball, raw, path, settings)
        return
    if names and isinstance(raw, (list, dict)) and all(find_item(raw, k) is None for k in range(len(names), len(names) + len(raw))):
        for number, name in enumerate(names):
            item = find_item(raw, number)
            if item is not None:
                _set(scope, joints, [name], item[0], (*path, item[1]), settings, exact=True)
        return
    joint = joints[names[0] if names else CoordinateName(key)]
    if joint is None:
        return
    example = ", ".join("..." for _ in names)
    scope.error(
        Code.COORDINATES, f"the value of joint `{key}` must be a list of {len(names)} items" if names
        else f"the value of joint `{key}` must not be a list", path, key=True,
        help=f"write `[{example}]`, or set only `{names[0]}`" if names else "write one value", notes=joint.definition_note(key),
    )


def _set_ball(scope: Scope, key: str, names: list[CoordinateName], ball: Joint, raw: Any, path: Path, settings: Settings) -> None:
    """Set the coordinates of a ball joint or free joint. The value in the document is the motion of the child mount from q = 0."""
    free = ball.kind.free
    if not isinstance(raw, TurnSpec) or (raw.xyz is not None and not free):
        scope.error(
            Code.POSE, f"the value of joint `{key}` ({ball.kind.words}) must be {'`xyz`, ' if free else ''}`rpy` or `quat`", path,
            key=True, help=f"write, for example, `{key}: {_EXAMPLE[free]}`", notes=ball.definition_note(key),
        )
        return
    place = scope.vector(raw.xyz, (*path, "xyz"), LENGTH, f"`xyz` of joint `{key}`") if raw.xyz is not None else (0.0, 0.0, 0.0)
    if raw.rpy is None and raw.quat is None:
        quaternion: Quaternion | None = (1.0, 0.0, 0.0, 0.0)
    elif raw.rpy is not None:
        rotation = scope.rotation(raw, path)
        quaternion = None if rotation is None else Pose(rotation=rotation).quaternion()
    else:
        at, subject = (*path, "quat"), f"`quat` of joint `{key}`"
        w, x, y, z = (scope.number(one, (*at, number), NUMBER, subject) for number, one in enumerate(raw.quat or ()))
        quaternion = None if w is None or x is None or y is None or z is None else (w, x, y, z)
        if quaternion is not None and not any(quaternion):
            scope.error(Code.POSE, f"{subject} must not be zero", at, help="write `[w, x, y, z]`, for example `[1, 0, 0, 0]`")
            return
    if quaternion is not None and place is not None:
        values = (*(place if free else ()), *turn_of(quaternion))
        settings.update((name.path, (q, scope.origin(path))) for name, q in zip(names, values, strict=True))


def _placeholders(joints: Joints, origin: Origin) -> Settings:
    """Return a position within the limits for each joint whose limits exclude 0.

    The returned positions are placeholders for a pose with errors.

    Without placeholders, thingc would also report that 0 is outside the limits. Build outputs never contain the placeholders.
    """
    settings: Settings = {}
    for name, joint in joints.items():
        if joint is None or not joint.settable:
            continue
        if joint.limit.lower is not None and joint.limit.lower > 0.0:
            settings[name.path] = (joint.limit.lower, origin)
        elif joint.limit.upper is not None and joint.limit.upper < 0.0:
            settings[name.path] = (joint.limit.upper, origin)
    return settings


def _set(scope: Scope, joints: Joints, names: list[CoordinateName], raw: Any, path: Path, settings: Settings, *, exact: bool) -> None:
    for name in names:
        joint = joints[name]
        if joint is None:
            continue
        coordinate, notes, key = joint.twist.coordinate if joint.twist is not None else None, joint.definition_note(name), True
        help: str | None
        if joint.kind.at_once:
            message = f"a pose cannot set a single coordinate of joint `{name.joint}` ({joint.kind.words})"
            help = f"write, for example, `{name.joint}: {_EXAMPLE[joint.kind.free]}`"
            notes = joint.definition_note(name.joint)
        elif coordinate is None:
            message, help = f"a pose cannot set joint `{name}`, which is {joint.kind.words}", "remove the joint from the pose"
        elif joint.mimic is not None:
            message = f"a pose cannot set joint `{name}`, which mimics `{joint.mimic.joint}`"
            help = f"set `{name.rpartition('.')[0] + '.' if '.' in name else ''}{joint.mimic.joint}`"
            notes = make_notes("`mimic` is set here", joint.mimic.origin)
        elif isinstance(raw, str):
            message = f"the value of joint `{name}` must be {coordinate.words} (such as {coordinate.example}), found the string `{raw}`"
            help, key = f"an expression begins with `=`: `={raw}`" if raw in scope.names else None, False
        else:
            subject = f"the value of joint `{name}`" if exact else f"the value of joint `{name}` (matched by the pattern)"
            value = scope.number(raw, path, coordinate, subject, notes=notes)
            if value is not None:
                settings[name.path] = (value, scope.origin(path))
            continue
        scope.error(Code.POSE, message, path, key=key, help=help, notes=notes)


def _settable_joints(joints: Joints) -> list[CoordinateName]:
    return [name for name, joint in joints.items() if joint is not None and joint.settable]


def _set_matching(table: DocumentScope, scope: Scope, joints: Joints, key: str, raw: Any, path: Path, settings: Settings) -> None:
    matches = [name for name in joints if fnmatchcase(name, key)]
    movable = [name for name in matches if (joint := joints[name]) is not None and joint.settable]
    if movable:
        _set(scope, joints, movable, raw, path, settings, exact=False)
    elif any(joints[name] is None for name in matches) or table.may_lack_joints() or _may_be_below_unresolved(table, key):
        return
    elif matches:
        scope.error(
            Code.NO_MATCH, f"pattern `{key}` matches no joint that a pose can set", path, key=True,
            help=f"write `{matches[0].joint}: {_EXAMPLE[joint.kind.free]}`"
            if (joint := joints[matches[0]]) and joint.kind.at_once else "use a pattern that matches an independent joint",
        )
    else:
        scope.error(
            Code.NO_MATCH, f"pattern `{key}` matches no joint", path, key=True, help=suggest(key, _settable_joints(joints), what="joints"),
        )


def _set_matching_coordinates(scope: Scope, joints: Joints, key: str, raw: Any, path: Path, settings: Settings) -> None:
    """Set the coordinates of all joints with several coordinates that match a pattern.

    The value in the document is a list, or a mapping whose keys are indices of coordinates.
    """
    matching = (name for name in joints if name.number is not None and fnmatchcase(name.joint, key))
    coordinates = group_by(matching, lambda name: name.joint)
    for joint, names in coordinates.items():
        _set_coordinates(scope, joints, joint, names, raw, path, settings)
    if not coordinates and not any(joint is None for joint in joints.values()):
        scope.error(Code.COORDINATES, f"the value of pattern `{key}` must not be a list", path, key=True, help="write one value")


def _apply_nested_pose(table: DocumentScope, scope: Scope, key: str, pose: str, path: Path, layers: dict[str, Settings]) -> None:
    """Apply an entry such as `leg_*: folded`, which uses the pose `folded` of the nested documents `leg_0`, `leg_1`, ...

    `layers` contains the positions from earlier entries by the prefix of the paths in the nested document. Joints that the pose does not
    set are at 0, so earlier positions from the same document, or from a document that contains it, are removed.
    """
    matched = references.matching(table, key)
    assemblies = [(name, node) for name, node in matched if node.spec.assembly is not None]
    if not assemblies:
        nested = [name for name, node in table.all_nodes() if node.table is not None]
        if table.unbuilt or any(node.incomplete for _, node in matched) or _may_be_below_unresolved(table, key):
            return
        code, message, candidates, nouns = Code.NO_MATCH, f"pattern `{key}` matches no nested assembly", nested, "nested assemblies"
        if matched:
            code, message = Code.POSE, f"`{key}` is not a nested assembly and has no pose `{pose}`"
        elif not GLOB.search(key):
            code, message = Code.UNKNOWN_JOINT, f"there is no joint or nested assembly `{key}`"
            candidates, nouns = [*_settable_joints(dict(table.all_joints())), *nested], "joints and nested assemblies"
        notes = references.declaration_note(matched[0][1]) if matched else []
        scope.error(code, message, path, key=True, help=suggest(key, candidates, what=nouns), notes=notes)
        return
    for name, node in assemblies:
        inner = node.table
        if inner is None:
            continue
        if pose not in inner.spec.poses and not inner.doubts.lacks("poses"):
            scope.error(  # only the first error at `path` is reported
                Code.UNKNOWN_POSE, f"`{name}` (`{inner.document.relative}`) has no pose `{pose}`", path,
                help=suggest(pose, inner.spec.poses, what="poses"), notes=references.definition_note(inner),
            )
        inner_pose = inner.poses.get(pose)
        if inner_pose is not None:
            prefix = f"{name.replace('.', '/')}/"
            earlier = [settings for owner, settings in layers.items() if prefix.startswith(owner)]
            for coordinate, _ in inner.all_joints():
                for settings in earlier:
                    settings.pop(prefix + coordinate.path, None)
            layers.pop(prefix, None)  # the new entry is the last one
            layers[prefix] = {
                prefix + joint: (q, (*inner_pose.origins[joint], *scope.origin(path))) for joint, q in inner_pose.values.items()
            }


def _may_be_below_unresolved(table: DocumentScope, key: str) -> bool:
    """Return whether a key or a pattern of a pose may refer to elements of a lump, or of a nested document that cannot be resolved."""
    glob = GLOB.search(key)
    head = key[: glob.start()] if glob else f"{key}."
    unresolved = [f"{name}." for name, node in table.all_nodes() if node.spec.assembly is not None and node.table is None]
    return any(head.startswith(prefix) or glob is not None and prefix.startswith(head) for prefix in unresolved)


def _report_unknown(table: DocumentScope, scope: Scope, joints: Joints, key: str, path: Path) -> None:
    first = key.partition(".")[0]
    node = table.nodes.get(first)
    if table.unbuilt_joints and any(f"{key}_".startswith(prefix) for prefix in table.unbuilt_joints):
        return
    if _may_be_below_unresolved(table, key) or any(f"{first}_".startswith(prefix) for prefix in table.unbuilt):
        return
    if node is not None and "." in key and node.table is not None and node.table.doubts:
        return
    bases = (f"{path}.{ROOT}_" for path, inner in table.all_nodes() if inner.spec.mode is not None and inner.unplaced)
    if any(f"{key}_".startswith(base) for base in bases):  # the mode of the nested assembly is invalid
        return
    names: list[str] = [*_settable_joints(joints)]
    if node is not None and "." not in key:
        if node.table is not None:
            message = f"the value of nested assembly `{key}` must be one of its poses"
            help = suggest("", node.table.spec.poses, what="poses")
        else:
            message, help = f"`{key}` is a component, not a joint", suggest(key, names, what="joints")
        scope.error(Code.POSE, message, path, key=True, help=help, notes=references.declaration_note(node))
        return
    repeated = table.spec.joints.get(key)
    if repeated is not None and repeated.repeat is not None:
        scope.error(Code.UNKNOWN_JOINT, f"there is no joint `{key}`", path, key=True, help=f"write `{key}_0`, or `{key}_*` for all copies")
        return
    names.extend(prefix[:-1] for prefix in table.unbuilt_joints if prefix)
    of_assembly = [name for name in names if name.startswith(f"{first}.")] if "." in key else []
    help = suggest(key, of_assembly or names, what="joints")
    scope.error(Code.UNKNOWN_JOINT, f"there is no joint `{key}`", path, key=True, help=help)
