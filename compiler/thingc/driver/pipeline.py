"""Run the compiler passes in order.

    documents -> specs -> definition -> part records -> assembly -> robots (one per mode) -> artifacts
      load     validate   resolve        realize        link       root                 emit

`check` and `compile` run the passes from a document to its robots. `recompile` runs the same passes with other settings. `build` and `emit`
run the remaining passes to artifacts.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report, Stage, shown_path
from thingc.base.filesystem import beginning
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.safe_text import shortened
from thingc.base.suggestions import Hint, did_you_mean
from thingc.driver.environment import Environment, Options

if TYPE_CHECKING:
    from thingc.base.pose import Vector
    from thingc.documents.load.documents import Documents
    from thingc.geometry.build_reasons import BuildReason
    from thingc.geometry.record import Mesh, PartFailure, PartRecord, PartSchema
    from thingc.model.assembly.types import Assembly
    from thingc.model.resolve.resolver import Settings, Sources
    from thingc.model.resolve.types import AssemblyDefinition
    from thingc.model.robot.types import Robot
    from thingc.targets.artifact import Artifacts, Content
    from thingc.targets.request import EmitRequest


PASSES = ("thingc.model.resolve.choices", "thingc.model.resolve.assembly", "thingc.model.assembly", "thingc.model.robot")
"""The modules of the passes that run after parts are described. These modules are imported while the CAD kernel loads."""


_LOOKED_THROUGH = 1 << 20
"""Maximum number of bytes of a document in which references to parts are searched."""
_LEADS_TO_PARTS = re.compile(rb"\b(?:part|file|assembly)[\"']?\s*[:=]")


class UnknownChoice(Exception):
    """Raised if an unknown mode, target or program is requested on the command line."""

    def __init__(self, message: str, hint: Hint) -> None:
        super().__init__(f"{message}: {hint}")
        self.message = message
        self.hint = str(hint)


def chosen_consumers(names: Iterable[str] | str) -> tuple[str, ...]:
    """Return the named programs that read MuJoCo models, in the order of `CONSUMERS`.

    `names` may be a comma-separated string. Raises `UnknownChoice`.
    """
    from thingc.documents.workspace import CONSUMERS

    words = [word for word in (names.split(",") if isinstance(names, str) else names) if word]
    for word in words:
        if word not in CONSUMERS:
            raise UnknownChoice(f"MuJoCo models are not written for `{shortened(word)}`", did_you_mean(word, CONSUMERS, what="programs"))
    return tuple(name for name in CONSUMERS if name in words)


class Compilation(FrozenStruct):
    """The result of a compilation: the report with all diagnostics, and the output of each pass that succeeded.

    `documents` are the document and all documents that it or a choice references. `robots` has an entry for each chosen mode. `decisions`
    are the reasons why parts were built or reused, and `records` are the properties of parts, both by definition text. `repeated` is True
    for one of many compilations in a process.
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
        """The definition texts of the parts that this compilation built."""
        return sorted(text for text, decision in self.decisions.items() if not decision.reused)

    @property
    def reused(self) -> list[str]:
        """Definition texts of the parts whose records were in the store."""
        return sorted(text for text, decision in self.decisions.items() if decision.reused)


# --- paths ---------------------------------------------------------------------------------------------------------


def check(environment: Environment) -> Compilation:
    """Check a document of any kind: run every pass up to `root`, for all modes. Errors are reported.

    Materials documents are only resolved. Variants documents are only validated.
    """
    compilation = compile(environment, kinds=("assembly", "materials", "variants"))
    say_unneeded(compilation, [Stage.CHECK])
    return compilation


def compile(
    environment: Environment, modes: Sequence[str] = (), *, kinds: Sequence[str] = ("assembly",),
    settings: Callable[[Sources], Settings] | None = None,
) -> Compilation:
    """Compile an assembly document: run every pass up to `root`, for the named modes (by default all).

    `kinds` are the accepted kinds of document. `settings` computes the settings from the sources (default: the settings of the options).
    Errors are reported. Raises `UnknownChoice`, and `BlobMissing` if the store is damaged (see `environment.attempted`).
    """
    sources = read(environment, kinds, modelling=True)
    told = settings(sources) if settings is not None and sources is not None else settings_of(environment.options)
    compilation = _passes(environment, sources, told, modes, None)
    if compilation.assembly is not None and not compilation.report.failed:
        from thingc.model.robot.start_pose_checks import check_starts

        check_starts(compilation.robots, _corners(environment), compilation.report, environment.memo)
    return compilation


