"""Tests of torque: what drives have to hold against gravity while nothing moves."""

from __future__ import annotations

import numpy as np

from thingc.diagnostics import Code, Note
from thingc.graph import joints_of
from thingc.graph.types import JointEdge
from thingc.joints import KINDS
from thingc.resolve.tests_model import TorqueCheck
from thingc.robot.types import Keyframe, Robot
from thingc.testing.chain import Array, Chain
from thingc.testing.results import Case, Failure, Measure, Outcome, shown
from thingc.units import FORCE, TORQUE

SLACK = 1e-6
"""What part of the gravity on the joints may stay unbalanced: rounding."""


def static_efforts(robot: Robot, frame: Keyframe) -> tuple[dict[str, float], float, str, int]:
    """What each driven joint of a mode has to give [N m or N] for the robot to stay where it is.

    With Q what gravity and springs do on the coordinates, C the derivative of the loops' closing conditions and N a basis of what
    they leave free, the efforts t of the drives S balance it where N' (Q + S t) = 0. Where there is more than one answer (two held
    feet, two drives on a loop) it is the one with the least sum of squares of effort by limit; the last number returned says how
    many directions it was chosen from. The second is the part of Q that no drive balances, the third the joint where
    it is largest. Dry friction holds nothing.
    """
    chain = Chain(robot, frame.base)
    at = chain.bodies(frame.q)
    joints = {joint.path: joint for joint in joints_of(robot.assembly)}
    load = _load(robot, chain, frame, joints)
    _, closing = chain.closing(frame.q, at)
    free = _null_space(closing, len(chain.paths))
    limits = np.array([_limit(joints[path]) for path in robot.present])
    drives = np.zeros((len(chain.paths), len(robot.present)))
    for number, path in enumerate(robot.present):
        column, factor = chain.drive(path)
        drives[column, number] = factor
    held = free.T @ drives * limits
    wanted = -free.T @ load
    effort = np.zeros(len(robot.present))
    rank = 0
    if held.size:
        found, _, rank, _ = np.linalg.lstsq(held, wanted, rcond=1e-9)
        effort = limits * found
    rest = free @ (free.T @ (load + drives @ effort)) if free.size else np.zeros(len(chain.paths))
    scale = float(np.abs(load).max(initial=0.0)) or 1.0
    worst = int(np.abs(rest).argmax()) if len(rest) else 0
    unheld = float(np.abs(rest).max(initial=0.0)) / scale
    efforts = {path: float(value) + 0.0 for path, value in zip(robot.present, effort, strict=True)}
    return efforts, unheld, chain.paths[worst] if chain.paths else "", len(robot.present) - int(rank)


def _limit(joint: JointEdge) -> float:
    """The effort limit, which says how efforts are weighed; 1 where there is none, or none above 0."""
    return joint.limit.effort or 1.0


def _load(robot: Robot, chain: Chain, frame: Keyframe, joints: dict[str, JointEdge]) -> Array:
    """What gravity and springs do on every coordinate [N m or N]."""
    at = chain.bodies(frame.q)
    load = np.zeros(len(chain.paths))
    for index, body in enumerate(robot.bodies):
        mass = robot.assembly.links[body.link].properties
        centre = np.array(at[index].apply(mass.centre))
        load += mass.mass * np.array(robot.gravity) @ chain.jacobian(index, centre, at)[:3]
    for path, joint in joints.items():
        if joint.dynamics.stiffness is not None:
            column, factor = chain.drive(path)
            load[column] -= factor * joint.dynamics.stiffness * frame.q[path]
    return load


def _null_space(rows: Array, count: int) -> Array:
    """An orthonormal basis (count x k) of what the rows map to 0."""
    if not len(rows):
        return np.eye(count)
    _, sizes, right = np.linalg.svd(rows)
    rank = int((sizes > 1e-9 * max(float(sizes.max(initial=0.0)), 1e-12)).sum())
    return np.asarray(right[rank:].T, dtype=np.float64)


def torque_margin(case: Case, check: TorqueCheck, frame: Keyframe) -> Outcome:
    """The least of limit by static effort among the drives named."""
    joints = {joint.path: joint for joint in joints_of(case.robot.assembly)}
    efforts, unheld, where, choices = static_efforts(case.robot, frame)
    margins = {path: _margin(joints[path], efforts[path]) for path in check.joints}
    least = min(check.joints, key=lambda path: margins[path])
    text = _effort(joints[least], efforts[least])
    limit = _effort(joints[least], joints[least].limit.effort or 0.0)
    measured: dict[str, Measure] = {
        "margin": margins[least] if np.isfinite(margins[least]) else None, "drive": least, "effort": efforts[least],
        "efforts": {path: efforts[path] for path in check.joints},
    }
    expected: dict[str, Measure] = {"min": check.minimum}
    notes: list[Note] = []
    open_ = ", one answer of many" if choices else ""
    if choices:
        measured["undetermined"] = choices
        notes.append(Note(message="statics alone does not determine these efforts: they are the least that hold the pose"))
    failure: Failure | None = None
    if unheld > SLACK:
        failure = Failure(
            code=Code.TEST_TORQUE, key="drive",
            message=f"no effort of the drives holds this pose: joint `{where}` would move",
            help="drive the joint, or choose a pose in which it hangs at rest",
        )
        return Outcome(measured=measured, expected=expected, said="does not stay in the pose", failure=failure)
    if not np.isfinite(margins[least]):
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


def _margin(joint: JointEdge, effort: float) -> float:
    limit = joint.limit.effort or 0.0
    return limit / abs(effort) if abs(effort) > 1e-12 else float("inf")


def _effort(joint: JointEdge, value: float) -> str:
    return shown(abs(value), FORCE if KINDS[joint.kind].core == "slide" else TORQUE)
