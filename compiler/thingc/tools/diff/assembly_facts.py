"""Convert a linked assembly to the entries of a snapshot: mates, occurrences, links, sensors, tendons and rows of the bill of materials."""

from __future__ import annotations

from collections.abc import Iterator
from hashlib import sha256

from msgspec.structs import replace

from thingc.base.pose import Pose
from thingc.geometry.record import PartDefinition
from thingc.model.assembly.types import ActuatorModel, Assembly, LinkedSensor, Mate, Occurrence, TendonStep
from thingc.model.resolve.coordinates import Dynamics, Limit
from thingc.model.resolve.types import AssemblyDefinition
from thingc.targets.bom.emit import with_pieces
from thingc.tools.diff.snapshot import Edge, Fact, LinkOf, Named, OccurrenceSnapshot, Row, Value, field_values


def edges_of(assembly: Assembly) -> Iterator[Edge]:
    """Yield each mate of an assembly as an edge of a graph, which connects the paths of two components."""
    paths = [occurrence.path for occurrence in assembly.occurrences]
    for mate in assembly.mates:
        kind = mate.joints[0].kind.name if mate.joints else "fixed" if mate.name is not None else ""
        yield Edge(parent=paths[mate.parent], child=paths[mate.child], mounts=(mate.parent_mount, mate.child_mount), joint=kind)


def occurrences_of(assembly: Assembly, exact: bool) -> Iterator[OccurrenceSnapshot]:
    """Yield the occurrences (parts and frames) of an assembly in document order.

    If `exact` is false, omit geometry, mounts, poses and full mass properties.
    """
    placed = {mate.child: mate for mate in _placing(assembly)}
    for occurrence in assembly.occurrences:
        mate = placed.get(occurrence.index)
        yield OccurrenceSnapshot(
            path=occurrence.path, definition=occurrence.definition.text,
            properties=occurrence.properties if exact else None, mass=occurrence.properties.mass, source=occurrence.mass_source,
            shape=occurrence.record if exact and occurrence.record is not None and occurrence.record.box is not None else None,
            mounts=_mounts(occurrence) if exact else {},
            place=assembly.rest[occurrence.index] if exact else None,
            parent=None if mate is None else assembly.occurrences[mate.parent].path, joint=None if mate is None else mate.name,
            material=None if occurrence.material is None else occurrence.material.name,
        )


def _placing(assembly: Assembly) -> Iterator[Mate]:
    """Yield the mates that form the spanning tree of the assembly. The parent of each mate is closer to the base than its child."""
    mates_of: dict[int, list[tuple[int, Mate]]] = {}
    for mate in assembly.mates:
        if mate.loop is None:
            mates_of.setdefault(mate.parent, []).append((mate.child, mate))
            mates_of.setdefault(mate.child, []).append((mate.parent, mate))
    waiting, met = [assembly.base], {assembly.base}
    while waiting:
        index = waiting.pop()
        for other, mate in mates_of.get(index, []):
            if other not in met:
                met.add(other)
                waiting.append(other)
                yield replace(mate, parent=index, child=other)


def _mounts(occurrence: Occurrence) -> dict[str, Pose]:
    """Return the mounts that the class of a part defines. The mount `origin` and mounts that the document adds are omitted."""
    added = occurrence.component.mounts
    return {name: mount.pose for name, mount in occurrence.mounts.items() if name not in (*added, "origin")}


def links_of(assembly: Assembly) -> Iterator[LinkOf]:
    """Yield the links of an assembly. Each link contains the paths of its parts and frames."""
    paths = [occurrence.path for occurrence in assembly.occurrences]
    for link in assembly.links:
        yield LinkOf(
            name=link.name, frame=paths[link.frame], members=tuple(paths[index] for index in link.members), properties=link.properties,
        )


def rows_of(assembly: Assembly) -> Iterator[Row]:
    """Yield the rows of the bill of materials. Each row contains the paths of the parts that the row counts."""
    for row, pieces in with_pieces(assembly):
        stem = None
        for occurrence in pieces:
            definition, record = occurrence.component.definition, occurrence.record
            if isinstance(definition, PartDefinition) and record is not None and "print" in record.meshes and row.make != "buy":
                stem = definition.stem
        yield Row(
            definition=row.definition, number=row.number, quantity=row.quantity, make=row.make, material=row.material,
            members=tuple(occurrence.path for occurrence in pieces), stem=stem,
        )


def sensor_values(assembly: Assembly, sensor: LinkedSensor) -> Iterator[tuple[tuple[str, ...], Value]]:
    """Yield the key and the value of each property of a sensor. The value of a property that is not set is None."""
    yield ("type",), sensor.kind
    for key, mount in (("at", sensor.at), ("in", sensor.seen_from)):
        if mount is not None:
            yield (key,), Named(what="component", path=assembly.occurrences[mount.occurrence].path, mount=mount.mount)
    yield ("fovy",), sensor.fovy
    yield ("joint",), None if sensor.joint is None else Named(what="joint", path=sensor.joint)
    yield ("tendon",), sensor.tendon
    for key, link in zip(("of", "with"), sensor.touching, strict=False):
        yield (key,), Named(what="component", path=assembly.occurrences[assembly.links[link].frame].path)
    if sensor.volume is not None:
        yield ("volume", sensor.volume.shape), sensor.volume.size
    for reading in dict.fromkeys((*sensor.noise, *sensor.cutoff)):
        yield ("noise", reading), sensor.noise.get(reading)
        yield ("cutoff", reading), sensor.cutoff.get(reading)


def tendon_facts(assembly: Assembly) -> dict[str, Fact]:
    """Return the properties of all tendons by key (`tendons.grip.dynamics.stiffness`): joints, path, limit, dynamics and drive.

    Properties that are not set are omitted.
    """
    facts: dict[str, Fact] = {}
    for one in assembly.tendons:
        values: dict[str, Value] = {f"joints.{path}": factor for path, factor in one.moves.items()}
        values |= {f"path.{place}": _step_value(step) for place, step in enumerate(one.steps)} | {"width": one.width}
        values |= field_values("limit", Limit, one.limit) | field_values("dynamics", Dynamics, one.dynamics)
        values |= field_values("drive", ActuatorModel, one.actuator)
        facts |= {f"tendons.{one.path}.{key}": Fact(value=value, span=one.origin[0]) for key, value in values.items() if value is not None}
    return facts


def motion_facts(definition: AssemblyDefinition) -> dict[str, Fact]:
    """Return the times of each motion by key (`motions.wave`), with a digest of its positions, which does not depend on names of joints."""
    return {
        f"motions.{one.name}": Fact(value=(
            f"{len(one.times)} positions from {one.times[0]:.6g} s to {one.times[-1]:.6g} s "
            f"({sha256(repr((one.times, one.smooth, *one.values.values())).encode()).hexdigest()[:8]})"
        ), span=one.origin[0]) for one in definition.motions
    }


def _step_value(step: TendonStep) -> Value:
    """Convert one step of a tendon path to a value that can be compared with `==`."""
    if step.divisor is not None:
        return step.divisor
    mounts = tuple(mount.path.replace("/", ".") for mount in (step.mount, step.side) if mount is not None)
    return mounts[0] if step.radius is None else (step.shape or "", step.radius, *mounts)
