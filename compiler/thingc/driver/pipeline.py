"""Run the compiler passes in order.

    documents -> specs -> definition -> part records -> assembly -> robots (one per mode) -> artifacts
      load     validate   resolve        realize        link       root                 emit

`check` and `compile` run the passes from a document to its robots. `recompile` runs the same passes with other settings. `build` and `emit`
run the remaining passes, which create the output files (artifacts).
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report, Stage, UserError, shown_path
from thingc.base.filesystem import beginning
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.safe_text import abbreviate
from thingc.base.suggestions import did_you_mean
from thingc.driver.environment import Environment, Options

if TYPE_CHECKING:
    from thingc.base.pose import Vector
    from thingc.documents.load.documents import Documents
    from thingc.documents.workspace import Workspace
    from thingc.geometry.build_reasons import BuildReason
    from thingc.geometry.record import Mesh, PartFailure, PartRecord, PartSchema
    from thingc.model.assembly.shape_links import Meshes
    from thingc.model.assembly.types import Assembly
    from thingc.model.resolve.resolver import Settings, Sources
    from thingc.model.resolve.types import AssemblyDefinition
    from thingc.model.robot.types import Robot
    from thingc.targets.artifact import Artifacts, Content
    from thingc.targets.request import EmitRequest


PASSES = ("thingc.model.resolve.choices", "thingc.model.resolve.assembly", "thingc.model.assembly", "thingc.model.robot")
"""The modules of the passes that run after the part schemas have been loaded. These modules are imported while the CAD kernel loads."""


_SEARCHED_BYTES = 1 << 20
"""Number of bytes at the beginning of a document that are searched for references to parts and nested documents."""
_MAX_DOCUMENTS = 100
"""If a document contains more nested documents, it probably needs the CAD kernel."""
_NAMES_PART = re.compile(rb"\b(?:part|file)[\"']?\s*[:=]")
_NAMES_LUMP = re.compile(rb"\bas[\"']?\s*[:=]\s*[\"']?lump\b")
_NAMES_ASSEMBLY = re.compile(rb"\bassembly[\"']?\s*[:=]\s*[\"']?([^\s\"',}]+)")


class UnknownChoice(UserError):
    """Raised if the user requests a mode, a target or a program that does not exist. The string also contains the help text."""

    def __str__(self) -> str:
        return f"{super().__str__()}: {self.diagnostic.help}"


def chosen_consumers(names: Iterable[str] | str) -> tuple[str, ...]:
    """Parse a list of programs that must be able to read the MuJoCo models, and return it in the order of `CONSUMERS`.

    `names` is an iterable of names or a comma-separated string. Raises `UnknownChoice` for an unknown program.
    """
    from thingc.documents.workspace import CONSUMERS

    requested = [item for item in (names.split(",") if isinstance(names, str) else names) if item]
    for item in requested:
        if item not in CONSUMERS:
            raise UnknownChoice(f"`--compat` does not support `{abbreviate(item)}`", did_you_mean(item, CONSUMERS, what="programs"))
    return tuple(name for name in CONSUMERS if name in requested)


class Compilation(FrozenStruct):
    """The result of a compilation: the output of each pass that succeeded, and the report with all diagnostics.

    `documents` contains the document, and all documents that the document or the choices of the user reference. `records` maps the
    definition text of each part to its record, and `decisions` to the reason why the part was built or reused. `robots` contains a robot
    for each requested mode. `repeated` is True if the process runs many compilations of the same document.
    """

    settings: Settings
    report: Report
    documents: Documents | None = None
    schemas: Mapping[str, PartSchema | PartFailure] = {}
    model: AssemblyDefinition | None = None
    records: Mapping[str, PartRecord | PartFailure] = {}
    decisions: Mapping[str, BuildReason] = {}
    assembly: Assembly | None = None
    robots: tuple[Robot, ...] = ()
    repeated: bool = False

    @property
    def modelled(self) -> list[str]:
        """The definition texts of the parts that were built during this compilation."""
        return sorted(text for text, decision in self.decisions.items() if not decision.reused)

    @property
    def reused(self) -> list[str]:
        """The definition texts of the parts whose records were already in the store."""
        return sorted(text for text, decision in self.decisions.items() if decision.reused)


# --- paths ---------------------------------------------------------------------------------------------------------


def check(environment: Environment) -> Compilation:
    """Check a document of any kind, as `thingc check` does.

    For an assembly, run every pass up to `root` for all modes, and report all errors. A materials document is only resolved, and variants
    and calibration documents are only validated.
    """
    compilation = compile(environment, kinds=("assembly", "materials", "variants", "calibration"))
    report_unneeded(compilation, [Stage.CHECK])
    return compilation


def compile(
    environment: Environment, modes: Sequence[str] = (), *, kinds: Sequence[str] = ("assembly",),
    settings: Callable[[Sources], Settings] | None = None,
) -> Compilation:
    """Compile an assembly document: run every pass up to `root`, for the modes with the given names (by default all modes).

    `kinds` contains the kinds of documents that are accepted. `settings` is a function that returns the settings, given the loaded
    documents; by default, the settings come from the options of the environment. Errors are added to the report of the result. Raises
    `UnknownChoice` for an unknown mode, and `BlobMissing` if the store is damaged (see `environment.with_environment`).
    """
    sources = read(environment, kinds, modelling=True)
    values = settings(sources) if settings is not None and sources is not None else settings_of(environment.options)
    compilation = _run_passes(environment, sources, values, modes, None)
    if compilation.assembly is not None and not compilation.report.failed:
        from thingc.model.robot.start_pose_checks import check_starts

        check_starts(compilation.robots, _vertex_reader(environment), compilation.report, environment.memo)
        _check_interfaces(environment, compilation.assembly, compilation.report)
    return compilation


def recompile(environment: Environment, sources: Sources | None, settings: Settings, modes: Sequence[str] = ()) -> Compilation:
    """Compile documents that are already loaded, with other settings. The result has the same meaning as for `compile`.

    Checks that are useful only for a single robot are skipped, such as the search for overlapping parts.
    """
    return replace(_run_passes(environment, sources, settings, modes, environment.memo), repeated=True)


def modules_of_build(targets: Collection[str]) -> tuple[str, ...]:
    """Return the names of modules that `build` needs for the given targets and that are slow to import, for `Options.ahead`.

    The module `shapes`, which imports numpy, is only needed for the target `mjcf`, for which solids are compared.
    """
    from thingc.targets.registry import modules_of

    return (*modules_of(targets), *(["thingc.model.solids.shapes"] if "mjcf" in targets else []))


def build(environment: Environment, compilation: Compilation, targets: Sequence[str], folder: str | None = None) -> dict[str, Artifacts]:
    """Run the passes after `root`: find overlapping parts, and create the files of all given targets.

    A worker process writes the STEP file in parallel. `folder` is the absolute path of the build folder, or None if unknown.
    """
    from thingc.model.robot.kinematics import occurrence_poses
    from thingc.model.solids.overlaps import Overlaps, check_overlaps
    from thingc.targets.registry import run_emitters

    request = request_of(environment, compilation, folder=folder)
    if "step" in targets:
        from thingc.targets.step import emit as step

        step.begin(request)
    robot = next(iter(compilation.robots), None)
    poses = request.assembly.rest
    if robot is not None and robot.mode.pose is not None:
        poses = occurrence_poses(robot, robot.start.q, robot.start.base)
    overlaps = Overlaps(environment.store, request.workspace.mesh.linear, environment.memo)
    check_overlaps(request.assembly, poses, overlaps, compilation.report)
    return run_emitters(request, targets)


# --- passes --------------------------------------------------------------------------------------------------------


def read(
    environment: Environment, kinds: Sequence[str] = ("assembly",), *, modelling: bool = False, lumps: bool = True,
) -> Sources | None:
    """Run the passes `load` and `validate` on the document, and load the schemas of all parts that it references.

    Return None if the document cannot be read. Set `modelling` to True if the caller builds parts next: the CAD kernel is then loaded in
    advance if the store probably does not contain all parts. With `lumps`, the schemas of parts in lumps come from the lock file.
    """
    workspace, report = environment.workspace, environment.report
    if workspace is None:
        return None
    # start this before other imports, because it takes longest
    kernel_loads = modelling and _may_need_kernel(environment, workspace) and environment.parts.anticipate()
    from thingc.documents.load.documents import load
    from thingc.documents.spec.validation import documents_in_lumps, part_references, validate

    documents = load(environment.document, workspace, report, kinds=kinds, texts=environment.options.texts, memo=environment.memo)
    if documents is None:
        return None
    specs = validate(documents, report, environment.memo)
    part_uses = part_references(specs, documents) if documents.root.kind == "assembly" else ()
    in_lumps = documents_in_lumps(specs, documents) if lumps and documents.root.kind == "assembly" else frozenset()
    locked = [reference for reference, span in part_uses if span.file in in_lumps]
    references = [reference for reference, span in part_uses if span.file not in in_lumps]
    if kernel_loads and references:
        schemas = environment.geometry.describe(references, lambda: [*map(import_module, (*PASSES, *environment.options.ahead))])
    else:
        schemas = environment.parts.describe(references) if references else {}
    if locked:
        from thingc.geometry.lock.lock import read_lock, report_missing

        if environment.options.code and read_lock(workspace, report) is None:
            report_missing(workspace, report)
        schemas = {**environment.locked.describe(locked), **schemas}
    from thingc.geometry.store.file_digests import digest_of
    from thingc.model.resolve.resolver import Sources

    cache = environment.store if environment.options.code else None
    digest = partial(digest_of, store=cache)
    return Sources(workspace=workspace, documents=documents, specs=specs, schemas=schemas, digest=digest)


def _may_need_kernel(environment: Environment, workspace: Workspace) -> bool:
    """Return whether compiling the document may need the CAD kernel: code may run, and the document or a nested document mentions parts.

    Only the beginning of each document is searched.
    """
    documents = [environment.document] if environment.options.code else []
    for document in documents:  # the list grows
        text = environment.options.texts.get(document)
        if text is None:
            try:
                text = beginning(document, _SEARCHED_BYTES) if workspace.contains(document) else b""
            except (OSError, ValueError):
                continue
        if _NAMES_PART.search(text) or len(documents) > _MAX_DOCUMENTS:
            return True
        names = set() if _NAMES_LUMP.search(text) else set(_NAMES_ASSEMBLY.findall(text))  # parts of lumps are not built
        nested = (os.path.join(os.path.dirname(document), os.fsdecode(name)) for name in names)
        documents += {os.path.normpath(path) for path in nested}.difference(documents)
    return False


def settings_of(options: Options) -> Settings:
    """Return the parameters and choices in the options of a compilation as `Settings`."""
    from thingc.model.resolve.resolver import Settings

    return Settings(parameters=options.parameters, choices=options.choices)


def choose(environment: Environment, sources: Sources, choices: Mapping[str, str], report: Report, memo: Memo | None) -> Sources:
    """Load the documents and part schemas that the choices of the user reference, and return them together with `sources`.

    Errors in these documents and parts are added to the report, which then suppresses the warnings that the documents allow. `memo` is a
    cache for the current contents of the documents.
    """
    if choices:
        from thingc.model.resolve.choices import chosen_texts

        assemblies, parts = chosen_texts(choices, "assembly"), chosen_texts(choices, "part")
        key = ("choices", frozenset(assemblies), frozenset(parts))
        sources, faults = (memo or Memo())(key, partial(_load_more, environment, sources, assemblies, parts))
        for fault in faults.diagnostics:  # errors without a place in a document are reported at the choice
            code, path = (fault.code, fault.path) if fault.span is not None else (Code.CHOICE_OPTION, "--set")
            report.add(code, fault.message, fault.span, help=fault.help, path=path, notes=fault.notes, severity=fault.severity)
    report.allowances = sources.specs.allowances
    return sources


def _load_more(environment: Environment, loaded: Sources, assemblies: Sequence[str], parts: Sequence[str]) -> tuple[Sources, Report]:
    """Load additional assembly documents and part schemas. Return them together with `loaded`, and a report with their errors."""
    from thingc.documents.load.documents import load_more
    from thingc.documents.spec.validation import part_references, validate

    documents, specs, report = loaded.documents, loaded.specs, Report()
    if assemblies:
        documents = load_more(documents, assemblies, loaded.workspace, report)
        added = {path: document for path, document in documents.by_path.items() if path not in loaded.documents.by_path}
        specs = specs.union(validate(replace(documents, by_path=added), report))
    references = [*parts, *(reference for reference, _ in part_references(specs, documents))]
    schemas = {**loaded.schemas, **environment.parts.describe([document for document in references if document not in loaded.schemas])}
    return replace(loaded, documents=documents, specs=specs, schemas=schemas), report


def model(environment: Environment, sources: Sources, settings: Settings, report: Report) -> AssemblyDefinition | None:
    """Run the pass `resolve` on documents that are already loaded, without building parts. Return the definition of the root assembly.

    Errors are added to the report. Return None if the root document is invalid as a whole.
    """
    from thingc.model.resolve.resolver import resolve

    chosen = choose(environment, sources, settings.choices, report, environment.memo)
    return resolve(chosen, settings, report, environment.memo)


def _run_passes(
    environment: Environment, loaded: Sources | None, settings: Settings, modes: Sequence[str], document_memo: Memo | None,
) -> Compilation:
    """Run the passes `resolve`, `link` and `root` on documents that are already loaded.

    `document_memo` is a cache for results that are valid only for the current contents of the documents. The cache of the environment
    contains results that are always valid.
    """
    from thingc.geometry.meshes.cache import mesh_records
    from thingc.model.assembly.linking import link
    from thingc.model.assembly.mass import likely_slicings, slicings_of
    from thingc.model.assembly.shape_links import listed_meshes, with_pieces
    from thingc.model.resolve.mirroring import with_own_images
    from thingc.model.resolve.resolver import resolve, resolve_materials
    from thingc.model.robot.floor_height import stand
    from thingc.model.robot.kinematic_tree import root
    from thingc.model.robot.lumps import with_lumps

    report, memo = environment.report.copy(), environment.memo
    if loaded is None:
        return Compilation(settings=settings, report=report)
    parts = environment.parts
    sources = choose(environment, loaded, settings.choices, report, document_memo)
    documents = sources.documents
    _report_hidden(environment, sources, report)
    compilation = Compilation(settings=settings, report=report, documents=documents, schemas=sources.schemas)
    if documents.root.kind == "materials":
        resolve_materials(sources, report)
    if documents.root.kind != "assembly":
        return compilation
    model = resolve(sources, settings, report, document_memo or memo.make_empty(), memo)
    if model is None:
        return compilation
    if not report.failed:
        _require_modes(modes, model, documents)

    def meshes_of(model: AssemblyDefinition) -> Meshes:
        files = listed_meshes(model, drawn=not environment.options.lock) if environment.options.code else {}
        return mesh_records(files, environment.store, report, memo) if files else {}

    model = with_lumps(model, lambda: environment.locked, meshes_of, report)
    definitions = model.part_definitions()
    records = parts.realize(definitions, model.decompositions(), partial(likely_slicings, model, sources.schemas))
    model = with_own_images(model, records)
    records = parts.slice(definitions, records, slicings_of(model, records))
    environment.report_lock_gaps(report)
    compilation = replace(compilation, decisions=parts.decisions, model=model, records=records)
    meshes = with_pieces(model, meshes_of(model), parts.decompose, report)
    linked = link(model, records, report, memo, meshes)
    if linked is None:
        return compilation
    assembly = stand(linked, _vertex_reader(environment), report, memo)
    robots = [root(assembly, mode, report, memo) for mode in assembly.modes if not modes or mode.name in modes]
    return replace(compilation, assembly=assembly, robots=tuple(robot for robot in robots if robot is not None))


def _check_interfaces(environment: Environment, assembly: Assembly, report: Report) -> None:
    """Compare the interfaces that documents add to mounts with the B-reps of the parts, if code of the workspace may run."""
    from thingc.geometry.record import AssemblyFailed
    from thingc.geometry.service import GeometryService
    from thingc.model.assembly.interfaces import check_added_interfaces

    if isinstance(environment.parts, GeometryService):
        try:
            check_added_interfaces(assembly, environment.parts.features, report)
        except AssemblyFailed as fault:
            report.add(Code.INTERNAL, f"the CAD kernel cannot read a part: {fault.reason}", assembly.definition.origin, detail=fault.detail)


def _report_hidden(environment: Environment, sources: Sources, report: Report) -> None:
    """Report each Python module with parts that hides another module with the same name."""
    from thingc.documents.spec.validation import part_references
    from thingc.geometry.part_source import report_hidden

    hiding = [reference for reference in sources.schemas if environment.parts.hiding(reference)]
    if hiding:
        part_uses = [use for use in part_references(sources.specs, sources.documents) if use[0] in hiding]
        report_hidden(environment.parts, [*part_uses, *((reference, None) for reference in hiding)], report)


def emit(environment: Environment, compilation: Compilation, targets: Sequence[str], *, verify: int = 1) -> dict[str, Artifacts]:
    """Create the files of the given targets. Return the files and export losses by target, in the requested order.

    If several targets have the same export loss, the loss is listed only with the first of these targets. Call this function only if the
    compilation has no errors. With `verify=0`, the generated models are not verified by compiling them with MuJoCo, because the caller does
    this. With `verify=n` and n > 1, only one of every n models that differ only in numbers is verified.
    """
    from thingc.targets.registry import run_emitters

    return run_emitters(request_of(environment, compilation, verify=verify), targets)


def request_of(environment: Environment, compilation: Compilation, *, verify: int = 1, folder: str | None = None) -> EmitRequest:
    """Create the `EmitRequest`, which is the input of the emitters of all targets.

    Call this function only if the compilation has no errors.
    """
    from thingc.targets.request import EmitRequest

    geometry = environment.geometry
    return EmitRequest(
        assembly=_assembly(compilation), robots=compilation.robots, store=environment.store, geometry=geometry,
        workspace=geometry.workspace, report=compilation.report, verify=verify, compat=environment.compat, folder=folder,
        progress=environment.options.progress, repeated=compilation.repeated, memo=environment.memo,
    )


def files(environment: Environment, compilation: Compilation, artifacts: Mapping[str, Artifacts]) -> dict[str, Content]:
    """Return the contents of all files of a build folder, keyed by path in the folder: the files of the targets, and `manifest.json`."""
    from thingc.targets.artifact import MANIFEST
    from thingc.targets.manifest import manifest

    documents = compilation.documents
    assert documents is not None
    files = {path: content for target_artifacts in artifacts.values() for path, content in target_artifacts.files.items()}
    files[MANIFEST] = manifest(
        _assembly(compilation), document=documents.root.relative,
        documents={path: document.sha256 for path, document in documents.by_path.items()}, settings=compilation.settings,
        modes=[robot.mode.name for robot in compilation.robots], emit=list(artifacts), compat=environment.compat, files=files,
        losses=[loss for target_artifacts in artifacts.values() for loss in target_artifacts.losses],
        workspace=environment.geometry.workspace,
    )
    return files


def report_unneeded(compilation: Compilation, stages: Collection[Stage]) -> None:
    """Report a warning for each `allow` entry that did not suppress any warning of the commands in `stages`.

    If the user set parameters or other values, nothing is reported, because the entries may be needed for the values in the document.
    """
    settings, documents = compilation.settings, compilation.documents
    if compilation.assembly is None or documents is None or compilation.report.failed or settings.parameters or settings.choices:
        return
    compilation.report.say_unneeded(documents.root.path, stages)


def _assembly(compilation: Compilation) -> Assembly:
    """Return the assembly of a compilation without errors. Raises `RuntimeError` if the compilation has failed."""
    if compilation.assembly is None:
        raise RuntimeError("the compilation failed")
    return compilation.assembly


def _vertex_reader(environment: Environment) -> Callable[[Mesh], tuple[Vector, ...]] | None:
    """Return a function that reads the vertices of a mesh of a part from the store. Return None if the store may not contain the meshes."""
    from thingc.geometry.store.meshes import vertices

    return None if environment.options.lock else partial(vertices, environment.store)


def _require_modes(requested: Sequence[str], model: AssemblyDefinition, documents: Documents) -> None:
    names = [mode.name for mode in model.modes]
    for name in requested:
        if name not in names:
            raise UnknownChoice(f"`{shown_path(documents.root.path)}` has no mode `{name}`", did_you_mean(name, names, what="modes"))

