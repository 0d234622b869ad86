"""Resolve the section `contacts` of a mode: excluded pairs, pairs with their own settings, contact groups and adhesion."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from thingc.base.diagnostics import Code, noted
from thingc.base.source import Path
from thingc.base.units import FORCE, LENGTH
from thingc.documents.spec.modes import PairSpec
from thingc.model.resolve import references
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.materials import friction
from thingc.model.resolve.references import GLOB, suggested
from thingc.model.resolve.scope import DefaultLayers, Scope
from thingc.model.resolve.types import OTHERS, ContactGroup, ContactPair, Reference

MOST_GROUPS = 31
"""Maximum number of contact groups of a mode, because MuJoCo has 32 bits for groups, one of which is for `others`."""

MAX_EXCLUDED = 100_000


def excluded(table: DocumentScope, scope: Scope, contacts: DefaultLayers) -> tuple[tuple[Reference, Reference], ...]:
    """Return the pairs of components whose contacts are ignored."""
    said = contacts.pick("exclude")
    if said is None:
        return ()
    pairs: dict[frozenset[str], tuple[Reference, Reference]] = {}
    for index, entry in enumerate(said[0]):
        sides: list[list[str]] = []
        for side, text in enumerate(entry):
            sides.append(components_fitting(table, scope, text, (*said[1], index, side)))
        origin = scope.origin((*said[1], index))
        if len(pairs) + len(sides[0]) * len(sides[1]) > MAX_EXCLUDED:
            scope.error(
                Code.TOO_MANY, f"with this entry, more than {MAX_EXCLUDED} pairs are excluded from contact", (*said[1], index),
                help="use patterns that match fewer components",
            )
            break
        for first, second in product(*sides):
            if first != second:
                one, other = (Reference(path=tuple(name.split(".")), mount=None, origin=origin) for name in (first, second))
                pairs.setdefault(frozenset((first, second)), (one, other))
    return tuple(pairs.values())


def components_fitting(table: DocumentScope, scope: Scope, text: str, path: Path) -> list[str]:
    """Return the components that match a name or pattern."""
    if not GLOB.search(text):
        component = references.component(table, scope, text, path)
        return [".".join(component[0].path)] if component is not None else []
    names = [name for name, _ in references.matching(table, text)]
    if not names and not table.unbuilt:
        scope.error(Code.NO_MATCH, f"pattern `{text}` matches no component", path, help=suggested(text, table.nodes, what="components"))
    return names


def adhesions(table: DocumentScope, scope: Scope, contacts: DefaultLayers) -> tuple[tuple[Reference, float], ...]:
    """Return the adhesion force [N] of each magnet mount. Forces of extended modes are included."""
    merged: dict[str, tuple[object, Path]] = {}
    for model, path in reversed(contacts.items):
        for text, raw in getattr(model, "adhesion", {}).items():
            merged[text] = (raw, (*path, "adhesion", text))
    forces: list[tuple[Reference, float]] = []
    for text, (raw, path) in merged.items():
        reference = references.shown_mount(table, scope, text, path, key=True)
        force = scope.number(raw, path, FORCE, "an adhesion", above=0.0)
        if reference is not None and force is not None:
            forces.append((reference, force))
    return tuple(forces)


def pairs(
    table: DocumentScope, scope: Scope, contacts: DefaultLayers, apart: Sequence[tuple[Reference, Reference]],
) -> tuple[ContactPair, ...]:
    """Return the pairs of components that always collide. The pairs `apart` must not collide.

    Invalid pairs are reported and omitted.
    """
    said, path = contacts.pick("pairs") or ((), ())
    ignored = {frozenset((one.path, other.path)): one.origin for one, other in apart}
    found: dict[frozenset[tuple[str, ...]], ContactPair] = {}
    for index, spec in enumerate(said):
        at = (*path, index)
        for pair in _pairs_of(table, scope, spec, at):
            names = frozenset((pair.one.path, pair.other.path))
            words = " and ".join(f"`{'.'.join(one.path)}`" for one in (pair.one, pair.other))
            if names in ignored:
                scope.error(
                    Code.CONTACTS, f"the contacts of {words} are excluded, and listed under `pairs`", (*at, "between"),
                    help="remove one of the two entries", notes=noted("the pair is excluded here", ignored[names]),
                )
            elif names in found:
                scope.error(
                    Code.CONTACTS, f"the contact pair of {words} is listed twice", (*at, "between"),
                    help="remove one of the two entries", notes=noted("the other entry is here", found[names].origin),
                )
            else:
                found[names] = pair
    return tuple(found.values())


def _pairs_of(table: DocumentScope, scope: Scope, spec: PairSpec, path: Path) -> list[ContactPair]:
    sides = [components_fitting(table, scope, text, (*path, "between", side)) for side, text in enumerate(spec.between)]
    margin, gap = (
        None if raw is None else scope.number(raw, (*path, key), LENGTH, f"`{key}`", least=0.0)
        for key, raw in (("margin", spec.margin), ("gap", spec.gap))
    )
    origin = scope.origin((*path, "between"))
    if gap is not None and gap > (margin or 0.0) and (margin is None) is (spec.margin is None):
        scope.error(
            Code.CONTACTS, "`gap` is larger than `margin`, so the contact transmits no force", (*path, "gap"),
            help="write a `gap` of at most the `margin`",
        )
    if sides[0] == sides[1] and len(sides[0]) == 1:
        scope.error(
            Code.CONTACTS, f"`{sides[0][0]}` cannot collide with itself", (*path, "between"), help="name two components of different links",
        )
    coefficients = friction(scope, spec.friction, (*path, "friction"))
    unique = {frozenset(names): names for names in product(*sides) if len(set(names)) == 2}
    ends = [[Reference(path=tuple(name.split(".")), mount=None, origin=origin) for name in names] for names in unique.values()]
    return [
        ContactPair(one=one, other=other, friction=coefficients, margin=margin, gap=gap, origin=origin) for one, other in ends
    ]


def groups(table: DocumentScope, scope: Scope, contacts: DefaultLayers) -> tuple[ContactGroup, ...]:
    """Return the contact groups of a mode. Unknown names of groups, and components in two groups, are reported."""
    said, path = contacts.pick("groups") or ({}, ())
    made: list[ContactGroup] = []
    owners: dict[str, str] = {}
    for name, spec in said.items():
        at = (*path, name)
        if name == OTHERS:
            what = f"`{OTHERS}` is the group of all components without a group"
            scope.error(Code.RESERVED_NAME, what, at, key=True, help="rename the group")
        for index, other in enumerate(spec.collide):
            if other not in said and other != OTHERS:
                scope.error(
                    Code.CONTACTS, f"there is no contact group `{other}`", (*at, "collide", index),
                    help=suggested(other, (*said, OTHERS), what="contact groups"),
                )
        members: dict[str, Reference] = {}
        for index, text in enumerate(spec.components):
            place = (*at, "components", index)
            for component in components_fitting(table, scope, text, place):
                owner = owners.setdefault(component, name)
                if owner != name:
                    scope.error(
                        Code.CONTACTS, f"`{component}` is in two contact groups, `{owner}` and `{name}`", place,
                        help="remove the component from one of the two groups",
                    )
                    continue
                members[component] = Reference(path=tuple(component.split(".")), mount=None, origin=scope.origin(place))
        origin = scope.origin(at, key=True)
        made.append(ContactGroup(name=name, members=tuple(members.values()), collides=tuple(spec.collide), origin=origin))
    return tuple(made)
