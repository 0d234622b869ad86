"""Implementation of `thingc fmt`, which formats documents in the canonical layout.

Sorts keys as in the language reference (your own names keep their order), indents by two spaces, and separates top-level blocks by
one empty line. Comments and values never change.

  thingc fmt assemblies                  format every document in a folder
  thingc fmt --check --diff assemblies   show what would change; exit code 1 for CI
  thingc fmt - < robot.yaml              format standard input to standard output, for editors
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator

from thingc.base.diagnostics import Code, Report, shown_path
from thingc.base.one_line_repr import format_count
from thingc.base.replacement import ReplacementRefused, replace_files
from thingc.documents.format.formatting import format_document, schema_path
from thingc.documents.load.discovery import documents_in, is_document
from thingc.documents.workspace import OWN_FILE, Workspace
from thingc.tools.cli import console

STANDARD_INPUT = "-"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc fmt` to the parser."""
    parser.set_defaults(stdout_errors=True)
    add = parser.add_argument
    add("document", metavar="DOC", nargs="+", help="document, folder of documents, or - for standard input")
    add("--check", action="store_true", help="check whether the files are formatted")
    add("--diff", action="store_true", help="show the changes without writing them")
    add("--modeline", action="store_true", help="write the path of the schema into the first line of each document")
    add("--touched", action="store_true", help="skip files that are not documents")


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc fmt`. Return the exit code 1 if a document is not well-formed or, with `--check`, not formatted, else 0."""
    if arguments.document == [STANDARD_INPUT]:
        return _standard_input(arguments)
    report = Report()
    paths = list(_documents(arguments))
    changed = sum(_one(path, arguments, report) for path in paths)
    code = console.print_text(report.sorted_diagnostics(), stream=sys.stdout, debug=False)
    if not arguments.diff:
        would = " would be" if arguments.check else ""
        console.say(f"{changed} of {format_count(len(paths), 'document')}{would} changed")
    return code or int(arguments.check and changed > 0)


def _documents(arguments: argparse.Namespace) -> Iterator[str]:
    """Yield the paths of the documents on the command line, without duplicates. Raises `WrongCommandLine` for an invalid path."""
    seen: set[str] = set()
    for word in arguments.document:
        if os.path.isdir(word) and not arguments.touched:
            workspace_file = os.path.join(word, OWN_FILE)
            paths = [*([workspace_file] if os.path.isfile(workspace_file) else []), *(shown_path(path) for path in documents_in(word))]
        elif arguments.touched:
            paths = [word] if is_document(word) or os.path.basename(word) == OWN_FILE and os.path.isfile(word) else []
        else:
            if word == STANDARD_INPUT:
                raise console.WrongCommandLine("`-` cannot be combined with documents", "write documents, or only `-` for standard input")
            console.require_document(word)
            paths = [word]
        for path in paths:
            if os.path.realpath(path) not in seen:
                seen.add(os.path.realpath(path))
                yield path


def _one(path: str, arguments: argparse.Namespace, report: Report) -> bool:
    """Format one document, and return whether the text of the document changes."""
    try:
        with open(path, "rb") as stream:
            data = stream.read(10_000_001)
    except OSError as fault:
        report.add(Code.UNREADABLE, f"cannot read `{path}`: {(fault.strerror or 'unknown error').lower()}", None)
        return False
    report_of_file = Report()
    schema = None
    if arguments.modeline:
        workspace = Workspace.find(path, report_of_file)
        schema = schema_path(workspace.relative(path)) if workspace is not None else None
    formatted = format_document(os.path.abspath(path), data, report_of_file, schema=schema)
    report.diagnostics.extend(report_of_file.diagnostics)
    if formatted is None or formatted == data:
        return False
    if arguments.diff:
        console.say_diff(path, data.decode("utf-8-sig"), formatted.decode("utf-8-sig"))
    elif arguments.check:
        console.say(f"{path}: would be changed")
    else:
        try:
            replace_files({path: (data, formatted)})
        except ReplacementRefused as fault:
            report.say(fault.diagnostic)
            return False
        console.say(f"{path}: changed")
    return True


def _standard_input(arguments: argparse.Namespace) -> int:
    data = sys.stdin.buffer.read(10_000_001)
    report = Report()
    # the first key shows the format: `thingc:` or `thingc =`
    name = "<stdin>.toml" if any(line.replace(b" ", b"").startswith(b"thingc=") for line in data.splitlines()) else "<stdin>"
    formatted = format_document(name, data, report)
    if formatted is None:
        texts = {name: data.decode("utf-8-sig", errors="replace")}
        return console.print_text(report.sorted_diagnostics(), stream=sys.stderr, debug=False, texts=texts)
    changed = formatted != data
    if arguments.diff:
        console.say_diff("<stdin>", data.decode("utf-8-sig"), formatted.decode("utf-8-sig"))
    elif not arguments.check:
        console.write_raw(formatted)
    return int(arguments.check and changed)
