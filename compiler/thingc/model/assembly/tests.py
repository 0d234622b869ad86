"""Tests of the top document with their references worked out to occurrences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from thingc.base.frozen_struct import FrozenStruct
from thingc.documents.checks import kinds
from thingc.model.assembly.instance_tree import Tree
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import JointEdge, LinkedTest, MountAt
from thingc.model.resolve.types import Reference, Test


def tests_of(tree: Tree, tests: Sequence[Test], joints: Sequence[JointEdge], findings: LinkReport) -> tuple[LinkedTest, ...]:
    """The tests whose mounts and components are there; the others have been reported."""
    by_path = {joint.path: joint for joint in joints}
    linked: list[LinkedTest] = []
    for test in tests:
        mounts: dict[Reference, MountAt] = {}
        components: dict[Reference, tuple[int, ...]] = {}
        lacking = False
        for reference in _references(test.check):
            if reference.mount is None:
                place = tree.component(tree.top, reference)
                components[reference] = () if place is None else tuple(one.index for one in place.occurrences() if one.index is not None)
                lacking = lacking or place is None
                continue
            mount = tree.find(tree.top, reference)
            if mount is None:
                lacking = True
            else:
                mounts[reference] = MountAt(occurrence=mount.occurrence, mount=mount.mount)
        link = kinds()[test.kind].link
        if link is not None:
            link(test, test.check, by_path, findings)
        if not lacking:
            linked.append(LinkedTest(test=test, mounts=mounts, components=components))
    return tuple(linked)


def _references(stated: object) -> Iterator[Reference]:
    """Every reference in what a test states."""
    if isinstance(stated, Reference):
        yield stated
    elif isinstance(stated, tuple):
        for item in stated:
            yield from _references(item)
    elif isinstance(stated, FrozenStruct):
        for name in stated.__struct_fields__:
            yield from _references(getattr(stated, name))
