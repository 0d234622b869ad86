"""Search the free intervals of the joints of a robot, and check pairs of joints between their limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import did_you_mean
from thingc.driver.pipeline import UnknownChoice
from thingc.driver.testing.collisions import Collisions, names_of
from thingc.driver.testing.poses import joints_text, keyframe, posed, starting_pose
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import JointEdge
from thingc.model.resolve.types import JointRange
from thingc.model.robot.types import Keyframe, Robot
from thingc.model.solids.clearance import ComparedPair, prove
from thingc.tools.limits.free_intervals import free_intervals

TURN = math.pi
"""Half of the range [rad] in which a rotation is searched."""


class JointLimits(FrozenStruct):
    """The free intervals of a joint [rad or m], the interval that contains the pose (None: parts touch in the pose), and its contacts.

    `contacts` contains, for each end, the pair of parts that touches beyond the end. An end without a contact is the end of the search.
    `proved` is False if some pairs were compared only in samples. The ends are at most `width` from a position in which parts touch.
    """

    joint: JointEdge
    intervals: tuple[tuple[float, float], ...]
    own: tuple[float, float] | None
    contacts: tuple[str | None, str | None]
    proved: bool
    width: float


class PairLimits(FrozenStruct):
    """The result for two joints that move between their limits: the pair of parts that touches or may touch (None: none), and where."""

    joints: tuple[str, str]
    verdict: str
    contact: str | None
    where: str
    proved: bool


def posed_robot(robot: Robot, wanted: str | None) -> tuple[Robot, Keyframe]:
    """Return the robot and its keyframe for a pose, by default the start pose of the mode. Raises `UnknownChoice`."""
    poses = {pose.name: pose for pose in robot.assembly.poses}
    if wanted is not None and wanted not in poses:
        raise UnknownChoice(f"there is no pose `{wanted}`", did_you_mean(wanted, list(poses), what="poses"))
    pose = poses[wanted] if wanted is not None else starting_pose(robot.assembly, robot.mode)
    placed = posed(robot.assembly, robot.mode, [pose])
    frame = keyframe(placed, pose) if placed is not None else None
    if placed is None or frame is None:
        raise UnknownChoice(f"the loops of mode `{robot.mode.name}` do not close in pose `{pose.name}`", "choose another pose with --pose")
    return placed, frame


def movable_joints(robot: Robot, patterns: Sequence[str]) -> list[JointEdge]:
    """Return the joints that match names or patterns, by default all joints that can be searched. Raises `UnknownChoice`."""
    movable = {str(joint.name): joint for joint in joints_of(robot.assembly) if joint.mimic is None and not joint.kind.at_once}
    matches = {word: [name for name in movable if name == word or fnmatchcase(name, word)] for word in patterns}
    unknown = next((word for word, names in matches.items() if not names), None)
    if unknown is not None:
        raise UnknownChoice(f"there is no joint `{unknown}` that can be moved", did_you_mean(unknown, list(movable), what="joints"))
    chosen = {name: joint for name, joint in movable.items() if not patterns or any(name in names for names in matches.values())}
    for name, joint in chosen.items():
        if not joint.twist.turns and (joint.limit.lower is None or joint.limit.upper is None):
            raise UnknownChoice(f"joint `{name}` slides without limits", f"add `limit` to joint `{name}`, or name other joints")
    return list(chosen.values())


class LimitSearch:
    """Searches the limits of joints. All joints that are not searched stay in the pose of the keyframe `frame`."""

    def __init__(self, robot: Robot, frame: Keyframe, collisions: Collisions) -> None:
        self._robot, self._frame, self._collisions = robot, frame, collisions

    def joint(self, joint: JointEdge, width: float) -> JointLimits:
        """Search the free intervals of a joint, with ends that are at most `width` [rad or m] from a contact."""
        q = self._frame.q[joint.path]
        free = free_intervals(*self._collisions.moving_pairs(self._robot, self._frame, [_range(joint, q)], 0.0), width)
        own = free.around(q, width)
        lower, upper = (self._names(free.contact(end, width)) for end in (own or (q, q)))
        return JointLimits(joint=joint, intervals=free.intervals, own=own, contacts=(lower, upper), proved=free.proved, width=width)

    def pair(self, one: JointEdge, other: JointEdge) -> PairLimits:
        """Compare all pairs of parts in all combinations of the positions of two joints between their limits."""
        ranges = [_range(joint, 0.0, limited=True) for joint in (one, other)]
        sweep, pairs = self._collisions.moving_pairs(self._robot, self._frame, ranges, 0.0)
        prove(sweep, pairs)
        worst = next((pair for verdict in ("touches", "undecided") for pair in pairs if pair.verdict == verdict), None)
        return PairLimits(
            joints=(one.name, other.name), verdict="clear" if worst is None else worst.verdict, contact=self._names(worst),
            where=self._places(worst.q, (one, other)) if worst is not None else "",
            proved=all(pair.method == "proved" and pair.verdict != "contact" for pair in pairs),
        )

    def _names(self, pair: ComparedPair | None) -> str | None:
        return None if pair is None else names_of(self._robot.assembly, pair.one, pair.other)

    def _places(self, q: Mapping[str, float], joints: Sequence[JointEdge]) -> str:
        return joints_text(self._robot.assembly, {joint.path: q[joint.path] for joint in joints}) if q else ""


def _range(joint: JointEdge, q: float, *, limited: bool = False) -> JointRange:
    """Return the range in which a joint is searched: one turn around `q`, or the range between its limits."""
    lower, upper = joint.limit.lower, joint.limit.upper
    if joint.twist.turns and (not limited or lower is None or upper is None):
        lower, upper = q - TURN, q + TURN
    assert lower is not None and upper is not None
    return JointRange(joint=joint.path, lower=lower, upper=upper)
