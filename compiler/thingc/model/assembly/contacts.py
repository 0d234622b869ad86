"""Resolve the contact pairs and the contact groups of the modes of the top document."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from thingc.base.diagnostics import Code, noted
from thingc.model.assembly.instance_tree import Tree
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import LinkedGroup, LinkedPair, Occurrence
from thingc.model.resolve.types import Mode, PairSettings, Reference


def pairs_of(
    tree: Tree, mode: Mode, occurrences: Sequence[Occurrence], link_of: Sequence[int], findings: LinkReport,
) -> tuple[LinkedPair, ...]:
    """Return the pairs of occurrences that always collide in a mode. A nested assembly represents all of its occurrences.

    A pair of one link, a pair without collision shapes, and a pair that is listed twice are reported and omitted.
    """
    found: dict[frozenset[int], LinkedPair] = {}
    for pair in mode.pairs:
        sides = [list(_members(tree, reference)) for reference in (pair.one, pair.other)]
        words = " and ".join(f"`{'.'.join(one.path)}`" for one in (pair.one, pair.other))
        apart = [(a, b) for a in sides[0] for b in sides[1] if link_of[a] != link_of[b]]
        for side, reference in zip(sides, (pair.one, pair.other), strict=True):
            if side and not any(occurrences[one].has_contacts for one in side):
                findings.error(
                    Code.CONTACTS, f"`{'.'.join(reference.path)}` is in a contact pair, but has no collision shapes", pair.origin,
                    help="set `collision` of the component, or remove the pair",
                )
        if all(sides) and not apart:
            findings.error(
                Code.CONTACTS, f"{words} are rigidly connected, so they cannot collide", pair.origin,
                help="name two components of different links",
            )
        for a, b in apart:
            if not (occurrences[a].has_contacts and occurrences[b].has_contacts):
                continue
            settings = {name: getattr(pair, name) for name in PairSettings.__struct_fields__}
            linked = LinkedPair(one=a, other=b, **settings)
            other = found.setdefault(frozenset((a, b)), linked)
            if other is not linked:
                findings.error(
                    Code.CONTACTS, f"the contact pair of `{occurrences[a].path}` and `{occurrences[b].path}` is listed twice", pair.origin,
                    help="remove one of the two entries", notes=noted("the other entry is here", other.origin),
                )
                break
    return tuple(found.values())


def groups_of(tree: Tree, mode: Mode, findings: LinkReport) -> tuple[LinkedGroup, ...]:
    """Return the contact groups of a mode with their occurrences. An occurrence in two groups is reported."""
    owners: dict[int, str] = {}
    made: list[LinkedGroup] = []
    for group in mode.groups:
        members = tuple(dict.fromkeys(member for reference in group.members for member in _members(tree, reference)))
        for member in members:
            if (owner := owners.setdefault(member, group.name)) != group.name:
                findings.error(
                    Code.CONTACTS, f"`{tree.occurrences[member].path}` is in two contact groups, `{owner}` and `{group.name}`",
                    group.origin, help="remove the component from one of the two groups",
                )
                break
        made.append(LinkedGroup(name=group.name, members=members, collides=group.collides))
    return tuple(made)


def _members(tree: Tree, reference: Reference) -> Iterator[int]:
    """Yield the occurrences to which a reference to a component refers."""
    place = tree.component(tree.top, reference)
    for one in place.occurrences() if place is not None else ():
        if one.index is not None:
            yield one.index
