"""Resolve the motions of a document: poses with times, and CSV files with the positions of joints."""

from __future__ import annotations

import re
from collections.abc import Sequence

from thingc.base.diagnostics import Code, Report
from thingc.base.numeric import inf, isfinite
from thingc.base.source import Path, Span
from thingc.base.suggestions import Hint
from thingc.base.units import ANGLE, LENGTH, TIME, Dimension, UnitError, checked, parse_quantity, shortened
from thingc.documents.load.csv_tree import cells_of
from thingc.documents.load.text import Source
from thingc.documents.spec.motions import MotionPoseSpec
from thingc.model.resolve.document_scope import DocumentScope, ResolveRun
from thingc.model.resolve.references import report_unmatched, suggested
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
        elif (document := context.documents.named(scope.document, written.file)) is None:
            table.motions[name] = None
        else:
            rows = cells_of(Source(document.path, document.text), context.report) or []
            table.motions[name] = _MotionFile(context.report, table, rows).motion(name, scope.span(path, key=True))


def _through_poses(table: DocumentScope, scope: Scope, name: str, written: Sequence[MotionPoseSpec]) -> NamedMotion | None:
    """Resolve a motion that is a list of poses with times. If the motion is invalid, report the errors and return None."""
    times: list[float | None] = []
    poses = [table.poses.get(point.pose) for point in written]
    for index, point in enumerate(written):
        at: Path = ("motions", name, index)
        if point.pose not in table.spec.poses and not scope.doubts.lacks("poses"):
            report_unmatched(scope, point.pose, table.poses, (*at, "pose"), "pose")
        time = scope.number(point.time, (*at, "time"), TIME, "`time`")
        before = times[-1] if times else None
        if time is not None and before is not None and time <= before:
            scope.error(
                Code.MOTION, f"the times of a motion must increase, found {time:.6g} s after {before:.6g} s", (*at, "time"),
                help="sort the poses by time",
            )
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


class _MotionFile:
    """Reads the rows of a CSV file, the first of which contains the names of the columns.

    `dimensions` contains the physical dimension of each column that the file can have. `sound` becomes False when an error is reported.
    """

    def __init__(self, report: Report, table: DocumentScope, rows: Sequence[Row]) -> None:
        self.report, self.sound = report, True
        self.header, self.rows = rows[0], rows[1:]
        joints = dict(table.all_joints())
        self.unsure = table.unsure_joints() or None in joints.values()
        self.joints: dict[str, Joint] = {name: joint for name, joint in joints.items() if joint is not None}
        self.dimensions: dict[str, Dimension] = {
            name: joint.twist.coordinate for name, joint in self.joints.items()
            if joint.mimic is None and joint.twist is not None and not joint.kind.at_once
        } | {TIME_COLUMN: TIME}

    def error(self, message: str, span: Span, help: Hint | None = None) -> None:
        """Report an error in the file."""
        self.sound = False
        self.report.add(Code.MOTION, message, span, help=help)

    def motion(self, name: str, where: Span) -> NamedMotion | None:
        """Return the motion of the file. After the first row with an error, return None.

        `where` is the location of the motion in the document.
        """
        columns = self._columns()
        values: dict[str, list[float]] = {column: [] for column, _ in columns}
        for row in self.rows if self.sound else ():
            for number, (column, factor) in enumerate(columns):
                text, span = row[number] if number < len(row) else ("", row[-1][1])
                value = self._number(text, span, column) * factor
                if column != TIME_COLUMN:
                    self._check_limits(self.joints[column], value, span)
                elif values[column] and value <= values[column][-1]:
                    self.error(f"the times of a motion must increase, found {value:.6g} s after {values[column][-1]:.6g} s", span)
                values[column].append(value)
            if not self.sound:
                return None
        if self.sound and len(self.rows) < 2:
            self.error("a motion needs at least two rows with numbers", self.header[0][1], "add rows below the names of the columns")
        if not self.sound or self.unsure:
            return None
        times = tuple(values.pop(TIME_COLUMN))
        by_path = {self.joints[column].path: tuple(own) for column, own in values.items()}
        return NamedMotion(name=name, times=times, values=by_path, smooth=True, origin=(where, self.header[0][1]))

    def _columns(self) -> list[tuple[str, float]]:
        """Return the name of each column, with the factor that converts its numbers to SI units. Wrong columns are reported."""
        columns: dict[str, float] = {}
        for text, span in self.header:
            match = _COLUMN.fullmatch(text)
            name, unit = match.groups() if match is not None else (text, None)
            joint = self.joints.get(name)
            if name in columns:
                self.error(f"the column `{name}` occurs twice", span, "remove one of the columns")
            elif name in self.dimensions:
                columns[name] = self._factor(unit, self.dimensions[name], span)
            elif joint is not None:
                why = f"mimics `{joint.mimic.joint}`" if joint.mimic is not None else f"is {joint.kind.words}"
                self.error(f"joint `{name}` {why}: a file cannot set it", span, "remove the column")
            elif not self.unsure:
                self.error(f"there is no joint `{shortened(name)}`", span, suggested(name, self.dimensions, what="columns"))
        driven = [name for name, joint in self.joints.items() if joint.drive is not None or joint.geared]
        required = [name for name in (TIME_COLUMN, *driven) if name in self.dimensions]
        missing = [f"`{name} [{_UNITS[self.dimensions[name]]}]`" for name in required if name not in columns]
        if missing and self.sound:
            self.error("columns of the motion are missing", self.header[0][1], f"add {', '.join(missing)}")
        return list(columns.items())

    def _factor(self, unit: str | None, dimension: Dimension, span: Span) -> float:
        """Return the SI value of a unit. Without a unit, numbers are in s, rad and m."""
        try:
            return 1.0 if unit is None else checked(parse_quantity(f"1 {unit}", (dimension,)), (dimension,), f"1 {unit}").value
        except UnitError as error:
            self.error(f"wrong unit of a column: {error.message}", span, error.help)
            return 1.0

    def _number(self, text: str, span: Span, column: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = inf
        if not isfinite(value):
            found = f"found `{shortened(text)}`" if text else "found an empty cell"
            self.error(f"expected a number in the column `{column}`, {found}", span)
        return value

    def _check_limits(self, joint: Joint, value: float, span: Span) -> None:
        lower, upper = joint.limit.lower, joint.limit.upper
        outside = (lower is not None and value < lower - 1e-9) or (upper is not None and value > upper + 1e-9)
        if outside and isfinite(value) and joint.twist is not None:
            ends = " to ".join("no limit" if end is None else joint.twist.shown(end) for end in (lower, upper))
            self.error(
                f"joint `{joint.name}` is at {joint.twist.shown(value)}, outside its limits {ends}", span,
                "change the number, or widen the limits",
            )