def recompile(environment: Environment, sources: Sources | None, settings: Settings, modes: Sequence[str] = ()) -> Compilation:
    """Compile documents that are already loaded with other settings (see `compile`).

    Checks of a single robot (start below the floor, overlapping parts) are skipped.
    """
    return replace(_passes(environment, sources, settings, modes, environment.memo), repeated=True)


def modules_of_build(targets: Collection[str]) -> tuple[str, ...]:
    """Return the modules that `build` needs and that are slow to import, for `Options.ahead`.

    This includes numpy, which compares solids, only if models need it.
    """
    from thingc.targets.registry import modules_of

    return (*modules_of(targets), *(["thingc.model.solids.shapes"] if "mjcf" in targets else []))


def build(environment: Environment, compilation: Compilation, targets: Sequence[str], folder: str | None = None) -> dict[str, Artifacts]:
    """Run the passes after `root`: warn of overlapping parts, and emit the files of the targets.

    The CAD kernel writes the STEP file in parallel.

    `folder` is the absolute path of the build folder, if known.
    """
    from thingc.model.robot.kinematics import occurrence_poses
    from thingc.model.solids.overlaps import Overlaps, check_overlaps
    from thingc.targets.registry import emitted

    request = request_of(environment, compilation, folder=folder)
    if "step" in targets:
        from thingc.targets.step import emit as step

        step.begin(request)
    robot = next(iter(compilation.robots), None)
    start = None if robot is None else robot.start
    poses = request.assembly.rest if robot is None or start is None else occurrence_poses(robot, start.q, start.base)
    overlaps = Overlaps(environment.store, request.workspace.mesh.linear, environment.memo)
    check_overlaps(request.assembly, poses, overlaps, compilation.report)
    return emitted(request, targets)


# --- passes --------------------------------------------------------------------------------------------------------


def read(environment: Environment, kinds: Sequence[str] = ("assembly",), *, modelling: bool = False) -> Sources | None:
    """Run the passes `load` and `validate`, and describe the referenced parts. Return None if the document is not valid.

    `modelling` is True if the caller builds parts next. In this case, the CAD kernel is loaded in advance if some parts are likely to be
    new.
    """
    workspace, report = environment.workspace, environment.report
    if workspace is None:
        return None
    # start this before other imports, because it takes longest
    kernel_loads = modelling and _may_name_parts(environment) and environment.parts.anticipate()
    from thingc.documents.load.documents import load
    from thingc.documents.spec.validation import part_references, validate

    documents = load(environment.document, workspace, report, kinds=kinds, texts=environment.options.texts, memo=environment.memo)
    if documents is None:
        return None
    specs = validate(documents, report, environment.memo)
    named = part_references(specs, documents) if documents.root.kind == "assembly" else ()
    references = [reference for reference, _ in named]
    if kernel_loads and references:
        schemas = environment.geometry.describe(references, lambda: [*map(import_module, (*PASSES, *environment.options.ahead))])
    else:
        schemas = environment.parts.describe(references) if references else {}
    from thingc.geometry.store.file_digests import digest_of
    from thingc.model.resolve.resolver import Sources

    kept = environment.store if environment.options.code else None
    digest = partial(digest_of, store=kept)
    return Sources(workspace=workspace, documents=documents, specs=specs, schemas=schemas, digest=digest)


def _may_name_parts(environment: Environment) -> bool:
    """Return whether the CAD kernel may be needed: part code may run, and the beginning of the document refers to parts."""
    if not environment.options.code:
        return False
    text = environment.options.texts.get(environment.document)
    if text is None:
        try:
            text = beginning(environment.document, _LOOKED_THROUGH)
        except (OSError, ValueError):
            return False
    return _LEADS_TO_PARTS.search(text) is not None


def settings_of(options: Options) -> Settings:
    """Return the settings that the options of a compilation specify."""
    from thingc.model.resolve.resolver import Settings

    return Settings(parameters=options.parameters, choices=options.choices)


