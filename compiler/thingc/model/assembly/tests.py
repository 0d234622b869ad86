"""Resolve the references in tests of the top document."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from thingc.base.frozen_struct import FrozenStruct
from thingc.documents.checks import kinds
from thingc.model.assembly.instance_tree import Tree
from thingc.model.assembly.types import JointEdge, LinkedTendon, LinkedTest, MountAt
from thingc.model.resolve.types import Reference


def tests_of(tree: Tree, joints: Sequence[JointEdge | LinkedTendon]) -> Iterator[LinkedTest]:
    """Yield the tests whose mounts and components are valid. All other tests are reported."""
    by_path = {joint.path: joint for joint in joints}
    for test in tree.model.tests:
        found = {
            reference: tree.members(tree.top, reference) if reference.mount is None else tree.find(tree.top, reference)
            for reference in _references(test.check)
        }
        link = kinds()[test.kind].link
        if link is not None:
            link(test, test.check, by_path, tree.findings)
        if None not in found.values():
            mounts = {one: mount for one, mount in found.items() if isinstance(mount, MountAt)}
            components = {one: members for one, members in found.items() if isinstance(members, tuple)}
            yield LinkedTest(test=test, mounts=mounts, components=components)


def _references(specification: object) -> Iterator[Reference]:
    """Yield all references in the specification of a test."""
    if isinstance(specification, Reference):
        yield specification
    elif isinstance(specification, tuple):
        for item in specification:
            yield from _references(item)
    elif isinstance(specification, FrozenStruct):
        for name in specification.__struct_fields__:
            yield from _references(getattr(specification, name))
