"""Implementation of `thingc schema`, which writes a JSON Schema for each document.

Writes .thingc/schema/<document>.json for every document of the workspace. If your editor does not use `thingc lsp`, add the path of the
schema to the first line of the document:

  # yaml-language-server: $schema=.thingc/schema/arm.yaml.json     YAML
  #:schema .thingc/schema/arm.toml.json                            TOML

  thingc schema                         all documents of the workspace
  thingc schema assemblies/arm.yaml     only this document
"""

from __future__ import annotations

import argparse
import os
import sys

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report, shown_path
from thingc.base.one_line_repr import format_count
from thingc.documents.load.discovery import is_document
from thingc.documents.workspace import OWN_FILE, Workspace
from thingc.driver.environment import Options, geometry_of
from thingc.geometry.client import NoWorkers
from thingc.geometry.lock.lock import read_lock
from thingc.tools.cli import console
from thingc.tools.schemas.refresh_schemas import SCHEMAS, Schemas


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc schema` to the parser."""
    parser.add_argument(
        "place", metavar="FOLDER|DOC", nargs="*", default=["."],
        help="document, or folder of documents (default: the working folder)",
    )
    parser.add_argument("--no-model", action="store_true", help="do not build parts that are missing from the cache")
    console.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc schema`. The schema of a document with errors contains the names from the valid part of the document."""
    report = Report()
    options = console.options_of(arguments)
    for workspace, only in _workspaces(arguments.place, report):
        _write(workspace, only, arguments.no_model, options)
    return console.print_text(report.sorted_diagnostics(), stream=sys.stderr, debug=arguments.debug)


def _workspaces(places: list[str], report: Report) -> list[tuple[Workspace, list[str] | None]]:
    """Return pairs of a workspace and the selected documents in the workspace.

    If the second item of a pair is None, all documents are selected. Raises `WrongCommandLine` for an invalid path.
    """
    by_root: dict[str, tuple[Workspace, list[str] | None]] = {}
    for place in places:
        if not os.path.isdir(place):
            console.require_document(place)
            if not is_document(place):
                help = "start the first line with the kind of the document, such as `thingc: assembly/1`"
                raise console.WrongCommandLine(f"`{place}` is not a document", help, Code.NO_DOCUMENT)
        workspace = Workspace.find(os.path.join(place, OWN_FILE) if os.path.isdir(place) else place, report)
        if workspace is None:
            continue
        _, only = by_root.get(workspace.root, (workspace, []))
        everything = os.path.isdir(place) or only is None
        by_root[workspace.root] = (workspace, None if everything else [*(only or []), os.path.abspath(place)])
    return list(by_root.values())


def _write(workspace: Workspace, only: list[str] | None, no_model: bool, options: Options) -> None:
    quiet = replace(options, progress=None if no_model else options.progress, printed=None)
    workers = NoWorkers() if no_model else None
    with geometry_of(workspace, quiet, lock=lambda: read_lock(workspace, Report()), workers=workers) as geometry:
        outcome = Schemas(workspace, geometry).write(only)
    folder = shown_path(os.path.join(workspace.root, SCHEMAS))
    unchanged = len(outcome.documents) - len(outcome.written) - len(outcome.kept)
    parts = [f"{len(outcome.written)} written", f"{unchanged} unchanged"]
    parts += [f"{len(outcome.removed)} removed"] if outcome.removed else []
    console.say(f"{folder}: schemas of {format_count(len(outcome.documents), 'document')}: {', '.join(parts)}")
    for name in outcome.kept:
        document = shown_path(os.path.join(workspace.root, name))
        console.say(f"{document}: the schema was not updated because of a syntax error")
