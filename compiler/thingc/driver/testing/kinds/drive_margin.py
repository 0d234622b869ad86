"""Measure whether the drives of a robot can follow a motion, for document tests of the kind `drive_margin`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from thingc.base.diagnostics import Code, Note
from thingc.base.numeric import inf, isfinite, minimum, round_significant, sum_of
from thingc.base.pose import Pose
from thingc.base.units import ANGULAR_VELOCITY, FORCE, TORQUE, VELOCITY
from thingc.documents.checks.drive_margin import KIND, DriveCheck
from thingc.driver.testing.kinds.torque_margin import SLACK, driven_elements
from thingc.driver.testing.outcomes import BELOW, Failure, Outcome, TestCase, TestMeasurement, format_si
from thingc.model.assembly.types import JointEdge, LinkedTendon
from thingc.model.dynamics.inertial_loads import inertial_loads
from thingc.model.dynamics.motion_curve import MotionCurve, with_closed_loops
from thingc.model.resolve.types import NamedMotion
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.types import Robot
from thingc.model.statics.efforts import balance_loads, problem
from thingc.model.statics.types import NO_LOAD


class Instant(NamedTuple):
    """The drive at `path` at a `time` [s] of a motion: its effort [N m or N] and its speed [rad/s or m/s].

    `available` is the largest effort at this speed. `stuck` is the path of a coordinate whose load no drive balances, if any.
    """

    path: str
    time: float
    effort: float
    speed: float
    available: float
    stuck: str | None = None

    @property
    def margin(self) -> float:
        """The ratio of the available effort to the needed effort."""
        if self.stuck is not None:
            return 0.0
        return self.available / abs(self.effort) if abs(self.effort) > NO_LOAD else inf


def measure(case: TestCase, check: DriveCheck) -> Outcome:
    """Measure the smallest margin of the tested drives during a motion: the effort that is available, divided by the effort needed."""
    motions = {motion.name: motion for motion in case.robot.assembly.definition.motions}
    motion = with_closed_loops(case.robot, motions[check.motion])
    if motion is None:
        return Outcome(summary="the loops do not close", failure=Failure(
            code=Code.TEST_DRIVE, key="motion", message="the loops of the mode do not close during the motion",
            help="change the poses of the motion",
        ))
    tested = (candidate for candidate in instants(case.robot, motion, case.frames[0].base) if candidate.path in check.joints)
    worst = min(tested, key=lambda candidate: round_significant(candidate.margin, 12))
    drive = driven_elements(case.robot)[worst.path]
    effort, speed = (TORQUE, ANGULAR_VELOCITY) if drive.turns else (FORCE, VELOCITY)
    needed, available = format_si(abs(worst.effort), effort), format_si(worst.available, effort)
    speed_text, time_text = format_si(abs(worst.speed), speed), f"{worst.time:.4g} s"
    failure: Failure | None = None
    if worst.stuck is not None:
        failure = Failure(
            code=Code.TEST_DRIVE, key="motion", help="add a drive to the joint, or use a mode in which the joint has a drive",
            message=f"no drive moves joint `{worst.stuck.replace('/', '.')}`",
        )
    elif worst.margin < check.minimum:
        failure = Failure(
            code=Code.TEST_DRIVE, key="min", message=f"the margin of drive `{drive.name}` ({worst.margin:.3g}) {BELOW} ({check.minimum:g})",
            notes=(Note(message=f"required: {needed} at {time_text}; available: {available} at {speed_text}"),),
        )
    summary = f"margin {worst.margin:.3g} at {drive.name}: {needed} of {available} at {speed_text} and {time_text}"
    summary += f" (at least {check.minimum:g})"
    if not isfinite(worst.margin):
        summary = f"{drive.name} carries no load (margin at least {check.minimum:g})"
    return Outcome(
        measured={
            "margin": worst.margin if isfinite(worst.margin) else None, "drive": worst.path, "time": worst.time, "effort": worst.effort,
            "speed": worst.speed, "available": worst.available,
        },
        expected={"min": check.minimum}, summary=summary, failure=failure,
    )


def instants(robot: Robot, motion: NamedMotion, base: Pose | None) -> Iterator[Instant]:
    """Yield the state of each drive at each examined time of a motion with closed loops. `base` is the pose of the root link."""
    curve, drives = MotionCurve(robot.assembly, motion), driven_elements(robot)
    for time in curve.samples().tolist():
        state = curve.at(time)
        bodies = body_poses(robot, state.q, base)
        load, moves = problem(robot, state.q, bodies, inertial_loads(robot, bodies, state))
        equilibrium = balance_loads(robot, state.q, bodies, load, moves)
        stuck = equilibrium.where if equilibrium.unheld > SLACK else None
        for path, coordinates, _, _ in moves:
            effort, speed = equilibrium.by_joint[path], sum_of(factor * state.v[leader] for leader, factor in coordinates)
            yield Instant(path, time, effort, speed, available(drives[path], effort, speed), stuck)


def available(drive: JointEdge | LinkedTendon, effort: float, speed: float) -> float:
    """Return the largest effort [N m or N] that a drive can exert at a speed [rad/s or m/s]. The sign of `effort` is the direction.

    If the drive acts in the direction of motion, its effort falls linearly from its `stall` effort (by default, its effort limit) at rest
    to 0 at its velocity limit, and is at most its effort limit. If the drive brakes, the effort limit is available. Above the velocity
    limit, no effort is available. Without a velocity limit, the effort does not depend on the speed.
    """
    limit = drive.limit.effort or 0.0
    stall_and_speed = drive.actuator.stall if drive.actuator is not None else None
    stall, velocity_limit = stall_and_speed or (limit, drive.limit.velocity)
    if velocity_limit is None:
        return limit
    if abs(speed) >= velocity_limit:
        return 0.0
    return minimum(limit, stall * (1.0 - abs(speed) / velocity_limit)) if effort * speed > 0.0 else limit


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure)
