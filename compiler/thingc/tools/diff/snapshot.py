"""A robot as it is compared: what stands in its documents as facts with their places, what comes of them, and changes of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Union, get_args

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import MassProperties
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.pose import Matrix, Pose, Vector
from thingc.base.source import Span

What = Literal[
    "component", "joint", "mate", "parameter", "mode", "pose", "material", "sensor", "test", "mass", "geometry", "mount", "bom", "file",
]
WHATS: tuple[What, ...] = get_args(What)
"""What a change may be of, the most important first where they are told."""

How = Literal["added", "removed", "renamed", "moved", "changed"]

DisplayValue = Union[None, bool, int, float, str, tuple["DisplayValue", ...]]
"""A value as an answer tells it: SI, names as documents write them."""

PERHAPS = "perhaps"
"""What `because` has of a match that is doubtful."""


class Change(OneLineRepr, FrozenStruct):
    """`path` is the occurrence, joint, mode, ... in the old robot (of what is added in the new one), `new_path` in the new one where it is
    called otherwise there. `field` is the key whose value was `old` and is `new` (SI; `words` both for people, where their dimension is
    known). `because` are paths of the changes that caused it: empty for what somebody changed himself. `reason` says by what
    something renamed was known, and a match that is doubtful has `perhaps` among its causes. `span` is where the new robot says it, of
    what is removed the old one."""

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
        """Whether it is the consequence of other changes."""
        return any(word != PERHAPS for word in self.because)


PLACES = frozenset({"origin", "origins", "span", "spans"})
"""Fields of structs that say where something is written."""
NOT_COMPARED = PLACES | {"name", "sources", "wrong"}
"""These, and fields that say what something is called, where its numbers come from, or that it could not be read."""


class Named(OneLineRepr, FrozenStruct):
    """The name of something of the robot: the component, joint, pose, ... `path`, and of a component perhaps one of its mounts."""

    what: What
    path: str
    mount: str | None = None

    @property
    def text(self) -> str:
        """As a document writes it, from the top: `hand.cap.pen`."""
        return ".".join(word for word in (*self.path.split("/"), self.mount) if word)


Value = Union[None, bool, int, float, str, Named, tuple["Value", ...]]
"""What a fact comes to: SI."""


class Fact(OneLineRepr, FrozenStruct):
    """A value, as it is `written` in its document where it is written there, and the path of the assembly whose parameters the names of
    an expression mean (`scope`). `words` is the value for people, where its own dimension is known."""

    value: Value
    written: str | None = None
    words: str | None = None
    scope: str = ""
    span: Span | None = None


class SnapshotElement(OneLineRepr, FrozenStruct):
    """Something that a document states, with its facts by dotted key. `label` says for people what it is; `of` is the path of the component
    that it belongs to, empty for what is of the whole document."""

    what: What
    path: str
    facts: Mapping[str, Fact] = {}
    label: str | None = None
    of: str = ""
    span: Span | None = None


class ComponentNode(OneLineRepr, FrozenStruct):
    """A component to be known again: `kind` is `part | file | assembly | frame`, `reference` its class, file or document, `text` its
    definition, `place` where its frame is at q = 0 in the base's (None: an assembly)."""

    path: str
    kind: str
    reference: str
    text: str
    place: Pose | None

    @property
    def parent(self) -> str:
        """The path of the assembly that it stands in; empty for the top."""
        return self.path.rpartition("/")[0]


class Edge(OneLineRepr, FrozenStruct):
    """Two components that meet, by path: `mounts` are the names of the mounts, `joint` the kind of what moves there, if anything does."""

    parent: str
    child: str
    mounts: tuple[str, str]
    joint: str


class PartShape(OneLineRepr, FrozenStruct):
    """The geometry of a part: volume [m^3], area [m^2], centre [m], inertia at density 1 [m^5], the corners of its box [m]; `mesh` is the
    SHA-256 of what is drawn of it (None: not known here), `made` where its code stands."""

    volume: float
    area: float
    centre: Vector
    inertia: Matrix
    box: tuple[Vector, Vector]
    mesh: str | None = None
    made: Span | None = None


class OccurrenceSnapshot(OneLineRepr, FrozenStruct):
    """What came of a part or frame: its mass in its own frame and where that is from, its shape (None: it has none), mounts of its part
    by name, and its place at q = 0. It hangs on `parent` (None: the base) by the joint `joint` (None: rigidly)."""

    path: str
    definition: str
    properties: MassProperties | None = None
    mass: float = 0.0
    source: str = ""
    shape: PartShape | None = None
    mounts: Mapping[str, Pose] = {}
    place: Pose | None = None
    parent: str | None = None
    joint: str | None = None
    material: str | None = None


class LinkOf(OneLineRepr, FrozenStruct):
    """A link by its name: the occurrence whose frame it has, its members, and its mass in its frame."""

    name: str
    frame: str
    members: tuple[str, ...]
    properties: MassProperties


class Row(OneLineRepr, FrozenStruct):
    """A line of the bill of materials: how many of a definition, and who they are. `stem` is what its print file is called (None: it has
    none)."""

    definition: str
    number: str
    quantity: int
    make: str
    material: str | None
    members: tuple[str, ...]
    stem: str | None = None


class TestOutcome(OneLineRepr, FrozenStruct):
    """What a test came to in one mode and pose: whether it passed, and what was measured, by name (SI)."""

    test: str
    where: str
    passed: bool
    measured: Mapping[str, float]


class Snapshot(OneLineRepr, FrozenStruct):
    """A robot, ready to be compared. `things` by what they are and path, in document order; `lacks` says in words what is not known of it.

    `coordinates` are the joints of every mode in the order in which its model has them, `prints` the SHA-256 of print files by path,
    of a build folder. `outcomes` is None where no tests were run."""

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


def told(value: Value) -> DisplayValue:
    """A value as an answer has it."""
    if isinstance(value, Named):
        return value.text
    return tuple(map(told, value)) if isinstance(value, tuple) else value


def field_values(key: str, kind: type[FrozenStruct], of: FrozenStruct | None) -> dict[str, Any]:
    """The fields of a struct of a kind by dotted key, without those that say where it is written. Without a struct each is None."""
    return {f"{key}.{name}": getattr(of, name, None) for name in kind.__struct_fields__ if name not in NOT_COMPARED}
