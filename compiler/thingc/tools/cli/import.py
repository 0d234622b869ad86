"""Implementation of `thingc import`, which converts a robot from another format, such as URDF, or a STEP assembly to a workspace.

Writes a document that you can edit, and `import.json`. This file lists the names and the losses, each with its line in the source file.

  thingc import robot.urdf                       write to a folder with the name of the robot
  thingc import robot.urdf -o robots/arm
  thingc import robot.urdf --repair inertia=nearest
  thingc import robot.urdf --root left_sole      add a mode with this link as root
  thingc import robot.urdf --update              import again: merge changes of the file, preserve your edits
  thingc import robot.step -o robot              a document for each assembly, and a STEP file for each part
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from typing import TYPE_CHECKING

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report, Severity, shown_path
from thingc.base.one_line_repr import format_count
from thingc.base.replacement import provisional
from thingc.base.safe_text import quote_names
from thingc.base.source import format_path
from thingc.driver.edit_document import check_document
from thingc.driver.environment import Options
from thingc.driver.output import OutputError, write_new
from thingc.tools.cli import console, robot_files, signals
from thingc.tools.importing.importing import Imported, import_robot
from thingc.tools.importing.three_way_merge import NOTHING
from thingc.tools.importing.update_import import PreviousImport, Update, earlier_import, update

if TYPE_CHECKING:
    from thingc.tools.importing.step import ImportedAssembly

MOST_SAID = 20
"""Maximum number of changes to print. `git diff` shows all changes."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc import` to the parser."""
    add = parser.add_argument
    add("file", metavar="FILE", help="robot (.urdf, .xacro, .sdf, .xml) or assembly (.step, .stp) to convert")
    add("-o", "--output", metavar="DIR", help="output folder (default: the name of the robot)")
    robot_files.configure(parser)
    add("--check", action="store_true", help="list imported elements, repairs and losses without writing files")
    add("--root", metavar="LINK", action="append", default=[], help="add a mode with this link as root (may be repeated)")
    add("--keep", action="store_true", help="keep fixed links as separate bodies")
    add("--update", action="store_true", help="update an earlier import, and preserve your edits")


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc import`, and return the exit code: 0 if the document was written, 1 for errors in the file, 2 for an invalid command
    line.
    """
    report = Report()
    if arguments.file.lower().endswith((".step", ".stp")):
        return _import_step(arguments, report)
    request = replace(
        robot_files.import_request(arguments), roots=arguments.root, update=arguments.update, keep=arguments.keep,
        earlier=lambda name: earlier_import(arguments.output or name),
    )
    imported = import_robot(arguments.file, report, request)
    texts: dict[str, str] = {}
    if imported is not None:
        try:
            if imported.earlier is not None:
                texts = _update(arguments, imported, imported.earlier, report)
            elif arguments.check:
                console.say(*_would(arguments, imported))
            else:
                with signals.delay_signals():
                    folder = write_new(arguments.output or imported.name, imported.files)
                console.say(*_format_result(arguments, imported, folder, []))
        except OutputError as fault:
            report.say(fault.diagnostic)
    return console.print_text(report.sorted_diagnostics(), stream=sys.stderr, debug=False, texts=texts)


def _import_step(arguments: argparse.Namespace, report: Report) -> int:
    """Import a STEP assembly, and return the exit code."""
    from thingc.driver.environment import store_of
    from thingc.tools.importing.step import import_step

    options = ("package", "arg", "repair", "mesh_root", "no_meshes", "root", "update")
    used = ["--" + name.replace("_", "-") for name in options if getattr(arguments, name)]
    if used:
        report.add(Code.COMMAND_LINE, f"{used[0]} cannot be used with a STEP file", None, help=f"remove {used[0]}")
    imported = None if used else import_step(arguments.file, store_of(Options()), report)
    if imported is not None:
        try:
            folder = "" if arguments.check else write_new(arguments.output or imported.name, imported.files)
            console.say(*_assembly_lines(arguments, imported, folder))
        except OutputError as fault:
            report.say(fault.diagnostic)
    return console.print_text(report.sorted_diagnostics(), stream=sys.stderr, debug=False)


def _assembly_lines(arguments: argparse.Namespace, imported: ImportedAssembly, folder: str) -> list[str]:
    """Describe an imported STEP assembly, and suggest commands that the user can run next."""
    assembly, folder_text = imported.assembly, shown_path(folder)
    components = sum(len(group.children) for group in assembly.assemblies)
    counts = [(len(assembly.assemblies), "document"), (components, "component"), (len(assembly.parts), "part")]
    words = [format_count(number, what) for number, what in counts]
    source = os.path.basename(arguments.file)
    lines = [f"{'would import' if arguments.check else folder_text + ':'} {', '.join(words[:-1])} and {words[-1]} of {source}"]
    lines += [f"  {note}" for note in _some([*imported.notes])]
    document = shlex.quote(os.path.join(folder_text, f"{imported.name}.yaml"))
    return lines if arguments.check else [
        *lines, "", f"  thingc check {document}    report errors and warnings", f"  thingc joints {document}   propose joints",
    ]


def _update(arguments: argparse.Namespace, imported: Imported, earlier: PreviousImport, report: Report) -> dict[str, str]:
    """Merge changes in the source file into the folder of an earlier import. Return the text of the merged document for diagnostics.

    Raises `OutputError`.
    """
    if earlier.source != os.path.basename(arguments.file) and not arguments.update:
        message = f"`{shown_path(earlier.folder)}` contains the import of `{earlier.source}` with the robot `{earlier.robot}`"
        raise OutputError(message, "choose another folder with -o, or merge with `--update`")
    edited = [shown_path(os.path.join(earlier.folder, name)) for name in earlier.edited_files()]
    if edited and not arguments.update and not arguments.check:
        message = f"imported files were modified after the import ({quote_names(edited, 6)})"
        raise OutputError(message, "merge with `--update`, or choose another folder with -o")
    now = update(earlier, imported.document, imported.files, report)
    if now is None:
        return {}
    document = os.path.join(earlier.folder, earlier.document)
    texts = {document: now.merged.text}
    if arguments.check:
        console.say(*_would(arguments, imported), *_describe_merge(now, disputed=report.failed))
        return texts
    fresh = {path: change for path, change in now.changes.items() if change[0] is None}
    with provisional(fresh) as keep:
        faults = _faults(document, now.merged.text) if edited else []
        if faults:
            for fault in faults:
                report.say(fault)
            return texts
        with signals.delay_signals():
            keep({path: change for path, change in now.changes.items() if path not in fresh})
    console.say(*_format_result(arguments, imported, earlier.folder, _describe_merge(now, disputed=report.failed)))
    return texts


def _faults(document: str, text: str) -> list[Diagnostic]:
    """Check the text of a document, and return the errors without the warnings."""
    return [one for one in check_document(document, Options(texts={document: text.encode()}))[1] if one.severity is Severity.ERROR]


def _describe_merge(now: Update, *, disputed: bool) -> list[str]:
    """Describe the changes in the source that were merged into the document, and the user's edits that were preserved.

    `disputed` is true if a change in the source conflicts with a user's edit.
    """
    from_source = [f"  {format_path(path)}: {_became(old, new)}" for path, old, new in now.merged.taken]
    from_user = [f"  {name}" for name in (*map(format_path, now.merged.kept), *now.kept)]
    lines = [f"merged: {format_count(len(from_source), 'change')} of the source", *_some(from_source)] if from_source else []
    if not from_source and not disputed:
        lines = ["no changes in the source"]
    return lines + ([f"preserved edits: {len(from_user)}", *_some(from_user)] if from_user else [])


def _became(old: str, new: str) -> str:
    """Describe how a value in the document has changed."""
    if new == NOTHING:
        return f"removed, was {old}"
    return f"new, {new}" if old == NOTHING else f"{old} -> {new}"


def _some(lines: list[str]) -> list[str]:
    return lines[:MOST_SAID] + ([f"  and {len(lines) - MOST_SAID} more"] if len(lines) > MOST_SAID else [])


def _would(arguments: argparse.Namespace, imported: Imported) -> list[str]:
    """Describe the result of a dry run of an import: the content of the robot, the repairs, and all losses with their line numbers."""
    source = os.path.basename(arguments.file)
    notes = [f"{source}:{note.span.line}: {note.message}" for note in imported.notes() if note.span is not None]
    return [f"would import {_read(arguments, imported)}", *notes]


def _read(arguments: argparse.Namespace, imported: Imported) -> str:
    robot, meshes = imported.robot, sum(name.startswith("meshes/") for name in imported.files)
    counts = [(len(robot.links), "link"), (sum(len(one.joints) for one in robot.attachments), "joint"), (meshes, "mesh")]
    phrases = [format_count(count, what) for count, what in counts if count or what != "mesh"]
    return f"{', '.join(phrases[:-1])} and {phrases[-1]} of {os.path.basename(arguments.file)}"


def _format_result(arguments: argparse.Namespace, imported: Imported, folder: str, changes: list[str]) -> list[str]:
    """Describe the files that an import has written, and suggest commands that the user can run next."""
    robot, folder_text = imported.robot, shown_path(folder)
    lines = [f"{folder_text}: {_read(arguments, imported)}", *changes]
    if imported.renamed:
        lines.append(f"renamed: {format_count(len(imported.renamed), 'element')}, listed in {os.path.join(folder_text, 'import.json')}")
    if imported.repaired:
        lines.append(f"repaired: {quote_names([one.link.name for one in imported.repaired], 6)}; old and new numbers are in import.json")
    if imported.losses:
        lines.append(f"not imported: {format_count(len(imported.losses), 'element')}, listed in {os.path.join(folder_text, 'import.json')}")
        lines += [f"  {one.what}: {one.why}" for one in imported.losses if one.what.startswith("the indices of")]
    document = shlex.quote(os.path.join(folder_text, imported.document))
    steps = [
        (f"thingc check {document}", "report errors and warnings"),
        (f"thingc view {document}", "show the robot in your browser, updated after every save"),
        (f"thingc build {document} --emit mjcf,urdf", "write models of every mode"),
    ]
    if not arguments.root and len(robot.links) > 1:
        lines.append("for another root, use `--root LINK`, or add a mode to the document")
    width = max(len(command) for command, _ in steps)
    return [*lines, "", *(f"  {command:{width}}   {what}" for command, what in steps)]
