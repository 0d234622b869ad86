"""What one case of a test comes to."""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.diagnostics import Code, Note
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.units import Dimension, Quantity

Measure = float | int | str | list[float] | dict[str, float] | dict[str, list[str]] | None
"""What a measured or expected value is in the JSON answer: SI."""

ROUNDING = 1e-9
"""How far beyond a bound counts as rounding: of a mass or a length in proportion, of a place in metres."""


class Failure(FrozenStruct):
    """What a failed test says: its code and words, and which of the test's values (`max`, `within.x`) it contradicts."""

    code: Code
    message: str
    key: str
    help: str | None = None
    notes: tuple[Note, ...] = ()


class Outcome(FrozenStruct):
    """What was measured (SI, by name), what was expected, both in words, and why it failed, if it did.

    `needed` are the numbers of the allowances of a collision test that were needed.
    """

    measured: Mapping[str, Measure]
    expected: Mapping[str, Measure]
    said: str
    failure: Failure | None = None
    needed: frozenset[int] = frozenset()


def shown(value: float, dimension: Dimension) -> str:
    """A measured value [SI] for people, to four digits: `533.2 g`. What is below a nanometre, or so, is nothing."""
    value = value if abs(value) >= 1e-9 else 0.0
    number, space, unit = str(Quantity(value, dimension)).partition(" ")
    return f"{float(f'{float(number):.4g}'):g}{space}{unit}"


def check_bounds(
    name: str, what: str, value: float, minimum: float | None, maximum: float | None, dimension: Dimension, code: Code,
) -> Outcome:
    """A value [SI] between two bounds, either of which may be missing."""
    measured = shown(value, dimension)
    expected = {key: bound for key, bound in (("min", minimum), ("max", maximum)) if bound is not None}
    words = [f"{word} {Quantity(bound, dimension)}" for word, bound in (("at least", minimum), ("at most", maximum)) if bound is not None]
    failure = None
    for key, bound, word in (("min", minimum, "below"), ("max", maximum, "above")):
        slack = ROUNDING * max(abs(bound), abs(value)) if bound is not None else 0.0
        if bound is None or not (value < bound - slack if key == "min" else value > bound + slack):
            continue
        off = abs(value - bound)
        share = f" ({float(f'{100.0 * off / bound:.3g}'):g} %)" if bound else ""
        failure = Failure(
            code=code, key=key, message=f"{what} is {measured}, {word} {Quantity(bound, dimension)} by {shown(off, dimension)}{share}",
        )
    return Outcome(measured={name: value}, expected=expected, said=f"{name} {measured} ({', '.join(words)})", failure=failure)


def unclosed() -> Outcome:
    """Of a pose in which the loops of the robot do not close."""
    failure = Failure(
        code=Code.TEST_POSE, key="pose", message="the loops of the mode do not close in this pose",
        help="`thingc info` says in which poses they do",
    )
    return Outcome(measured={}, expected={}, said="the loops do not close", failure=failure)
