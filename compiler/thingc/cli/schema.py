"""`thingc schema`: for editors, a JSON Schema per document that knows its parts, mounts, joints and names."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from typing import TYPE_CHECKING

from thingc.brief import counted
from thingc.cli import common
from thingc.diagnostics import Code, Report, shown_path
from thingc.shown import some

if TYPE_CHECKING:
    from thingc.editor.refresh import RefreshOutcome
    from thingc.environment import Options
    from thingc.workspace import Workspace

EPILOG = """\
Writes .thingc/schema/<document>.json for every document of the workspace, and names them to editors: in
.vscode/settings.json (YAML) and .taplo.toml (TOML), where everything else stays as it is.

  thingc schema                         the workspace of this folder
  thingc schema --watch                 and again after every save, until Ctrl-C
  thingc schema assemblies/arm.yaml     only this document
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `schema`."""
    parser.epilog = EPILOG
    parser.add_argument(
        "place", metavar="FOLDER|DOC", nargs="*", default=["."],
        help="every document of the workspace of this folder, or only this document (default: the current folder)",
    )
    parser.add_argument("--watch", action="store_true", help="stay, and write schemas anew after every save")
    parser.add_argument("--no-model", action="store_true", help="start no CAD kernel: of parts only what is known already")
    parser.add_argument("--no-wire", action="store_true", help="leave .vscode/settings.json and .taplo.toml alone")
    common.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Writes the schemas; documents that are wrong are no fault here, they get the schema of their sound rest."""
    report = Report()
    options = common.options_of(arguments)
    chosen = _workspaces(arguments.place, report)
    if arguments.watch and len(chosen) > 1:
        raise common.WrongCommandLine("--watch looks at one workspace", "start one for each")
    for workspace, only in chosen:
        if arguments.watch:
            _watch(workspace, only, arguments, options, report)
        else:
            _once(workspace, only, arguments, options, report)
    diagnostics = report.ordered()
    common.print_text(diagnostics, stream=sys.stderr, debug=arguments.debug)
    return common.exit_code(diagnostics)


def _workspaces(places: list[str], report: Report) -> list[tuple[Workspace, list[str] | None]]:
    """Each workspace that is named, with the documents that are named of it (None: all). Raises `WrongCommandLine`."""
    from thingc.editor.refresh import workspace_of
    from thingc.load import is_document

    by_root: dict[str, tuple[Workspace, list[str] | None]] = {}
    for place in places:
        if not os.path.isdir(place):
            common.require_document(place)
            if not is_document(place):
                raise common.WrongCommandLine(
                    f"`{place}` does not begin as a document does", "its first line is for example `thingc: assembly/1`",
                    Code.NO_DOCUMENT,
                )
        workspace = workspace_of(place, report)
        if workspace is None:
            continue
        _, only = by_root.get(workspace.root, (workspace, []))
        everything = os.path.isdir(place) or only is None
        by_root[workspace.root] = (workspace, None if everything else [*(only or []), os.path.abspath(place)])
    return list(by_root.values())


def _once(
    workspace: Workspace, only: list[str] | None, arguments: argparse.Namespace, options: Options, report: Report
) -> None:
    from thingc.editor.parts import ask
    from thingc.editor.refresh import Schemas
    from thingc.environment import store_of
    from thingc.realize import NoWorkers

    with ask(
        workspace, store_of(options), jobs=options.jobs or os.cpu_count() or 1, timeout=options.part_timeout or workspace.part_timeout,
        progress=None if arguments.no_model else options.progress, workers=NoWorkers() if arguments.no_model else None,
    ) as geometry:
        outcome = Schemas(workspace, geometry, only).refresh()
    _say_all(workspace, outcome)
    if not arguments.no_wire and only is None:
        _wire(workspace, outcome, report)


def _watch(
    workspace: Workspace, only: list[str] | None, arguments: argparse.Namespace, options: Options, report: Report
) -> None:
    from thingc.editor.watching import Watch
    from thingc.environment import store_of

    watch = Watch(
        workspace, store_of(options), options.jobs or os.cpu_count() or 1, options.part_timeout or workspace.part_timeout, only=only,
        model=not arguments.no_model,
    )
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: watch.stop.set())
    known: list[tuple[str, ...]] = []

    def say(outcome: RefreshOutcome, seconds: float) -> None:
        first = not known
        if first:
            _say_all(workspace, outcome)
            common.say("watching; Ctrl-C ends it")
        else:
            _say_changes(workspace, outcome, seconds)
        if not arguments.no_wire and only is None and outcome.documents not in known[-1:]:
            _wire(workspace, outcome, report)
        known.append(outcome.documents)
        del known[:-1]

    watch.run(say)


def _wire(workspace: Workspace, outcome: RefreshOutcome, report: Report) -> None:
    from thingc.editor.wiring import wire

    documents = counted(len(outcome.documents), "document")
    for name in wire(workspace.root, outcome.documents, report):
        common.say(f"{shown_path(os.path.join(workspace.root, name))}: names {documents} and their schemas")


def _say_all(workspace: Workspace, outcome: RefreshOutcome) -> None:
    from thingc.editor.folder import SCHEMAS

    folder = shown_path(os.path.join(workspace.root, SCHEMAS))
    same = len(outcome.documents) - len(outcome.written) - len(outcome.kept)
    said = [f"{len(outcome.written)} written", f"{same} as they were"]
    said += [f"{len(outcome.removed)} removed"] if outcome.removed else []
    common.say(f"{folder}: schemas of {counted(len(outcome.documents), 'document')}: {', '.join(said)}")
    _say_kept(workspace, outcome)


def _say_changes(workspace: Workspace, outcome: RefreshOutcome, seconds: float) -> None:
    for word, names in (("refreshed", outcome.written), ("removed", outcome.removed)):
        if names:
            common.say(f"{word} in {seconds:.2f} s: {some([_shown(workspace, name) for name in names], 3)}")
    _say_kept(workspace, outcome)


def _say_kept(workspace: Workspace, outcome: RefreshOutcome) -> None:
    for name in outcome.kept:
        common.say(f"{_shown(workspace, name)}: not well-formed just now; it keeps its last schema")


def _shown(workspace: Workspace, name: str) -> str:
    return shown_path(os.path.join(workspace.root, name))
