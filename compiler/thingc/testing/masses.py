"""Tests of mass and of the centre of mass."""

from __future__ import annotations

from thingc.diagnostics import Code
from thingc.inertia import total
from thingc.resolve.tests_model import CentreCheck, MassCheck
from thingc.robot import occurrence_poses
from thingc.robot.types import Keyframe
from thingc.testing.results import Case, Failure, Measure, Outcome, shown
from thingc.units import LENGTH, MASS, Dimension, Quantity

ROUNDING = 1e-9
"""How far beyond a bound counts as rounding: of a mass or a length in proportion, of a place in metres."""


def _chosen(case: Case, check: MassCheck | CentreCheck) -> list[int]:
    """The occurrences that count: those named, or all."""
    if not check.of:
        return list(range(len(case.robot.assembly.occurrences)))
    return sorted({index for reference in check.of for index in case.linked.components[reference]})


def mass(case: Case, check: MassCheck) -> Outcome:
    """The sum of the masses [kg]."""
    occurrences = case.robot.assembly.occurrences
    value = sum(occurrences[index].properties.mass for index in _chosen(case, check))
    return bounded("mass", "the mass", value, check.minimum, check.maximum, MASS, Code.TEST_MASS)


def bounded(
    name: str, what: str, value: float, minimum: float | None, maximum: float | None, dimension: Dimension, code: Code,
) -> Outcome:
    """A value [SI] between two bounds, either of which may be missing."""
    found = shown(value, dimension)
    expected = {key: bound for key, bound in (("min", minimum), ("max", maximum)) if bound is not None}
    words = [f"{word} {Quantity(bound, dimension)}" for word, bound in (("at least", minimum), ("at most", maximum))
             if bound is not None]
    failure = None
    for key, bound, word in (("min", minimum, "below"), ("max", maximum, "above")):
        slack = ROUNDING * max(abs(bound), abs(value)) if bound is not None else 0.0
        if bound is None or not (value < bound - slack if key == "min" else value > bound + slack):
            continue
        off = abs(value - bound)
        share = f" ({float(f'{100.0 * off / bound:.3g}'):g} %)" if bound else ""
        failure = Failure(
            code=code, key=key,
            message=f"{what} is {found}, {word} {Quantity(bound, dimension)} by {shown(off, dimension)}{share}",
        )
    return Outcome(measured={name: value}, expected=expected, said=f"{name} {found} ({', '.join(words)})", failure=failure)


def centre(case: Case, check: CentreCheck, frame: Keyframe) -> Outcome:
    """The centre of mass [m] in the frame of a mount, or in the world."""
    robot = case.robot
    at = occurrence_poses(robot, frame.q, frame.base)
    whole = total(robot.assembly.occurrences[index].properties.seen_from(at[index]) for index in _chosen(case, check))
    expected: dict[str, Measure] = {axis: list(box) for axis, box in check.box.items()}
    if whole.mass <= 0.0:
        weightless = Failure(code=Code.TEST_CENTRE, key="of", message="what is named weighs nothing, and has no centre of mass")
        return Outcome(measured={"mass": 0.0}, expected=expected, said="no mass", failure=weightless)
    place = whole.centre
    if check.frame is not None:
        mount = case.linked.mounts[check.frame]
        pose = at[mount.occurrence] @ robot.assembly.occurrences[mount.occurrence].mounts[mount.mount].pose
        place = pose.inverse().apply(place)
    failures: list[Failure] = []
    for axis, (low, high) in check.box.items():
        value = place["xyz".index(axis)]
        if low - ROUNDING <= value <= high + ROUNDING:
            continue
        bound, word = (low, "below") if value < low else (high, "above")
        failures.append(Failure(
            code=Code.TEST_CENTRE, key=f"within.{axis}.{0 if value < low else 1}",
            message=f"{axis} of the centre of mass is {shown(value, LENGTH)}, {word} {Quantity(bound, LENGTH)} by "
            f"{shown(abs(value - bound), LENGTH)}",
        ))
    text = "  ".join(f"{round(1000.0 * v, 1) + 0.0:.1f}" for v in place)
    failure = None
    if failures:
        failure = Failure(
            code=Code.TEST_CENTRE, key=failures[0].key, message="; ".join(one.message for one in failures),
        )
    return Outcome(
        measured={"centre": list(place), "mass": whole.mass},
        expected=expected, said=f"centre {text} mm", failure=failure,
    )
