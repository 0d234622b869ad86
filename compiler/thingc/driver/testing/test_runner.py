"""Run the tests of a document in all requested modes and poses."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatchcase
from functools import partial

from msgspec.structs import replace

from thingc.base.diagnostics import Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.driver.testing.kinds import measurement_of
from thingc.driver.testing.outcomes import Failure, Outcome, Result, TestCase, open_loops_outcome
from thingc.driver.testing.poses import keyframe, pose_robot
from thingc.model.assembly.types import LinkedMode, LinkedTest
from thingc.model.resolve.types import NamedPose
from thingc.targets.request import EmitRequest


class Selection(FrozenStruct):
    """The tests to run, selected by patterns of test names (empty: all tests), and the modes in which the tests run.

    If no modes are given, each test runs in the modes that it specifies.
    """

    only: tuple[str, ...] = ()
    modes: tuple[str, ...] = ()

    def includes(self, test: LinkedTest) -> bool:
        """Return whether the selection includes a test."""
        return not self.only or any(test.test.name == text or fnmatchcase(test.test.name, text) for text in self.only)


def run(request: EmitRequest, selection: Selection, on_result: Callable[[Result], None] = lambda result: None) -> list[Result]:
    """Run the selected tests in document order, and return their results. The callback `on_result` is called with each result.

    A failed test is reported in `request.report` as an error, at the location of the violated value in the document. `request.robots` must
    contain the robot in all modes of the assembly.
    """
    results: list[Result] = []
    for linked in request.assembly.tests:
        if not selection.includes(linked):
            continue
        outcomes: list[Outcome] = []
        modes = [mode for mode in request.assembly.modes if mode.name in linked.test.modes]
        chosen = [mode for mode in modes if not selection.modes or mode.name in selection.modes]
        for mode_name, pose_name, measure in _runs(request, linked, chosen):
            started = time.perf_counter()
            outcome = measure()
            result = Result(
                name=linked.test.name, kind=linked.test.kind, mode=mode_name, pose=pose_name, outcome=outcome,
                seconds=time.perf_counter() - started,
            )
            outcomes.append(outcome)
            if outcome.failure is not None:
                _report_failure(linked, result, outcome.failure, request.report)
                result = replace(result, diagnostic=request.report.diagnostics[-1])
            results.append(result)
            on_result(result)
        finish = measurement_of(linked.test.kind).finish
        if finish is not None and len(chosen) == len(modes):
            finish(linked, outcomes, request.report)
    return results


def _report_failure(linked: LinkedTest, result: Result, failure: Failure, report: Report) -> None:
    """Report a failed test as an error, at the location of the violated value in the document."""
    test = linked.test
    span = test.spans.get(failure.key)
    labelled = [f"{label} `{name}`" for label, name in (("mode", result.mode), ("pose", result.pose)) if name is not None]
    location = f" ({', '.join(labelled)})" if labelled else ""
    report.add(
        failure.code, f"test `{test.name}`{location}: {failure.message}", (span,) if span is not None else test.origin,
        path=f"tests.{test.name}", help=failure.help, notes=failure.notes,
    )


Run = tuple[str | None, str | None, Callable[[], Outcome]]
"""A single run of a test that has not yet started: the names of its mode and pose, and a function that measures the outcome."""


def _runs(request: EmitRequest, linked: LinkedTest, modes: Sequence[LinkedMode]) -> Iterator[Run]:
    """Yield all runs of a test, in the order of modes and poses.

    A test that does not depend on the mode is run once. All other tests are run once for each mode and pose.
    """
    measurement, assembly = measurement_of(linked.test.kind), request.assembly
    kind = measurement.kind
    if not kind.takes("mode"):
        case = TestCase(linked=linked, robot=request.robots[0], request=request)
        yield None, None, partial(measurement.measure, case, linked.test.check)
        return
    for mode in modes:
        for pose in _poses(request, linked, mode) if kind.takes("pose") else [assembly.start_pose(mode)]:
            pose_name = pose.name if kind.takes("pose") and pose.stated else None
            yield mode.name, pose_name, partial(_measure_in_pose, request, linked, mode, pose)


def _poses(request: EmitRequest, linked: LinkedTest, mode: LinkedMode) -> list[NamedPose]:
    """Return the poses of a test in a mode. The test specifies names of poses, all keyframes, or by default the start pose of the mode."""
    assembly = request.assembly
    by_name = {pose.name: pose for pose in assembly.poses}
    if linked.test.every_pose:
        robot = next(robot for robot in request.robots if robot.mode.name == mode.name)
        return [by_name[frame.name] for frame in robot.keyframes] or [assembly.start_pose(mode)]
    return [assembly.start_pose(mode) if name is None else by_name[name] for name in linked.test.poses]


def _measure_in_pose(request: EmitRequest, linked: LinkedTest, mode: LinkedMode, pose: NamedPose) -> Outcome:
    """Run a test in a mode and a pose, and return the outcome."""
    measurement, check = measurement_of(linked.test.kind), linked.test.check
    poses = measurement.poses(check, pose)
    robot = pose_robot(request.assembly, mode, poses)
    frames = () if robot is None else tuple(frame for run_pose in poses if (frame := keyframe(robot, run_pose)) is not None)
    if robot is None or not frames:
        return open_loops_outcome()
    case = TestCase(linked=linked, robot=robot, request=request, frames=frames, missing=len(poses) - len(frames))
    return measurement.measure(case, check)
