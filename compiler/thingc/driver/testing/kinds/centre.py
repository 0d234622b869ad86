"""Measure the centre of mass, for document tests of the kind `centre`."""

from __future__ import annotations

from thingc.base.diagnostics import Code
from thingc.base.inertia import total
from thingc.base.units import LENGTH, Quantity
from thingc.documents.checks.centre import KIND, CentreCheck
from thingc.driver.testing.outcomes import ROUNDING, Failure, Measure, Outcome, TestCase, TestMeasurement, format_si
from thingc.model.robot.kinematics import occurrence_poses


def measure(case: TestCase, check: CentreCheck) -> Outcome:
    """Measure the centre of mass [m] of the tested components, in the frame of a mount or in the world."""
    robot, frame = case.robot, case.frames[0]
    at = occurrence_poses(robot, frame.q, frame.base)
    whole = total(robot.assembly.occurrences[index].properties.seen_from(at[index]) for index in case.components(check.of))
    expected: dict[str, Measure] = {axis: list(box) for axis, box in check.box.items()}
    if whole.mass <= 0.0:
        weightless = Failure(code=Code.TEST_CENTRE, key="of", message="the components have no mass and thus no centre of mass")
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
        bound, word = (low, "below the minimum") if value < low else (high, "above the maximum")
        failures.append(Failure(
            code=Code.TEST_CENTRE, key=f"within.{axis}.{0 if value < low else 1}",
            message=f"{axis} of the centre of mass is {format_si(value, LENGTH)}, "
            f"{format_si(abs(value - bound), LENGTH)} {word} of {Quantity(bound, LENGTH)}",
        ))
    text = "  ".join(f"{1000.0 * v:z.1f}" for v in place)
    failure = None
    if failures:
        failure = Failure(code=Code.TEST_CENTRE, key=failures[0].key, message="; ".join(one.message for one in failures))
    return Outcome(measured={"centre": list(place), "mass": whole.mass}, expected=expected, said=f"centre {text} mm", failure=failure)


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure)
