"""The tree of all instances of definitions in a robot, with methods that find the element to which a reference refers.

An instance is one use of a definition in the robot. An instance of a part, a link or a frame is called an occurrence.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from typing import Any

from thingc.base.diagnostics import Code, Note, make_notes
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Mirror
from thingc.base.source import Origin
from thingc.base.suggestions import Hint, closest_name, did_you_mean
from thingc.model.assembly.part_instances import PartInstances
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import MountAt, PartInstance, Unit
from thingc.model.resolve.types import COUNTED, AssemblyDefinition, Component, ExtraMount, Reference


@dataclass(slots=True, eq=False)
class Instance:
    """One use of the definition of an assembly, a part, a link or a frame in the robot, at a path such as `hand/cap`.

    The path of the top document is empty. `origin` contains the spans in documents that created the instance.

    `assembly` is set for an assembly, and `part` is set for a part, a link or a frame. For an invalid component, which has been reported,
    both are None. `index` is the index of an occurrence in document order. For an assembly, `index` is the index of its `base`, which is
    the component that is not placed. The index is None if there is no base. `unit` is the outermost bought assembly that contains the
    instance. `detail` contains the levels of detail of its component and of all components that contain it. `mode` is the mode of the
    nested assembly that contains the instance, or None.
    """

    path: str
    component: Component | None
    origin: Origin
    assembly: AssemblyDefinition | None = None
    part: PartInstance | None = None
    children: dict[str, Instance] = field(default_factory=dict)
    index: int | None = None
    base: Instance | None = None
    unit: Unit | None = None
    detail: frozenset[str] = frozenset()
    mode: str | None = None

    @property
    def name(self) -> str:
        """The path as documents write it, such as `hand.cap`. The name of the top document is empty."""
        return self.path.replace("/", ".")

    def within(self, name: str) -> str:
        """Return the path of an element of this assembly in the robot: `hand/tip` for the element `tip` of the assembly at `hand`."""
        return f"{self.path}/{name}" if self.path else name

    def fields_of(self, record: Any, base: type[FrozenStruct]) -> dict[str, Any]:
        """Return the fields of `base`, which a record of this document and the linked record have in common.

        The `origin` of the record is followed by the origin of this instance.
        """
        return {name: getattr(record, name) for name in base.__struct_fields__} | {"origin": record.origin + self.origin}

    def occurrences(self) -> Iterator[Instance]:
        """Yield all parts, links and frames in this instance, in document order.

        If the instance is itself a part, a link or a frame, yield only this instance.
        """
        waiting = [self]
        while waiting:
            instance = waiting.pop()
            if instance.part is not None:
                yield instance
            waiting.extend(reversed(instance.children.values()))


class _Fault(FrozenStruct):
    """The reason why the target of a reference was not found. If the message is empty, the cause has already been reported."""

    code: Code = Code.UNKNOWN_MOUNT
    message: str = ""
    help: Hint = ""
    notes: tuple[Note, ...] = ()


_SILENT = _Fault()


def unplaced_components(definition: AssemblyDefinition) -> list[str]:
    """Return the names of an assembly's components that are not placed.

    A valid assembly has exactly one such component, which is its base.
    """
    placed = {joint.child.path[0] for joint in definition.joints if joint.child.path and not joint.loop}
    return [c.name for c in definition.components if c.placement is None and c.name not in placed]


class Tree:
    """The tree of all instances of assemblies, parts, links and frames in a robot.

    `assemblies` contains parent assemblies before the assemblies nested in them. `occurrences` contains the occurrences of the whole robot
    in document order. `added` contains the mounts that documents add to nested assemblies, keyed by the base occurrence of the nested
    assembly.
    """

    def __init__(self, model: AssemblyDefinition, instances: PartInstances, findings: LinkReport) -> None:
        self.model, self.findings = model, findings
        self._reported: set[tuple[Code, str, Origin]] = set()
        self.top = Instance(path="", component=None, origin=(), assembly=model)
        self.assemblies: list[tuple[Instance, AssemblyDefinition]] = []
        self.occurrences: list[Instance] = []
        self.added: dict[int, dict[str, ExtraMount]] = {}
        self._unroll(model, instances)
        self._find_bases()
        self._add_mounts()

    def _unroll(self, model: AssemblyDefinition, instances: PartInstances) -> None:
        waiting: list[tuple[Instance, AssemblyDefinition]] = [(self.top, model)]
        while waiting:
            instance, scope = waiting.pop()
            component = instance.component
            if instance.assembly is not None:
                scope = instance.assembly
                self.assemblies.append((instance, scope))
                if not scope.whole:
                    self.findings.incomplete = True
                for inner in scope.components:
                    nested = inner.definition if isinstance(inner.definition, AssemblyDefinition) else None
                    path, unit = instance.within(inner.name), instance.unit
                    if nested is not None and inner.bom.one and unit is None:
                        unit = instances.unit_of(inner, nested, scope, path, inner.origin + instance.origin)
                    instance.children[inner.name] = Instance(
                        path=path, component=inner, origin=inner.origin + instance.origin, assembly=nested, unit=unit,
                        detail=instance.detail | inner.detail, mode=None if component is None else component.mode,
                    )
                waiting.extend((child, scope) for child in reversed(instance.children.values()))
            elif component is not None:
                instance.part = instances.of(component, scope, instance.path, instance.origin)
                if instance.part is None:
                    self.findings.incomplete = True
                else:
                    instance.index = len(self.occurrences)
                    self.occurrences.append(instance)

    def _find_bases(self) -> None:
        for instance, definition in reversed(self.assemblies):  # children first, because the base may itself be an assembly
            bases = unplaced_components(definition)
            if len(bases) != 1:
                self.findings.incomplete = True
            if bases:
                instance.base = instance.children[bases[0]]
                instance.index = instance.base.index

    def _add_mounts(self) -> None:
        for instance, definition in self.assemblies:
            component = instance.component
            if component is None:
                continue
            for name, extra in component.mounts.items():
                if name in definition.mounts or name in instance.children:
                    self.findings.error(
                        Code.MOUNT_CLASH, f"`{component.name}` already has a mount `{name}`",
                        component.full_origin(extra.origin, instance.origin), path=instance.path,
                        help="rename the new mount", notes=_exports_note(definition),
                    )
                elif instance.index is not None:
                    self.added.setdefault(instance.index, {})[f"{instance.path}/{name}"] = extra

    def find(self, instance: Instance, reference: Reference) -> MountAt | None:
        """Find the mount to which a reference in the document of `instance` refers.

        If the reference is invalid, report an error and return None.
        """
        place: MountAt | Instance | _Fault = self._walk(instance, reference.path)
        if isinstance(place, Instance):
            place = self._mount(place, reference.mount or "origin", ".".join(reference.path), instance)
        if isinstance(place, MountAt):
            return place
        self._report_fault(place, reference, instance)
        return None

    def find_mount(self, instance: Instance, name: str) -> MountAt | None:
        """Return the mount `name` of a part, or the mount that an assembly exports as `name`. Return None if the mount does not exist."""
        mount = self._mount(instance, name, "", self.top)
        return mount if isinstance(mount, MountAt) else None

    def component(self, instance: Instance, reference: Reference) -> Instance | None:
        """Find the component to which a reference refers.

        If the reference is to a mount, its component is returned. If the reference is invalid, report an error and return None.
        """
        place = self._walk(instance, reference.path)
        if isinstance(place, Instance):
            return place
        self._report_fault(place, reference, instance)
        return None

    def members(self, instance: Instance, reference: Reference) -> tuple[int, ...] | None:
        """Return the indices of all occurrences of the component to which a reference refers, or of the occurrence of the mount.

        If the reference is invalid, report an error and return None.
        """
        if reference.mount is not None:
            mount = self.find(instance, reference)
            return None if mount is None else (mount.occurrence,)
        place = self.component(instance, reference)
        return None if place is None else tuple(occurrence.index for occurrence in place.occurrences() if occurrence.index is not None)

    def _report_fault(self, fault: _Fault, reference: Reference, instance: Instance) -> None:
        self.findings.incomplete = True
        # A `repeat` or a nested document that is used twice creates many references from one line, but the line is reported once.
        place = (fault.code, re.sub(r"\d+", "#", reference.text), reference.origin[:1])
        if fault.message and place not in self._reported:
            self._reported.add(place)
            self.findings.error(
                fault.code, fault.message, reference.origin + instance.origin, help=fault.help, notes=fault.notes + _repeat_note(reference),
                path=instance.within(reference.text.replace(".", "/")),
            )

    def _walk(self, instance: Instance, path: tuple[str, ...]) -> Instance | _Fault:
        for depth, name in enumerate(path):
            child = instance.children.get(name)
            if child is None:
                owner = _owner(instance, ".".join(path[:depth]))
                return _Fault(
                    code=Code.UNKNOWN_COMPONENT, message=f"{owner} has no component `{name}`",
                    help=did_you_mean(name, instance.children, what="components"),
                )
            if child.assembly is None and child.part is None:
                return _SILENT
            instance = child
        return instance

    def _mount(self, instance: Instance, name: str, label: str, document: Instance) -> MountAt | _Fault:
        """Find a mount of an instance by name: a mount of a part, an exported or added mount of an assembly, or `origin`.

        `label` is the name of the instance in `document`, for messages. If an exported mount is invalid, the error is reported at the
        export, and not at each reference to the mount.
        """
        exported, within = False, document.assembly
        while instance.assembly is not None:
            definition = instance.assembly
            component = instance.component
            if name == "origin":
                if instance.base is None:
                    return _SILENT
                instance = instance.base
            elif component is not None and name in component.mounts and name not in definition.mounts:
                if instance.index is None:
                    return _SILENT
                return MountAt(occurrence=instance.index, mount=f"{instance.path}/{name}", pose=component.mounts[name].pose)
            elif name in definition.mounts:
                reference = definition.mounts[name]
                place = self._walk(instance, reference.path)
                if isinstance(place, _Fault):
                    return _SILENT
                instance, name, exported, within = place, reference.mount or "origin", True, definition
            elif exported:
                return _SILENT
            else:
                added = component.mounts if component is not None else {}
                return _Fault(
                    code=Code.UNKNOWN_MOUNT, message=f"{_owner(instance, label)} exports no mount `{name}`",
                    help=_mount_help(name, [*definition.mounts, *added, "origin"], document), notes=_exports_note(definition),
                )
        if instance.part is not None and instance.index is not None and name in instance.part.mounts:
            pose = instance.part.mounts[name].pose
            if name == "origin" and within is not None and within.mirror is not None:
                pose = Mirror(within.mirror).origin
            return MountAt(occurrence=instance.index, mount=name, pose=pose)
        return _SILENT if exported else _no_mount(instance, name, label, document)


def _no_mount(instance: Instance, name: str, label: str, document: Instance) -> _Fault:
    """Create the error for a reference to a mount that the part does not have."""
    part = instance.part
    if part is None or instance.index is None:
        return _SILENT
    if part.record is not None and not part.exact and _may_have_mount(name, part.record.mounts):
        return _SILENT
    return _Fault(
        code=Code.UNKNOWN_MOUNT, message=f"{_owner(instance, label)} has no mount `{name}`",
        help=f"define the mount in the part class: `self.{name} = MountPoint(...)`"
        if part.record is not None and name in part.record.references else _mount_help(name, part.mounts, document),
        notes=part.written,
    )


def _mount_help(name: str, mounts: Collection[str], document: Instance) -> Hint:
    """Return a hint for the name of an unknown mount.

    The hint contains the valid indices of a list, the most similar name, the existing mounts, or the only other component with such a
    mount.
    """
    numbers = sorted(int(mount[len(name) + 1 :]) for mount in mounts if re.fullmatch(rf"{re.escape(name)}_\d+", mount))
    if numbers:
        return f"write the number of the mount: `{name}_{numbers[0]}`" + (f" to `{name}_{numbers[-1]}`" if len(numbers) > 1 else "")
    owners = [other for other, child in document.children.items() if child.part is not None and name in child.part.mounts]
    if closest_name(name, mounts) is None and len(owners) == 1:
        return f"{did_you_mean('', mounts, what='mounts')}; or did you mean `{owners[0]}.{name}`?"
    return did_you_mean(name, mounts, what="mounts")


def _may_have_mount(name: str, mounts: Collection[str]) -> bool:
    """Return whether a part whose geometry is only partly known can have a mount with this name.

    If no mounts of the part are known, the result is True. The result is also True for an element of a list (`hip_7` if `hip_0` exists),
    because parameters can change the length of the list.
    """
    stem, _, index = name.rpartition("_")
    return not mounts or index.isdigit() and f"{stem}_0" in mounts


def _repeat_note(reference: Reference) -> tuple[Note, ...]:
    """Return a note with the location of the `repeat` whose index a reference uses. If both are on the same line, return no notes."""
    count, reference_place = reference.repeat_origin[:1], reference.origin[:1]
    return make_notes(COUNTED, count) if count and reference_place and count[0].line != reference_place[0].line else ()


def _owner(instance: Instance, label: str) -> str:
    """Format the name of an instance in the document with the reference, followed by its definition: `hand.cap` (`arm:Cap`)."""
    definition_label = instance.assembly.label if instance.assembly is not None else instance.part.definition.label if instance.part else ""
    return f"`{label}` (`{definition_label}`)" if label and definition_label else f"`{label or definition_label}`"


def _exports_note(definition: AssemblyDefinition) -> tuple[Note, ...]:
    """Return a note with the location of the section `mounts` in the document of an assembly."""
    places = [reference.origin[0] for reference in definition.mounts.values() if reference.origin] or list(definition.origin[:1])
    return (Note(message=f"`{definition.label}` exports its mounts here", span=places[0]),) if places else ()
