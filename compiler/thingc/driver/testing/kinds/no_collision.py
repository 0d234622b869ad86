"""Find collisions between parts, for document tests of the kind `no_collision`."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import chain, product

from thingc.base.diagnostics import Code, Note, Report, allow_hint, first_notes
from thingc.base.one_line_repr import format_count
from thingc.base.units import LENGTH, Quantity
from thingc.documents.checks.no_collision import KIND, CollisionCheck
from thingc.driver.testing.certificate import Certificate
from thingc.driver.testing.collisions import LOOK, Collisions, NearPair, collisions_of, names_of, skipped_text
from thingc.driver.testing.outcomes import Failure, Measure, Outcome, TestCase, TestMeasurement, format_si
from thingc.driver.testing.poses import joints_text, sweep_poses
from thingc.driver.testing.references import first_overlaps
from thingc.model.assembly.types import Assembly, LinkedTest
from thingc.model.resolve.types import NamedPose
from thingc.model.robot.kinematics import occurrence_poses

LISTED = 5
"""Maximum number of pairs that a message lists in addition to the worst pair."""


def poses(check: CollisionCheck, pose: NamedPose) -> Sequence[NamedPose]:
    """Return the poses in which the test measures: all poses of its sweep, or only `pose` if the test does not specify a sweep.

    With `certify`, the only pose is inside the ranges. The certificate checks all other positions.
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
    sure = {(near.one, near.other) for near in touching}
    only = certificate.references if certificate is not None else None
    for near in chain(_find_pairs(case, check, collisions, allowed, needed) if only is None else (), touching):
        pair = near.one, near.other
        wrong = pair in sure or collisions.violates(near, check.clearance)
        if near.allowance is not None:
            needed.update((near.allowance,) if wrong else ())
            continue
        if nearest is None or near.gap < nearest.gap:
            nearest = near
        if wrong and (pair not in worst or near.badness > worst[pair].badness):
            worst[pair] = near
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
    looked = f", {format_count(len(case.frames), 'position')}" if check.ranges and certificate is None else ""
    looked += f", in {missing} more positions the loops do not close" if missing else ""
    failure: Failure | None = None
    if certificate is not None:
        said, measured["certificate"] = certificate.said, certificate.measured
        needed |= certificate.warn(allowed)
    if worst:
        failure = _failure(case, check, sorted(worst.values(), key=lambda near: near.badness, reverse=True), collisions, certificate)
        measured["overlap"] = max(near.depth for near in worst.values())
        said = "1 pair collides" if len(worst) == 1 else f"{len(worst)} pairs collide"
    elif certificate is None:
        said = _least_gap(collisions.assembly, nearest)
    return Outcome(
        measured=measured, expected={"clearance": check.clearance}, failure=failure, needed=frozenset(needed),
        said=f"{said}{looked}; {format_count(compared, 'pair')} compared{skipped_text(skipped)}",
    )


def _find_pairs(
    case: TestCase, check: CollisionCheck, collisions: Collisions, allowed: Mapping[tuple[int, int], int], needed: Collection[int],
) -> Iterator[NearPair]:
    """Yield the pairs of components that are close to each other or overlap in the frames of a test.

    `needed` contains the indices of the `allow` entries that have already permitted a collision, and may grow during the iteration.
    """
    seen: set[object] | None = set() if check.ranges else None
    look = LOOK
    for frame in case.frames:
        at = occurrence_poses(case.robot, frame.q, frame.base)
        close = collisions.overlapping(at, frame, allowed, seen)
        for near in chain(collisions.near_pairs(at, frame, check.clearance, look, allowed, needed), close):
            look = look if near.allowance is not None else min(look, near.gap)
            yield near


def _least_gap(assembly: Assembly, nearest: NearPair | None) -> str:
    if nearest is None:
        return f"every gap between links without a common joint is over {Quantity(LOOK, LENGTH)}"
    return f"least gap {format_si(nearest.gap, LENGTH)}, {names_of(assembly, nearest.one, nearest.other)}"


