"""Resolve the motions of a document: poses with times, and CSV files with the positions of joints."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from thingc.base.diagnostics import Code
from thingc.base.numeric import inf, isfinite
from thingc.base.one_line_repr import format_count
from thingc.base.source import Path, Span
from thingc.base.suggestions import Hint
from thingc.base.units import ANGLE, LENGTH, TIME, Dimension, UnitError, check_dimension, parse_quantity, shorten
from thingc.documents.load.csv_tree import cells_of
from thingc.documents.load.text import Source
from thingc.documents.spec.motions import MotionPoseSpec
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.document_scope import DocumentScope, ResolveRun
from thingc.model.resolve.references import report_unmatched, suggest
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import Joint, NamedMotion

Row = list[tuple[str, Span]]
"""The cells of a row of a CSV file: their texts and spans."""

TIME_COLUMN = "time"
_UNITS = {TIME: "s", ANGLE: "deg", LENGTH: "mm"}
_COLUMN = re.compile(r"(.*?)\s*(?:\[([^\]\d][^\]]*)\])?")
"""The name of a column, and its unit in brackets. Brackets with a number, such as `wrist[0]`, belong to the name."""


def motions(context: ResolveRun, table: DocumentScope, scope: Scope) -> None:
    """Resolve the motions of a document, and store them in `table.motions`. Invalid motions are reported, and None is stored."""
    for name, written in table.spec.motions.items():
        path: Path = ("motions", name)
        if isinstance(written, list):
            table.motions[name] = _through_poses(table, scope, name, written)
        elif (document := context.documents.find_referenced(scope.document, written.file)) is None:
            table.motions[name] = None
        else:
            rows = cells_of(Source(document.path, document.text), context.report) or []
            try:
                table.motions[name] = _of_file(table, rows, name, scope.span(path, key=True))
            except _WrongCell as error:
                context.report.add(Code.MOTION, error.message, error.span, help=error.help)
                table.motions[name] = None


def _through_poses(table: DocumentScope, scope: Scope, name: str, written: Sequence[MotionPoseSpec]) -> NamedMotion | None:
    """Resolve a motion that is a list of poses with times. If the motion is invalid, report the errors and return None."""
    times: list[float | None] = []
    poses = [table.poses.get(point.pose) for point in written]
    for index, point in enumerate(written):
        at: Path = ("motions", name, index)
        if point.pose not in table.spec.poses and not scope.doubts.lacks("poses"):
            report_unmatched(scope, point.pose, table.poses, (*at, "pose"), "pose")
        time = scope.number(point.time, (*at, "time"), TIME, "`time`")
        if time is not None and (fault := _time_fault(time, times[-1] if times else None)) is not None:
            scope.error(Code.MOTION, fault, (*at, "time"), help="sort the poses by time, starting at 0 s")
            time = None
        times.append(time)
    known, instants = [pose for pose in poses if pose is not None], [time for time in times if time is not None]
    if len(known) < len(written) or len(instants) < len(written) or scope.doubts.touch(("motions", name)):
        return None
    paths = dict.fromkeys(path for pose in known for path in pose.values)
    return NamedMotion(
        name=name, times=tuple(instants), values={path: tuple(pose.values.get(path, 0.0) for pose in known) for path in paths},
        smooth=False, origin=scope.origin(("motions", name), key=True),
    )


def _time_fault(time: float, before: float | None) -> str | None:
    """Describe why a time [s] of a motion is invalid after the time `before`, or return None."""
    if before is not None and time <= before:
        return f"the times of a motion must increase, found {time:.6g} s after {before:.6g} s"
    return f"the times of a motion must not be negative, found {time:.6g} s" if time < 0.0 else None


class _WrongCell(Exception):
    """The first error in a file, at the `span` of a cell."""

    def __init__(self, message: str, span: Span, help: Hint | None = None) -> None:
        super().__init__(message)
        self.message, self.span, self.help = message, span, help


def _of_file(table: DocumentScope, rows: Sequence[Row], name: str, where: Span) -> NamedMotion | None:
    """Return the motion of a CSV file, or None if an error in the document has been reported. `where` is the location of the motion.

    Raises `_WrongCell`.
    """
    joints = dict(table.all_joints())
    if table.may_lack_joints() or None in joints.values():
        return None
    columns = _columns({name: joint for name, joint in joints.items() if joint is not None}, rows[0])
    values: list[list[float]] = [[] for _ in columns]
    for row in rows[1:]:
        if len(row) > len(columns):
            text, span = row[len(columns)]
            found = f"expected {format_count(len(columns), 'cell')} as in the header, found `{shorten(text)}` in cell {len(columns) + 1}"
            raise _WrongCell(found, span, "write numbers with decimal points, and separate only columns with commas")
        for number, (own, (column, factor)) in enumerate(zip(values, columns.items(), strict=True)):
            text, span = row[number] if number < len(row) else ("", row[-1][1])
            own.append(factor * _number(text, span, column))
            joint = joints.get(CoordinateName(column))
            if column == TIME_COLUMN and (fault := _time_fault(own[-1], own[-2] if len(own) > 1 else None)) is not None:
                raise _WrongCell(fault, span)
            if column != TIME_COLUMN and joint is not None and joint.twist is not None and not joint.limit.contains(own[-1]):
                limits = joint.limit.format(joint.twist)
                found = f"the value of `{column}` ({joint.twist.format(own[-1])}) is outside its limits ({limits})"
                raise _WrongCell(found, span, "change the number, or widen the limits")
    if len(rows) < 3:
        raise _WrongCell("a motion needs at least two rows with numbers", rows[0][0][1], "add rows below the names of the columns")
    by_column = dict(zip(columns, map(tuple, values), strict=True))
    times = by_column.pop(TIME_COLUMN)
    by_path = {CoordinateName(column).path: own for column, own in by_column.items()}
    return NamedMotion(name=name, times=times, values=by_path, smooth=True, origin=(where, rows[0][0][1]))


def _columns(joints: Mapping[CoordinateName, Joint], header: Row) -> dict[str, float]:
    """Return the factor that converts the numbers of each column to SI units. Without a unit, they are in s, rad and m."""
    dimensions: dict[str, Dimension] = {
        name: joint.twist.coordinate for name, joint in joints.items()
        if joint.mimic is None and joint.twist is not None and not joint.kind.at_once
    } | {TIME_COLUMN: TIME}
    columns: dict[str, float] = {}
    for text, span in header:
        match = _COLUMN.fullmatch(text)
        name, unit = match.groups() if match is not None else (text, None)
        joint = joints.get(CoordinateName(name))
        if name in columns:
            raise _WrongCell(f"the column `{name}` occurs twice", span, "remove one of the columns")
        if name in dimensions:
            columns[name] = _factor(unit, dimensions[name], span)
        elif joint is not None:
            why = f"mimics `{joint.mimic.joint}`" if joint.mimic is not None else f"is {joint.kind.words}"
            raise _WrongCell(f"a CSV file cannot set joint `{name}`, which {why}", span, "remove the column")
        else:
            raise _WrongCell(f"there is no joint `{shorten(name)}`", span, suggest(name, dimensions, what="columns"))
    required = [TIME_COLUMN, *(name for name, joint in joints.items() if name in dimensions and (joint.drive is not None or joint.geared))]
    missing = [f"`{name} [{_UNITS[dimensions[name]]}]`" for name in required if name not in columns]
    if missing:
        raise _WrongCell(f"missing columns: {', '.join(missing)}", header[0][1], "add the columns to the table")
    return columns


def _factor(unit: str | None, dimension: Dimension, span: Span) -> float:
    try:
        return 1.0 if unit is None else check_dimension(parse_quantity(f"1 {unit}", (dimension,)), (dimension,), unit).value
    except UnitError as error:
        raise _WrongCell(f"wrong unit of a column: {error.message}", span, error.help) from None


def _number(text: str, span: Span, column: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = inf
    if isfinite(value):
        return value
    found = f"found `{shorten(text)}`" if text else "found an empty cell"
    raise _WrongCell(f"expected a number in the column `{column}`, {found}", span)
