"""What resolving knows of a document beyond the model it makes: also the names of what was wrong, so that a mistake is
reported once and not again by everything that refers to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from thingc.diagnostics import Code, Report
from thingc.realize.record import PartDefinition, PartFailure, PartSchema, Value
from thingc.resolve.model import AssemblyDefinition, ExtraMount, Joint, Material, NamedPose, Reference
from thingc.resolve.scope import NOTHING, Found, Scope
from thingc.source import Document, Path
from thingc.spec.doubts import NO_DOUBTS, Doubts

if TYPE_CHECKING:
    from thingc.load import Documents
    from thingc.spec.assembly import AssemblySpec, ComponentSpec
    from thingc.spec.doubts import Specs
    from thingc.workspace import Workspace


@dataclass(slots=True, kw_only=True)
class Node:
    """A component while its document is resolved. `table` is that of the nested document, None for parts and frames;
    `unsound`: something that later passes need was wrong; `doubtful`: validation has left something of it out."""

    name: str
    spec: ComponentSpec
    path: Path
    scope: Scope
    definition: PartDefinition | AssemblyDefinition | None = None
    table: Table | None = None
    mounts: dict[str, ExtraMount] = field(default_factory=dict)
    unsound: bool = False
    doubtful: bool = False

    @property
    def frame(self) -> bool:
        """Whether it is a component without geometry."""
        return self.spec.frame is True


@dataclass(slots=True, kw_only=True)
class Table:
    """One document with one set of parameters. In `exports`, `joints` and `poses` None stands for one that was wrong.

    `unbuilt` and `unbuilt_joints` are the prefixes (`leg_`) of repeats that could not be unrolled; `occurrences` counts
    the leaves; `base` is the name of the base component.
    """

    document: Document
    spec: AssemblySpec
    scope: Scope
    parameters: tuple[tuple[str, Value], ...]
    text: str
    materials: dict[str, Material | None] = field(default_factory=dict)
    nodes: dict[str, Node] = field(default_factory=dict)
    unbuilt: list[str] = field(default_factory=list)
    unbuilt_joints: list[str] = field(default_factory=list)
    exports: dict[str, Reference | None] = field(default_factory=dict)
    joints: dict[str, Joint | None] = field(default_factory=dict)
    poses: dict[str, NamedPose | None] = field(default_factory=dict)
    base: str | None = None
    occurrences: int = 0
    definition: AssemblyDefinition | None = None

    @property
    def doubts(self) -> Doubts:
        """What validation has left out of the document."""
        return self.scope.doubts

    def all_joints(self) -> Iterator[tuple[str, Joint | None]]:
        """Every joint with its path in dots, nested ones after this document's own; None for one that was wrong."""
        yield from self.joints.items()
        for node in self.nodes.values():
            if node.table is not None:
                for path, joint in node.table.all_joints():
                    yield f"{node.name}.{path}", joint

    def all_nodes(self) -> Iterator[tuple[str, Node]]:
        """Every component with its path in dots, parents before what is inside them."""
        for node in self.nodes.values():
            yield node.name, node
            if node.table is not None:
                for path, inner in node.table.all_nodes():
                    yield f"{node.name}.{path}", inner

    def unsure_joints(self) -> bool:
        """Whether joints may be missing here because something was wrong: then a pattern without a match is no news."""
        return bool(self.unbuilt or self.unbuilt_joints) or any(
            node.unsound or (node.table is not None and node.table.unsure_joints()) for node in self.nodes.values()
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Declared:
    """The parameters of a document with nothing set: their values (absent where wrong), and the names that were wrong."""

    values: Mapping[str, Found]
    broken: frozenset[str]


@dataclass(slots=True, kw_only=True)
class Context:
    """One run of `resolve`: its inputs, and what has been worked out or reported already.

    `tables` is keyed by document and canonical parameters (equal definitions are one object); `nesting` holds the
    documents being resolved, outermost first; `said` is that of every scope; `overfull`: too many occurrences were reported.
    """

    documents: Documents
    specs: Specs
    workspace: Workspace
    schemas: Mapping[str, PartSchema | PartFailure]
    report: Report
    tables: dict[tuple[str, tuple[tuple[str, Value], ...]], Table] = field(default_factory=dict)
    declared: dict[str, Declared] = field(default_factory=dict)
    nesting: list[str] = field(default_factory=list)
    parts: dict[tuple[str, tuple[tuple[str, Value], ...]], PartDefinition] = field(default_factory=dict)
    failed_parts: set[str] = field(default_factory=set)
    materials: dict[str, dict[str, Material | None]] = field(default_factory=dict)
    said: set[tuple[str, Code, Path, bool]] = field(default_factory=set)
    overfull: bool = False

    def scope(self, document: Document, names: Mapping[str, Found], broken: frozenset[str] = NOTHING) -> Scope:
        """A scope that reports to this run."""
        return Scope(
            document=document, report=self.report, names=names, broken=broken, said=self.said, doubts=self.doubts(document),
        )

    def doubts(self, document: Document) -> Doubts:
        """What validation has left out of a document."""
        return self.specs.doubts.get(document.relative, NO_DOUBTS)