def finish(linked: LinkedTest, outcomes: Sequence[Outcome], report: Report) -> None:
    """Report a warning for each pair of components that the test allows to collide but that did not collide in any mode or pose, and if the
    test has not compared any parts.
    """
    check: CollisionCheck = linked.test.check
    if not any(outcome.measured.get("pairs", True) for outcome in outcomes):
        help = "no mount at these joints was designed for another part: use `certify: true`" if check.certify == "references" else None
        name, origin = linked.test.name, linked.test.origin
        report.warn(Code.TEST_EMPTY, f"test `{name}` compares no parts", origin, path=f"tests.{name}", help=help)
    needed = {number for outcome in outcomes for number in outcome.needed}
    for number, allowance in enumerate(check.allow):
        if number not in needed:
            report.warn(
                Code.TEST_ALLOWANCE, f"test `{linked.test.name}` allows {allowance.text} to collide, but they never collide",
                allowance.origin, path=f"tests.{linked.test.name}", help="remove the pair from `allow`",
                notes=[Note(message=f"reason for the allowance: {allowance.reason}")],
            )


def _allowed_pairs(linked: LinkedTest, check: CollisionCheck) -> dict[tuple[int, int], int]:
    """Return a mapping from each pair of components that the test allows to collide to the index of the first matching `allow` entry."""
    allowed: dict[tuple[int, int], int] = {}
    for number, allowance in enumerate(check.allow):
        ones, others = (
            [index for reference in side for index in linked.components[reference]] for side in (allowance.one, allowance.other)
        )
        for a, b in product(ones, others):
            allowed.setdefault((min(a, b), max(a, b)), number)
    return allowed


def _failure(
    case: TestCase, check: CollisionCheck, worst: Sequence[NearPair], collisions: Collisions, certificate: Certificate | None,
) -> Failure:
    """Create the `Failure` of a test. The message describes the worst pair of components, and the notes describe the other pairs."""
    assembly, first = collisions.assembly, worst[0]
    others = [Note(message=f"also {_how(assembly, near, check.clearance)}{_at(case, check, near)}") for near in worst[1:]]
    notes = first_notes(others, LISTED, "more pair")
    notes += [
        Note(message=f"the surface of `{path.replace('/', '.')}` is not closed: the convex hull of the mesh is used instead")
        for path in collisions.hulls if path in (assembly.occurrences[first.one].path, assembly.occurrences[first.other].path)
    ]
    names = ", ".join(assembly.occurrences[index].path.replace("/", ".") for index in (first.one, first.other))
    where, help = _at(case, check, first), f'if this is intended, add `allow: [{{pair: [{names}], reason: "..."}}]`'
    if certificate is not None and certificate.references is not None:
        pairs = {(pair.one, pair.other): pair for pair in certificate.pairs}
        begins = first_overlaps(case.robot, case.frames[0], check.ranges, [pairs[near.one, near.other] for near in worst])
        where, help = (f" at {begins[0]}", begins[1]) if begins is not None else (where, help)
        notes = [*certificate.references[first.one, first.other], *notes]
    elif (first.one, first.other) in collisions.close:
        help = f"{allow_hint(Code.OVERLAP)} on one of the two"
    return Failure(
        code=Code.TEST_COLLISION, key="clearance" if first.gap > 0.0 else "", notes=tuple(notes),
        message=f"{_how(assembly, first, check.clearance)}{where}", help=help,
    )


def _how(assembly: Assembly, near: NearPair, clearance: float) -> str:
    text = names_of(assembly, near.one, near.other, "`")
    if near.gap > 0.0:
        return f"{text} are {format_si(near.gap, LENGTH)} apart, but at least {Quantity(clearance, LENGTH)} is required"
    if near.depth == 0.0:
        return f"{text} touch, but a gap of {Quantity(clearance, LENGTH)} is required"
    return f"{text} overlap by {format_si(near.depth, LENGTH)} on average ({float(f'{1e9 * near.volume:.3g}'):g} mm^3)"


def _at(case: TestCase, check: CollisionCheck, near: NearPair) -> str:
    """Describe the joint positions of the sweep in which a pair of components is closest."""
    if not check.ranges:
        return ""
    return f" at {joints_text(case.robot.assembly, {r.joint: near.where.q[r.joint] for r in check.ranges})}"


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure, poses=poses, finish=finish)
