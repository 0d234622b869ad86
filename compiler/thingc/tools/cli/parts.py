"""Implementation of `thingc parts`, which lists the available parts with their parameters and mounts.

Lists the Things in the part folders of the workspace and in the allowed packages. For parts given as arguments, the command also shows the
frames of their mounts for default parameters (the axes of the part along x, y and z of the mount) and the names of their reference
geometry. An argument can be any part that a document can use, such as a shape, a function, or a class of another installed package.

  thingc parts
  thingc parts thingc_stock bd_warehouse.fastener:SocketHeadCapScrew
  thingc parts arm:RotorBrace
  thingc parts --format json | jq '.parts[].reference'
"""

from __future__ import annotations

import argparse
import os
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence

from thingc.base.diagnostics import Code, Diagnostic, Report, Severity
from thingc.base.interfaces import format_interface
from thingc.base.source import line_of
from thingc.base.suggestions import did_you_mean
from thingc.documents.workspace import Workspace
from thingc.driver.environment import geometry_of
from thingc.geometry.key.catalogue import classes_installed, installed_modules
from thingc.geometry.part_source import PartSource, report_hidden
from thingc.geometry.record import NO_PARTS, MountRecord, ParameterSchema, PartFailure, PartRecord, PartSchema
from thingc.geometry.service import GeometryService
from thingc.tools.cli import console

