"""The driver: the order of the passes, and nothing else. Read it as a table of contents.

    documents -> spec -> model -> realized model -> graph -> robots (one per mode) -> artifacts
      load     validate  resolve      realize       link      root                  emit
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from typing import TYPE_CHECKING

from thingc.diagnostics import Code, Report, Severity, Stage, shown_path
from thingc.frozen import dataclass
from thingc.memo import Memo
from thingc.slips import did_you_mean

if TYPE_CHECKING:
    from thingc.emit.artifact import Artifacts, Content, Loss
    from thingc.graph.types import Assembly
    from thingc.load import Documents
    from thingc.realize.answers import PartAnswers
    from thingc.realize.lock import Lock
    from thingc.realize.record import PartFailure, PartSchema
    from thingc.realize.service import Decision, GeometryService
    from thingc.realize.store import Store
    from thingc.resolve.model import AssemblyDefinition
    from thingc.robot.types import Robot
    from thingc.spec.doubts import Specs
    from thingc.workspace import Workspace

Progress = Callable[[str, int, int], None]
"""`progress(what, done, total)`: called while parts are modelled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How to compile. `parameters` are texts as on the command line (`{"reach": "120 mm"}`), `choices` texts by dotted path in
    the document (`{"components.foot.part": "feet:Wide"}`); `store` a folder or a URL (None: the user's cache); `jobs` how many parts are
    modelled at once; `part_timeout` [s] (None: the workspace's).

    `lock`: what the store does not hold may come from `parts.lock.json`, for callers who need no meshes. Without `code` it comes
    from there alone: nothing of the workspace is run, and the store is not touched.

    `texts`: what documents hold instead of what is on disk, by absolute path."""

    parameters: Mapping[str, str] = field(default_factory=dict)
    choices: Mapping[str, str] = field(default_factory=dict)
    store: str | None = None
    jobs: int = 0
    part_timeout: float | None = None
    progress: Progress | None = None
    lock: bool = False
    code: bool = True
    texts: Mapping[str, bytes] = field(default_factory=dict)


class UnknownChoice(Exception):
    """A mode or target that is not there: a wrong command line, in words."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


@dataclass(frozen=True, slots=True, kw_only=True)
class Sources:
    """What `resolve` works on: documents, their models, and what the parts that they name take."""

    documents: Documents
    specs: Specs
    schemas: Mapping[str, PartSchema | PartFailure]


class Front:
    """A document and everything about it that no setting changes: its workspace, the documents that it names, their models,
    and what the parts in them take. Many compilations may share one, and with it the store and the geometry service.

    A context manager: leaving it ends the geometry service, unless that was given. Every attribute is None until it has been
    found on sound input; `report` has what was said of the documents themselves, `memo` what passes need not work out again.
    """

    def __init__(self, document: str, options: Options, geometry: GeometryService | None = None) -> None:
        self.document = os.path.abspath(document)
        self.options = options
        self.report = Report()
        self.memo = Memo()
        self.started = time.time_ns()
        self.workspace: Workspace | None = None
        self.documents: Documents | None = None
        self.specs: Specs | None = None
        self.schemas: Mapping[str, PartSchema | PartFailure] = {}
        self._geometry = geometry
        self._lent = geometry is not None
        self._parts: PartAnswers | None = None
        self._lock_report = Report()
        self._store: Store | None = None
        self._read = False
        self._chosen: dict[tuple[frozenset[str], frozenset[str]], tuple[Sources, Report]] = {}

    def __enter__(self) -> Front:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._geometry is not None and not self._lent:
            self._geometry.close()

    @property
    def store(self) -> Store:
        """The content-addressed store."""
        if self._store is None:
            self._store = store_of(self.options)
        return self._store

    @property
    def geometry(self) -> GeometryService:
        """The door to the CAD kernel; only there once a workspace has been found."""
        if self._geometry is None:
            if self.workspace is None:
                raise RuntimeError("the geometry service belongs to a workspace, and none was found")
            if not self.options.code:
                raise RuntimeError("no code of the workspace may run")
            self._geometry = geometry_of(self.workspace, self.options, self.store, self._lock if self.options.lock else None)
        return self._geometry

    @property
    def parts(self) -> PartAnswers:
        """Who answers for parts: the geometry service, or, where no code may run, the lock; once a workspace has been found."""
        if self._parts is None:
            if self.options.code or self.workspace is None:
                self._parts = self.geometry
            else:
                from thingc.realize.locked import LockedGeometry

                self._parts = LockedGeometry(self.workspace, self._lock())
        return self._parts

    def _lock(self) -> Lock | None:
        """The workspace's lock; None where there is none or it is broken, which is said where nothing else may answer."""
        from thingc.realize.lock import read_lock, report_missing

        if self.workspace is None:
            return None
        report = self._lock_report if self.options.code else self.report
        lock = read_lock(self.workspace, report)
        if lock is None and not self.options.code:
            report_missing(self.workspace, report)
        return lock

    def say_gaps(self, report: Report) -> None:
        """What the lock could not tell of the parts realized last, and what is wrong with it: a warning where code may run, for
        then it is not needed."""
        from thingc.realize.answers import report_gaps

        severity = Severity.WARNING if self.options.code else Severity.ERROR
        report.diagnostics.extend(replace(fault, severity=severity) for fault in self._lock_report.diagnostics)
        report_gaps(self.parts, report, severity=severity)

    def read(self, kinds: Sequence[str] = ("assembly",)) -> None:
        """The passes `load` and `validate`, and what the parts that are named take; once, however often it is called."""
        from thingc.load import load
        from thingc.spec import part_references, validate
        from thingc.workspace import Workspace

        if self._read:
            return
        self._read = True
        self.workspace = Workspace.find(self.document, self.report)
        if self.workspace is None:
            return
        self.parts.anticipate()
        self.documents = load(self.document, self.workspace, self.report, kinds=kinds, texts=self.options.texts)
        if self.documents is None:
            return
        self.specs = validate(self.documents, self.report)
        if self.documents.root.kind == "assembly":
            references = part_references(self.specs, self.documents)
            self.schemas = self.parts.describe([reference for reference, _ in references])

    def sources(self, choices: Mapping[str, str], report: Report) -> Sources | None:
        """What there is to resolve, with the documents and parts that `choices` name; what is wrong with those is in `report`.
        None where the document itself could not be read."""
        if self.workspace is None or self.documents is None or self.specs is None:
            return None
        own = Sources(documents=self.documents, specs=self.specs, schemas=self.schemas)
        if not choices:
            return own
        from thingc.resolve.choices import documents_and_parts

        assemblies, parts = documents_and_parts(choices)
        new = Report()
        key = (frozenset(assemblies), frozenset(parts))
        known = self._chosen.get(key)
        if known is None:
            known = self._chosen[key] = (self._widened(own, assemblies, parts, new), new)
        for said in known[1].diagnostics:  # what has no place in a document is said of the choice
            code, path = (said.code, said.path) if said.span is not None else (Code.CHOICE_OPTION, "--set")
            report.add(code, said.message, said.span, help=said.help, path=path, notes=said.notes, severity=said.severity)
        return known[0]

    def _widened(self, own: Sources, assemblies: Sequence[str], parts: Sequence[str], report: Report) -> Sources:
        """`own` and the further assemblies and parts that are named."""
        from thingc.load import load_more
        from thingc.spec import part_references, validate

        assert self.workspace is not None
        documents, specs = own.documents, own.specs
        if assemblies:
            documents = load_more(documents, assemblies, self.workspace, report)
            added = {path: one for path, one in documents.by_path.items() if path not in own.documents.by_path}
            specs = specs.joined(validate(replace(documents, by_path=added), report))
        wanted = [*parts, *(reference for reference, _ in part_references(specs, documents))]
        schemas = {**own.schemas, **self.parts.describe([one for one in wanted if one not in own.schemas])}
        return Sources(documents=documents, specs=specs, schemas=schemas)

    def inputs(self) -> dict[str, str | None] | None:
        """Everything that has been read, by absolute path, with its content's digest (see `stamp.state_of`).

        None where a file changed while it was being read: nobody knows which content the answer is of.
        """
        from thingc.resolve.choices import chosen_files
        from thingc.stamp import state_of

        found: dict[str, str | None] = {}
        if self.workspace is not None:
            found.update(self.workspace.inputs)
        others = set(chosen_files(self.options.choices, self.document)) | (self._parts.inputs if self._parts is not None else set())
        for documents in (self.documents, *(known[0].documents for known in self._chosen.values())):
            if documents is not None:
                found.update({document.path: document.sha256 for document in documents.by_path.values()})
                others |= documents.files
        found.update({path: state_of(path) for path in others if path not in found})
        for path, state in found.items():
            if state is not None and os.stat(path).st_mtime_ns >= self.started:
                return None
        return found


class Compilation:
    """One document, with one choice of settings, on its way through the passes. A context manager: leaving it ends the
    geometry service, unless that belongs to a `front` that was given.

    Every attribute is None until its pass has run on sound input; `report` has what was said. `decisions` are why each part was
    modelled or reused, by definition text.
    """

    def __init__(self, document: str, options: Options, front: Front | None = None) -> None:
        self.options = options
        self.front = front or Front(document, options)
        self.report = Report()
        self.assembly: Assembly | None = None
        self.robots: tuple[Robot, ...] = ()
        self.decisions: Mapping[str, Decision] = {}
        self._lent = front is not None
        self._sources: Sources | None = None

    def __enter__(self) -> Compilation:
        return self

    def __exit__(self, *exception: object) -> None:
        if not self._lent:
            self.front.__exit__(*exception)

    @property
    def document(self) -> str:
        """The absolute path of the document."""
        return self.front.document

    @property
    def workspace(self) -> Workspace | None:
        """The workspace that the document lies in."""
        return self.front.workspace

    @property
    def documents(self) -> Documents | None:
        """The document and those that it names, or choices do."""
        return self._sources.documents if self._sources is not None else self.front.documents

    @property
    def store(self) -> Store:
        """The content-addressed store of this compilation."""
        return self.front.store

    @property
    def geometry(self) -> GeometryService:
        """The door to the CAD kernel; only there once a workspace has been found."""
        return self.front.geometry

    @property
    def modelled(self) -> list[str]:
        """Definition texts of the parts that were modelled just now."""
        return sorted(text for text, decision in self.decisions.items() if not decision.reused)

    @property
    def reused(self) -> list[str]:
        """Definition texts of the parts whose records were in the store."""
        return sorted(text for text, decision in self.decisions.items() if decision.reused)

    def inputs(self) -> dict[str, str | None] | None:
        """Everything that this run has read: see `Front.inputs`."""
        return self.front.inputs()

    def run(self, modes: Sequence[str] = (), *, kinds: Sequence[str] = ("assembly",)) -> None:
        """Every pass up to `root`, for the modes named (none: all). Bad input ends in `report`; raises `UnknownChoice`.

        `kinds` are the kinds of document that are welcome; one of materials is only looked through, one of variants not at all.
        What turns out to be damaged in the store is made anew; only with a `front` that was given that is left to whoever gave it
        (`BlobMissing`).
        """
        from thingc.realize.store import BlobMissing

        try:
            self._run(modes, kinds)
        except BlobMissing:
            if self._lent:
                raise
            self.front.__exit__(None, None, None)
            self.front = Front(self.document, self.options)
            self._run(modes, kinds)

    def _run(self, modes: Sequence[str], kinds: Sequence[str]) -> None:
        from thingc.graph import link, slicings_of
        from thingc.realize.outline import outline
        from thingc.resolve import part_definitions, resolve, resolve_materials
        from thingc.robot import check_starts, root, stand

        front = self.front
        front.read(kinds)
        self.report = report = front.report.continued()
        workspace, sources = front.workspace, front.sources(self.options.choices, report)
        if workspace is None or sources is None:
            return
        self._sources = sources
        report.allowances = sources.specs.allowances
        documents, specs = sources.documents, sources.specs
        if documents.root.kind == "materials":
            resolve_materials(documents, specs, workspace, report)
        if documents.root.kind != "assembly":
            return
        model = resolve(documents, specs, workspace, sources.schemas, self.options.parameters, report, self.options.choices, front.memo)
        if model is None:
            return
        self._check_modes(modes, [mode.name for mode in model.modes], failed=report.failed)
        definitions = part_definitions(model)
        records = front.parts.realize(definitions, convex=_decomposed(model))
        records = front.parts.slice(definitions, records, slicings_of(model, records))
        self.decisions = front.parts.decisions
        front.say_gaps(report)
        linked = link(model, records, report, front.memo)
        if linked is None:
            return
        corners = None if self.options.lock else partial(outline, self.store)
        self.assembly = stand(linked, corners, report, front.memo)
        robots = [root(self.assembly, mode, report, front.memo) for mode in self.assembly.modes if not modes or mode.name in modes]
        self.robots = tuple(robot for robot in robots if robot is not None)
        if not self._lent and not report.failed:
            check_starts(self.robots, corners, report, front.memo)

    def say_unneeded(self, stages: Collection[Stage]) -> None:
        """Say which allowances nothing has needed, after all of these stages; only where nothing is set, for other values may need
        them."""
        if self.assembly is not None and not self.report.failed and not self.options.parameters and not self.options.choices:
            self.report.say_unneeded(self.document, stages)

    def model_again(self) -> int:
        """Model every part once more, in other processes, under another hash seed and with an empty store: those that become something
        else are errors in `report`. How many parts that were. Only for a compilation whose report has no errors."""
        import tempfile

        from thingc.graph.twice import OTHER_SEED, compare, definitions_of
        from thingc.realize.store import Store

        if self.assembly is None or self.workspace is None:
            raise RuntimeError("there is nothing to model again: the compilation failed")
        definitions = definitions_of(self.assembly)
        with (
            tempfile.TemporaryDirectory(prefix="thingc-twice-") as folder,
            geometry_of(self.workspace, self.options, Store(folder), seed=OTHER_SEED) as geometry,
        ):
            compare(self.assembly, geometry.realize(definitions), self.report)
        return len(definitions)

    def _check_modes(self, wanted: Sequence[str], known: Sequence[str], *, failed: bool) -> None:
        for name in wanted:
            if name not in known and not failed:
                raise UnknownChoice(f"`{shown_path(self.document)}` has no mode `{name}`", did_you_mean(name, known, what="modes"))

    def emit(self, targets: Sequence[str], *, verify: bool = True) -> dict[str, Artifacts]:
        """Artifacts per target, in the order asked; each loss with the first target that has it. Only for a compilation whose
        report has no errors.

        Without `verify` MuJoCo is not asked whether it takes the models: for the caller who compiles them anyway.
        """
        from thingc.emit import emitter
        from thingc.emit.request import EmitRequest

        if self.assembly is None or self.workspace is None:
            raise RuntimeError("there is nothing to emit: the compilation failed")
        if verify and not self._lent:
            from thingc.solids import check_overlaps

            check_overlaps(self.assembly, self.store, self.report)
        request = EmitRequest(
            assembly=self.assembly, robots=self.robots, store=self.store, geometry=self.geometry, workspace=self.workspace,
            report=self.report, verify=verify, repeated=self._lent,
            memo=self.front.memo,
        )
        artifacts: dict[str, Artifacts] = {}
        told: dict[Loss, None] = {}
        for target in targets:
            made = emitter(target)(request)
            artifacts[target] = replace(made, losses=tuple(loss for loss in made.losses if loss not in told))
            told |= dict.fromkeys(made.losses)
        return artifacts

    def files(self, artifacts: Mapping[str, Artifacts]) -> dict[str, Content]:
        """What a build folder holds, by path in it: the files of all targets, and the manifest that lists them."""
        from thingc.emit.artifact import MANIFEST
        from thingc.emit.manifest import Choice, manifest

        if self.assembly is None or self.workspace is None or self.documents is None:
            raise RuntimeError("there is nothing to list: the compilation failed")
        files = {path: content for made in artifacts.values() for path, content in made.files.items()}
        files[MANIFEST] = manifest(
            self.assembly,
            document=self.documents.root.relative,
            documents={path: document.sha256 for path, document in self.documents.by_path.items()},
            choice=Choice(
                modes=tuple(robot.mode.name for robot in self.robots), emit=tuple(artifacts),
                parameters=dict(self.options.parameters), choices=dict(self.options.choices),
            ),
            files=files,
            losses=[loss for made in artifacts.values() for loss in made.losses],
            workspace=self.workspace,
        )
        return files


def store_of(options: Options) -> Store:
    """The store that the options name, else the user's."""
    from thingc.realize.shared_store import opened

    return opened(options.store)


def geometry_of(
    workspace: Workspace, options: Options, store: Store | None = None, lock: Callable[[], Lock | None] | None = None, *, seed: int = 0,
) -> GeometryService:
    """The geometry service of a workspace; close it. `lock` reads the lock that may answer beside the store; `seed` is that of the
    workers' hashes."""
    from thingc.realize.service import GeometryService

    return GeometryService(
        workspace,
        store or store_of(options),
        jobs=options.jobs or os.cpu_count() or 1,
        timeout=options.part_timeout or workspace.part_timeout,
        on_progress=options.progress,
        lock=lock,
        seed=seed,
    )


def _decomposed(model: AssemblyDefinition) -> frozenset[str]:
    """The texts of the part definitions of which some component asks for `collision: decompose`."""
    from thingc.realize.record import PartDefinition

    found: set[str] = set()
    waiting, met = [model], {id(model)}
    while waiting:
        for component in waiting.pop().components:
            definition = component.definition
            if isinstance(definition, PartDefinition):
                if component.overrides.collision == "decompose":
                    found.add(definition.text)
            elif definition is not None and id(definition) not in met:
                met.add(id(definition))
                waiting.append(definition)
    return frozenset(found)
