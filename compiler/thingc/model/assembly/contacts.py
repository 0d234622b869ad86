"""Resolve the contact pairs and the contact groups of the modes of the top document."""

from __future__ import annotations

from collections.abc import Sequence

from thingc.base.diagnostics import Code, noted
from thingc.base.source import Origin
from thingc.model.assembly.instance_tree import Tree
from thingc.model.assembly.types import Occurrence
from thingc.model.resolve.types import ContactGroup, ContactPair, Mode


def pairs_of(tree: Tree, mode: Mode, occurrences: Sequence[Occurrence], link_of: Sequence[int]) -> tuple[ContactPair[int], ...]:
    """Return the pairs of occurrences that always collide in a mode. A nested assembly represents all of its occurrences.

    A pair of one link, a pair without collision shapes, and a pair that is listed twice are reported and omitted.
    """
    found: dict[frozenset[int], ContactPair[int]] = {}
    twice: set[Origin] = set()
    for pair in mode.pairs:
        sides = [tree.members(tree.top, reference) or () for reference in (pair.one, pair.other)]
        apart = [(a, b) for a in sides[0] for b in sides[1] if link_of[a] != link_of[b]]
        for side, reference in zip(sides, (pair.one, pair.other), strict=True):
            if side and not any(occurrences[one].has_contacts for one in side):
                tree.findings.error(
                    Code.CONTACTS, f"`{reference.text}` is in a contact pair, but has no collision shapes", pair.origin,
                    help="set `collision` of the component, or remove the pair",
                )
        if all(sides) and not apart:
            tree.findings.error(
                Code.CONTACTS, f"`{pair.one.text}` and `{pair.other.text}` are rigidly connected, so they cannot collide", pair.origin,
                help="name two components of different links",
            )
        for a, b in apart:
            if not (occurrences[a].has_contacts and occurrences[b].has_contacts):
                continue
            linked = ContactPair(one=a, other=b, friction=pair.friction, margin=pair.margin, gap=pair.gap, origin=pair.origin)
            other = found.setdefault(frozenset((a, b)), linked)
            if other is not linked and pair.origin not in twice:
                twice.add(pair.origin)
                names = " and ".join(f"`{occurrences[index].path.replace('/', '.')}`" for index in (a, b))
                tree.findings.error(
                    Code.CONTACTS, f"the contact pair of {names} is listed twice", pair.origin, help="remove one of the two entries",
                    notes=noted("the other entry is here", other.origin),
                )
    return tuple(found.values())


def groups_of(tree: Tree, mode: Mode) -> tuple[ContactGroup[int], ...]:
    """Return the contact groups of a mode with their occurrences. An occurrence in two groups is reported."""
    owners: dict[int, str] = {}
    made: list[ContactGroup[int]] = []
    for group in mode.groups:
        members = {member: reference for reference in group.members for member in tree.members(tree.top, reference) or ()}
        for member, reference in members.items():
            if (owner := owners.setdefault(member, group.name)) != group.name:
                name = tree.occurrences[member].path.replace("/", ".")
                tree.findings.error(
                    Code.CONTACTS, f"`{name}` is in two contact groups, `{owner}` and `{group.name}`", reference.origin,
                    help="remove the component from one of the two groups",
                )
        made.append(ContactGroup(name=group.name, members=tuple(members), collides=group.collides))
    return tuple(made)
