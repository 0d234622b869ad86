"""What running a test comes to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from thingc.diagnostics import Code, Diagnostic, Note
from thingc.graph.types import LinkedTest
from thingc.robot.types import Robot
from thingc.units import Dimension, Quantity

Measure = float | int | str | list[float] | dict[str, float] | None
"""What a measured or expected value is in the JSON answer: SI."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """What a failed test says: its code and words, and which of the test's values (`max`, `within.x`) it contradicts."""

    code: Code
    message: str
    key: str
    help: str | None = None
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What was measured (SI, by name), what was expected, both in words, and why it failed, if it did.

    `needed` are the numbers of the allowances of a collision test that were needed.
    """

    measured: Mapping[str, Measure]
    expected: Mapping[str, Measure]
    said: str
    failure: Failure | None = None
    needed: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A test in one mode: `robot` is that mode, with keyframes for the poses that the test asks for."""

    linked: LinkedTest
    robot: Robot


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """A case that was run, the time that it took [s], and what was said of it where it failed."""

    name: str
    kind: str
    mode: str | None
    pose: str | None
    outcome: Outcome
    seconds: float
    diagnostic: Diagnostic | None = None

    @property
    def passed(self) -> bool:
        """Whether the test holds."""
        return self.outcome.failure is None

    @property
    def where(self) -> str:
        """`bench, home`: the mode and the pose, as far as there are any."""
        return ", ".join(word for word in (self.mode, self.pose) if word is not None)


def shown(value: float, dimension: Dimension) -> str:
    """A measured value [SI] for people, to four digits: `533.2 g`. What is below a nanometre, or so, is nothing."""
    value = value if abs(value) >= 1e-9 else 0.0
    number, space, unit = str(Quantity(value, dimension)).partition(" ")
    return f"{float(f'{float(number):.4g}'):g}{space}{unit}"
