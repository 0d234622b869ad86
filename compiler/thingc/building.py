"""A build, once: a document compiled, and its folder written where nothing is wrong. What `thingc build` and `thingc watch` share."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import field

from thingc import pipeline
from thingc.diagnostics import Code, Diagnostic, Report, Severity, Stage, allow_hint
from thingc.emit.artifact import Content, Loss
from thingc.environment import Environment
from thingc.frozen import dataclass
from thingc.output import Waiting, build_folder, write_build
from thingc.pipeline import Compilation
from thingc.source import Origin


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """What a build is to be: of which `modes` (none: all), for which `targets`, for whom besides MuJoCo (`compat`; none: what the workspace
    says), in which folder's folder (`output`; None: the workspace's). `strict`: warnings are errors; `deny_loss`: so are losses;
    `force`: strange files in the folder are given up; `twice`: parts are modelled again, and compared."""

    targets: tuple[str, ...]
    modes: Sequence[str] = ()
    compat: Sequence[str] = ()
    output: str | None = None
    strict: bool = False
    deny_loss: bool = False
    force: bool = False
    twice: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Built:
    """What came of it: all that was said, and what is written, `files` by path in the folder; None with errors. `twice` is how many parts
    were modelled again."""

    diagnostics: tuple[Diagnostic, ...]
    compilation: Compilation
    files: Mapping[str, Content] | None = None
    losses: Sequence[Loss] = field(default=())
    twice: int = 0


def build(environment: Environment, wish: Wish) -> Built:
    """Every pass, and nothing written yet. Raises `UnknownChoice`, and `BlobMissing` where the store turns out to be damaged."""
    compilation = pipeline.compile(environment, wish.modes)
    report = compilation.report
    if _failed(report, wish):
        return _built(compilation, wish)
    twice = pipeline.model_again(environment, compilation) if wish.twice else 0
    if report.failed:
        return _built(compilation, wish)
    compat = wish.compat or environment.geometry.workspace.compat
    parent, name = place(environment, compilation, wish)
    artifacts = pipeline.build(environment, compilation, wish.targets, build_folder(parent, name), compat)
    losses = [loss for target in wish.targets for loss in artifacts[target].losses]
    if wish.deny_loss:
        assert compilation.assembly is not None
        _deny(losses, compilation.assembly.definition.origin, report)
    if not wish.modes:
        pipeline.say_unneeded(compilation, [Stage.CHECK, Stage.BUILD] if "mjcf" in wish.targets else [Stage.CHECK])
    if _failed(report, wish):
        return _built(compilation, wish)
    files = pipeline.files(environment, compilation, artifacts, compat)
    return Built(diagnostics=_said(report, wish), compilation=compilation, files=files, losses=losses, twice=twice)


def place(environment: Environment, compilation: Compilation, wish: Wish) -> tuple[str, str]:
    """The folder in which the build folder lies, and the latter's name."""
    assert environment.workspace is not None and compilation.assembly is not None
    parent = wish.output or os.path.join(environment.workspace.root, environment.workspace.build)
    return os.path.abspath(parent), compilation.assembly.name


def write(environment: Environment, built: Built, wish: Wish, on_wait: Waiting | None = None) -> str:
    """Put the files of a build without errors into its folder, at once; the folder's absolute path. Raises `OutputError`; `on_wait` is
    called when another build of it must be waited for."""
    documents, files = built.compilation.documents, built.files
    assert files is not None and documents is not None, "the build has errors"
    parent, name = place(environment, built.compilation, wish)
    return write_build(parent, name, files, environment.store, documents.root.relative, force=wish.force, on_wait=on_wait)


def _built(compilation: Compilation, wish: Wish) -> Built:
    return Built(diagnostics=_said(compilation.report, wish), compilation=compilation)


def _said(report: Report, wish: Wish) -> tuple[Diagnostic, ...]:
    return tuple((report.strict() if wish.strict else report).ordered())


def _failed(report: Report, wish: Wish) -> bool:
    return any(d.severity is Severity.ERROR for d in _said(report, wish))


def _deny(losses: Sequence[Loss], document: Origin, report: Report) -> None:
    """Every loss that is not allowed where it is made, nor at the top of the document that is built."""
    for loss in losses:
        if not report.allows(Code.LOSS_DENIED, (*loss.origin, *document)):
            mode = f" in mode `{loss.mode}`" if loss.mode is not None else ""
            report.add(
                Code.LOSS_DENIED, f"{loss.target} cannot say this of `{loss.path}`{mode}: {loss.what} ({loss.how})", loss.origin,
                path=loss.path, help=allow_hint(Code.LOSS_DENIED),
            )
