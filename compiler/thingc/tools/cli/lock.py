"""Implementation of `thingc lock`, which writes the properties of the parts in a workspace to a lock file.

Writes parts.lock.json at the root of the workspace: parameters with units, defaults and bounds, mounts, volumes, masses and a hash of
the code, for every Thing in the part folders and every part that a document uses. Commit the file with the documents. This command
runs the code of parts in a worker process; `thingc check --no-code` then needs neither this code nor a CAD kernel.

  thingc lock
  thingc lock --check          check that the file is up to date, in a pipeline that trusts the code
"""

from __future__ import annotations

import argparse
import json
import os
import sys

from thingc.base.diagnostics import Code, Report, shown_path
from thingc.base.filesystem import write_whole
from thingc.base.one_line_repr import format_count
from thingc.base.safe_text import json_text
from thingc.base.source import Span, line_of
from thingc.documents.load.discovery import documents_in
from thingc.documents.workspace import Workspace
from thingc.driver.environment import Environment, Options, geometry_of
from thingc.driver.pipeline import read
from thingc.geometry.lock.lock import LOCK_FILE, MAX_BYTES, REMAKE, lock_path, read_lock
from thingc.geometry.print_slices import Slicing
from thingc.geometry.record import PartDefinition, PartFailure
from thingc.geometry.service import GeometryService
from thingc.model.assembly.mass import slicings_of
from thingc.model.resolve.resolver import Settings, resolve
from thingc.tools.cli import console
from thingc.tools.cli.lock_content import create_lock, differences, lock_text
from thingc.tools.cli.parts import unreadable


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc lock` to the parser."""
    parser.add_argument("folder", metavar="FOLDER", nargs="?", default=".", help="a folder of the workspace (default: the working folder)")
    parser.add_argument("--check", action="store_true", help="check whether parts.lock.json is up to date")
    console.add_format(parser, console.FINDINGS)
    console.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc lock`, and return the exit code, which is 0 if the lock file was written (with `--check`: is up to date)."""
    report = Report()
    options = console.options_of(arguments)
    if not os.path.isdir(arguments.folder):
        raise console.WrongCommandLine(f"`{arguments.folder}` is not a folder", "use the folder of a workspace")
    line = _lock(arguments.folder, options, report, check=arguments.check)
    stream = sys.stdout if arguments.check else sys.stderr
    code = console.print_found(report.sorted_diagnostics(), arguments.format, stream=stream, debug=arguments.debug)
    if line is not None and arguments.format == "text":
        console.say(line)
    return code


def _lock(folder: str, options: Options, report: Report, *, check: bool) -> str | None:
    """Write the lock file, or compare the lock file with the current parts. Return a summary, or None after reporting an error."""
    workspace = Workspace.find(os.path.join(folder, "thingc.toml"), report)
    if workspace is None:
        return None
    with geometry_of(workspace, options) as geometry:
        references, definitions, slicings = _used_parts(workspace, geometry, options, report)
        values, failures = create_lock(geometry, references, definitions, slicings)
    labels = {definition.text: definition.label for definition in definitions}
    for failure in failures:
        report.say(unreadable(labels.get(failure.subject, failure.subject), "locked", failure))
    if report.failed:
        return None
    text, path = lock_text(values), lock_path(workspace)
    display_path = shown_path(path)
    if not check:
        if len(text.encode()) > MAX_BYTES:
            report.add(Code.TOO_LARGE, f"`{LOCK_FILE}` exceeds the maximum size ({MAX_BYTES} bytes)", None, help="split the workspace")
            return None
        write_whole(path, text.encode())
        return f"{display_path}: {format_count(len(values['things']) + len(values['files']), 'part')}"
    if not os.path.lexists(path):
        report.add(Code.NO_LOCK, f"there is no `{LOCK_FILE}` in the workspace folder", workspace.origin, help=REMAKE)
        return None
    if read_lock(workspace, report) is None:
        return None
    with open(path, encoding="utf-8") as stream:
        current = stream.read()
    lines = current.split("\n")
    for key, words in differences(json.loads(current), values):
        report.add(Code.LOCK_STALE, f"`{LOCK_FILE}` is out of date: {words}", _line(path, lines, key), help="run `thingc lock`")
    return None if report.failed else f"{display_path}: current"


def _used_parts(
    workspace: Workspace, geometry: GeometryService, options: Options, report: Report,
) -> tuple[list[str], list[PartDefinition], dict[str, set[Slicing]]]:
    """Return the parts that the assembly documents of a workspace use.

    The result contains the references `module:Class`, the part definitions, and the slicing settings for each definition.
    """
    references: dict[str, None] = {}
    definitions: dict[str, PartDefinition] = {}
    slicings: dict[str, set[Slicing]] = {}
    for document in documents_in(workspace.root, workspace):
        environment = Environment(document, options, lambda *_: geometry)
        sources = read(environment, kinds=("assembly", "materials", "variants", "calibration"), modelling=True, lumps=False)
        report_of_document = Report()
        if sources is not None and sources.documents.root.kind == "assembly":
            model = resolve(sources, Settings(), report_of_document)
            references.update(dict.fromkeys(sources.schemas))
            if model is not None:
                used = {definition.text: definition for definition in model.part_definitions(lumps=True)}
                definitions = {**used, **definitions}
                for text, ways in slicings_of(model, geometry.realize(list(used.values()))).items():
                    slicings.setdefault(text, set()).update(ways)
        if environment.report.failed or report_of_document.failed:
            message = f"parts of `{shown_path(document)}` may be missing from `{LOCK_FILE}`"
            report.warn(Code.LOCK_DOCUMENT, message, line_of(document), help=f"run `thingc check {shown_path(document)}`")
    # missing parts have already been reported as errors in a document
    known = {reference for reference, answer in geometry.describe(list(references)).items() if not isinstance(answer, PartFailure)}
    return sorted(known), list(definitions.values()), slicings


def _line(path: str, lines: list[str], key: str) -> Span:
    """Return the span of a key in the lock file. If the key is missing, return the span of the first line."""
    word = json_text(json.dumps(key, ensure_ascii=False))
    for number, line in enumerate(lines, 1):
        if line.lstrip().startswith(word + ":"):
            column = len(line) - len(line.lstrip()) + 1
            return Span(file=path, line=number, column=column, end_line=number, end_column=column + len(word))
    return line_of(path)
