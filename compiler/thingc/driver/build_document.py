"""Build a document: compile the document and, if there are no errors, write its build folder.

`thingc build` and `thingc watch` use this module.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report, Stage, allow_hint
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Origin
from thingc.driver import pipeline
from thingc.driver.environment import Environment, geometry_of
from thingc.driver.output import Waiting, build_folder, write_build
from thingc.driver.pipeline import Compilation
from thingc.targets.artifact import Content, Loss


class BuildRequest(FrozenStruct):
    """The options of a build, as on the command line.

    `modes` are the modes to build (default: all), `output` is the parent of the build folder (default: the workspace's build folder).
    `strict` treats warnings as errors, `deny_loss` treats export losses as errors. `force` overwrites unexpected files in the folder.
    `twice` builds each part a second time and compares the results.
    """

    targets: tuple[str, ...]
    modes: Sequence[str] = ()
    output: str | None = None
    strict: bool = False
    deny_loss: bool = False
    force: bool = False
    twice: bool = False


class BuildResult(FrozenStruct):
    """The result of a build: the compilation, the files and the diagnostics.

    `files` are the files to write, by path in the folder, or None if there are errors. `place` is the parent folder (an absolute path) and
    the name of the build folder. `twice` is the number of parts that were built a second time for a comparison.
    """

    compilation: Compilation
    diagnostics: tuple[Diagnostic, ...] = ()
    place: tuple[str, str] = ("", "")
    files: Mapping[str, Content] | None = None
    losses: Sequence[Loss] = ()
    twice: int = 0


def build(environment: Environment, wish: BuildRequest) -> BuildResult:
    """Run all passes, without writing the folder. Raises `UnknownChoice`, and `BlobMissing` if the store is damaged."""
    compilation = pipeline.compile(environment, wish.modes)
    report, built = compilation.report, BuildResult(compilation=compilation)
    if wish.twice and not report.judged(strict=wish.strict).failed:
        built = replace(built, twice=_model_again(environment, compilation))
    if not report.judged(strict=wish.strict).failed:
        built = _with_files(environment, built, wish)
    judged = report.judged(strict=wish.strict)
    return replace(built, diagnostics=tuple(judged.ordered()), files=None if judged.failed else built.files)


def _with_files(environment: Environment, built: BuildResult, wish: BuildRequest) -> BuildResult:
    """Add the files of all targets to the result of a compilation without errors. The emitters may report further errors."""
    compilation, workspace = built.compilation, environment.workspace
    assert workspace is not None and compilation.assembly is not None
    place = os.path.abspath(wish.output or os.path.join(workspace.root, workspace.build)), compilation.assembly.name
    artifacts = pipeline.build(environment, compilation, wish.targets, build_folder(*place))
    files = pipeline.files(environment, compilation, artifacts)
    losses = [loss for target in wish.targets for loss in artifacts[target].losses]
    if wish.deny_loss:
        _deny(losses, compilation.assembly.definition.origin, compilation.report)
    if not wish.modes:
        pipeline.say_unneeded(compilation, [Stage.CHECK, Stage.BUILD] if "mjcf" in wish.targets else [Stage.CHECK])
    return replace(built, place=place, files=files, losses=losses)


def write(environment: Environment, built: BuildResult, wish: BuildRequest, on_wait: Waiting | None = None) -> str:
    """Write the files of a build without errors atomically to its folder, and return the absolute path of the folder.

    Raises `OutputError`. `on_wait` is called if another build of the folder is in progress.
    """
    documents, files = built.compilation.documents, built.files
    assert files is not None and documents is not None, "the build has errors"
    return write_build(*built.place, files, environment.store, documents.root.relative, force=wish.force, on_wait=on_wait)


def _model_again(environment: Environment, compilation: Compilation) -> int:
    """Build every part again in new processes, with another hash seed and an empty store, and report parts with different results.

    Return the number of these parts. The report of the compilation must have no errors.
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


def _deny(losses: Sequence[Loss], document: Origin, report: Report) -> None:
    """Report each export loss that is not suppressed by an `allow` at its place in the document or at the top of the document."""
    for loss in losses:
        if not report.allows(Code.LOSS_DENIED, (*loss.origin, *document)):
            mode = f" in mode `{loss.mode}`" if loss.mode is not None else ""
            report.add(
                Code.LOSS_DENIED, f"{loss.target} cannot express `{loss.path}`{mode}: {loss.what} ({loss.how})", loss.origin,
                path=loss.path, help=allow_hint(Code.LOSS_DENIED),
            )
