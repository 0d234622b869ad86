"""Measure how close a mount can get to a point, for document tests of the kind `point`."""

from __future__ import annotations

from thingc.base.diagnostics import Code, Note
from thingc.base.units import ANGLE, LENGTH, Quantity
from thingc.documents.checks.point import KIND, PointCheck
from thingc.driver.testing.outcomes import ABOVE, Failure, Measure, Outcome, TestCase, TestMeasurement, format_si
from thingc.driver.testing.poses import joints_text
from thingc.driver.testing.reach_search import nearest


def measure(case: TestCase, check: PointCheck) -> Outcome:
    """Measure the smallest distance [m] of a mount from a point over all joint positions.

    Also measure the angle [rad] between the z axis of the mount and the required direction.
    """
    mounts = case.linked.mounts
    best = nearest(case.robot, case.frames[0], mounts[check.mount], None if check.frame is None else mounts[check.frame], check)
    target = f"within {Quantity(check.within, LENGTH)}"
    expected = {"distance": check.within} | ({"angle": check.angle} if check.direction is not None else {})
    failure: Failure | None = None
    if best is None:
        failure = Failure(code=Code.TEST_POINT, key="at", message="the loops of the robot do not close in any tested position")
        return Outcome(expected=expected, summary="no position", failure=failure)
    distance, angle, joints = best
    summary = f"{format_si(distance, LENGTH)} from the point ({target}"
    measured: dict[str, Measure] = {"distance": distance}
    if check.direction is not None:
        measured["angle"] = angle
        summary += f"; {format_si(angle, ANGLE)} from the direction, at most {Quantity(check.angle, ANGLE)}"
    position_text = joints_text(case.robot.assembly, joints)
    notes = (Note(message=f"joint values of the nearest position: {position_text}"),) if position_text else ()
    if distance > check.within:
        failure = Failure(
            code=Code.TEST_POINT, key="at", notes=notes,
            message=f"the distance from `{check.mount.text}` to the point ({format_si(distance, LENGTH)}) {ABOVE} "
            f"({Quantity(check.within, LENGTH)})",
        )
    elif check.direction is not None and angle > check.angle:
        failure = Failure(
            code=Code.TEST_POINT, key="direction", notes=notes,
            message=f"the direction error of `{check.mount.text}` at the point ({format_si(angle, ANGLE)}) {ABOVE} "
            f"({Quantity(check.angle, ANGLE)})",
        )
    return Outcome(measured={**measured, "joints": joints}, expected=expected, summary=f"{summary})", failure=failure)


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure)
