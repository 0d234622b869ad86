"""Implementation of `thingc rename`, which renames an element of a document and updates all references to the element.

Also updates tests, variants, the Python code of parts, and other documents that use the element. If a reference would then refer to another
element, nothing is written.

  thingc rename assemblies/arm.yaml components.hand gripper
  thingc rename assemblies/arm.yaml joints.yaw turn --diff      show the change, write nothing
"""

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
from thingc.documents.names.part_names import Name
from thingc.documents.names.rename import RenameRefused, rename_edits
from thingc.documents.names.workspace_index import WorkspaceIndex, index_workspace, read_from_disk
from thingc.documents.workspace import Workspace
from thingc.tools.cli import console, signals


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc rename` to the parser."""
    parser.set_defaults(stdout_errors=True)
    parser.add_argument("document", metavar="DOC", help="an assembly or materials document (YAML or TOML)")
    parser.add_argument("path", metavar="PATH", help="path of the element, such as components.hand")
    parser.add_argument("name", metavar="NAME", help="the new name of the element")
    parser.add_argument("--diff", action="store_true", help="show the changes without writing them")


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc rename`, and return the exit code, which is 0 if the element was renamed (with `--diff`: can be renamed)."""
    report = Report()
    console.require_document(arguments.document)
    workspace = Workspace.find(os.path.abspath(arguments.document), report)
    if workspace is None:
        return console.print_text(report.sorted_diagnostics(), stream=sys.stdout, debug=False)
    sight = index_workspace(workspace, {}, disk=cache(read_from_disk))  # read each file only once
    declared = _find_name(sight, arguments.document, arguments.path)
    try:
        result = rename_edits(sight, declared, arguments.name)
    except RenameRefused as fault:
        raise console.WrongCommandLine(str(fault)) from fault
    old = {file: sight.read(file) or "" for file in result.texts}
    for file, text in result.texts.items():
        if arguments.diff:
            console.say_diff(shown_path(file), old[file], text)
    if not arguments.diff:
        marks = {file: mark if beginning(file, 3) == (mark := b"\xef\xbb\xbf") else b"" for file in old}
        with signals.delay_signals():
            replace_files({file: (marks[file] + old[file].encode(), marks[file] + text.encode()) for file, text in result.texts.items()})
        for file in result.texts:
            count = sum(span.file == file for span in result.places)
            console.say(f"{shown_path(file)}: {declared.text} -> {arguments.name} ({count})")
    return 0


def _find_name(sight: WorkspaceIndex, document: str, path: str) -> Name:
    """Return the name that a document declares at the given path. Raises `WrongCommandLine` if the document does not declare this name."""
    keys = tuple(path.split("."))
    written = sight.documents.get(os.path.abspath(document))
    if written is None:
        raise console.WrongCommandLine(f"`{document}` cannot be read", f"run `thingc check {document}`")
    names = entries_of(node_at(written.document.tree, keys[:-1]))
    if keys[-1] not in names:
        raise console.WrongCommandLine(f"`{document}` has no `{path}`", did_you_mean(keys[-1], names, what="names") if names else "")
    span = written.document.span(keys, key=True)
    place = sight.index.at(written.path, span.line, span.column + 1)
    if place is None or not span.holds(place.span) or place.role != "declared":
        raise console.WrongCommandLine(f"`{path}` cannot be renamed", "write, for example, `components.NAME` or `joints.NAME`")
    return place.name
