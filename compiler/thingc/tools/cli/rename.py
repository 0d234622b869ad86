"""`thingc rename`: gives something in a document another name, wherever it is written."""

from __future__ import annotations

import argparse
import os
import sys
from functools import cache

from thingc.base.diagnostics import Report, shown_path
from thingc.base.filesystem import beginning
from thingc.base.replacement import replace_files
from thingc.base.source import entries_of, node_at
from thingc.base.suggestions import did_you_mean
from thingc.documents.names.index import Name
from thingc.documents.names.rename import RenameRefused, rename_edits
from thingc.documents.names.workspace_index import WorkspaceIndex, index_workspace, on_disk
from thingc.documents.workspace import Workspace
from thingc.tools.cli import console, signals

EPILOG = """\
What is renamed is named by its path. Documents that use it, tests, variants, and the Python of parts follow; where something would
mean something else then, nothing is written.

  thingc rename assemblies/arm.yaml components.hand gripper
  thingc rename assemblies/arm.yaml joints.yaw turn --diff      show it, and write nothing
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `rename`."""
    parser.epilog = EPILOG
    parser.add_argument("document", metavar="DOC", help="an assembly or materials document (YAML or TOML)")
    parser.add_argument("path", metavar="PATH", help="what is renamed: components.hand, joints.yaw, components.hand.mounts.tip")
    parser.add_argument("name", metavar="NAME", help="what it is called then")
    parser.add_argument("--diff", action="store_true", help="write nothing, show what would change")


def run(arguments: argparse.Namespace) -> int:
    """Exit code 0 where it is renamed (with `--diff`: could be)."""
    report = Report()
    try:
        console.require_document(arguments.document)
        workspace = Workspace.find(os.path.abspath(arguments.document), report)
        if workspace is None:
            return console.print_text(report.ordered(), stream=sys.stdout, debug=False)
        sight = index_workspace(workspace, {}, disk=cache(on_disk))  # of each file one state is read
        declared = _named(sight, arguments.document, arguments.path)
        done = rename_edits(sight, declared, arguments.name)
    except console.WrongCommandLine as fault:
        return console.print_text([fault.diagnostic], stream=sys.stdout, debug=False)
    except RenameRefused as fault:
        return console.print_text([console.WrongCommandLine(str(fault)).diagnostic], stream=sys.stdout, debug=False)
    before = {file: sight.read(file) or "" for file in done.texts}
    for file, text in done.texts.items():
        if arguments.diff:
            console.say_diff(shown_path(file), before[file], text)
    if not arguments.diff:
        marks = {file: mark if beginning(file, 3) == (mark := b"\xef\xbb\xbf") else b"" for file in before}
        with signals.held():
            replace_files({file: (marks[file] + before[file].encode(), marks[file] + text.encode()) for file, text in done.texts.items()})
        for file in done.texts:
            count = sum(span.file == file for span in done.places)
            console.say(f"{shown_path(file)}: {declared.text} -> {arguments.name} ({count})")
    return 0


def _named(sight: WorkspaceIndex, document: str, path: str) -> Name:
    """What a document declares at a path. Raises `common.WrongCommandLine`."""
    keys = tuple(path.split("."))
    written = sight.documents.get(os.path.abspath(document))
    if written is None:
        raise console.WrongCommandLine(f"`{document}` cannot be read", f"`thingc check {document}` says why")
    names = entries_of(node_at(written.document.tree, keys[:-1]))
    if keys[-1] not in names:
        raise console.WrongCommandLine(f"`{document}` has no `{path}`", did_you_mean(keys[-1], names, what="names") if names else "")
    span = written.document.span(keys, key=True)
    place = sight.index.at(written.path, span.line, span.column + 1)
    if place is None or not span.holds(place.span) or place.role != "declared":
        raise console.WrongCommandLine(f"`{path}` is no name", "name for example `components.NAME` or `joints.NAME`")
    return place.name
