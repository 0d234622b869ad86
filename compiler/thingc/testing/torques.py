"""Tests of torque: what drives have to hold against gravity while nothing moves."""

from __future__ import annotations

import math

from thingc.diagnostics import Code, Note
from thingc.graph import joints_of
from thingc.graph.types import JointEdge
from thingc.joints import KINDS
from thingc.resolve.tests_model import TorqueCheck
from thingc.robot import body_poses
from thingc.robot.types import Keyframe
from thingc.statics import static_efforts
from thingc.testing.results import Case, Failure, Measure, Outcome, shown
from thingc.units import FORCE, TORQUE

SLACK = 1e-6
"""What part of the gravity on the joints may stay unbalanced: rounding."""


def torque_margin(case: Case, check: TorqueCheck, frame: Keyframe) -> Outcome:
    """The least of limit by static effort among the drives named."""
    joints = {joint.path: joint for joint in joints_of(case.robot.assembly)}
    held = static_efforts(case.robot, frame.q, body_poses(case.robot, frame.q, frame.base))
    efforts, margins, choices = held.by_joint, held.margins, held.choices
    least = min(check.joints, key=lambda path: float(f"{margins[path]:.12g}"))  # of those that differ by rounding, the first
    text = _effort(joints[least], efforts[least])
    limit = _effort(joints[least], joints[least].limit.effort or 0.0)
    measured: dict[str, Measure] = {
        "margin": margins[least] if math.isfinite(margins[least]) else None, "drive": least, "effort": efforts[least],
        "efforts": {path: efforts[path] for path in check.joints},
    }
    expected: dict[str, Measure] = {"min": check.minimum}
    notes: list[Note] = []
    open_ = ", one answer of many" if choices else ""
    if choices:
        measured["undetermined"] = choices
        notes.append(Note(message="statics alone does not determine these efforts: they are the least that hold the pose"))
    failure: Failure | None = None
    if held.unheld > SLACK:
        failure = Failure(
            code=Code.TEST_TORQUE, key="drive",
            message=f"no effort of the drives holds this pose: joint `{held.where}` would move",
            help="drive the joint, or choose a pose in which it hangs at rest",
        )
        return Outcome(measured=measured, expected=expected, said="does not stay in the pose", failure=failure)
    if not math.isfinite(margins[least]):
        said = f"{least} carries nothing (margin at least {check.minimum:g}){open_}"
        return Outcome(measured=measured, expected=expected, said=said)
    said = f"margin {margins[least]:.3g} at {least}: {text} of {limit} (at least {check.minimum:g}){open_}"
    if margins[least] < check.minimum:
        others = [path for path in check.joints if path != least and margins[path] < check.minimum]
        notes += [
            Note(message=f"drive `{path}` holds {_effort(joints[path], efforts[path])}, a margin of {margins[path]:.3g}")
            for path in others
        ]
        failure = Failure(
            code=Code.TEST_TORQUE, key="min", notes=tuple(notes),
            message=f"drive `{least}` has to hold {text} of its {limit}: a margin of {margins[least]:.3g}, below {check.minimum:g}",
        )
    return Outcome(measured=measured, expected=expected, said=said, failure=failure)


def _effort(joint: JointEdge, value: float) -> str:
    return shown(abs(value), FORCE if KINDS[joint.kind].core == "slide" else TORQUE)
