"""Data types for snapshots of robots, and for the changes between two snapshots.

A snapshot contains the values in the documents of a robot, their source locations, and the results of the compilation.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Union, get_args

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import MassProperties
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import Pose
from thingc.base.source import Span
from thingc.geometry.record import PartRecord

What = Literal[
    "component", "joint", "mate", "parameter", "mode", "pose", "material", "sensor", "test", "mass", "geometry", "mount", "bom", "file",
]
WHATS: tuple[What, ...] = get_args(What)
"""Kinds of changes, the most important first."""

How = Literal["added", "removed", "renamed", "moved", "changed"]

DisplayValue = Union[None, bool, int, float, str, tuple["DisplayValue", ...]]
"""A value in a report, in SI units. References to elements are strings, as in documents."""

PERHAPS = "perhaps"
"""Item of `Change.because` that marks an uncertain match."""


class Change(OneLineStruct):
    """A difference between two snapshots of a robot, which concerns the whole robot, one element, or one value.

    Attributes:
        path: The path of the element in the old robot, or in the new robot if it was added.
        new_path: The path in the new robot, if it differs from `path`.
        field: The key whose value changed from `old` to `new` (SI units).
        words: The old and the new value in display units, if their physical dimension is known.
        because: The paths of the changes that caused this change, or an empty tuple for a change by the user. The item `perhaps` marks an
            uncertain match.
        reason: The reason why a renamed element was matched.
        span: The source location in the new document, or in the old document if the element was removed.
    """

    what: What
    change: How
    path: str
    new_path: str | None = None
    field: str | None = None
    old: DisplayValue = None
    new: DisplayValue = None
    because: tuple[str, ...] = ()
    reason: str = ""
    words: tuple[str, str] | None = None
    span: Span | None = None

    @property
    def caused(self) -> bool:
        """Whether this change is a consequence of other changes, and not a change by the user in a document."""
        return any(word != PERHAPS for word in self.because)


PLACES = frozenset({"origin", "origins", "span", "spans"})
"""Fields of structs that contain source locations."""
NOT_COMPARED = PLACES | {"name", "sources", "wrong"}
"""Fields that are not compared: source locations, names, the sources of values, and invalid values."""


class Named(OneLineStruct):
    """A reference to an element of the robot by its path, or to a mount of a component."""

    what: What
    path: str
    mount: str | None = None

    @property
    def text(self) -> str:
        """The reference as it is written in the top-level document, such as `hand.cap.pen`."""
        return ".".join(word for word in (*self.path.split("/"), self.mount) if word)


Value = Union[None, bool, int, float, str, Named, tuple["Value", ...]]
"""The value of a property, in SI units."""


class Fact(OneLineStruct):
    """The value of a property, which is compared between the old and the new robot.

    `written` is the text of the value in the document, or None if the document does not contain the value. `scope` is the path of the
    assembly in which the names of an expression are resolved. `words` is the value in display units, if the physical dimension is known.
    """

    value: Value
    written: str | None = None
    words: str | None = None
    scope: str = ""
    span: Span | None = None


class SnapshotElement(OneLineStruct):
    """An element of a document, such as a joint or a mount.

    `facts` are the properties of the element, keyed by dotted names such as `limit.upper`. `label` is the description of the element in
    reports. `of` is the path of the component to which the element belongs, or an empty string for an element of the whole document.
    """

    what: What
    path: str
    facts: Mapping[str, Fact] = {}
    label: str | None = None
    of: str = ""
    span: Span | None = None


class ComponentNode(OneLineStruct):
    """A component with the properties that `match` uses to match components of two robots.

    `kind` is `part`, `file`, `assembly`, `link` or `frame`. `reference` is the class, file or document of the component, and `text` is the
    definition of the component. `place` is the pose of the component in the frame of the base at q = 0, or None for an assembly.
    """

    path: str
    kind: str
    reference: str
    text: str
    place: Pose | None

    @property
    def parent(self) -> str:
        """The path of the assembly that contains the component, or an empty string at the top level."""
        return self.path.rpartition("/")[0]


class Edge(OneLineStruct):
    """A mate between the mounts of two components. The components are given by their paths.

    `joint` is the kind of the joint, `fixed`, or an empty string if the mate is not a joint.
    """

    parent: str
    child: str
    mounts: tuple[str, str]
    joint: str


class OccurrenceSnapshot(OneLineStruct):
    """A part or frame of the linked assembly, with its mass properties, geometry and pose.

    Attributes:
        properties: The mass properties in the frame of the occurrence, such as `mass` [kg].
        source: The source of the mass, such as `estimated`.
        shape: The record of the part, or None for an occurrence without geometry.
        mounts: The mounts of the occurrence's part.
        place: The pose of the occurrence in the frame of the base at q = 0.
        parent: The path of the occurrence to which this occurrence is attached, or None for the base.
        joint: The joint that attaches the occurrence, or None for a rigid mate.
    """

    path: str
    definition: str
    properties: MassProperties | None = None
    mass: float = 0.0
    source: str = ""
    shape: PartRecord | None = None
    mounts: Mapping[str, Pose] = {}
    place: Pose | None = None
    parent: str | None = None
    joint: str | None = None
    material: str | None = None


class LinkOf(OneLineStruct):
    """A link of a robot in a snapshot.

    The link has a name, the occurrence that defines the frame of the link, all occurrences of the link, and mass properties.
    """

    name: str
    frame: str
    members: tuple[str, ...]
    properties: MassProperties


class Row(OneLineStruct):
    """A row of the bill of materials: a part definition, the number of equal parts, and the paths of these parts.

    `stem` is the name of the print file without a suffix, or None if the row has no print file.
    """

    definition: str
    number: str
    quantity: int
    make: str
    material: str | None
    members: tuple[str, ...]
    stem: str | None = None


class TestOutcome(OneLineStruct):
    """The result of a document test in one mode and pose, which `where` specifies.

    `measured` maps the names of measured values to numbers in SI units.
    """

    test: str
    where: str
    passed: bool
    measured: Mapping[str, float]


class Snapshot(OneLineStruct):
    """A snapshot of a robot, which can be compared with another snapshot of the same robot.

    `things` maps the kind and path of each element to the element, in document order. `lacks` lists the kinds of information that the
    snapshot does not contain. `coordinates` lists the joint coordinates of each mode in the order of the model. `prints` maps the paths of
    print files to SHA-256 hashes, only in snapshots of build folders. `outcomes` is None if no tests were run.
    """

    name: str
    nodes: tuple[ComponentNode, ...] = ()
    edges: tuple[Edge, ...] = ()
    things: Mapping[tuple[What, str], SnapshotElement] = {}
    occurrences: Mapping[str, OccurrenceSnapshot] = {}
    links: tuple[LinkOf, ...] = ()
    whole: MassProperties | None = None
    rows: tuple[Row, ...] = ()
    coordinates: Mapping[str, tuple[str, ...]] = {}
    prints: Mapping[str, str] = {}
    outcomes: tuple[TestOutcome, ...] | None = None
    lacks: frozenset[str] = frozenset()


def display_value(value: Value) -> DisplayValue:
    """Convert a value in a snapshot to the corresponding value in a report."""
    if isinstance(value, Named):
        return value.text
    return tuple(map(display_value, value)) if isinstance(value, tuple) else value


def field_values(key: str, kind: type[FrozenStruct], of: FrozenStruct | None) -> dict[str, Any]:
    """Return the values of the fields of a struct, except the fields in `NOT_COMPARED`.

    Each key starts with `key` and a dot: the fields of `limit` have keys such as `limit.upper`. If `of` is None, all values are None.
    """
    return {f"{key}.{name}": getattr(of, name, None) for name in kind.__struct_fields__ if name not in NOT_COMPARED}
