"""Data types for single runs of document tests (`TestCase`, `Result`) and the results of their measurements (`Outcome`)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Generic, TypeVar

from thingc.base.diagnostics import Code, Diagnostic, Note, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.units import Dimension, Quantity
from thingc.documents.checks.kind import CheckKind
from thingc.model.assembly.types import LinkedTest
from thingc.model.resolve.types import NamedPose, Reference
from thingc.model.robot.types import Keyframe, Robot
from thingc.targets.request import EmitRequest

Measure = float | int | str | list[float] | dict[str, float] | dict[str, list[str]] | None
"""A measured or expected value in the JSON output, in SI units."""

ROUNDING = 1e-9
"""Tolerance for rounding errors: relative to the value for masses and lengths, and in metres for positions."""


class Failure(FrozenStruct):
    """The reason why a test failed: a diagnostic code, a message, and the key of the violated limit, such as `max` or `within.x`."""

    code: Code
    message: str
    key: str
    help: str | None = None
    notes: tuple[Note, ...] = ()


class Outcome(FrozenStruct):
    """The result of a measurement.

    `summary` is a short text for the list of results. `measured` and `expected` contain values in SI units by name. `failure` is None if
    the test passed. `needed` contains the indices of the `allow` entries that permitted a collision.
    """

    summary: str
    measured: Mapping[str, Measure] = {}
    expected: Mapping[str, Measure] = {}
    failure: Failure | None = None
    needed: frozenset[int] = frozenset()


class Result(FrozenStruct):
    """The result of a single run of a test, with the duration of the run [s]. A failed run also has a diagnostic."""

    name: str
    kind: str
    mode: str | None
    pose: str | None
    outcome: Outcome
    seconds: float
    diagnostic: Diagnostic | None = None

    @property
    def passed(self) -> bool:
        """Whether the test passed."""
        return self.outcome.failure is None

    @property
    def where(self) -> str:
        """The mode and the pose in which the test ran, such as `bench, home`.

        The result is an empty string for a test that does not depend on the mode and the pose.
        """
        return ", ".join(name for name in (self.mode, self.pose) if name is not None)


BELOW, ABOVE = "is below the minimum", "exceeds the maximum"
"""The comparison of a measured value with a bound in messages."""


def format_si(value: float, dimension: Dimension) -> str:
    """Format a measured value [SI] with a unit and four digits, such as `533.2 g`. Values below about a nanometre are shown as 0."""
    value = value if abs(value) >= 1e-9 else 0.0
    number, space, unit = str(Quantity(value, dimension)).partition(" ")
    return f"{float(f'{float(number):.4g}'):g}{space}{unit}"


def check_bounds(
    name: str, label: str, value: float, minimum: float | None, maximum: float | None, dimension: Dimension, code: Code,
) -> Outcome:
    """Compare a measured value [SI] with its minimum and maximum, which can be None, and return the outcome.

    `name` is the name of the value in the results, and `label` its name in messages. `code` is the diagnostic code that is reported
    if the value is out of bounds.
    """
    measured = format_si(value, dimension)
    expected = {key: bound for key, bound in (("min", minimum), ("max", maximum)) if bound is not None}
    limits = [f"{text} {Quantity(bound, dimension)}" for text, bound in (("at least", minimum), ("at most", maximum)) if bound is not None]
    failure = None
    for key, bound, text in (("min", minimum, BELOW), ("max", maximum, ABOVE)):
        slack = ROUNDING * max(abs(bound), abs(value)) if bound is not None else 0.0
        if bound is None or not (value < bound - slack if key == "min" else value > bound + slack):
            continue
        failure = Failure(code=code, key=key, message=f"{label} ({measured}) {text} ({Quantity(bound, dimension)})")
    return Outcome(measured={name: value}, expected=expected, summary=f"{name} {measured} ({', '.join(limits)})", failure=failure)


def open_loops_outcome() -> Outcome:
    """Return the outcome of a test in a pose in which the kinematic loops of the robot do not close: a failure."""
    return Outcome(summary="the loops do not close", failure=Failure(
        code=Code.TEST_POSE, key="pose", message="the loops of the mode do not close in this pose",
        help="run `thingc info` to list the poses in which the loops close",
    ))


class TestCase(FrozenStruct):
    """A single run of a document test, in one mode and one pose. A test with a sweep is also a single run, with many poses.

    `robot` is the robot in this mode, and `frames` contains a keyframe for each pose. `missing` is the number of poses in which the loops
    of the robot do not close. If the test does not depend on the mode, `robot` is the robot in the first mode, and `frames` is empty.
    """

    linked: LinkedTest
    robot: Robot
    request: EmitRequest
    frames: tuple[Keyframe, ...] = ()
    missing: int = 0

    def components(self, references: Collection[Reference]) -> list[int]:
        """Return the indices of the referenced components, sorted.

        Without references, return the indices of all components.
        """
        if not references:
            return list(range(len(self.robot.assembly.occurrences)))
        return sorted({index for reference in references for index in self.linked.components[reference]})


Specification = TypeVar("Specification", bound=OneLineRepr)


class TestMeasurement(FrozenStruct, Generic[Specification]):
    """The functions that measure one kind of document test.

    `measure(case, specification)` measures a single run of a test. `poses(specification, pose)` returns the poses of a run with the named
    pose `pose`, such as the poses of a sweep. `finish(linked, outcomes, report)` is called after all runs with their outcomes, if the test
    ran in all of its modes.
    """

    kind: CheckKind[Any, Specification]
    measure: Callable[[TestCase, Specification], Outcome]
    poses: Callable[[Specification, NamedPose], Sequence[NamedPose]] = lambda specification, pose: [pose]
    finish: Callable[[LinkedTest, Sequence[Outcome], Report], None] | None = None
