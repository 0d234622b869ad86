"""Measure the centre of mass, for document tests of the kind `centre`."""

from __future__ import annotations

from thingc.base.diagnostics import Code
from thingc.base.inertia import total
from thingc.base.units import LENGTH, Quantity
from thingc.documents.checks.centre import KIND, CentreCheck
from thingc.driver.testing.outcomes import ABOVE, BELOW, ROUNDING, Failure, Measure, Outcome, TestCase, TestMeasurement, format_si
from thingc.model.robot.kinematics import occurrence_poses


def measure(case: TestCase, check: CentreCheck) -> Outcome:
    """Measure the centre of mass [m] of the tested components, in the frame of a mount or in the world."""
    robot, frame = case.robot, case.frames[0]
    poses = occurrence_poses(robot, frame.q, frame.base)
    body = total(robot.assembly.occurrences[index].properties.seen_from(poses[index]) for index in case.components(check.of))
    expected: dict[str, Measure] = {axis: list(box) for axis, box in check.box.items()}
    if body.mass <= 0.0:
        weightless = Failure(code=Code.TEST_CENTRE, key="of", message="the mass of the components is 0")
        return Outcome(measured={"mass": 0.0}, expected=expected, summary="no mass", failure=weightless)
    centre = body.centre
    if check.frame is not None:
        mount = case.linked.mounts[check.frame]
        pose = poses[mount.occurrence] @ mount.pose
        centre = pose.inverse().apply(centre)
    failures: list[Failure] = []
    for axis, (low, high) in check.box.items():
        value = centre["xyz".index(axis)]
        if low - ROUNDING <= value <= high + ROUNDING:
            continue
        bound, required = (low, BELOW) if value < low else (high, ABOVE)
        failures.append(Failure(
            code=Code.TEST_CENTRE, key=f"within.{axis}.{0 if value < low else 1}",
            message=f"{axis} of the centre of mass ({format_si(value, LENGTH)}) {required} ({Quantity(bound, LENGTH)})",
        ))
    text = "  ".join(f"{1000.0 * v:z.1f}" for v in centre)
    failure = None
    if failures:
        failure = Failure(code=Code.TEST_CENTRE, key=failures[0].key, message="; ".join(axis_failure.message for axis_failure in failures))
    return Outcome(measured={"centre": list(centre), "mass": body.mass}, expected=expected, summary=f"centre {text} mm", failure=failure)


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure)
