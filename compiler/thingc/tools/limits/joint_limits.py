"""Find the intervals of joints in which no parts touch, and check pairs of joints between their limits."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from math import inf, pi, remainder, tau

import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.progress import Progress, ProgressCounter
from thingc.base.suggestions import did_you_mean
from thingc.driver.pipeline import UnknownChoice
from thingc.driver.testing.collisions import Collisions, names_of
from thingc.driver.testing.poses import joints_text, keyframe, pose_robot
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import JointEdge
from thingc.model.resolve.types import JointRange
from thingc.model.robot.kinematics import placed_bodies
from thingc.model.robot.types import Keyframe, Robot
from thingc.model.solids.clearance import SolidPair, SolidPlace, Sweep, prove
from thingc.model.solids.contact_cells import prove_pairs
from thingc.model.solids.joint_boxes import SKIN

COARSE = 16.0
"""Length of the shortest interval that is surely found, relative to the accuracy of the ends of intervals."""


class FreeIntervals(FrozenStruct):
    """The intervals [rad or m] of a joint in which no parts touch, in ascending order.

    `blocked` contains positions outside the intervals, each with the pair that touches there (None: a loop does not close). `proved` is
    False if some pairs were compared only in samples, or if there are no pairs. Positions that differ by a multiple of `period` are the
    same (infinite: no period).
    """

    period: float
    intervals: tuple[tuple[float, float], ...]
    blocked: tuple[tuple[float, SolidPair | None], ...]
    proved: bool

    def around(self, q: float, width: float) -> tuple[float, float] | None:
        """Return the interval that contains `q`, or that has a bound at most `width` from `q`. Return None if there is no such interval."""
        return next((one for one in self.intervals if one[0] - width <= q <= one[1] + width), None)

    def contact(self, q: float, width: float) -> SolidPair | None:
        """Return the pair that touches at the nearest blocked position, or None if this position is farther than `width` from `q`."""
        distances = ((abs(remainder(at - q, self.period)), pair) for at, pair in self.blocked)
        return min((one for one in distances if one[0] <= width), key=lambda one: one[0], default=(q, None))[1]


def free_intervals(sweep: Sweep, pairs: Sequence[SolidPair], width: float, progress: Progress | None = None) -> FreeIntervals:
    """Return the intervals of a sweep of one joint in which no pair touches.

    The ends of the intervals are at most `width` [rad or m] from the nearest position in which parts touch or are closer than the errors of
    their meshes. Intervals that are shorter than `COARSE` times this distance can be missing. Pairs that are in contact in all positions
    are compared in samples. If the robot repeats after a turn of the joint, an interval can extend beyond the range of the sweep, and
    intervals that are connected across the ends of the range are one interval.
    """
    prove_pairs(sweep, pairs, progress)
    search = _Search(sweep, [pair for pair in pairs if pair.verdict in ("touches", "undecided")], width)
    free: list[tuple[float, float]] = []
    one = sweep.ranges[0]
    waiting = [((one.lower + one.upper) / 2.0, (one.upper - one.lower) / 2.0)]
    while waiting:
        middle, half = waiting.pop()
        if search.is_free(middle, half):
            free.append((free.pop()[0] if free and free[-1][1] >= middle - half - 1e-9 else middle - half, middle + half))
        elif 2.0 * half > COARSE * width:
            waiting += [(middle + half / 2.0, half / 2.0), (middle - half / 2.0, half / 2.0)]
    period = tau if free and _repeats(sweep) else inf
    first, last = (free[-1][1] - tau, free[0][0] + tau) if period == tau else (one.lower, one.upper)
    grown: list[tuple[float, float]] = []
    for low, high in free:
        low, high = search.advance(low, -1.0, first), search.advance(high, 1.0, last)
        grown.append((grown.pop()[0] if grown and grown[-1][1] >= low - 1e-9 else low, high))
    if len(grown) > 1 and grown[-1][1] - period >= grown[0][0] - 1e-9:
        (_, high), *between, (low, _) = grown
        up = period if low <= (one.lower + one.upper) / 2.0 + width else 0.0
        grown = sorted([(low - period + up, high + up), *between])
    if grown and grown[0][1] - grown[0][0] >= period - 1e-9:
        grown, search.blocked = [(one.lower, one.upper)], []
    known = all(pair.method == "proved" and pair.verdict in ("clear", "touches", "undecided") and pair.apart for pair in pairs)
    return FreeIntervals(period=period, intervals=tuple(grown), blocked=tuple(search.blocked), proved=bool(pairs) and known)


def _repeats(sweep: Sweep) -> bool:
    """Return whether the range of a sweep is one turn, and the robot is the same at positions that differ by one turn."""
    one = sweep.ranges[0]
    if abs(one.upper - one.lower - tau) > 1e-9:
        return False
    for q in (one.lower, one.lower + 1.0, one.lower + 2.0):
        places = [place for at in (q, q + tau) if (place := sweep.place([at])) is not None]
        poses = [np.array([pose.rows() for pose in placed_bodies(sweep.robot.bodies, place.q, sweep.base)]) for place in places]
        if len(poses) < 2 or not np.allclose(poses[0], poses[1], rtol=0.0, atol=1e-6):
            return False
    return True


class _Search:
    """A search for positions of a joint in which no pair of `pairs` touches, with the positions in which a pair touches (`blocked`)."""

    def __init__(self, sweep: Sweep, pairs: Sequence[SolidPair], width: float) -> None:
        self._sweep, self._pairs, self._width = sweep, list(pairs), width
        self._fine = True  # whether a shorter step is not free either, because parts touch, or the step is too short
        self.blocked: list[tuple[float, SolidPair | None]] = []

    def is_free(self, middle: float, half: float) -> bool:
        """Return whether no pair touches within `half` of a position."""
        place = self._sweep.place([middle])
        for number, pair in enumerate(self._pairs):
            if place is None or not self._is_clear(place, pair, half):
                self._pairs.insert(0, self._pairs.pop(number))  # this pair is likely to touch in the next position, too
                self.blocked.append((middle, pair if place is not None else None))
                return False
        return True

    def advance(self, end: float, sign: float, last: float) -> float:
        """Move an end of a free interval towards `last` as far as no pair touches, and return it."""
        step = COARSE * self._width
        while end != last and (step > self._width / 4.0 or not self._fine):
            step = min(step, abs(last - end))
            if self.is_free(end + sign * step / 2.0, step / 2.0):
                end = last if step == abs(last - end) else end + sign * step
            else:
                step /= 2.0
        return end

    def _is_clear(self, place: SolidPlace, pair: SolidPair, half: float) -> bool:
        if not pair.apart:
            self._fine = True
            return 2.0 * half <= COARSE * self._width and place.overlap(pair)[1] <= pair.deep
        (gap,), (path,) = place.bounds([pair], np.array([half]))
        within = pair.floor + path
        if gap < within:
            gap = place.gap(pair, within)
            self._fine = bool(path <= SKIN or gap < pair.floor)
        return bool(gap >= within)


TURN = pi
"""Half of the range [rad] in which a rotation is searched."""


class JointLimits(FrozenStruct):
    """The free intervals of a joint [rad or m], the interval that contains the pose (None: parts touch in the pose), and its contacts.

    `contacts` contains, for each end, the pair of parts that touches beyond the end. An end without a contact is the end of the search.
    `compared` is the number of compared pairs. `proved` is False if it is 0, or if some pairs were compared only in samples. The ends are
    at most `width` from a position in which parts touch. `skipped` contains the pairs that move relative to each other and were not
    compared, by reason.
    """

    joint: JointEdge
    intervals: tuple[tuple[float, float], ...]
    own: tuple[float, float] | None
    contacts: tuple[str | None, str | None]
    proved: bool
    width: float
    compared: int
    skipped: dict[str, list[str]]


class PairLimits(FrozenStruct):
    """The result for two joints that move between their limits: the pair of parts that touches or may touch (None: none), and where."""

    joints: tuple[str, str]
    verdict: str
    contact: str | None
    where: str
    proved: bool
    compared: int
    skipped: dict[str, list[str]]


def posed_robot(robot: Robot, pose_name: str | None) -> tuple[Robot, Keyframe]:
    """Return the robot and its keyframe for a pose, by default the start pose of the mode. Raises `UnknownChoice`."""
    poses = {pose.name: pose for pose in robot.assembly.poses}
    if pose_name is not None and pose_name not in poses:
        raise UnknownChoice(f"there is no pose `{pose_name}`", did_you_mean(pose_name, list(poses), what="poses"))
    pose = poses[pose_name] if pose_name is not None else robot.assembly.start_pose(robot.mode)
    placed = pose_robot(robot.assembly, robot.mode, [pose])
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
        raise UnknownChoice(f"there is no movable joint `{unknown}`", did_you_mean(unknown, list(movable), what="joints"))
    chosen = {name: joint for name, joint in movable.items() if not patterns or any(name in names for names in matches.values())}
    for name, joint in chosen.items():
        if not joint.twist.turns and (joint.limit.lower is None or joint.limit.upper is None):
            raise UnknownChoice(f"the sliding joint `{name}` has no limits", f"add `limit` to joint `{name}`, or select other joints")
    return list(chosen.values())


class LimitSearch:
    """Searches the limits of some joints. All other joints stay at their positions in the keyframe `frame`."""

    def __init__(self, robot: Robot, frame: Keyframe, collisions: Collisions) -> None:
        self._robot, self._frame, self._collisions = robot, frame, collisions

    def joint(self, joint: JointEdge, width: float) -> JointLimits:
        """Search the free intervals of a joint, with ends that are at most `width` [rad or m] from a contact."""
        q = self._frame.q[joint.path]
        sweep, pairs = self._collisions.moving_pairs(self._robot, self._frame, [_range(joint, q)], 0.0)
        free, skipped = free_intervals(sweep, pairs, width, self._collisions.progress), self._skipped_names(sweep)
        interval = free.around(q, width)
        lower, upper = (self._names(free.contact(end, width)) for end in (interval or (q, q)))
        return JointLimits(
            joint=joint, intervals=free.intervals, own=interval, contacts=(lower, upper), proved=free.proved and not skipped, width=width,
            compared=len(pairs), skipped=skipped,
        )

    def pair(self, one: JointEdge, other: JointEdge) -> PairLimits:
        """Compare all pairs of parts in all combinations of the positions of two joints between their limits."""
        ranges = [_range(joint, 0.0, limited=True) for joint in (one, other)]
        sweep, pairs = self._collisions.moving_pairs(self._robot, self._frame, ranges, 0.0)
        skipped = self._skipped_names(sweep)
        prove(sweep, pairs, ProgressCounter(self._collisions.progress, "proving pairs", len(pairs)))
        worst = next((pair for verdict in ("touches", "undecided") for pair in pairs if pair.verdict == verdict), None)
        q = worst.q if worst is not None else {}
        return PairLimits(
            joints=(one.name, other.name), verdict="clear" if worst is None else worst.verdict, contact=self._names(worst),
            where=joints_text(self._robot.assembly, {joint.path: q[joint.path] for joint in (one, other) if joint.path in q}),
            proved=bool(pairs) and all(pair.method == "proved" and pair.verdict != "contact" for pair in pairs) and not skipped,
            compared=len(pairs), skipped=skipped,
        )

    def _skipped_names(self, sweep: Sweep) -> dict[str, list[str]]:
        """Return the names of the pairs that move relative to each other and are not compared, by reason."""
        moving = {reason: [pair for pair in pairs if sweep.joints_between(*pair)[1]] for reason, pairs in self._collisions.skipped.items()}
        return {reason: [names_of(self._robot.assembly, *pair) for pair in pairs] for reason, pairs in moving.items() if pairs}

    def _names(self, pair: SolidPair | None) -> str | None:
        return None if pair is None else names_of(self._robot.assembly, pair.one, pair.other)


def _range(joint: JointEdge, q: float, *, limited: bool = False) -> JointRange:
    """Return the range in which a joint is searched: one turn around `q`, or the range between its limits."""
    lower, upper = joint.limit.lower, joint.limit.upper
    if joint.twist.turns and (not limited or lower is None or upper is None):
        lower, upper = q - TURN, q + TURN
    assert lower is not None and upper is not None
    return JointRange(joint=joint.path, lower=lower, upper=upper)
