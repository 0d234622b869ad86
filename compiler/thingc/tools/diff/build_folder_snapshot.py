"""Create snapshots from build folders and lock files. Such a snapshot does not contain information that only documents contain."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from thingc.base.diagnostics import Report
from thingc.base.grouping import group_by
from thingc.base.source import line_of
from thingc.geometry.lock.json_format import BadLock
from thingc.geometry.lock.lock import Lock, read_lock_file, report_bad
from thingc.geometry.record import ActuatorRecord, PartRecord
from thingc.targets.artifact import MANIFEST
from thingc.tools.diff.arguments import REBUILD, UnknownComparison
from thingc.tools.diff.cached_snapshots import BrokenDocument
from thingc.tools.diff.snapshot import ComponentNode, Fact, OccurrenceSnapshot, Row, Snapshot, SnapshotElement, Value, field_values

OF_BUILDS = "parameters, mates, limits, drives, poses, materials, sensors, mounts, geometry and tests (missing in a build folder)"
OF_LOCKS = "content of documents (missing in a lock file)"


def snapshot_of_build(folder: str) -> Snapshot:
    """Create a snapshot from a build folder, which contains the outputs of `thingc build`. Raises `UnknownComparison`.

    The snapshot contains the components with their definitions and masses, the modes, the joints, the bill of materials and the print
    files.
    """
    manifest = _json(folder, MANIFEST, dict)
    modes, rows = _json(folder, "modes.json", dict, {}), _json(folder, "bom.json", list, [])
    try:
        return _of_build(manifest, modes, rows)
    except (KeyError, TypeError, AttributeError) as fault:
        message = f"`{folder}` was not built by this version of thingc: {type(fault).__name__}: {fault}"
        raise UnknownComparison(message, REBUILD) from fault


def _of_build(manifest: Mapping[str, Any], modes: Mapping[str, Any], rows: list[Any]) -> Snapshot:
    occurrences = manifest["occurrences"]
    joints = {joint["name"]: joint for mode in modes.values() for joint in mode["joints"]}
    things = [
        *(_component(one["path"], one["definition"]) for one in occurrences),
        *(SnapshotElement(what="joint", path=name, facts={"type": Fact(value=joint["kind"])}) for name, joint in joints.items()),
        *(_mode(name, mode["base"], tuple(mode["gravity"])) for name, mode in modes.items()),
    ]
    equal_parts = group_by(occurrences, lambda one: one["definition"])
    return Snapshot(
        name=manifest["name"],
        nodes=tuple(_node(one["path"], one["definition"]) for one in occurrences),
        things={(thing.what, thing.path): thing for thing in things},
        occurrences={one["path"]: _occurrence(one["path"], one["definition"], one["mass"], one["mass_source"]) for one in occurrences},
        rows=tuple(
            Row(
                definition=row["definition"], number=row["number"], quantity=row["quantity"], make=row["make"], material=row["material"],
                members=tuple(one["path"] for one in equal_parts.get(row["definition"], ())),
            )
            for row in rows
        ),
        coordinates={
            name: tuple(one["name"] for joint in mode["joints"] for one in joint["coordinates"]) for name, mode in modes.items()
        },
        prints={path: sha256 for path, sha256 in manifest["files"].items() if path.startswith("stl/")},
        lacks=frozenset({OF_BUILDS}),
    )


def outline(snapshot: Snapshot) -> Snapshot:
    """Return a copy of the snapshot of a document without the information that build folders do not contain."""
    things = [_component(path, one.definition) for path, one in snapshot.occurrences.items()]
    for (what, _), thing in snapshot.things.items():
        if what == "joint" and "type" in thing.facts:
            things.append(replace(thing, facts={"type": thing.facts["type"]}, of=""))
        elif what == "mode":
            things.append(replace(thing, facts={key: thing.facts[key] for key in ("base", "gravity")}))
    return Snapshot(
        name=snapshot.name, nodes=tuple(_node(path, one.definition) for path, one in snapshot.occurrences.items()),
        things={(thing.what, thing.path): thing for thing in things},
        occurrences={path: _occurrence(path, one.definition, one.mass, one.source) for path, one in snapshot.occurrences.items()},
        rows=tuple(replace(row, stem=None) for row in snapshot.rows), coordinates=snapshot.coordinates, lacks=snapshot.lacks,
    )


def snapshot_of_lock(path: str) -> Snapshot:
    """Create a snapshot from a lock file. Raises `BrokenDocument` for a lock file with errors.

    The snapshot contains the parameters of each part with defaults and bounds, and the properties and shapes of all its definitions.
    """
    report = Report()
    lock = read_lock_file(path, report)
    if lock is not None:
        try:
            return _of_lock(path, lock)
        except BadLock as fault:
            report_bad(path, fault, report)
    raise BrokenDocument(report.sorted_diagnostics())


def _of_lock(path: str, lock: Lock) -> Snapshot:
    things: dict[str, SnapshotElement] = {}
    occurrences: dict[str, OccurrenceSnapshot] = {}
    for reference in sorted(lock.things):
        schema = lock.schema(reference)
        facts: dict[str, Value] = {}
        for one in schema.parameters if schema is not None else ():
            facts |= {
                f"params.{one.name}": one.default, f"params.{one.name}.min": one.minimum, f"params.{one.name}.max": one.maximum,
                f"params.{one.name}.kind": one.kind,
            }
        things[reference] = _make_element(reference, facts, path)
        for record in lock.relatives(reference):
            own = facts if record.text == reference else {}
            things[record.text] = _make_element(record.text, {**own, **_properties_of(record)}, path)
            occurrences[record.text] = _of_record(record)
    return Snapshot(
        name=os.path.basename(path), nodes=tuple(_node(text, text) for text in things),
        things={(thing.what, thing.path): thing for thing in things.values()}, occurrences=occurrences, lacks=frozenset({OF_LOCKS}),
    )


def _make_element(text: str, facts: Mapping[str, Value], file: str) -> SnapshotElement:
    return SnapshotElement(
        what="component", path=text, facts={key: Fact(value=value) for key, value in facts.items()}, label=text, span=line_of(file)
    )


def _properties_of(record: PartRecord) -> dict[str, Value]:
    """Return the properties of a part in a lock file, such as the material. The result does not include the shape."""
    values: dict[str, Value] = {"material": record.material, "color": record.color}
    for key, value in (("mass", record.mass), ("com", record.com), ("density", record.density)):
        if value is not None:
            values |= {f"{key}.value": value.value, f"{key}.source": value.source}
    return values if record.actuator is None else values | field_values("drive", ActuatorRecord, record.actuator)


def _of_record(record: PartRecord) -> OccurrenceSnapshot:
    shape = None if record.box is None else replace(record, code=None)
    mounts = {name: mount.pose for name, mount in record.mounts.items()}
    return OccurrenceSnapshot(path=record.text, definition=record.text, shape=shape, mounts=mounts)


def _component(path: str, definition: str) -> SnapshotElement:
    return SnapshotElement(what="component", path=path, facts={"part": Fact(value=definition)}, label=definition)


def _mode(name: str, base: str, gravity: Value) -> SnapshotElement:
    return SnapshotElement(what="mode", path=name, facts={"base": Fact(value=base), "gravity": Fact(value=gravity)})


def _node(path: str, definition: str) -> ComponentNode:
    return ComponentNode(path=path, kind="part", reference=definition.partition("(")[0], text=definition, place=None)


def _occurrence(path: str, definition: str, mass: float, source: str) -> OccurrenceSnapshot:
    return OccurrenceSnapshot(path=path, definition=definition, mass=mass, source=source)


def _json(folder: str, name: str, kind: type, otherwise: Any = None) -> Any:
    path = os.path.join(folder, name)
    if otherwise is not None and not os.path.isfile(path):
        return otherwise
    try:
        with open(path, encoding="utf-8") as stream:
            value = json.load(stream)
    except (OSError, ValueError) as fault:
        raise UnknownComparison(f"`{path}` cannot be read: {fault}", REBUILD) from fault
    if not isinstance(value, kind):
        raise UnknownComparison(f"`{path}` was not built by this version of thingc", REBUILD)
    return value
