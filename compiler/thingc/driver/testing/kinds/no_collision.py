"""Find collisions between parts, for document tests of the kind `no_collision`."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import chain, product

from thingc.base.diagnostics import Code, Note, Report, first_notes, shown_path
from thingc.base.one_line_repr import format_count
from thingc.base.units import LENGTH, Quantity
from thingc.documents.checks.no_collision import KIND, CollisionCheck
from thingc.driver.testing.certificate import Certificate
from thingc.driver.testing.collisions import SEARCH_DISTANCE, Collisions, NearPair, collisions_of, names_of, skipped_text
from thingc.driver.testing.outcomes import BELOW, Failure, Measure, Outcome, TestCase, TestMeasurement, format_si
from thingc.driver.testing.poses import joints_text, sweep_poses
from thingc.driver.testing.references import first_overlaps
from thingc.model.assembly.types import Assembly, LinkedTest
from thingc.model.resolve.types import NamedPose
from thingc.model.robot.kinematics import occurrence_poses

LISTED = 5
"""Maximum number of pairs that a message lists in addition to the worst pair."""


def poses(check: CollisionCheck, pose: NamedPose) -> Sequence[NamedPose]:
    """Return the poses that the test samples: `samples` poses over its ranges, or only `pose` if the test has no ranges.

    With `certify`, return a single pose inside the ranges, because a `Certificate` checks all other positions.
    """
    return sweep_poses(pose, check.ranges, 1 if check.certify else check.samples) if check.ranges else [pose]


def measure(case: TestCase, check: CollisionCheck) -> Outcome:
    """Measure the gaps and overlaps between components in one pose, or in all poses of a sweep."""
    collisions = collisions_of(case.request)
    allowed = _allowed_pairs(case.linked, check)
    nearest: NearPair | None = None
    worst: dict[tuple[int, int], NearPair] = {}
    needed: set[int] = set()
    certificate = Certificate(case, check, collisions) if check.certify else None
    touching = list(certificate.touching(allowed)) if certificate is not None else []
    certain = {(found.one, found.other) for found in touching}
    only = certificate.references if certificate is not None else None
    for found in chain(_find_pairs(case, check, collisions, allowed, needed) if only is None else (), touching):
        pair = found.one, found.other
        wrong = pair in certain or collisions.violates(found, check.clearance)
        if found.allowance is not None:
            needed.update((found.allowance,) if wrong else ())
            continue
        if nearest is None or found.gap < nearest.gap:
            nearest = found
        if wrong and (pair not in worst or found.severity > worst[pair].severity):
            worst[pair] = found
    compared = len(collisions.pairs) + len(collisions.close) if only is None else len(only)
    measured: dict[str, Measure] = {"gap": nearest.gap if nearest is not None else None, "positions": len(case.frames), "pairs": compared}
    skipped = {reason: [names_of(collisions.assembly, *pair) for pair in pairs] for reason, pairs in collisions.skipped.items()}
    if skipped:
        measured["skipped"] = skipped
    missing = case.missing + (certificate.missing if certificate is not None else 0)
    if missing:
        measured["not_closing"] = missing
    if nearest is not None:
        measured["pair"] = names_of(collisions.assembly, nearest.one, nearest.other)
    details = f", {format_count(len(case.frames), 'position')}" if check.ranges and certificate is None else ""
    details += f", the loops do not close in {missing} more positions" if missing else ""
    failure: Failure | None = None
    if certificate is not None:
        summary, measured["certificate"] = certificate.summary, certificate.measured
        needed |= certificate.warn(allowed)
    if worst:
        failure = _failure(case, check, sorted(worst.values(), key=lambda found: found.severity, reverse=True), collisions, certificate)
        measured["overlap"] = max(found.depth for found in worst.values())
        summary = "1 pair collides" if len(worst) == 1 else f"{len(worst)} pairs collide"
    elif certificate is None:
        summary = _least_gap(collisions.assembly, nearest)
    return Outcome(
        measured=measured, expected={"clearance": check.clearance}, failure=failure, needed=frozenset(needed),
        summary=f"{summary}{details}; {format_count(compared, 'pair')} compared{skipped_text(skipped)}",
    )


def _find_pairs(
    case: TestCase, check: CollisionCheck, collisions: Collisions, allowed: Mapping[tuple[int, int], int], needed: Collection[int],
) -> Iterator[NearPair]:
    """Yield the pairs of components that are close to each other or overlap in the frames of a test.

    `needed` contains the indices of the `allow` entries that have already permitted a collision, and may grow during the iteration.
    """
    compared_poses: set[object] | None = set() if len(case.frames) > 1 else None
    search_distance = SEARCH_DISTANCE
    for frame in case.frames:
        component_poses = occurrence_poses(case.robot, frame.q, frame.base)
        close = collisions.overlapping(component_poses, frame, allowed, compared_poses)
        for found in chain(collisions.near_pairs(component_poses, frame, check.clearance, search_distance, allowed, needed), close):
            search_distance = search_distance if found.allowance is not None else min(search_distance, found.gap)
            yield found


def _least_gap(assembly: Assembly, nearest: NearPair | None) -> str:
    if nearest is None:
        return f"every gap between links without a common joint is over {Quantity(SEARCH_DISTANCE, LENGTH)}"
    return f"least gap {format_si(nearest.gap, LENGTH)}, {names_of(assembly, nearest.one, nearest.other)}"


def finish(linked: LinkedTest, outcomes: Sequence[Outcome], report: Report) -> None:
    """Report a warning for each pair of components that the test allows to collide but that did not collide in any mode or pose, and if the
    test has not compared any parts.
    """
    check: CollisionCheck = linked.test.check
    if not any(outcome.measured.get("pairs", True) for outcome in outcomes):
        help = None
        if check.certify == "references":
            help = "use `certify: true`, or add `align` to the mounts of the joints"
        name, origin = linked.test.name, linked.test.origin
        report.warn(Code.TEST_EMPTY, f"test `{name}` has no parts to compare", origin, path=f"tests.{name}", help=help)
    needed = {number for outcome in outcomes for number in outcome.needed}
    for number, allowance in enumerate(check.allow):
        if number not in needed:
            report.warn(
                Code.TEST_ALLOWANCE, f"unused `allow` entry for {allowance.text} in test `{linked.test.name}`",
                allowance.origin, path=f"tests.{linked.test.name}", help="remove the pair from `allow`",
                notes=[Note(message=f"reason for the allowance: {allowance.reason}")],
            )


def _allowed_pairs(linked: LinkedTest, check: CollisionCheck) -> dict[tuple[int, int], int]:
    """Return the pairs of components that the test allows to collide, each with the index of the first matching `allow` entry."""
    allowed: dict[tuple[int, int], int] = {}
    for number, allowance in enumerate(check.allow):
        first, second = (
            [index for reference in side for index in linked.components[reference]] for side in (allowance.one, allowance.other)
        )
        for a, b in product(first, second):
            allowed.setdefault((min(a, b), max(a, b)), number)
    return allowed


def _failure(
    case: TestCase, check: CollisionCheck, worst: Sequence[NearPair], collisions: Collisions, certificate: Certificate | None,
) -> Failure:
    """Create the `Failure` of a test. The message describes the worst pair of components, and the notes describe the other pairs."""
    assembly, worst_pair = collisions.assembly, worst[0]
    texts = (f"{_describe_pair(assembly, near, check.clearance)}{_describe_position(case, check, near)}" for near in worst[1:])
    also = [Note(message=f"also {text}") for text in texts]
    notes = first_notes(also, LISTED, "more pair")
    notes += [
        Note(message=f"the surface of `{path.replace('/', '.')}` is not closed (the convex hull of the mesh is used)")
        for path in collisions.hulls if path in (assembly.occurrences[worst_pair.one].path, assembly.occurrences[worst_pair.other].path)
    ]
    names = ", ".join(assembly.occurrences[index].name for index in (worst_pair.one, worst_pair.other))
    location, help = _describe_position(case, check, worst_pair), f'if this is intended, add `allow: [{{pair: [{names}], reason: "..."}}]`'
    if certificate is not None and certificate.references is not None:
        pairs = {(pair.one, pair.other): pair for pair in certificate.pairs}
        begins = first_overlaps(case.robot, case.frames[0], check.ranges, [pairs[near.one, near.other] for near in worst])
        notes = [*certificate.references[worst_pair.one, worst_pair.other], *notes]
        if begins is not None:
            location, help, notes = f" at {begins[0]}", begins[2], [Note(message=begins[1]), *notes]
    elif (worst_pair.one, worst_pair.other) in collisions.close:
        help = f'if this is intended, add `allow: {{{Code.OVERLAP.code}: "the reason"}}` to one of the two components'
    return Failure(
        code=Code.TEST_COLLISION, key="clearance" if worst_pair.gap > 0.0 else "", notes=tuple(notes),
        message=f"{_describe_pair(assembly, worst_pair, check.clearance)}{location}", help=f"{help}; {_picture(case, check, worst_pair)}",
    )


def _describe_pair(assembly: Assembly, pair: NearPair, clearance: float) -> str:
    text = names_of(assembly, pair.one, pair.other, "`")
    if pair.gap > 0.0:
        return f"the gap between {text} ({format_si(pair.gap, LENGTH)}) {BELOW} ({Quantity(clearance, LENGTH)})"
    if pair.depth == 0.0:
        return f"the gap between {text} (0 mm) {BELOW} ({Quantity(clearance, LENGTH)})"
    return f"{text} overlap by {format_si(pair.depth, LENGTH)} on average ({float(f'{1e9 * pair.volume:.3g}'):g} mm^3)"


def _describe_position(case: TestCase, check: CollisionCheck, pair: NearPair) -> str:
    """Describe the joint positions of the sweep in which a pair of components is closest."""
    if not check.ranges:
        return ""
    return f" at {joints_text(case.robot.assembly, {r.joint: pair.where.q[r.joint] for r in check.ranges})}"


def _picture(case: TestCase, check: CollisionCheck, pair: NearPair) -> str:
    """Return the command that draws the robot in the position in which a pair of components is closest."""
    robot, pose = case.robot, pair.where.name.partition(":")[0]
    words = ["thingc", "render", shown_path(case.linked.test.origin[0].file), "--mode", robot.mode.name]
    words += ["--pose", pose] if any(one.name == pose for one in case.request.assembly.poses) else []
    for joint_range in check.ranges:
        position = joints_text(robot.assembly, {joint_range.joint: pair.where.q[joint_range.joint]})
        words += ["--position", position.replace(" = ", "=")]
    return f"to draw this position, run `{shlex.join(words)}`"


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure, poses=poses, finish=finish)
