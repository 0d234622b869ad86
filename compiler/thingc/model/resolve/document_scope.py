"""The state of the pass `resolve` for each document: resolved elements, the definition, and the names of invalid elements."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

from pydantic import BaseModel

from thingc.base.diagnostics import Code, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.source import SET, Document, Path
from thingc.base.suggestions import Hint
from thingc.base.units import Quantity
from thingc.documents.expressions.evaluation import ExpressionValue
from thingc.documents.expressions.terms import Expression
from thingc.documents.load.documents import Documents
from thingc.documents.spec.assembly import AssemblySpec, ComponentSpec
from thingc.documents.spec.invalid_entries import NO_DOUBTS, InvalidEntries, Specs
from thingc.documents.workspace import Workspace
from thingc.geometry.record import PartDefinition, PartFailure, PartSchema, Value
from thingc.geometry.store.file_digests import digest_of
from thingc.model.resolve import types as resolved
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.link_definition import LinkDefinition
from thingc.model.resolve.scope import NOTHING, Scope

Named = TypeVar("Named", resolved.Component, resolved.Joint)
Answer = TypeVar("Answer")


@dataclass(slots=True, kw_only=True)
class ComponentScope:
    """A component of a document that is being resolved.

    `table` contains the resolved elements of the nested document, or is None if the component is not a nested assembly. `shapes` contains
    the collision shapes that the document lists for a part, by their path below `collision`. `unsound` is True if a value that later passes
    need is invalid, and `unplaced` is True if only the placement is invalid. `incomplete` is True if validation removed invalid entries.
    `chosen` contains the keys whose values come from `--set` options.
    """

    name: str
    spec: ComponentSpec
    path: Path
    scope: Scope
    definition: PartDefinition | LinkDefinition | resolved.AssemblyDefinition | None = None
    table: DocumentScope | None = None
    shapes: dict[resolved.ChoicePath, LinkDefinition] = field(default_factory=dict)
    mounts: dict[str, resolved.ExtraMount] = field(default_factory=dict)
    unsound: bool = False
    unplaced: bool = False
    incomplete: bool = False
    chosen: frozenset[str] = frozenset()

    @property
    def frame(self) -> bool:
        """Whether the component has no geometry."""
        return self.spec.frame is True

    @property
    def bare(self) -> str | None:
        """`frame` or `link` for a frame or a link, whose mounts are all in the document. None for a part and an assembly."""
        return "frame" if self.frame else "link" if self.spec.link is not None else None


@dataclass(slots=True, kw_only=True)
class DocumentScope:
    """The resolved elements of a document with one set of parameters.

    In `exports`, `joints`, `motions` and `poses`, None represents an invalid element.

    `parameters` also contains the `--set` options for values and components of the document. `unbuilt` and `unbuilt_joints` contain the
    prefixes (`leg_`) of repeats that could not be unrolled. `occurrences` is the number of parts, links and frames in the document and its
    nested documents. `base` is the name of the base component. `loose` contains the valid references of elements that were omitted because
    of another, invalid reference. `coupled` contains the drives of differentials. `images` contains the mirror images of the definition,
    keyed by axis. `by_mode` contains the modes in which nested assemblies are placed, by component.
    `has_modes` is True if the document or a document below it contains such an assembly.
    """

    document: Document
    spec: AssemblySpec
    scope: Scope
    parameters: tuple[tuple[str, Value], ...]
    text: str
    label: str
    choices: tuple[tuple[str, str], ...] = ()
    materials_unreadable: bool = False
    materials: dict[str, resolved.Material | None] = field(default_factory=dict)
    nodes: dict[str, ComponentScope] = field(default_factory=dict)
    unbuilt: list[str] = field(default_factory=list)
    unbuilt_joints: list[str] = field(default_factory=list)
    exports: dict[str, resolved.Reference | None] = field(default_factory=dict)
    joints: dict[CoordinateName, resolved.Joint | None] = field(default_factory=dict)
    coupled: list[resolved.Tendon] = field(default_factory=list)
    poses: dict[str, resolved.NamedPose | None] = field(default_factory=dict)
    motions: dict[str, resolved.NamedMotion | None] = field(default_factory=dict)
    base: str | None = None
    loose: list[resolved.Reference] = field(default_factory=list)
    occurrences: int = 0
    definition: resolved.AssemblyDefinition | None = None
    images: dict[str, resolved.AssemblyDefinition] = field(default_factory=dict)
    by_mode: dict[str, resolved.Mode] = field(default_factory=dict)
    has_modes: bool = False

    @property
    def doubts(self) -> InvalidEntries:
        """The locations of entries that validation removed from the document because they are invalid."""
        return self.scope.doubts

    @property
    def key(self) -> tuple[str, tuple[tuple[str, Value], ...]]:
        """The cache key of the resolved document: the path of the document and the values of its parameters."""
        return self.document.relative, self.parameters

    def all_tables(self) -> Iterator[tuple[str, DocumentScope]]:
        """Yield the scope of this document with an empty prefix, and that of each nested document with the prefix of its names (`hand.`).

        If a document is nested several times, its scope is yielded several times.
        """
        yield "", self
        yield from ((f"{path}.", node.table) for path, node in self.all_nodes() if node.table is not None)

    def all_joints(self) -> Iterator[tuple[CoordinateName, resolved.Joint | None]]:
        """Yield the name of every joint, with dots, and the joint.

        The joint is None if it is invalid. Joints of nested documents come last.
        """
        for prefix, table in self.all_tables():
            yield from ((CoordinateName(prefix + name) if prefix else name, joint) for name, joint in table.joints.items())

    def all_nodes(self) -> Iterator[tuple[str, ComponentScope]]:
        """Yield every component with its path, in which names are separated by dots. Parents precede their children."""
        for node in self.nodes.values():
            yield node.name, node
            if node.table is not None:
                yield from ((f"{node.name}.{path}", inner) for path, inner in node.table.all_nodes())

    def all_modes(self) -> Iterator[tuple[str, DocumentScope, resolved.Mode]]:
        """Yield the path of each nested assembly that is placed in a mode, with dots, its scope and the mode.

        Modes below such an assembly are part of its mode.
        """
        for node in self.nodes.values():
            if node.table is not None and node.name in self.by_mode:
                yield node.name, node.table, self.by_mode[node.name]
            elif node.table is not None and node.table.has_modes:  # otherwise, equal nested documents would be searched many times
                yield from ((f"{node.name}.{path}", inner, mode) for path, inner, mode in node.table.all_modes())

    def may_lack_joints(self) -> bool:
        """Return whether joints may be missing because of errors.

        If joints may be missing, a pattern that does not match any joint is not reported.
        """
        return bool(self.unbuilt or self.unbuilt_joints) or any(
            node.unsound or node.unplaced or (node.table is not None and node.table.may_lack_joints()) for node in self.nodes.values()
        )


class ParameterValues(FrozenStruct):
    """The valid values of the parameters of a document, and the names of the parameters with invalid values."""

    values: Mapping[str, ExpressionValue]
    broken: frozenset[str]


@dataclass(slots=True, kw_only=True)
class ResolveRun:
    """One run of `resolve`: its inputs, its results, and the reported errors.

    `tables` contains the scope of each document by its key, so that equal definitions are the same object. `nesting` contains the documents
    that are being resolved, outermost first, and `route` contains the components that nest these documents. All scopes share `reported`,
    the set of reported errors. `overfull` is True if the error about too many occurrences has been reported. `digest` is a function
    that returns the SHA-256 of a file. `quantities` is copied from the `Settings` of the compilation.
    """

    documents: Documents
    specs: Specs
    workspace: Workspace
    schemas: Mapping[str, PartSchema | PartFailure]
    report: Report
    tables: dict[tuple[str, tuple[tuple[str, Value], ...]], DocumentScope] = field(default_factory=dict)
    declared: dict[str, ParameterValues] = field(default_factory=dict)
    nesting: list[str] = field(default_factory=list)
    route: list[str] = field(default_factory=list)
    parts: dict[str, PartDefinition] = field(default_factory=dict)
    failed_parts: set[str] = field(default_factory=set)
    materials: dict[str, dict[str, resolved.Material | None]] = field(default_factory=dict)
    reported: set[tuple[str, Code, Path, bool]] = field(default_factory=set)
    overfull: bool = False
    recalled: Mapping[tuple[str, tuple[tuple[str, Value], ...]], DocumentScope] = field(default_factory=dict)
    memo: Memo = field(default_factory=Memo)
    nested_memo: Memo = field(default_factory=Memo)
    digest: Callable[[str], str] = digest_of
    quantities: Mapping[str, Quantity] = field(default_factory=dict)

    def recall(self) -> None:
        """Reuse results of the last run whose inputs have not changed: resolved nested documents and materials documents."""
        results = self.memo.last("resolve", (self.specs, self.schemas))
        if results is not None:
            self.recalled, declared, materials = results
            self.declared.update(declared)
            self.materials.update(materials)
        else:
            self.recalled = self.nested_memo.last(("nested", self.documents.root.relative), self._nested_inputs()) or {}

    def _nested_inputs(self) -> tuple[object, ...]:
        """Return the data on which the resolution of nested documents depends, for comparison with the last run."""
        root = self.documents.root
        return {path: document for path, document in self.documents.by_path.items() if document is not root}, self.schemas, self.workspace

    def table(self, key: tuple[str, tuple[tuple[str, Value], ...]]) -> DocumentScope | None:
        """Return the cached scope of a document with these parameters, from this run or from the last run.

        Return None if there is no cached scope.
        """
        cached = self.tables.get(key)
        if cached is None and key in self.recalled:
            cached = self.recalled[key]
            self.tables.update((table.key, table) for _, table in cached.all_tables())
        return cached

    def values(self, scope: Scope, place: str, model: object) -> tuple[ExpressionValue | None, ...]:
        """Return the values of all names that occur in the expressions of a section of a document."""
        names = self.memo(("names", scope.document.relative, place), names_in, model)
        return tuple(scope.names.get(name) for name in names)

    def component_inputs(self, table: DocumentScope) -> list[tuple[object, ...]]:
        """Return the properties of components that influence the resolution of references."""
        return [
            (node.name, node.spec, node.unsound, node.unplaced, node.definition if node.table is not None else node.definition is None)
            for node in table.nodes.values()
        ]

    def around(self, table: DocumentScope) -> tuple[object, ...]:
        """Return the elements of other sections that a section can refer to, without the numeric values of these elements."""
        return (
            self.component_inputs(table),
            [
                (name, joint and (joint.kind.name, joint.drive is not None, joint.mimic is not None, joint.loop))
                for name, joint in table.joints.items()
            ],
            dict(table.exports), list(table.poses), list(table.motions), table.base, [(path, mode) for path, _, mode in table.all_modes()],
        )

    def sound(self, place: Hashable, inputs: tuple[object, ...], make: Callable[[], Answer]) -> Answer:
        """Return the result of the function `make`, or its cached result if `inputs` are the same as in the last run.

        `place` identifies the result in the cache. Results are not cached if diagnostics were reported.
        """
        result: Answer | None = self.memo.last(place, inputs)
        if result is None:
            result = make()
            if not self.report.diagnostics:
                self.memo.keep(place, inputs, result)
        return result

    def same(self, section: str, document: str, elements: Iterable[Named]) -> tuple[Named, ...]:
        """Return the elements, with each element that equals an element of the last run replaced by the object of the last run.

        `section` identifies the elements in the cache. Because unchanged elements are identical objects, later passes can use cached
        results.
        """
        return tuple(self.memo.same((section, document, *self.route, element.name), element) for element in elements)

    def remember(self, top: DocumentScope) -> None:
        """Cache the resolved nested documents for the next run, unless diagnostics were reported.

        If all diagnostics are in the top document, resolved nested documents are still cached for other versions of the top document. After
        failed parts or suppressed warnings, nothing is cached, because the next run must report them again.
        """
        tables = {table.key: table for prefix, table in top.all_tables() if prefix}
        spans = [diagnostic.span for diagnostic in self.report.diagnostics]
        top_file = self.documents.root.path
        if not (self.failed_parts or self.report.allowed) and all(span is not None and span.file == top_file for span in spans):
            self.nested_memo.keep(("nested", self.documents.root.relative), self._nested_inputs(), tables)
        if not spans:
            self.memo.keep("resolve", (self.specs, self.schemas), (tables, self.declared, self.materials))

    def from_top(self, path: str) -> str:
        """Convert a path in the current document to a path that begins in the top document."""
        return ".".join((*(f"components.{name}" for name in self.route), path))

    def report_option_error(self, path: str, message: str, help: Hint | None) -> None:
        """Report an error in the option `--set` whose path is `path` in the current document."""
        self.report.add(Code.CHOICE_OPTION, message, None, path=f"{SET}{self.from_top(path)}", help=help)

    def scope(self, document: Document, names: Mapping[str, ExpressionValue], broken: frozenset[str] = NOTHING) -> Scope:
        """Create a scope for expressions in a document. Errors in expressions are added to the report of this run."""
        doubts = self.doubts(document)
        return Scope(document=document, report=self.report, names=names, broken=broken, reported=self.reported, doubts=doubts)

    def doubts(self, document: Document) -> InvalidEntries:
        """Return the locations of entries that validation removed from a document because they are invalid."""
        return self.specs.doubts.get(document.relative, NO_DOUBTS)


def names_in(*models: object) -> tuple[str, ...]:
    """Return the names that expressions in these models use. Only the values of these names influence the evaluation of the models."""
    names: set[str] = set()
    waiting = list(models)
    for value in waiting:
        if isinstance(value, Expression):
            names.update(use.name for use in value.names)
        elif isinstance(value, BaseModel):
            waiting.extend(inner for inner in vars(value).values() if inner is not None)  # most values are None
        elif isinstance(value, Mapping):
            waiting.extend(value.values())
        elif isinstance(value, (list, tuple)):
            waiting.extend(value)
    return tuple(sorted(names))
