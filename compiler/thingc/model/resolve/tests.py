"""Resolve the tests of a document: names of elements, values with units, and ranges.

References to mounts of parts are resolved later, by `model/assembly/linking.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from functools import partial
from typing import Any

from thingc.base import numeric
from thingc.base.diagnostics import Code
from thingc.base.pose import Vector
from thingc.base.source import MappingNode, Origin, Path, SequenceNode, node_at, walk
from thingc.base.suggestions import Hint
from thingc.base.units import Dimension, Quantity
from thingc.documents.checks import kinds
from thingc.documents.spec.tests import TestSpec
from thingc.model.resolve import references
from thingc.model.resolve.contacts import components_fitting
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.document_scope import DocumentScope, ResolveRun
from thingc.model.resolve.modes import driven_joints
from thingc.model.resolve.references import GLOB, report_unmatched, suggest
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import Joint, JointRange, Mode, Reference, Test

ALL = "all"

Key = str | Path
"""The location of a value in a test: a key or a path of keys."""


def tests(context: ResolveRun, table: DocumentScope, scope: Scope, modes: Sequence[Mode]) -> Iterator[Test]:
    """Yield the resolved tests of a document, in the order of the document. Invalid tests are reported and omitted."""
    elements = context.around(table)
    by_name = {mode.name: mode for mode in modes}
    for name, spec in table.spec.tests.items():
        limits = [joint and joint.limit for joint in table.joints.values()] if kinds()[spec.kind].of_limits else None
        inputs = (spec, context.values(scope, f"tests {name}", spec), modes, limits, *elements)
        test = context.sound(("test", name), inputs, partial(_test, table, scope, by_name, name, spec))
        if test is not None:
            yield test


def _test(table: DocumentScope, scope: Scope, modes: Mapping[str, Mode], name: str, spec: TestSpec) -> Test | None:
    """Resolve a document test. If the test is invalid, report an error and return None."""
    path: Path = ("tests", name, spec.kind)
    reader = Reader(table, scope, modes, path)
    reader.choose(spec.stated)
    check = kinds()[spec.kind].read(spec.stated, reader)
    if not reader.sound or check is None:
        return None
    node = node_at(scope.document.tree, path)
    spans = {
        ".".join(str(step) for step in inner): scope.span((*path, *inner)) for inner, _ in walk(node) if inner
    } if isinstance(node, (MappingNode, SequenceNode)) else {}
    return Test(
        name=name, kind=spec.kind, check=check, modes=reader.chosen_modes, poses=reader.chosen_poses, every_pose=reader.every_pose,
        origin=scope.origin(("tests", name), key=True), spans=spans,
    )


class Reader:
    """Reads the values and references in the specification of one test.

    The function `read` of each type of test calls the methods of this class.

    `modes` contains the modes of the document by name. `chosen_modes` and `chosen_poses` contain the modes and poses in which the test
    runs. If `every_pose` is True, the test runs in all keyframes of the mode. `sound` becomes False when an error is reported.
    """

    def __init__(self, table: DocumentScope, scope: Scope, modes: Mapping[str, Mode], path: Path) -> None:
        self.table = table
        self.scope = scope
        self.modes = modes
        self.path = path
        self.sound = not scope.doubts.touch(path)
        self.chosen_modes: tuple[str, ...] = ()
        self.chosen_poses: tuple[str | None, ...] = ()
        self.every_pose = False

    def at(self, key: Key) -> Path:
        """Convert the key of a value in the specification of the test to the path of the value in the document."""
        return (*self.path, key) if isinstance(key, str) else (*self.path, *key)

    def origin(self, key: Key) -> Origin:
        """Return the location of a value of the test in the document."""
        return self.scope.origin(self.at(key))

    def error(self, code: Code, message: str, key: Key, *, help: Hint | None = None, on_key: bool = False) -> None:
        """Report an error at a value of the test, or at the key of the value if `on_key` is True. A test with an error is omitted."""
        self.sound = False
        self.scope.error(code, message, self.at(key), help=help, key=on_key)

    # --- values -----------------------------------------------------------------------------------------------------

    def number(
        self, raw: Any, key: Key, dimension: Dimension, subject: str | None = None, *, above: float | None = None,
        least: float | None = None, most: float | None = None, default: float = numeric.nan,
    ) -> float:
        """Evaluate a number of the test and return it in SI units, or return `default` for None.

        If the value is invalid, report an error and return NaN, so that every comparison with the value is false.

        `subject` is the name of the value in messages, by default the key.
        """
        if raw is None:
            return default
        subject = f"`{key}`" if subject is None else subject
        value = self.scope.number(raw, self.at(key), dimension, subject, above=above, least=least)
        if value is not None and most is not None and value > most:
            bound = Quantity(most, dimension)
            self.error(Code.OUT_OF_RANGE, f"{subject} must be at most {bound}, found {Quantity(value, dimension)}", key)
        if value is None:
            self.sound = False
            return numeric.nan
        return value

    def vector(self, raw: Any, key: str, dimension: Dimension) -> Vector | None:
        """Evaluate a vector of three values and return it in SI units. If the vector is invalid, report an error and return None."""
        vector = self.scope.vector(raw, self.at(key), dimension, f"`{key}`")
        self.sound = self.sound and vector is not None
        return vector

    def interval(self, values: Sequence[Any], key: Path, dimension: Dimension, subject: str) -> tuple[float, float]:
        """Evaluate an interval, which is given by two values. Return its ends in SI units and in ascending order."""
        low, high = (self.number(value, (*key, index), dimension, subject) for index, value in enumerate(values))
        if low > high:
            self.error(
                Code.OUT_OF_RANGE, f"{subject} must begin with the smallest value, found {Quantity(low, dimension)} before "
                f"{Quantity(high, dimension)}", key, help="swap the two values",
            )
        return low, high

    def bounds(self, low: Any, high: Any, dimension: Dimension, subject: str) -> tuple[float | None, float | None]:
        """Evaluate the bounds `min` and `max` of a test, and return them in SI units. If a bound is not specified, it is None."""
        least = None if low is None else self.number(low, "min", dimension, f"`min` of {subject}", least=0.0)
        most = None if high is None else self.number(high, "max", dimension, f"`max` of {subject}", least=0.0)
        if least is not None and most is not None and least > most:
            self.error(
                Code.OUT_OF_RANGE, f"`min` of {subject} is above its `max`: {Quantity(least, dimension)} > {Quantity(most, dimension)}",
                "min", help="swap `min` and `max`",
            )
        return least, most

    # --- references -------------------------------------------------------------------------------------------------

    def mount(self, text: str | None, key: Key) -> Reference | None:
        """Resolve a reference to a mount of a component, or to a mount that the document exports."""
        if text is None:
            return None
        mount = references.shown_mount(self.table, self.scope, text, self.at(key))
        self.sound = self.sound and mount is not None
        return mount

    def components(self, text: str | None, key: Key) -> tuple[Reference, ...]:
        """Return the components that match a name or pattern."""
        if text is None:
            return ()
        components = components_fitting(self.table, self.scope, text, self.at(key))
        self.sound = self.sound and bool(components)
        return tuple(components)

    def drives(self, names: str | list[str], key: Key) -> tuple[str, ...]:
        """Return the paths of the driven joints that match names or patterns."""
        paths = driven_joints(self.table, self.scope, _with_paths(names, self.at(key)))
        self.sound = self.sound and bool(paths)
        return paths

    def motion(self, name: str, key: Key) -> None:
        """Report an error if the document does not define a motion. For an invalid motion, which has been reported, omit the test."""
        self.sound = self.sound and self.table.motions.get(name) is not None
        if name not in self.table.spec.motions and not self.scope.doubts.lacks("motions") and not self.scope.doubts.at(("motions", name)):
            self.error(Code.MOTION, f"there is no motion `{name}`", key, help=suggest(name, self.table.motions, what="motions"))

    def choose(self, specification: Any) -> None:
        """Read the modes and poses in which the test runs, if the document specifies them."""
        if hasattr(specification, "mode"):
            self.chosen_modes = self._modes(specification.mode)
        if hasattr(specification, "pose"):
            self.chosen_poses, self.every_pose = self._poses(specification.pose)

    def _modes(self, names: str | list[str] | None) -> tuple[str, ...]:
        """Return the modes in which the test runs. By default, the test runs only in the first mode of the document."""
        if not self.modes:
            self.sound = False
            return ()
        if names is None:
            return (next(iter(self.modes)),)
        return self._match(names, self.at("mode"), list(self.modes), "mode")

    def _poses(self, names: str | list[str] | None) -> tuple[tuple[str | None, ...], bool]:
        """Return the poses in which the test runs, and whether the test runs in all keyframes of each mode."""
        if names is None:
            return (None,), False
        if names == ALL and ALL not in self.table.poses:
            return (), True
        return self._match(names, self.at("pose"), list(self.table.poses), "pose"), False

    def _match(self, texts: str | list[str], path: Path, known: Sequence[str], noun: str) -> tuple[str, ...]:
        """Return the modes or poses that match names or patterns, in the order of `known`. `noun` is `mode` or `pose`."""
        section = f"{noun}s"
        names: set[str] = set()
        for text, text_path in _with_paths(texts, path):
            matches = [text] if text in known else [name for name in known if text == ALL or fnmatchcase(name, text)]
            names.update(matches)
            if matches:
                continue
            self.sound = False
            if not self.scope.doubts.lacks(section) and text not in getattr(self.table.spec, section):
                report_unmatched(self.scope, text, known, text_path, noun, pattern=text == ALL)
        return tuple(name for name in known if name in names)

    def ranges(self, specification: str | list[str] | dict[str, Any], key: str) -> Iterator[JointRange]:
        """Yield the joints that the test moves through a range, each with its range.

        The specification is `all`, a list of names and patterns, or ranges by name or pattern. If both an exact joint name and a pattern
        match a joint, the exact name takes precedence.
        """
        joints = dict(self.table.all_joints())
        movable = {name: joint for name, joint in joints.items() if joint is not None and joint.settable}
        chosen: dict[CoordinateName, tuple[Any, Path]] = {}
        entries = (
            [(text, value, (key, text)) for text, value in specification.items()] if isinstance(specification, dict)
            else [("*", ALL, (key,))] if specification == ALL else [(text, ALL, (key, number)) for number, text in enumerate(specification)]
        )
        for text, value, entry_key in sorted(entries, key=lambda entry: entry[0] in joints):
            exact = [name for name in joints if text in (name, name.joint)]
            matches = exact or [name for name in movable if fnmatchcase(name, text)]
            chosen.update((name, (value, entry_key)) for name in matches)
            if matches or self.table.may_lack_joints():
                self.sound = self.sound and bool(matches)
            else:
                glob = GLOB.search(text)
                message = f"pattern `{text}` matches no joint that can be moved" if glob else f"there is no joint `{text}`"
                code = Code.NO_MATCH if glob else Code.UNKNOWN_JOINT
                self.error(code, message, entry_key, on_key=True, help=suggest(text, movable, what="joints"))
        for name, joint in joints.items():
            if name not in chosen:
                continue
            if joint is None:
                self.sound = False
            elif joint.settable:
                yield self._range(name, joint, *chosen[name])
            elif not (joint.kind.at_once and name.number and name.with_number(0) in chosen):  # report a ball joint or free joint once
                reason = f"is {joint.kind.words}" if joint.mimic is None else f"mimics `{joint.mimic.joint}`"
                self.error(
                    Code.TEST, f"joint `{name.joint if joint.kind.at_once else name}` {reason} and cannot be moved through a range",
                    chosen[name][1], on_key=True,
                    help="remove the joint from `joints`" if joint.mimic is None else f"move `{joint.mimic.joint}`",
                )

    def _range(self, name: CoordinateName, joint: Joint, specification: Any, key: Path) -> JointRange:
        """Return the range of positions through which the test moves a joint.

        By default, the range is between the limits of the joint, or one turn for a joint without limits.
        """
        twist = joint.twist
        endless = numeric.pi if twist is not None and twist.turns else numeric.inf
        low = joint.limit.lower if joint.limit.lower is not None else -endless
        high = joint.limit.upper if joint.limit.upper is not None else endless
        if specification == ALL and numeric.isinf(high - low):
            self.error(Code.TEST, f"the range `all` requires limits of joint `{name}`", key,
                       help="write a range such as `[-20 mm, 20 mm]`, or add `limit` to the joint")
        if specification != ALL and twist is not None:
            first, last = self.interval(specification, key, twist.coordinate, f"the range of joint `{name}`")
            if joint.kind.may_stop and (first < low - 1e-9 or last > high + 1e-9):
                ends = " to ".join(twist.format(end) if numeric.isfinite(end) else "unlimited" for end in (low, high))
                self.error(
                    Code.OUT_OF_RANGE, f"the range of joint `{name}` exceeds its limits ({ends})", key,
                    help="write `all` for the whole range",
                )
            low, high = first, last
        return JointRange(joint=name.path, lower=low, upper=high)


def _with_paths(value: str | list[str], path: Path) -> list[tuple[str, Path]]:
    """Convert a value that is a string or a list of strings to a list of pairs of a string and its path in the document."""
    return [(value, path)] if isinstance(value, str) else [(text, (*path, index)) for index, text in enumerate(value)]