WIDTH = 120
"""Maximum number of characters in a line of names."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc parts` to the parser."""
    parser.add_argument("part", metavar="PART", nargs="*", help="part (module:Class), module or package to list")
    parser.add_argument("-C", "--workspace", metavar="DIR", default=".", help="a folder of the workspace (default: the working folder)")
    console.add_no_code(parser)
    console.add_format(parser)
    console.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc parts`, and return the exit code. If a part class cannot be described, report an error and list all other parts."""
    report = Report()
    listed: list[tuple[PartSchema, PartRecord | None]] = []
    try:
        options = console.options_of(arguments)
        if not os.path.isdir(arguments.workspace):
            raise console.WrongCommandLine(f"`{arguments.workspace}` is not a folder", "use the folder of a workspace")
        workspace = Workspace.find(os.path.join(arguments.workspace, "thingc.toml"), report)
        if workspace is not None and arguments.no_code:
            listed = _locked_parts(workspace, arguments.part, report)
        elif workspace is not None:
            with geometry_of(workspace, options) as geometry:
                listed = _list_parts(geometry, arguments.part, report)
        diagnostics = report.sorted_diagnostics()
    except console.WrongCommandLine as fault:
        diagnostics = [fault.diagnostic]
    if not listed and not diagnostics and arguments.format == "text":
        console.say("no parts found in the `parts` folders of the workspace", stream=sys.stderr)
    lines = [line for schema, record in listed for line in ("", *_as_text(schema, record, details=bool(arguments.part)))][1:]
    return console.print_result(arguments, diagnostics, lines, parts=[_as_data(schema, record) for schema, record in listed])


def _list_parts(geometry: GeometryService, requested: list[str], report: Report) -> list[tuple[PartSchema, PartRecord | None]]:
    references = _parts_named(geometry, requested) if requested else geometry.catalogue()
    if not requested:
        report.diagnostics.extend(unreadable(failure.subject, "read", failure) for failure in geometry.not_python())
    report_hidden(geometry, ((reference, None) for reference in references), report)
    return _describe_parts(geometry, references, requested, report)


def _locked_parts(workspace: Workspace, requested: list[str], report: Report) -> list[tuple[PartSchema, PartRecord | None]]:
    """Return the parts in the lock file, without running their code. Raises `WrongCommandLine` for an unknown name."""
    from thingc.geometry.lock.lock import read_lock, report_bad, report_missing
    from thingc.geometry.lock.reader import LockOnlyGeometry

    lock = read_lock(workspace, report)
    if lock is None:
        report_missing(workspace, report)
        return []
    geometry, references = LockOnlyGeometry(workspace, lock), sorted(lock.things)
    for word in requested:
        if not _matching(word, references):
            raise console.WrongCommandLine(f"`parts.lock.json` does not contain `{word}`", did_you_mean(word, references, what="parts"))
    chosen = sorted({one for word in requested for one in _matching(word, references)}) if requested else references
    listed = _describe_parts(geometry, chosen, requested, report)
    for fault in geometry.broken:
        report_bad(lock.file, fault, report)
    return listed


def _describe_parts(
    geometry: PartSource, references: Sequence[str], requested: Sequence[str], report: Report,
) -> list[tuple[PartSchema, PartRecord | None]]:
    """Return the schemas of parts, and the records for their default parameters. Errors in parts are added to the report."""
    schemas: list[PartSchema] = []
    answers = geometry.describe(references)
    for reference in references:  # the results are in the order in which they were finished
        answer = answers[reference]
        if isinstance(answer, PartSchema):
            if answer.kind == "thing" or requested:
                schemas.append(answer)
        elif answer.kind not in NO_PARTS or reference in requested:
            report.diagnostics.append(unreadable(reference, "read", answer))
    definitions = {schema.reference: schema.default for schema in schemas}
    records = geometry.realize([definition for definition in definitions.values() if definition is not None])
    built = {reference: record for reference, record in records.items() if isinstance(record, PartRecord) and record.exact}
    return [(schema, built.get(schema.reference)) for schema in schemas]


def _parts_named(geometry: GeometryService, words: list[str]) -> list[str]:
    """Return the references of the parts with the given names, which can be names of parts, modules or packages.

    Raises `WrongCommandLine` for an unknown name.
    """
    references = geometry.catalogue()
    installed = installed_modules(geometry.part_code.sources, geometry.workspace.packages)
    for module in {word.partition(":")[0] for word in words} & installed.keys():
        references += classes_installed(module, installed[module])
    chosen: dict[str, None] = {}
    for word in words:
        named = _matching(word, references)
        if not named and ":" in word and not isinstance(geometry.part_code.code(word), PartFailure):
            named = [word]  # a function, or a class that a package imports from another package
        modules = [module for module in installed if module.startswith(f"{word}.")]
        if not named and modules:
            help = f"list one of the modules {', '.join(f'`{module}`' for module in modules)}"
            raise console.WrongCommandLine(f"the package `{word}` has too many modules to list ({len(modules)})", help)
        if not named:
            known = {*references, *(one.partition(":")[0] for one in references), *installed}
            raise console.WrongCommandLine(f"there is no part `{word}`", did_you_mean(word, known, what="parts"))
        chosen.update(dict.fromkeys(named))
    return sorted(chosen)


def _matching(word: str, references: Iterable[str]) -> list[str]:
    """Return the references of parts with the given name, or in the module or package with this name."""
    return [one for one in references if word in (one, one.partition(":")[0]) or one.startswith(f"{word}.")]


def unreadable(called: str, done: str, failure: PartFailure) -> Diagnostic:
    """Create the error diagnostic for a part that could not be read or built.

    `done` is the past participle of the failed operation, such as `read`. `called` is the name of the part in the error message.
    """
    span = None if failure.file is None else line_of(failure.file, failure.line or 1, failure.column)
    return Diagnostic(
        code=Code.PART_UNREADABLE, severity=Severity.ERROR, message=f"`{called}` cannot be {done}: {failure.message}",
        span=span, path=failure.subject, help="fix the part file", detail=failure.detail,
    )


def _as_data(schema: PartSchema, record: PartRecord | None) -> dict[str, object]:
    return {
        "reference": schema.reference, "doc": schema.doc, "material": schema.material, "actuator": schema.actuator,
        "parameters": [
            {
                "name": p.name, "kind": p.kind, "required": p.required, "default": p.default, "minimum": p.minimum,
                "maximum": p.maximum, "choices": list(p.choices), "doc": p.doc,
            }
            for p in schema.parameters
        ],
        "mounts": None if record is None else {
            name: {"pose": [list(row) for row in mount.pose.rows()], "interface": mount.interface}
            for name, mount in sorted(record.mounts.items())
        },
        "references": None if record is None else sorted(record.references),
    }


def _as_text(schema: PartSchema, record: PartRecord | None, *, details: bool) -> list[str]:
    """Format the description of a part as lines of text.

    If `details` is true, include the frames of the mounts, and the reference geometry.
    """
    lines = [schema.reference]
    first = schema.doc.strip().partition("\n")[0]
    if first:
        lines.append(f"  {first}")
    for p in schema.parameters:
        lines.append(f"  {p.name}: {_kind(p)}{_range(p)}" + (f"  {p.doc}" if p.doc else ""))
    if schema.material:
        lines.append(f"  material: {schema.material} by default")
    if schema.actuator:
        lines.append("  has an actuator: use it in `drive` of a joint")
    if record is None:
        lines.append("  mounts: unknown for the default parameters")
    elif record.mounts and details:
        lines += [f"  {line}" for line in _mounts(record.mounts)]
    elif record.mounts:
        lines.append(f"  mounts: {', '.join(_runs(record.mounts))}")
    if details and record is not None and record.references:
        names = f"reference geometry: {', '.join(sorted(record.references))}"
        lines += textwrap.wrap(names, WIDTH, initial_indent="  ", subsequent_indent="    ", break_long_words=False)
    return lines


def _mounts(mounts: Mapping[str, MountRecord]) -> list[str]:
    """Format the mounts of a part as a table with positions, axes, and interfaces.

    The table has no column for interfaces if no mount has an interface.
    """
    rows = [("mount", "at [mm]", "x, y, z along", "interface")]
    rows += [
        (
            name, console.millimetres(mount.pose.translation), console.axes(mount.pose.rotation),
            format_interface(mount.interface, mount.features),
        )
        for name, mount in sorted(mounts.items(), key=lambda entry: _in_order(entry[0]))
    ]
    return console.table(rows if any(row[3] for row in rows[1:]) else [row[:3] for row in rows])


def _in_order(name: str) -> tuple[str, int]:
    """Return a sort key for the name of a mount. `hole_9` is sorted before `hole_10`."""
    stem, _, index = name.rpartition("_")
    return (stem, int(index)) if stem and index.isdecimal() else (name, -1)


def _kind(p: ParameterSchema) -> str:
    kind = " | ".join(str(c) for c in p.choices) if p.choices else p.kind
    return f"{kind}, required" if p.default is None else f"{kind} = {p.format_value(p.default)}"


def _range(p: ParameterSchema) -> str:
    bounds = [f"{word} {p.format_value(bound)}" for word, bound in (("from", p.minimum), ("to", p.maximum)) if bound is not None]
    return f" ({' '.join(bounds)})" if bounds else ""


def _runs(names: Iterable[str]) -> list[str]:
    """Abbreviate lists of numbered mounts: `hip_0`, `hip_1`, `hip_2` become `hip_0 ... hip_2`."""
    lists: dict[str, int] = {}
    plain: list[str] = []
    for name in names:
        stem, _, index = name.rpartition("_")
        if stem and index.isdigit():
            lists[stem] = lists.get(stem, 0) + 1
        else:
            plain.append(name)
    return sorted([*plain, *(f"{stem}_0 ... {stem}_{count - 1}" if count > 1 else f"{stem}_0" for stem, count in lists.items())])
