"""Apply the custom names in `names:` of the documents to the robot.

Emitters of targets with `Target.by_name` get the renamed robot and do not see the original names. A `/` in a custom name is converted in
the same way as a `/` in a path.

The module finds the paths in a record by the types of its fields (see `base/export_names.py`). Records for which this is not sufficient
have explicit rules (see `_Caller.rules`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.model.assembly.hag import Definition
from thingc.model.assembly.types import Assembly, FileNames, JointEdge, LinkedSensor, LinkedTendon, LinkedTest, Occurrence
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.raw import named_kind
from thingc.model.resolve.types import AssemblyDefinition, Component, RawAttribute, RawElement
from thingc.model.robot.types import Closure, TreeJoint
from thingc.targets.request import EmitRequest

MADE = "called"
"""Key under which a request caches the renamed request."""

AS_WRITTEN = frozenset({AssemblyDefinition, Component, Definition, FileNames, LinkedTest, Occurrence})
"""Classes of records that keep the names of the documents."""


def apply_custom_names(request: EmitRequest) -> EmitRequest:
    """Apply the custom names of the documents to the robot in a request.

    If the documents contain no custom names, return the request unchanged.
    """
    names = request.assembly.names
    if names is None:
        return request
    known = request.made.get(MADE)
    if isinstance(known, EmitRequest):
        return known
    caller = _Caller(request.assembly, names)
    robots = tuple(caller.record(robot) for robot in request.robots)
    renamed = replace(request, assembly=caller.record(request.assembly), robots=robots, made={})
    request.made[MADE] = renamed
    return renamed


@cache
def fields_of(record: type) -> Mapping[str, Any]:
    """Return the fields of a record class that contain paths at any depth, with their types."""
    return {name: hint for name, hint in get_type_hints(record, include_extras=True).items() if _holds(hint, frozenset())}


def _holds(hint: Any, within: frozenset[type]) -> bool:
    kind = get_origin(hint) or hint
    if kind is Annotated or kind is CoordinateName:
        return True
    if isinstance(kind, type) and issubclass(kind, FrozenStruct) and kind not in AS_WRITTEN | within:
        return any(_holds(inner, within | {kind}) for inner in get_type_hints(kind, include_extras=True).values())
    return any(_holds(argument, within) for argument in get_args(hint))


class _Caller:
    """Applies custom names to an assembly and its robots."""

    def __init__(self, assembly: Assembly, names: FileNames) -> None:
        self.names = names
        joints = dict(names.joints)  # whole joints and their coordinates
        for mate in assembly.mates:
            custom_name = names.joints.get(mate.name or "")
            for joint in mate.joints if custom_name is not None else ():
                joints[joint.path] = f"{custom_name}{joint.path.removeprefix(mate.name or '')}"
        self.named: dict[str, Mapping[str, str]] = {
            "components": names.components, "mounts": names.components | names.mounts, "joints": joints, "poses": names.poses,
            "sensors": names.sensors, "tendons": names.tendons,
        }
        self.raw = {
            "joint": joints, "numeric": joints,
            "equality": names.mounts | joints
            | {f"{own}:{mark}": name for own, name in names.equalities.items() for mark in ("mimic", "loop")},
            "body": names.components, "link": names.components, "site": names.mounts, "key": names.poses,
            "actuator": joints | names.tendons | names.actuators, "sensor": names.sensors, "camera": names.sensors,
            "tendon": names.tendons,
        }
        self.rules: dict[type, Callable[[Any, dict[str, Any]], dict[str, Any]]] = {
            Assembly: lambda _, fields: {**fields, "names": None},
            JointEdge: self._drive, TreeJoint: self._drive, LinkedTendon: self._drive, Closure: self._closure,
            LinkedSensor: self._sensor, RawAttribute: self._attribute, RawElement: self._element,
        }
        self._made: dict[int, tuple[Any, Any]] = {}

    def record(self, old: Any) -> Any:
        """Return a copy of a record with custom names in place of paths. A record that occurs in several places is converted only once."""
        if id(old) not in self._made:
            fields = {name: self.value(hint, getattr(old, name)) for name, hint in fields_of(old.__class__).items()}
            rule = self.rules.get(old.__class__)
            self._made[id(old)] = old, replace(old, **(fields if rule is None else rule(old, fields)))
        return self._made[id(old)][1]

    def value(self, hint: Any, old: Any) -> Any:
        """Return a value of the type `hint` with custom names in place of paths."""
        kind = get_origin(hint)
        if old is None:
            return None
        if kind is Annotated:
            (what,) = hint.__metadata__
            return self.named[what].get(old, old) if what in self.named else old
        if isinstance(old, CoordinateName):
            return old.in_files(self.named["joints"].get(old.path, old.path))
        if kind is tuple:
            return tuple(self.value(get_args(hint)[0], item) for item in old)
        if kind is dict:
            of_key, of_value = get_args(hint)
            return {self.value(of_key, key): self.value(of_value, item) for key, item in old.items()}
        if isinstance(old, FrozenStruct):
            return self.record(old) if type(old) not in AS_WRITTEN else old
        return self.value(next(item for item in get_args(hint) if _holds(item, frozenset())), old) if get_args(hint) else old

    # --- rules: the fields of a record that change; `fields` are the fields found by their types ---------------------------

    def _drive(self, driven: JointEdge | TreeJoint | LinkedTendon, fields: dict[str, Any]) -> dict[str, Any]:
        name, mimic_name = self.names.actuators.get(driven.path), self.names.equalities.get(driven.path)
        if not isinstance(driven, LinkedTendon) and driven.mimic is not None and mimic_name is not None:
            fields = {**fields, "mimic": replace(fields["mimic"], name=mimic_name)}
        return fields if driven.actuator is None or name is None else {**fields, "actuator": replace(driven.actuator, name=name)}

    def _closure(self, closure: Closure, fields: dict[str, Any]) -> dict[str, Any]:
        kind = "mounts" if closure.hold else "joints"
        name = None if closure.hold else self.names.equalities.get(closure.path)
        return {**fields, "path": self.named[kind].get(closure.path, closure.path), "name": name}

    def _sensor(self, sensor: LinkedSensor, fields: dict[str, Any]) -> dict[str, Any]:
        names, begin = self.names.sensors, f"{sensor.path}:"
        parts = {path.removeprefix(begin): name for path, name in names.items() if path.startswith(begin)}
        return {**fields, "parts": parts}

    def _attribute(self, attribute: RawAttribute, fields: dict[str, Any]) -> dict[str, Any]:
        path = attribute.path
        if len(path) < 3:
            return fields
        named, name = self.raw.get(path[0], {}), path[1].replace(".", "/")
        thing, colon, part = name.partition(":")  # `knee:mimic` is the equality of a joint, `imu:gyro` a part of a sensor
        name = named.get(name) or (f"{named[thing]}:{part}" if colon and thing in named else path[1])
        return {**fields, "path": (path[0], name, *path[2:])}

    def _element(self, element: RawElement, fields: dict[str, Any]) -> dict[str, Any]:
        attributes = {}
        for name, value in element.attributes.items():
            kind = named_kind(element.attributes, name)
            path = CoordinateName(value.replace("/", ".")).path if kind == "joint" else value
            attributes[name] = self.raw.get(kind or "", {}).get(path, value)
        return {**fields, "attributes": attributes}
