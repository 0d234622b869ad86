"""The driver: the order of the passes, and nothing else. Read it as a table of contents.

    documents -> spec -> model -> realized model -> graph -> robots (one per mode) -> artifacts
      load     validate  resolve      realize       link      root                  emit
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from thingc.diagnostics import Report, did_you_mean, shown_path

if TYPE_CHECKING:
    from thingc.emit.artifact import Artifacts
    from thingc.graph.types import Assembly
    from thingc.load import Documents
    from thingc.realize.service import Decision, GeometryService
    from thingc.realize.store import Store
    from thingc.resolve.model import AssemblyDefinition
    from thingc.robot.types import Robot
    from thingc.workspace import Workspace

Progress = Callable[[str, int, int], None]
"""`progress(what, done, total)`: called while parts are modelled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How to compile. `parameters` are texts as on the command line (`{"reach": "120 mm"}`); `store` a folder (None: the
    user's cache); `jobs` how many parts are modelled at once; `part_timeout` [s] (None: the workspace's)."""

    parameters: Mapping[str, str] = field(default_factory=dict)
    store: str | None = None
    jobs: int = 0
    part_timeout: float | None = None
    progress: Progress | None = None


class UnknownChoice(Exception):
    """A mode or target that is not there: a wrong command line, in words."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class Compilation:
    """One document on its way through the passes. A context manager: leaving it ends the geometry service.

    Every attribute is None until its pass has run on sound input; `report` has what was said.
    """

    def __init__(self, document: str, options: Options) -> None:
        self.document = os.path.abspath(document)
        self.options = options
        self.report = Report()
        self._started = time.time_ns()
        self.workspace: Workspace | None = None
        self.documents: Documents | None = None
        self.assembly: Assembly | None = None
        self.robots: tuple[Robot, ...] = ()
        self._geometry: GeometryService | None = None
        self._store: Store | None = None

    def __enter__(self) -> Compilation:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._geometry is not None:
            self._geometry.close()

    @property
    def store(self) -> Store:
        """The content-addressed store of this compilation."""
        if self._store is None:
            self._store = store_of(self.options)
        return self._store

    @property
    def geometry(self) -> GeometryService:
        """The door to the CAD kernel; only there once a workspace has been found."""
        if self._geometry is None:
            if self.workspace is None:
                raise RuntimeError("the geometry service belongs to a workspace, and none was found")
            self._geometry = geometry_of(self.workspace, self.options, self.store)
        return self._geometry

    @property
    def modelled(self) -> list[str]:
        """Definition texts of the parts that were modelled just now."""
        return sorted(self._geometry.modelled) if self._geometry is not None else []

    @property
    def reused(self) -> list[str]:
        """Definition texts of the parts whose records were in the store."""
        return sorted(self._geometry.reused) if self._geometry is not None else []

    @property
    def decisions(self) -> Mapping[str, Decision]:
        """Why each part was modelled or reused, by definition text."""
        return self._geometry.decisions if self._geometry is not None else {}

    def inputs(self) -> dict[str, str | None] | None:
        """Everything that this run has read, by absolute path, with its content's digest (see `stamp.state_of`).

        None where a file changed while the run was reading: nobody knows which content its answer is of.
        """
        from thingc.stamp import state_of

        found: dict[str, str | None] = {}
        if self.workspace is not None:
            found.update(self.workspace.inputs)
        if self.documents is not None:
            found.update({document.path: document.sha256 for document in self.documents.by_path.values()})
        if self._geometry is not None:
            found.update({path: state_of(path) for path in self._geometry.inputs if path not in found})
        for path, state in found.items():
            if state is not None and os.stat(path).st_mtime_ns >= self._started:
                return None
        return found

    def run(self, modes: Sequence[str] = (), *, kinds: Sequence[str] = ("assembly",)) -> None:
        """Every pass up to `root`, for the modes named (none: all). Bad input ends in `report`; raises `UnknownChoice`.

        `kinds` are the kinds of document that are welcome; one of materials is only looked through.
        """
        from thingc.graph import link
        from thingc.load import load
        from thingc.resolve import part_definitions, resolve, resolve_materials
        from thingc.robot import root
        from thingc.spec import part_references, validate
        from thingc.workspace import Workspace

        report = self.report
        self.workspace = Workspace.find(self.document, report)
        if self.workspace is None:
            return
        self.geometry.anticipate()
        self.documents = load(self.document, self.workspace, report, kinds=kinds)
        if self.documents is None:
            return
        specs = validate(self.documents, report)
        if self.documents.root.kind == "materials":
            resolve_materials(self.documents, specs, self.workspace, report)
            return
        references = part_references(specs, self.documents)
        schemas = self.geometry.describe([reference for reference, _ in references])
        model = resolve(self.documents, specs, self.workspace, schemas, self.options.parameters, report)
        if model is None:
            return
        self._check_modes(modes, [mode.name for mode in model.modes], failed=report.failed)
        definitions = part_definitions(model)
        records = self.geometry.realize(definitions, convex=_decomposed(model))
        self.assembly = link(model, records, report)
        if self.assembly is None:
            return
        robots = [root(self.assembly, mode, report) for mode in self.assembly.modes if not modes or mode.name in modes]
        self.robots = tuple(robot for robot in robots if robot is not None)

    def _check_modes(self, wanted: Sequence[str], known: Sequence[str], *, failed: bool) -> None:
        for name in wanted:
            if name not in known and not failed:
                raise UnknownChoice(f"`{shown_path(self.document)}` has no mode `{name}`", did_you_mean(name, known, what="modes"))

    def emit(self, targets: Sequence[str]) -> dict[str, Artifacts]:
        """Artifacts per target, in the order asked. Only for a compilation whose report has no errors."""
        from thingc.emit import emitter
        from thingc.emit.request import EmitRequest

        if self.assembly is None or self.workspace is None:
            raise RuntimeError("there is nothing to emit: the compilation failed")
        request = EmitRequest(
            assembly=self.assembly, robots=self.robots, store=self.store, geometry=self.geometry, workspace=self.workspace,
            report=self.report,
        )
        artifacts = {target: emitter(target)(request) for target in targets}
        if "mjcf" in artifacts:
            # What run-time mode switching needs states addresses in the MJCF models, so the two go together.
            from thingc.emit import modes

            mjcf = artifacts["mjcf"]
            artifacts["mjcf"] = replace(mjcf, files={**mjcf.files, **modes.emit(request).files})
        return artifacts


def store_of(options: Options) -> Store:
    """The store that the options name, else the user's."""
    from thingc.realize.store import Store, default_root

    return Store(options.store or default_root())


def geometry_of(workspace: Workspace, options: Options, store: Store | None = None) -> GeometryService:
    """The geometry service of a workspace; close it."""
    from thingc.realize.service import GeometryService

    return GeometryService(
        workspace,
        store or store_of(options),
        jobs=options.jobs or os.cpu_count() or 1,
        timeout=options.part_timeout or workspace.part_timeout,
        on_progress=options.progress,
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
