"""Resolve the section `contacts` of a mode: excluded pairs, pairs with their own settings, contact groups and adhesion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, product

from thingc.base.diagnostics import Code, make_notes
from thingc.base.source import Origin, Path
from thingc.base.units import FORCE, LENGTH
from thingc.documents.spec.modes import PairSpec
from thingc.model.resolve import references
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.materials import friction
from thingc.model.resolve.references import GLOB, suggest
from thingc.model.resolve.scope import DefaultLayers, Scope
from thingc.model.resolve.types import OTHERS, ContactGroup, ContactPair, Reference

MOST_GROUPS = 31
"""Maximum number of contact groups of a mode, because MuJoCo has 32 bits for groups, one of which is for `others`."""

MAX_EXCLUDED = 100_000


def excluded_pairs(table: DocumentScope, scope: Scope, contacts: DefaultLayers) -> tuple[tuple[Reference, Reference], ...]:
    """Return the pairs of components whose contacts are ignored."""
    entries, path = contacts.pick("exclude")
    pairs: dict[frozenset[tuple[str, ...]], tuple[Reference, Reference]] = {}
    for index, entry in enumerate(entries or ()):
        at = (*path, index)
        sides = [components_fitting(table, scope, text, (*at, side), scope.origin(at)) for side, text in enumerate(entry)]
        if len(pairs) + len(sides[0]) * len(sides[1]) > MAX_EXCLUDED:
            scope.error(
                Code.TOO_MANY, f"more than {MAX_EXCLUDED} pairs are excluded from contact", at,
                help="use patterns that match fewer components",
            )
            break
        for one, other in product(*sides):
            if one.path != other.path:
                pairs.setdefault(frozenset((one.path, other.path)), (one, other))
    return tuple(pairs.values())


def components_fitting(table: DocumentScope, scope: Scope, text: str, path: Path, origin: Origin | None = None) -> list[Reference]:
    """Return the components that match a name or pattern. The origin of the references is `origin`, or the location of the pattern."""
    if not GLOB.search(text):
        component = references.component(table, scope, text, path)
        paths = [component[0].path] if component is not None else []
    else:
        paths = [tuple(name.split(".")) for name, _ in references.matching(table, text)]
        if not paths and not table.unbuilt:
            scope.error(Code.NO_MATCH, f"pattern `{text}` matches no component", path, help=suggest(text, table.nodes, what="components"))
    return [Reference(path=names, mount=None, origin=scope.origin(path) if origin is None else origin) for names in paths]


def adhesions(table: DocumentScope, scope: Scope, contacts: DefaultLayers) -> Iterator[tuple[Reference, float]]:
    """Yield the adhesion force [N] of each magnet mount. Forces of extended modes are included."""
    for text, (raw, path) in contacts.entries("adhesion").items():
        reference = references.shown_mount(table, scope, text, path, key=True)
        force = scope.number(raw, path, FORCE, "an adhesion", above=0.0)
        if reference is not None and force is not None:
            yield reference, force


def pairs(
    table: DocumentScope, scope: Scope, contacts: DefaultLayers, excluded: Sequence[tuple[Reference, Reference]],
) -> Iterator[ContactPair[Reference]]:
    """Yield the pairs of components that always collide. The pairs in `excluded` must not collide.

    Invalid pairs are reported and omitted. The pass `link` finds pairs that are listed twice.
    """
    specs, path = contacts.pick("pairs")
    ignored = {frozenset((one.path, other.path)): one.origin for one, other in excluded}
    for index, spec in enumerate(specs or ()):
        at = (*path, index)
        for pair in _pairs_of(table, scope, spec, at):
            excluded_here = ignored.get(frozenset((pair.one.path, pair.other.path)))
            if excluded_here is None:
                yield pair
            else:
                scope.error(
                    Code.CONTACTS, f"`{pair.one.text}` and `{pair.other.text}` are in both `pairs` and `exclude`",
                    (*at, "between"), help="remove the pair from `pairs` or from `exclude`",
                    notes=make_notes("the pair is excluded here", excluded_here),
                )


def _pairs_of(table: DocumentScope, scope: Scope, spec: PairSpec, path: Path) -> Iterator[ContactPair[Reference]]:
    origin = scope.origin((*path, "between"))
    sides = [components_fitting(table, scope, text, (*path, "between", side), origin) for side, text in enumerate(spec.between)]
    margin, gap = (scope.number(getattr(spec, key), (*path, key), LENGTH, f"`{key}`", least=0.0) for key in ("margin", "gap"))
    if gap is not None and gap > (margin or 0.0) and (margin is None) is (spec.margin is None):
        scope.error(
            Code.CONTACTS, "`gap` is larger than `margin`", (*path, "gap"),
            help="write a `gap` that is not larger than the `margin`",
        )
    if sides[0] == sides[1] and len(sides[0]) == 1:
        scope.error(
            Code.CONTACTS, f"`{sides[0][0].text}` cannot collide with itself", (*path, "between"),
            help="use two components of different links",
        )
    coefficients = friction(scope, spec.friction, (*path, "friction"))
    unique = {frozenset(ends): ends for ends in product(*sides) if len(set(ends)) == 2}
    for one, other in unique.values():
        yield ContactPair(one=one, other=other, friction=coefficients, margin=margin, gap=gap, origin=origin)


def groups(table: DocumentScope, scope: Scope, contacts: DefaultLayers) -> Iterator[ContactGroup[Reference]]:
    """Yield the contact groups of a mode. Unknown names of groups are reported. The pass `link` finds components in two groups."""
    specs, path = contacts.pick("groups")
    for name, spec in (specs or {}).items():
        at = (*path, name)
        if name == OTHERS:
            message = f"a contact group cannot have the reserved name `{OTHERS}`"
            scope.error(Code.RESERVED_NAME, message, at, key=True, help="rename the group")
        for index, other in enumerate(spec.collide):
            if other not in (*specs, OTHERS):
                scope.error(
                    Code.CONTACTS, f"there is no contact group `{other}`", (*at, "collide", index),
                    help=suggest(other, (*specs, OTHERS), what="contact groups"),
                )
        listed = (components_fitting(table, scope, text, (*at, "components", index)) for index, text in enumerate(spec.components))
        yield ContactGroup(name=name, members=tuple(chain.from_iterable(listed)), collides=tuple(spec.collide))
