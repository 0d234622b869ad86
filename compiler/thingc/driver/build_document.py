"""Build a document: compile the document and, if there are no errors, write the build folder.

`thingc build` and `thingc watch` use this module.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report, Stage
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Origin
from thingc.driver import pipeline
from thingc.driver.environment import Environment, geometry_of
from thingc.driver.output import Waiting, build_folder, write_build
from thingc.driver.pipeline import Compilation
from thingc.targets.artifact import Content, Loss


class BuildRequest(FrozenStruct):
    """The options of a build, with the same meaning as on the command line.

    `modes` contains the names of the modes to build (default: all). `output` is the folder that contains the build folder (default: as
    specified by the workspace). `strict` treats warnings as errors, and `deny_loss` treats export losses as errors. `force` overwrites
    files in the build folder that thingc did not write. `twice` builds each part a second time and compares the results.
    """

    targets: tuple[str, ...]
    modes: Sequence[str] = ()
    output: str | None = None
    strict: bool = False
    deny_loss: bool = False
    force: bool = False
    twice: bool = False


class BuildResult(FrozenStruct):
    """The result of a build: the compiled robot, the files to write, and the diagnostics.

    `files` maps the paths of the files in the build folder to their contents, or is None if there are errors. `place` contains the absolute
    path of the parent folder and the name of the build folder. `twice` is the number of parts that were built a second time for a
    comparison.
    """

    compilation: Compilation
    diagnostics: tuple[Diagnostic, ...] = ()
    place: tuple[str, str] = ("", "")
    files: Mapping[str, Content] | None = None
    losses: Sequence[Loss] = ()
    twice: int = 0


def build(environment: Environment, request: BuildRequest) -> BuildResult:
    """Compile a document and create the contents of all files, without writing the build folder.

    Raises `UnknownChoice` for an unknown mode or target, and `BlobMissing` if the store is damaged.
    """
    compilation = pipeline.compile(environment, request.modes)
    report, result = compilation.report, BuildResult(compilation=compilation)
    if request.twice and not report.apply_strict(strict=request.strict).failed:
        result = replace(result, twice=_build_parts_again(environment, compilation))
    if not report.apply_strict(strict=request.strict).failed:
        result = _with_files(environment, result, request)
    checked = report.apply_strict(strict=request.strict)
    return replace(result, diagnostics=tuple(checked.sorted_diagnostics()), files=None if checked.failed else result.files)


def _with_files(environment: Environment, result: BuildResult, request: BuildRequest) -> BuildResult:
    """Create the files of all targets, and return a copy of the build result that contains the files. Emitters can report further errors.

    Call this function only if the compilation has no errors.
    """
    compilation, workspace = result.compilation, environment.workspace
    assert workspace is not None and compilation.assembly is not None
    folder = os.path.abspath(request.output or os.path.join(workspace.root, workspace.build)), compilation.assembly.name
    artifacts = pipeline.build(environment, compilation, request.targets, build_folder(*folder))
    files = pipeline.files(environment, compilation, artifacts)
    losses = [loss for target in request.targets for loss in artifacts[target].losses]
    if request.deny_loss:
        _report_losses(losses, compilation.assembly.definition.origin, compilation.report)
    if not request.modes:
        pipeline.report_unneeded(compilation, [Stage.CHECK, Stage.BUILD] if "mjcf" in request.targets else [Stage.CHECK])
    return replace(result, place=folder, files=files, losses=losses)


def write(environment: Environment, result: BuildResult, request: BuildRequest, on_wait: Waiting | None = None) -> str:
    """Replace the build folder by the files of a build, in one atomic step. Return the absolute path of the folder.

    Call this function only if the build has no errors. Raises `OutputError` if the folder cannot be written. The callback `on_wait` is
    called if another build of the same folder is in progress.
    """
    documents, files = result.compilation.documents, result.files
    assert files is not None and documents is not None, "the build has errors"
    return write_build(*result.place, files, environment.store, documents.root.relative, force=request.force, on_wait=on_wait)


def _build_parts_again(environment: Environment, compilation: Compilation) -> int:
    """Build every part a second time, and report each part for which the second result differs from the first.

    Return the number of parts built. The second build uses new processes with another hash seed and an empty store. Call this function only
    if the compilation has no errors.
    """
    import tempfile

    from thingc.geometry.store.local import Store
    from thingc.model.assembly.inconsistent_parts import OTHER_SEED, compare, definitions_of

    assembly = compilation.assembly
    assert assembly is not None
    definitions = definitions_of(assembly)
    with (
        tempfile.TemporaryDirectory(prefix="thingc-twice-") as folder,
        geometry_of(environment.geometry.workspace, environment.options, Store(folder), seed=OTHER_SEED) as geometry,
    ):
        compare(assembly, geometry.realize(definitions), compilation.report)
    return len(definitions)


def _report_losses(losses: Sequence[Loss], document: Origin, report: Report) -> None:
    """Report each export loss as an error, except losses that an `allow` entry suppresses, at their location or for the whole document."""
    for loss in losses:
        if not report.allows(Code.LOSS_DENIED, (*loss.origin, *document)):
            mode = f" in mode `{loss.mode}`" if loss.mode not in (None, loss.path) else ""
            report.add(
                Code.LOSS_DENIED, f"{loss.target} cannot fully represent `{loss.path}`{mode}: {loss.what} ({loss.how})", loss.origin,
                path=loss.path, allow=True,
            )
