"""Measure the reach of a robot, for document tests of the kind `reach`."""

from __future__ import annotations

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note
from thingc.base.units import LENGTH
from thingc.documents.checks.reach import KIND, ReachCheck
from thingc.driver.testing.outcomes import Outcome, TestCase, TestMeasurement, check_bounds, open_loops_outcome
from thingc.driver.testing.poses import joints_text, pose_robot
from thingc.driver.testing.reach_search import farthest


def measure(case: TestCase, check: ReachCheck) -> Outcome:
    """Measure the largest distance [m] between two mounts over all joint positions.

    A search finds the distance, so the result is a lower bound. The result is the same in every mode: the base component is fixed, and no
    other mounts are held.
    """
    assembly = case.robot.assembly
    mode = replace(assembly.modes[0], holds=(), cut=(), pose=None, base="fixed")
    robot = pose_robot(assembly, mode, [assembly.start_pose(mode)])
    if robot is None:
        return open_loops_outcome()
    best, joints = farthest(robot, case.linked.mounts[check.of], case.linked.mounts[check.base], case.linked.test.origin)
    outcome = check_bounds("reach", "the reach", best, check.minimum, check.maximum, LENGTH, Code.TEST_REACH)
    position_text = joints_text(assembly, joints)
    if outcome.failure is not None:
        note = Note(message=f"joint values of the farthest position: {position_text}") if position_text else None
        outcome = replace(outcome, failure=replace(outcome.failure, notes=(note,) if note else ()))
    return replace(outcome, measured={**outcome.measured, "joints": joints})


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure)