def choose(environment: Environment, sources: Sources, choices: Mapping[str, str], report: Report, memo: Memo | None) -> Sources:
    """Add the documents and parts that `choices` select to the sources. Report errors in these documents and parts.

    `memo` caches results for the current contents of the documents.
    """
    if not choices:
        return sources
    from thingc.model.resolve.choices import documents_and_parts

    assemblies, parts = documents_and_parts(choices)
    place = ("choices", frozenset(assemblies), frozenset(parts))
    widened, faults = (memo or Memo())(place, lambda: _widened(environment, sources, assemblies, parts))
    for fault in faults.diagnostics:  # errors without a place in a document are reported at the choice
        code, path = (fault.code, fault.path) if fault.span is not None else (Code.CHOICE_OPTION, "--set")
        report.add(code, fault.message, fault.span, help=fault.help, path=path, notes=fault.notes, severity=fault.severity)
    return widened


def _widened(environment: Environment, own: Sources, assemblies: Sequence[str], parts: Sequence[str]) -> tuple[Sources, Report]:
    """Return `own` with additional assemblies and parts, and a report of errors in these assemblies and parts."""
    from thingc.documents.load.documents import load_more
    from thingc.documents.spec.validation import part_references, validate

    documents, specs, report = own.documents, own.specs, Report()
    if assemblies:
        documents = load_more(documents, assemblies, own.workspace, report)
        added = {path: one for path, one in documents.by_path.items() if path not in own.documents.by_path}
        specs = specs.joined(validate(replace(documents, by_path=added), report))
    wanted = [*parts, *(reference for reference, _ in part_references(specs, documents))]
    schemas = {**own.schemas, **environment.parts.describe([one for one in wanted if one not in own.schemas])}
    return replace(own, documents=documents, specs=specs, schemas=schemas), report


def model(environment: Environment, own: Sources, settings: Settings, report: Report) -> AssemblyDefinition | None:
    """Run only the pass `resolve`, before parts are built, and return the resolved document.

    Errors are reported. Return None if nothing is valid.
    """
    from thingc.model.resolve.resolver import resolve

    return resolve(choose(environment, own, settings.choices, report, environment.memo), settings, report, environment.memo)


def _passes(environment: Environment, own: Sources | None, settings: Settings, modes: Sequence[str], of_text: Memo | None) -> Compilation:
    """Run the passes `resolve`, `link` and `root` on the loaded documents.

    `of_text` caches results that are valid for the current contents of the documents. The memo of the environment caches results that are
    always valid.
    """
    from thingc.geometry.meshes.cache import mesh_records
    from thingc.model.assembly.linking import link
    from thingc.model.assembly.print_settings import likely_slicings, slicings_of
    from thingc.model.assembly.shape_links import listed_meshes
    from thingc.model.assembly.symmetric_parts import with_own_images
    from thingc.model.resolve.nested_assemblies import decomposed, part_definitions
    from thingc.model.resolve.resolver import resolve, resolve_materials
    from thingc.model.robot.floor_height import stand
    from thingc.model.robot.spanning_tree import root

    report, memo = environment.report.continued(), environment.memo
    if own is None:
        return Compilation(settings=settings, report=report)
    parts = environment.parts
    sources = choose(environment, own, settings.choices, report, of_text)
    documents = sources.documents
    report.allowances = sources.specs.allowances
    _say_hidden(environment, sources, report)
    compilation = Compilation(settings=settings, report=report, documents=documents, schemas=sources.schemas)
    if documents.root.kind == "materials":
        resolve_materials(sources, report)
    if documents.root.kind != "assembly":
        return compilation
    model = resolve(sources, settings, report, of_text or memo.apart(), memo)
    if model is None:
        return compilation
    if not report.failed:
        _require_modes(modes, model, documents)
    definitions = part_definitions(model)
    records = parts.realize(definitions, decomposed(model), partial(likely_slicings, model, sources.schemas))
    model = with_own_images(model, records)
    records = parts.slice(definitions, records, slicings_of(model, records))
    environment.say_gaps(report)
    compilation = replace(compilation, decisions=parts.decisions, model=model, records=records)
    listed = listed_meshes(model, drawn=not environment.options.lock) if environment.options.code else {}
    meshes = mesh_records(listed, environment.store, report, memo) if listed else {}
    linked = link(model, records, report, memo, meshes)
    if linked is None:
        return compilation
    assembly = stand(linked, _corners(environment), report, memo)
    robots = [root(assembly, mode, report, memo) for mode in assembly.modes if not modes or mode.name in modes]
    return replace(compilation, assembly=assembly, robots=tuple(robot for robot in robots if robot is not None))


