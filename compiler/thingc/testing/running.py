"""The tests of a document, run one after the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

from thingc.diagnostics import Code, Note, Report
from thingc.emit.mjcf import target as mjcf
from thingc.emit.request import EmitRequest
from thingc.graph.types import Assembly, LinkedMode, LinkedTest
from thingc.resolve.model import NamedPose
from thingc.resolve.tests_model import (
    CentreCheck,
    CollisionCheck,
    MassCheck,
    PointCheck,
    ReachCheck,
    SettleCheck,
    TorqueCheck,
)
from thingc.robot.types import Keyframe, Robot
from thingc.testing import masses
from thingc.testing.results import Case, Failure, Outcome, Result
from thingc.testing.stances import keyframe, posed, starting_pose, swept


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """What to run: names of tests, patterns allowed (none: all), and of modes (none: those of each test)."""

    only: tuple[str, ...] = ()
    modes: tuple[str, ...] = ()

    def takes(self, test: LinkedTest) -> bool:
        """Whether a test is meant."""
        return not self.only or any(test.test.name == text or fnmatchcase(test.test.name, text) for text in self.only)


def run(request: EmitRequest, selection: Selection, on_result: Callable[[Result], None] = lambda result: None) -> list[Result]:
    """Run the tests of `request.assembly` that are meant, in document order; `on_result` hears of each when it is done.

    What fails is said in `request.report`, at the value that it contradicts. `request.robots` are the robots of its modes.
    """
    runner = _Runner(request)
    results: list[Result] = []
    for linked in request.assembly.tests:
        if not selection.takes(linked):
            continue
        needed: set[int] = set()
        modes = [mode for mode in request.assembly.modes if mode.name in linked.test.modes]
        chosen = [mode for mode in modes if not selection.modes or mode.name in selection.modes]
        for attempt in runner.attempts(linked, chosen):
            started = time.perf_counter()
            outcome = attempt.run()
            result = Result(
                name=linked.test.name, kind=linked.test.kind, mode=attempt.mode, pose=attempt.pose, outcome=outcome,
                seconds=time.perf_counter() - started,
            )
            needed |= outcome.needed
            if outcome.failure is not None:
                _say(linked, result, outcome.failure, request.report)
                result = replace(result, diagnostic=request.report.diagnostics[-1])
            results.append(result)
            on_result(result)
        if isinstance(linked.test.check, CollisionCheck) and len(chosen) == len(modes):
            _unneeded(linked, linked.test.check, needed, request.report)
    return results


def _say(linked: LinkedTest, result: Result, failure: Failure, report: Report) -> None:
    """The diagnostic of a failed test, at the value that it contradicts."""
    test = linked.test
    span = test.spans.get(failure.key)
    where = "" if not result.where else ", ".join(
        f"{what} `{word}`" for what, word in (("mode", result.mode), ("pose", result.pose)) if word is not None
    )
    report.add(
        failure.code, f"test `{test.name}`{f' ({where})' if where else ''}: {failure.message}",
        (span,) if span is not None else test.origin, path=f"tests.{test.name}", help=failure.help, notes=failure.notes,
    )


def _unneeded(linked: LinkedTest, check: CollisionCheck, needed: set[int], report: Report) -> None:
    for number, allowance in enumerate(check.allow):
        if number not in needed:
            report.warn(
                Code.TEST_ALLOWANCE, f"test `{linked.test.name}` allows {allowance.text} to meet, which they never do",
                allowance.origin, path=f"tests.{linked.test.name}", help="take the pair out of `allow`",
                notes=[Note(message=f"the reason given is: {allowance.reason}")],
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Attempt:
    """One case, not yet run."""

    mode: str | None
    pose: str | None
    run: Callable[[], Outcome]


class _Runner:
    """Knows how each kind is run, and keeps what several tests need."""

    def __init__(self, request: EmitRequest) -> None:
        self.request = request
        self.assembly: Assembly = request.assembly
        self._collisions: Any = None

    def attempts(self, linked: LinkedTest, modes: Sequence[LinkedMode]) -> Iterator[_Attempt]:
        """The cases of a test, in the order of modes and poses."""
        check = linked.test.check
        if isinstance(check, MassCheck):
            yield _Attempt(mode=None, pose=None, run=lambda: masses.mass(self.case(linked, self.request.robots[0]), check))
        elif isinstance(check, ReachCheck):
            yield _Attempt(mode=None, pose=None, run=lambda: self.reach(linked, check))
        elif isinstance(check, PointCheck):
            for mode in modes:
                yield _Attempt(mode=mode.name, pose=None, run=self.in_pose(linked, mode, starting_pose(self.assembly, mode)))
        else:
            for mode in modes:
                for pose in self.poses(linked, mode):
                    named = pose.name if any(known.name == pose.name for known in self.assembly.poses) else None
                    yield _Attempt(mode=mode.name, pose=named, run=self.in_pose(linked, mode, pose))

    def case(self, linked: LinkedTest, robot: Robot) -> Case:
        """The test on a robot."""
        return Case(linked=linked, robot=robot)

    def poses(self, linked: LinkedTest, mode: LinkedMode) -> list[NamedPose]:
        """The poses of a test in a mode: those named, where the mode starts, or all of its keyframes."""
        known = {pose.name: pose for pose in self.assembly.poses}
        if linked.test.every_pose:
            robot = next(robot for robot in self.request.robots if robot.mode.name == mode.name)
            return [known[frame.name] for frame in robot.keyframes] or [starting_pose(self.assembly, mode)]
        return [starting_pose(self.assembly, mode) if name is None else known[name] for name in linked.test.poses]

    def reach(self, linked: LinkedTest, check: ReachCheck) -> Outcome:
        """In no mode: without holds, from the base component."""
        from thingc.testing.reaching import reach

        mode = replace(self.assembly.modes[0], holds=(), cut=(), pose=None, base="fixed")
        start = starting_pose(self.assembly, mode)
        robot = posed(self.assembly, mode, [start])
        if robot is None:
            return _unclosed(linked, start)
        return reach(self.case(linked, robot), check)

    def in_pose(self, linked: LinkedTest, mode: LinkedMode, pose: NamedPose) -> Callable[[], Outcome]:
        """The case in a mode and a pose, ready to be run."""
        def run() -> Outcome:
            check = linked.test.check
            sweep = swept(pose, check.ranges, check.samples) if isinstance(check, CollisionCheck) and check.ranges else [pose]
            robot = posed(self.assembly, mode, sweep)
            frames = [] if robot is None else [frame for one in sweep if (frame := keyframe(robot, one)) is not None]
            if robot is None or not frames:
                return _unclosed(linked, pose)
            return self.checked(self.case(linked, robot), frames, len(sweep) - len(frames))

        return run

    def checked(self, case: Case, frames: list[Keyframe], missing: int) -> Outcome:
        """One kind of test in its keyframes: one, or those of a sweep."""
        check = case.linked.test.check
        if isinstance(check, CentreCheck):
            return masses.centre(case, check, frames[0])
        if isinstance(check, PointCheck):
            from thingc.testing.reaching import point

            return point(case, check, frames[0])
        if isinstance(check, TorqueCheck):
            from thingc.testing.torques import torque_margin

            return torque_margin(case, check, frames[0])
        if isinstance(check, CollisionCheck):
            from thingc.testing.collisions import no_collision

            return no_collision(case, check, frames, self.collisions(), missing)
        if isinstance(check, SettleCheck):
            return self.settles(case, check, frames[0])
        raise TypeError(f"no test in a pose: {check!r}")

    def collisions(self) -> Any:
        """The pairs and shapes of the assembly, made once."""
        if self._collisions is None:
            from thingc.solids.shapes import Shapes
            from thingc.testing.collisions import Collisions

            self._collisions = Collisions(self.assembly, Shapes(self.request.store), self.request.workspace.mesh.linear)
        return self._collisions

    def settles(self, case: Case, check: SettleCheck, frame: Keyframe) -> Outcome:
        """The mode's model emitted with the pose as a keyframe, and simulated."""
        from thingc.testing.settling import settles

        report = Report()
        request = replace(self.request, robots=(case.robot,), report=report, made={}, verify=True)
        artifacts = mjcf.emit(request)
        if report.failed:
            for diagnostic in report.diagnostics:
                self.request.report.say(diagnostic)
            failure = Failure(code=Code.TEST_SETTLES, key="", message="MuJoCo does not take the model")
            return Outcome(measured={}, expected={}, said="no model", failure=failure)
        store = self.request.store
        files = {
            path: content if isinstance(content, bytes) else store.read(content.sha256) for path, content in artifacts.files.items()
        }
        return settles(case, check, frame, f"mjcf/scene_{case.robot.mode.name}.xml", files)


def _unclosed(linked: LinkedTest, pose: NamedPose) -> Outcome:
    failure = Failure(
        code=Code.TEST_POSE, key="pose", message="the loops of the mode do not close in this pose",
        help="`thingc info` says in which poses they do",
    )
    return Outcome(measured={}, expected={}, said="the loops do not close", failure=failure)
