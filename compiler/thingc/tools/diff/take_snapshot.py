"""Create the snapshot of a compiled document: the values in the documents, their source locations, and the results of the compilation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.interfaces import format_interface
from thingc.base.pose import Pose, rpy_of
from thingc.base.source import Origin, Span
from thingc.driver.pipeline import Compilation
from thingc.geometry.record import PartDefinition
from thingc.model.assembly.types import ActuatorModel, Assembly, JointEdge
from thingc.model.resolve.coordinates import Dynamics, Limit
from thingc.model.resolve.types import AssemblyDefinition, Attach, Component, Joint, JointRange, Mode, Overrides, Process, Reference
from thingc.tools.diff.assembly_facts import edges_of, links_of, motion_facts, occurrences_of, rows_of, sensor_values, tendon_facts
from thingc.tools.diff.snapshot import PLACES, ComponentNode, Fact, Named, Snapshot, SnapshotElement, Value, What, field_values
from thingc.tools.diff.source_locations import DocumentTrees

KEYS = {"minimum": "min", "maximum": "max", "base": "from"}
"""Maps names of fields to the keys of document tests, if the key differs from the name of the field."""


def take_snapshot(compilation: Compilation) -> Snapshot:
    """Create the snapshot of a document that was compiled without errors. The snapshot does not contain test results."""
    assembly, documents = compilation.assembly, compilation.documents
    assert assembly is not None and documents is not None, "the compilation failed"
    reader = _Reader(assembly, DocumentTrees(documents))
    reader.assembly_at("", assembly.definition)
    reader.top()
    exact = all(occurrence.exact for occurrence in assembly.occurrences)
    return Snapshot(
        name=assembly.name, nodes=tuple(reader.nodes), edges=tuple(edges_of(assembly)),
        things={(thing.what, thing.path): thing for thing in reader.things},
        occurrences={one.path: one for one in occurrences_of(assembly, exact)},
        links=tuple(links_of(assembly)) if exact else (), whole=assembly.properties if exact else None,
        rows=tuple(rows_of(assembly)) if exact else (),
        coordinates={
            robot.mode.name: tuple(joint.path for body in robot.bodies for joint in body.joints) for robot in compilation.robots
        },
        lacks=frozenset() if exact else frozenset({"masses and geometry"}),
    )


class _Reader:
    """Collects the elements of a document and of all documents nested in it."""

    def __init__(self, assembly: Assembly, written: DocumentTrees) -> None:
        self.assembly = assembly
        self.written = written
        self.things: list[SnapshotElement] = []
        self.nodes: list[ComponentNode] = []
        self._occurrences = {occurrence.path: occurrence for occurrence in assembly.occurrences}
        self._edges = {joint.path: joint for mate in assembly.mates for joint in mate.joints}

    # --- assemblies ----------------------------------------------------------------------------------------------

    def assembly_at(self, prefix: str, definition: AssemblyDefinition) -> None:
        """Collect the elements of the nested document with the path `prefix` (for example `hand/`), and of the documents nested in it."""
        place = prefix.rstrip("/")
        self._parameters(prefix, definition)
        for component in definition.components:
            if component.definition is None and not component.frame:
                continue
            self._component(prefix, definition, component)
        for name, coordinates in groupby(definition.joints, key=lambda joint: joint.name.joint):
            self._joint(prefix, definition, prefix + name.replace(".", "/"), list(coordinates))
        for name, reference in definition.mounts.items():
            self._add(
                "mount", prefix + name, {"of": Fact(value=_occurrence(definition, prefix, reference))}, of=place, span=reference.origin[0],
            )
        for component in definition.components:
            if isinstance(component.definition, AssemblyDefinition):
                self.assembly_at(f"{prefix}{component.name}/", component.definition)

    def _add(
        self, kind: What, path: str, facts: Mapping[str, Fact], *, of: str = "", label: str | None = None, span: Span | None = None,
    ) -> None:
        self.things.append(SnapshotElement(what=kind, path=path, facts=facts, label=label, of=of, span=span))

    def _parameters(self, prefix: str, definition: AssemblyDefinition) -> None:
        """Collect the values and the bounds of the parameters of a nested document."""
        node = self.written.component(prefix)
        for name, value in definition.parameters:
            fact = self.written.fact(value, node, ("parameters", name), scope=prefix.rstrip("/").rpartition("/")[0])
            texts = self.written.parameter(definition.document, name)
            if fact.written is None:
                text, span = texts.get("value", (None, None))
                fact = Fact(value=value, written=text, scope=prefix.rstrip("/"), span=span)
            facts = {"value": fact}
            for bound in ("min", "max"):
                if bound in texts:
                    text, span = texts[bound]
                    facts[bound] = Fact(value=self.written.number(text), written=text, span=span)
            self._add("parameter", prefix + name, facts, of=prefix.rstrip("/"), span=fact.span)

    # --- components ----------------------------------------------------------------------------------------------

    def _component(self, prefix: str, definition: AssemblyDefinition, component: Component) -> None:
        path = prefix + component.name
        target, occurrence = component.definition, self._occurrences.get(path)
        place = None if occurrence is None else self.assembly.rest[occurrence.index]
        if isinstance(target, PartDefinition):
            kind, reference, text = "part" if target.kind == "code" else "file", target.reference, target.text
        elif isinstance(target, AssemblyDefinition):
            kind, reference, text = "assembly", target.document, target.text
        elif target is not None:
            kind, reference, text = "link", "link", target.text
        else:
            kind, reference, text = "frame", "frame", "frame"
        self.nodes.append(ComponentNode(path=path, kind=kind, reference=reference, text=text, place=place))
        # the document contains only the components of the moving assembly
        node = () if definition.lump else self.written.note_component(path, definition.document, component)
        scope = prefix.rstrip("/")

        def fact(value: Value, *keys: str) -> Fact:
            return self.written.fact(value, node, keys, scope=scope, otherwise=component.origin[0])

        material = occurrence.material if occurrence is not None else None
        values: dict[str, Value] = {
            kind: reference if kind not in ("link", "frame") else True, "mirror": target.mirror if target is not None else None,
            "material": Named(what="material", path=material.name) if material is not None else None,
            "detail": tuple(sorted(component.detail)), **dict(_overrides(component.overrides)),
            **field_values("bom", type(component.bom), component.bom),
        }
        facts = {key: fact(value, *key.split(".")) for key, value in values.items()}
        if isinstance(target, PartDefinition):
            inner = ("params",) if target.kind == "code" else ()
            facts |= {".".join((*inner, name)): fact(value, *inner, name) for name, value in target.parameters}
            for (name, _), text_of_value in zip(target.parameters, target.words, strict=False):
                key = ".".join((*inner, name))
                facts[key] = replace(facts[key], words=text_of_value)
        self._add("component", path, facts, of=path, label=component.label, span=component.origin[0])
        self._placement(prefix, definition, component, path, fact)
        for name, mount in component.mounts.items():
            self._add("mount", f"{path}/{name}", {
                **{key: fact(value, "mounts", name, key) for key, value in _pose(mount.pose)},
                "interface": fact(format_interface(mount.interface, mount.features) or None, "mounts", name, "interface"),
            }, of=path, span=mount.origin[0])

    def _placement(self, prefix: str, definition: AssemblyDefinition, component: Component, path: str, fact: Any) -> None:
        """Collect the mate by which a component is placed. A component that is placed by a joint does not have such a mate."""
        placement = component.placement
        if placement is None:
            return
        to = _occurrence(definition, prefix, placement.to)
        values: dict[str, Value]
        if isinstance(placement, Attach):
            section, mount = "attach", _occurrence(definition, prefix, placement.mount)
            values = {"mount": mount, "to": to, "turn": placement.turn, "gap": placement.gap}
        else:
            section, values = "at", {"in": to, **dict(_pose(placement.pose))}
        facts = {key: fact(value, section, key) for key, value in values.items()}
        self._add("mate", path, facts, of=path, span=placement.origin[0])

    # --- joints --------------------------------------------------------------------------------------------------

    def _joint(self, prefix: str, definition: AssemblyDefinition, path: str, coordinates: list[Joint]) -> None:
        first, scope = coordinates[0], prefix.rstrip("/")

        def fact(joint: Joint, key: str, value: Value) -> Fact:
            return Fact(value=value, written=joint.written.get(key), scope=scope, span=joint.spans.get(key, joint.origin[0]))

        values: dict[str, Value] = {
            "type": first.kind.name, "parent": _occurrence(definition, prefix, first.parent),
            "child": _occurrence(definition, prefix, first.child), "axis": first.axis, "turn": first.turn, "gap": first.gap,
            "loop": first.loop, "reverse": first.reverse,
        }
        if first.twist is not None and first.kind.leads:
            values["lead"] = first.twist.pitch
        facts = {key: fact(first, key, value) for key, value in values.items()}
        if len(coordinates) > 1:
            self._add("joint", path, facts, label=first.kind.name, of=scope, span=first.origin[0])
            facts = {}
        for joint in coordinates:
            joint_facts = facts | {key: fact(joint, key, value) for key, value in self._moving(prefix, definition, joint)}
            self._add("joint", prefix + joint.path.replace(".", "/"), joint_facts, label=joint.kind.name, of=scope, span=joint.origin[0])

    def _moving(self, prefix: str, definition: AssemblyDefinition, joint: Joint) -> Iterator[tuple[str, Value]]:
        """Yield the properties of one coordinate of a joint, including values that the joint inherits from its drive."""
        edge: JointEdge | None = self._edges.get(prefix + joint.path.replace(".", "/"))
        limit, dynamics = (edge.limit, edge.dynamics) if edge is not None else (joint.limit, joint.dynamics)
        yield "offset", joint.offset
        yield from field_values("limit", Limit, limit).items()
        yield from field_values("dynamics", Dynamics, dynamics).items()
        drive, actuator = joint.drive, edge.actuator if edge is not None else None
        component = drive.component if drive is not None else None
        yield "drive", _occurrence(definition, prefix, component) if component is not None else None
        yield from field_values("drive", ActuatorModel, actuator).items()
        mimic = joint.mimic
        yield "mimic.joint", Named(what="joint", path=prefix + mimic.joint.path) if mimic is not None else None
        yield "mimic.multiplier", mimic.multiplier if mimic is not None else None
        yield "mimic.offset", mimic.offset if mimic is not None else None
        yield "mimic.polynomial", mimic.polynomial if mimic is not None and mimic.higher else None

    # --- the top document --------------------------------------------------------------------------------------------

    def top(self) -> None:
        """Collect the elements that only the top-level document can have, such as modes."""
        assembly, definition = self.assembly, self.assembly.definition
        raw = {element.dotted: Fact(value=element.value, span=element.origin[0]) for element in assembly.raw}
        raw |= tendon_facts(assembly) | motion_facts(definition)
        raw |= {element.dotted: Fact(value=element.text, span=element.origin[0]) for element in assembly.added}
        self._add("component", "", {"name": Fact(value=definition.name), **raw}, span=definition.origin[0] if definition.origin else None)
        for mode in definition.modes:
            if mode.stated:
                self._mode(definition, mode)
        for pose in definition.poses:
            self._add("pose", pose.name, {
                path: self._make_fact(value, pose.origins.get(path, ())) for path, value in pose.values.items()
            }, span=pose.origin[0])
        for sensor in assembly.sensors:
            section = self.written.section(definition.document, "sensors", sensor.path)
            self._add("sensor", sensor.path, {
                ".".join(keys): self.written.fact(value, section, keys, otherwise=sensor.origin[0])
                for keys, value in sensor_values(assembly, sensor)
            }, span=sensor.origin[0])
        for linked in assembly.tests:
            test = linked.test
            text_of_test = self.written.fact(None, self.written.section(definition.document, "tests", test.name), ()).written
            modes = tuple(Named(what="mode", path=name) for name in test.modes)
            poses = tuple(Named(what="pose", path=name) if name is not None else None for name in test.poses)
            facts = {"kind": Fact(value=test.kind)}
            for key, value in (*self._check(definition, test.check), ("mode", modes), ("pose", "all" if test.every_pose else poses)):
                span = test.spans.get(key)
                text = self.written.words_at(span) or text_of_test
                facts[f"{test.kind}.{key}"] = Fact(value=value, written=text, span=span or test.origin[0])
            self._add("test", test.name, facts, span=test.origin[0])
        self._materials(definition)

    def _make_fact(self, value: Value, origin: Origin) -> Fact:
        """Create a `Fact` for a value in the top-level document, with the first source location in `origin`."""
        span = origin[0] if origin else None
        return Fact(value=value, written=self.written.words_at(span), span=span)

    def _check(self, definition: AssemblyDefinition, check: object, within: str = "") -> Iterator[tuple[str, Value]]:
        """Yield the key and the value of each setting of a document test. The settings of nested structs have dotted keys."""
        assert isinstance(check, FrozenStruct)
        for name in check.__struct_fields__:
            value, key = getattr(check, name), within + KEYS.get(name, name)
            if isinstance(value, FrozenStruct) and not isinstance(value, (Reference, JointRange, Pose)):
                yield from self._check(definition, value, f"{key}.")
            else:
                yield key, self._plain(definition, value)

    def _plain(self, definition: AssemblyDefinition, value: Any) -> Value:
        if isinstance(value, Reference):
            return _occurrence(definition, "", value)
        if isinstance(value, JointRange):
            return (Named(what="joint", path=value.joint), value.lower, value.upper)
        if isinstance(value, Pose):
            return tuple(part for _, part in _pose(value))
        if isinstance(value, Mapping):
            return tuple((str(key), self._plain(definition, item)) for key, item in sorted(value.items()))
        if isinstance(value, (tuple, list)):
            return tuple(self._plain(definition, item) for item in value)
        if isinstance(value, str) and value in self._edges:
            return Named(what="joint", path=value)
        if isinstance(value, FrozenStruct):
            return tuple((name, self._plain(definition, getattr(value, name))) for name in value.__struct_fields__ if name not in PLACES)
        return value if isinstance(value, (bool, int, float, str)) else None

    def _mode(self, definition: AssemblyDefinition, mode: Mode) -> None:
        node = self.written.section(definition.document, "modes", mode.name)

        def component(reference: Reference) -> Named:
            return _occurrence(definition, "", reference)

        def fact(value: Value, *keys: str) -> Fact:
            return self.written.fact(value, node, keys, otherwise=mode.origin[0])

        standing = mode.standing
        values: dict[str, Value] = {
            "root": component(mode.root), "base": mode.base, **{f"at.{key}": value for key, value in _pose(mode.at)},
            "at.on": "floor" if mode.on_floor else None, "gravity": tuple(mode.gravity),
            "pose": None if mode.pose is None else Named(what="pose", path=mode.pose),
            "poses": _sort_names(Named(what="pose", path=name) for name in mode.poses),
            "actuators": None if mode.actuators is None else _sort_names(Named(what="joint", path=path) for path in mode.actuators),
            "exclude": tuple(sorted((_sort_names(component(one) for one in pair) for pair in mode.exclude), key=repr)),
            "cut": _sort_names(Named(what="joint", path=cut.joint) for cut in mode.cut),
            "standing_on": None if standing is None else _sort_names(component(mount) for mount in standing.mounts),
            "standing_on.friction": None if standing is None else standing.friction,
        }
        facts = {key: fact(value, *key.split(".")) for key, value in values.items()}
        for pair in mode.pairs:
            ends = ", ".join(sorted(component(one).text for one in (pair.one, pair.other)))
            for key, setting in (("friction", pair.friction), ("margin", pair.margin), ("gap", pair.gap)):
                facts[f"pairs.[{ends}].{key}"] = fact(setting, "contacts", "pairs")
        for group in mode.groups:
            facts[f"groups.{group.name}.components"] = fact(_sort_names(map(component, group.members)), "contacts", "groups", group.name)
            facts[f"groups.{group.name}.collide"] = fact(tuple(sorted(group.collides)), "contacts", "groups", group.name)
        for hold in mode.holds:
            value = (*(part for _, part in _pose(hold.pose)),) if hold.pose is not None else "here"
            facts[f"hold.{component(hold.mount).text}"] = fact((value, "force" if hold.turns else "all"), "hold")
        for mount, force in mode.adhesion:
            facts[f"adhesion.{component(mount).text}"] = fact(force, "adhesion")
        for key, one in {**definition.simulation, **mode.simulation}.items():
            facts[f"simulation.{key}"] = fact(one, "simulation", key)
        for path, levels in definition.omitted.items():
            if path[0] != "modes" or path == ("modes", mode.name):
                facts[f"detail.{path[0]}"] = fact(tuple(f"-{level}" for level in sorted(levels)), "detail", *path)
        self._add("mode", mode.name, facts, span=mode.origin[0])

    def _materials(self, top: AssemblyDefinition) -> None:
        """Collect the materials of all documents, keyed by name.

        If two documents define different materials of the same name, the key also contains the path of the document.
        """
        known: dict[str, Mapping[str, Fact]] = {}
        for definition in top.assemblies():
            for name, material in definition.materials.items():
                facts = {
                    "density": Fact(value=material.density, span=material.density_origin[0] if material.density_origin else None),
                    "color": Fact(value=material.color), "friction.slide": Fact(value=material.slide),
                    "friction.torsion": Fact(value=material.torsion), "friction.roll": Fact(value=material.roll),
                    **dict(_process(material.process)),
                }
                same = known.get(name)
                if same is not None and {k: f.value for k, f in same.items()} == {k: f.value for k, f in facts.items()}:
                    continue
                called = name if same is None else f"{name} [{definition.name}]"
                if called not in known:
                    known[called] = facts
                    self._add("material", called, facts, span=material.origin[0] if material.origin else None)


def _occurrence(definition: AssemblyDefinition, prefix: str, reference: Reference) -> Named:
    """Resolve a reference in the document at `prefix` to a part or frame, and to a mount of this part or frame."""
    current, at, mount = definition, prefix.rstrip("/"), reference.mount
    names = list(reference.path)
    while names:
        name = names.pop(0)
        component = next((one for one in current.components if one.name == name), None)
        at = f"{at}/{name}" if at else name
        inner = component.definition if component is not None else None
        if isinstance(inner, AssemblyDefinition):
            current = inner
            if not names and mount is not None and (further := inner.mounts.get(mount)) is not None:
                names, mount = list(further.path), further.mount
    if not reference.path and mount is not None and (further := definition.mounts.get(mount)) is not None and further.path:
        return _occurrence(definition, prefix, further)
    return Named(what="component", path=at, mount=mount)


def _overrides(overrides: Overrides) -> Iterator[tuple[str, Value]]:
    for key, value in (("mass", overrides.mass), ("com", overrides.com), ("inertia", overrides.inertia)):
        yield f"{key}.value", None if value is None else value.value[0] if len(value.value) == 1 else tuple(value.value)
        yield f"{key}.source", None if value is None else value.source
    for path, choice in overrides.choices.items():
        key = ".".join(("collision", *path))
        yield key, choice.collision
        if choice.shapes is not None:
            yield f"{key}.shapes", f"{choice.shapes.label.removeprefix('link ')}, {choice.shapes.text.removeprefix('link-')}"
        yield f"{key}.decompose.pieces", choice.pieces or None
    yield "visual", overrides.visual
    yield "print.up", overrides.up
    yield from field_values("process", Process, overrides.process).items()


def _process(process: Process | None) -> Iterator[tuple[str, Fact]]:
    for key, value in field_values("process", Process, process).items():
        origin: Origin = process.origins.get(key.removeprefix("process."), ()) if process is not None else ()
        yield key, Fact(value=value, span=origin[0] if origin else None)


def _pose(pose: Pose) -> Iterator[tuple[str, Value]]:
    yield "xyz", tuple(pose.translation)
    # round first, because rounding errors change the angles of a rotation by 180 degrees, or with a pitch of 90 degrees
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (tuple(round(part, 14) + 0.0 for part in row) for row in pose.rotation)
    yield "rpy", tuple(rpy_of(((xx, xy, xz), (yx, yy, yz), (zx, zy, zz))))


def _sort_names(names: Iterator[Named]) -> tuple[Named, ...]:
    return tuple(sorted(names, key=lambda one: one.text))