def _say_hidden(environment: Environment, sources: Sources, report: Report) -> None:
    """Report modules of parts that hide other modules with the same name."""
    from thingc.documents.spec.validation import part_references
    from thingc.geometry.part_source import report_hidden

    hiding = [reference for reference in sources.schemas if environment.parts.hiding(reference)]
    if hiding:
        named = [one for one in part_references(sources.specs, sources.documents) if one[0] in hiding]
        report_hidden(environment.parts, [*named, *((reference, None) for reference in hiding)], report)


def emit(environment: Environment, compilation: Compilation, targets: Sequence[str], *, verify: int = 1) -> dict[str, Artifacts]:
    """Return the artifacts by target, in the requested order. An export loss that several targets share is listed with the first target.

    The report of the compilation must have no errors. With `verify=0`, MuJoCo does not compile the models, for callers that compile the
    models anyway. With `verify=n` and n > 1, MuJoCo compiles only every n-th of the models that differ only in numbers.
    """
    from thingc.targets.registry import emitted

    return emitted(request_of(environment, compilation, verify=verify), targets)


def request_of(environment: Environment, compilation: Compilation, *, verify: int = 1, folder: str | None = None) -> EmitRequest:
    """Return the input for the emitters of targets. The compilation must not have errors."""
    from thingc.targets.request import EmitRequest

    geometry = environment.geometry
    return EmitRequest(
        assembly=_assembly(compilation), robots=compilation.robots, store=environment.store, geometry=geometry,
        workspace=geometry.workspace, report=compilation.report, verify=verify, compat=environment.compat, folder=folder,
        repeated=compilation.repeated, memo=environment.memo,
    )


def files(environment: Environment, compilation: Compilation, artifacts: Mapping[str, Artifacts]) -> dict[str, Content]:
    """Return the files of a build folder by path: the files of all targets, and the manifest."""
    from thingc.targets.artifact import MANIFEST
    from thingc.targets.manifest import BuildChoice, manifest

    assembly, documents, settings = _assembly(compilation), compilation.documents, compilation.settings
    assert documents is not None
    files = {path: content for made in artifacts.values() for path, content in made.files.items()}
    files[MANIFEST] = manifest(
        assembly,
        document=documents.root.relative,
        documents={path: document.sha256 for path, document in documents.by_path.items()},
        choice=BuildChoice(
            modes=tuple(robot.mode.name for robot in compilation.robots), emit=tuple(artifacts), compat=environment.compat,
            parameters=dict(settings.parameters), choices=dict(settings.choices),
        ),
        files=files,
        losses=[loss for made in artifacts.values() for loss in made.losses],
        workspace=environment.geometry.workspace,
    )
    return files


def say_unneeded(compilation: Compilation, stages: Collection[Stage]) -> None:
    """Warn of unused `allow` entries after these stages. With settings, nothing is reported, because other values may need the entries."""
    settings, documents = compilation.settings, compilation.documents
    if compilation.assembly is None or documents is None or compilation.report.failed or settings.parameters or settings.choices:
        return
    compilation.report.say_unneeded(documents.root.path, stages)


def _assembly(compilation: Compilation) -> Assembly:
    """Return the assembly. Raises `RuntimeError` if the compilation failed, so the caller must check the report first."""
    if compilation.assembly is None:
        raise RuntimeError("the compilation failed")
    return compilation.assembly


def _corners(environment: Environment) -> Callable[[Mesh], tuple[Vector, ...]] | None:
    """Return a function that returns the vertices of a part's mesh, or None if meshes may be missing."""
    from thingc.geometry.store.meshes import vertices

    return None if environment.options.lock else partial(vertices, environment.store)


def _require_modes(wanted: Sequence[str], model: AssemblyDefinition, documents: Documents) -> None:
    names = [mode.name for mode in model.modes]
    for name in wanted:
        if name not in names:
            raise UnknownChoice(f"`{shown_path(documents.root.path)}` has no mode `{name}`", did_you_mean(name, names, what="modes"))

