"""Simulate whether a robot comes to rest, for document tests of the kind `settles`."""

from __future__ import annotations

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report
from thingc.base.numeric import maximum
from thingc.base.units import LENGTH, TIME, Quantity
from thingc.documents.checks.settles import KIND, SettleCheck
from thingc.driver.testing.outcomes import ABOVE, Failure, Measure, Outcome, TestCase, TestMeasurement, format_si
from thingc.driver.testing.settle_simulation import SettleResult, simulate
from thingc.targets.mjcf import emit as mjcf
from thingc.targets.mjcf.compat import separator


def measure(case: TestCase, check: SettleCheck) -> Outcome:
    """Simulate the MuJoCo model of the mode, starting in the pose of the test.

    The simulated time is the sum of the keys `within` and `for` of the test.
    """
    report = Report()
    artifacts = mjcf.emit(replace(case.request, robots=(case.robot,), report=report, made={}, verify=True))
    if report.failed:
        for diagnostic in report.diagnostics:
            case.request.report.say(diagnostic)
        return Outcome(summary="no model", failure=Failure(code=Code.TEST_SETTLES, key="", message="MuJoCo rejects the model"))
    files = artifacts.contents(case.request.store)
    scene = f"mjcf/scene_{case.robot.mode.name}.xml"
    motion = simulate(
        case.robot, case.frames[0], scene, files, seconds=check.within + check.hold, resting=check.within, floor=check.floor,
        separator=separator(case.request.compat),
    )
    return _divergence(motion) if isinstance(motion, float) else _compare(check, motion)


def _compare(check: SettleCheck, motion: SettleResult) -> Outcome:
    """Compare the simulated motion of the robot with the limits that the test specifies."""
    rest_time, drift, moved, deepest = motion.rest_time(check.drift), motion.drift(check.within), motion.moved, maximum(motion.deepest, 0.0)
    # At the last instant, every point is at its final position, so the points must also be at rest for some time before.
    settled = rest_time <= check.within + 1e-9
    measured: dict[str, Measure] = {"rest": rest_time if settled else None, "drift": drift, "moved": moved, "penetration": deepest}
    expected: dict[str, Measure] = {
        "within": check.within, "drift": check.drift, "for": check.hold, "penetration": check.penetration,
        **({} if check.moved is None else {"moved": check.moved}),
    }
    moved_text, depth = format_si(moved, LENGTH), format_si(deepest, LENGTH)
    summary = f"at rest after {rest_time:.3g} s (drift {format_si(drift, LENGTH)}), {moved_text} from the pose, contacts {depth} deep"
    failure = None
    if not settled:
        summary = f"not at rest after {check.within:g} s"
        failure = Failure(
            code=Code.TEST_SETTLES, key="within",
            message=f"the drift of the robot after {Quantity(check.within, TIME)} ({format_si(drift, LENGTH)}) {ABOVE} "
            f"({Quantity(check.drift, LENGTH)})",
        )
    elif check.moved is not None and moved > check.moved:
        failure = Failure(
            code=Code.TEST_SETTLES, key="moved",
            message=f"the distance between the start and the rest position ({moved_text}) {ABOVE} ({Quantity(check.moved, LENGTH)})",
        )
    elif deepest > check.penetration:
        failure = Failure(
            code=Code.TEST_SETTLES, key="penetration",
            message=f"the penetration depth of the contacts ({depth}) {ABOVE} ({Quantity(check.penetration, LENGTH)})",
            help="start the mode on the floor (`at: {on: floor}`), or increase `penetration`",
        )
    return Outcome(measured=measured, expected=expected, summary=summary, failure=failure)


def _divergence(time: float) -> Outcome:
    return Outcome(measured={"diverged": time}, summary=f"diverges after {time:.3g} s", failure=Failure(
        code=Code.TEST_SETTLES, key="", message=f"the simulation diverges after {time:.3g} s",
        help="reduce `timestep` under `simulation`, or change the pose if parts overlap",
    ))


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure)
