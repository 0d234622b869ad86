"""Collect the names of elements in output files, which documents specify in their section `names`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from thingc.base.diagnostics import Code, make_notes
from thingc.base.export_names import TAKEN
from thingc.base.source import Origin
from thingc.model.assembly.instance_tree import Tree
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Connected, FileNames, JointEdge, LinkedTendon, Occurrence
from thingc.model.resolve.types import NamedKind, NameInFiles, Reference

Named = dict[NamedKind, dict[str, tuple[str, Origin]]]
"""Names in output files and their locations in documents, by the kind and path of the element."""


def names_of(tree: Tree, robot: Connected) -> FileNames | None:
    """Return the names of elements in output files that documents specify.

    Return None if documents do not specify names. Duplicate names are reported.
    """
    named: Named = {}
    for instance, definition in tree.assemblies:
        for one in definition.names:
            own = _own(tree, instance.within(one.own), one, robot.occurrences)
            if own is not None and (one.kind != "poses" or instance is tree.top):
                named.setdefault(one.kind, {}).setdefault(own, (instance.within(one.name), one.origin + instance.origin))
    if not named:
        return None
    joints = [joint for mate in robot.mates for joint in mate.joints]
    driven: tuple[JointEdge | LinkedTendon, ...] = (*joints, *robot.tendons)
    things: dict[NamedKind, Iterable[tuple[str, Origin]]] = {
        "components": ({one.path: one.origin for one in robot.occurrences} | {link.name: link.origin for link in robot.links}).items(),
        "mounts": ((mount.path, mount.origin) for mount in robot.exported),
        "joints": [*((mate.name, mate.origin) for mate in robot.mates if mate.name is not None), *((one, ()) for one in TAKEN["joints"])],
        "tendons": ((tendon.path, tendon.origin) for tendon in robot.tendons),
        "actuators": ((one.path, one.actuator.origin) for one in driven if one.actuator is not None),
        "equalities": (),  # MuJoCo reports duplicate names
        "sensors": ((sensor.path, sensor.origin) for sensor in robot.sensors),
        "poses": ((pose.name, pose.origin) for pose in tree.model.poses),
    }
    joint_names = named.get("joints", {})
    for kind, those in things.items():
        names = named.get(kind, {})
        if kind == "actuators":  # by default, an actuator has the same name as its joint or tendon
            names = {joint.path: joint_names[joint.name.joint.replace(".", "/")] for joint in joints if joint.path in joint_names} | names
            names = named.get("tendons", {}) | names
        if names:
            _check(those, names, tree.findings)
    by_kind = {kind: {path: name for path, (name, _) in those.items()} for kind, those in named.items()}
    return FileNames(**by_kind)


def _own(tree: Tree, path: str, one: NameInFiles, occurrences: Sequence[Occurrence]) -> str | None:
    """Return the path in the robot of an element in the document at `path`.

    For a nested assembly, return the path of its base component.
    """
    if one.kind != "components":
        return path
    place = tree.component(tree.top, Reference(path=tuple(path.split("/")), mount=None, origin=one.origin))
    return None if place is None or place.index is None else occurrences[place.index].path


def _check(things: Iterable[tuple[str, Origin]], names: Mapping[str, tuple[str, Origin]], findings: LinkReport) -> None:
    """Report two elements of the same type, such as two joints or two links, that would have the same name in output files."""
    owners: dict[str, tuple[str, Origin]] = {}
    for path, origin in things:
        name, where = names.get(path, (path, origin))
        other, place = owners.setdefault(name, (path, where))
        if other != path:
            mine = path in names
            findings.error(
                Code.SAME_NAME, f"`{other}` and `{path}` have the same name `{name}` in output files", where if mine else place, path=path,
                help="rename one of the two elements",
                notes=make_notes(f"`{other if mine else path}` is defined here", place if mine else where),
            )
