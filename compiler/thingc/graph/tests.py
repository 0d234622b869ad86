"""Tests of the top document with their references worked out to occurrences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from thingc.diagnostics import Code
from thingc.graph.findings import Findings, noted
from thingc.graph.types import JointEdge, LinkedTest, MountAt
from thingc.graph.unroll import Tree
from thingc.resolve.model import Reference
from thingc.resolve.tests_model import CentreCheck, Check, CollisionCheck, MassCheck, PointCheck, ReachCheck, Test, TorqueCheck


def tests_of(tree: Tree, tests: Sequence[Test], joints: Sequence[JointEdge], findings: Findings) -> tuple[LinkedTest, ...]:
    """The tests whose mounts and components are there; the others have been reported."""
    by_path = {joint.path: joint for joint in joints}
    found: list[LinkedTest] = []
    for test in tests:
        mounts: dict[Reference, MountAt] = {}
        lacking = False
        for reference in _mounts(test.check):
            there = tree.find(tree.top, reference)
            if there is None:
                lacking = True
            else:
                mounts[reference] = MountAt(occurrence=there.occurrence, mount=there.mount)
        components: dict[Reference, tuple[int, ...]] = {}
        for reference in _components(test.check):
            place = tree.component(tree.top, reference)
            components[reference] = () if place is None else tuple(leaf.index for leaf in place.leaves() if leaf.index is not None)
            lacking = lacking or place is None
        if isinstance(test.check, TorqueCheck):
            _check_efforts(test, test.check, by_path, findings)
        if not lacking:
            found.append(LinkedTest(test=test, mounts=mounts, components=components))
    return tuple(found)


def _mounts(check: Check) -> Iterator[Reference]:
    if isinstance(check, ReachCheck):
        yield from (check.of, check.base)
    elif isinstance(check, PointCheck):
        yield check.mount
    if isinstance(check, PointCheck | CentreCheck) and check.frame is not None:
        yield check.frame


def _components(check: Check) -> Iterator[Reference]:
    if isinstance(check, MassCheck | CentreCheck):
        yield from check.of
    elif isinstance(check, CollisionCheck):
        for allowance in check.allow:
            yield from (*allowance.one, *allowance.other)


def _check_efforts(test: Test, check: TorqueCheck, joints: dict[str, JointEdge], findings: Findings) -> None:
    """A margin is one of a limit: a drive without one has none."""
    for path in check.joints:
        joint = joints.get(path)
        if joint is not None and joint.limit.effort is None:
            findings.error(
                Code.TEST, f"joint `{path}` has no limit of effort: its drive has no margin",
                (test.spans["drive"],) if "drive" in test.spans else test.origin, path=path,
                help="write `limit: {effort: ...}` on the joint, or `effort` of its drive",
                notes=noted(f"`{path}` is here", joint.origin),
            )
