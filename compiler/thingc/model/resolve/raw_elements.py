"""Elements that a document adds to the model of MuJoCo: `raw: {mjcf: {add: {tendon: [{fixed: {...}}]}}}`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from thingc.base.diagnostics import Code
from thingc.base.source import Path
from thingc.base.suggestions import did_you_mean
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import RawElement

ADD, INSIDE = "add", "in"
"""The key of what is added, and in an element that of the elements in it."""

ORDER, ORDERED = "order", ("actuator", "sensor")
"""The key of the order of elements in MuJoCo's model, and the kinds of elements that it lists."""
IN_ORDER = "[order]"
"""The last key of an attribute that only gives an element its place among the others, which no attribute of a document can have."""

SECTIONS = ("contact", "custom", "tendon", "equality", "actuator", "sensor")
"""Sections of MJCF that may be added to, such that what stands in one may name what stands in those before."""

_KINDS = {
    **dict.fromkeys(("joint", "joint1", "joint2", "jointinparent"), "joint"),
    **dict.fromkeys(("site", "site1", "site2", "cranksite", "slidersite", "refsite", "sidesite"), "site"),
    **dict.fromkeys(("body", "body1", "body2", "subtree1", "subtree2"), "body"), **dict.fromkeys(("geom", "geom1", "geom2"), "geom"),
    **dict.fromkeys(("tendon", "tendon1", "tendon2"), "tendon"), "actuator": "actuator", "camera": "camera",
}
"""Attributes that name another element, by the kind of that."""

_OBJECTS = {"objname": "objtype", "refname": "reftype"}
"""Attributes that name one of the kind that another attribute says."""

KINDS = frozenset(_KINDS.values())
"""The kinds of elements that others name."""

_EXAMPLE = "`- fixed: {name: grip, in: [{joint: {joint: left, coef: 1}}]}`"


def added(scope: Scope, written: Mapping[str, Any]) -> tuple[RawElement, ...]:
    """Every element under `raw: mjcf: add:`, section by section; what has no such form is reported."""
    under = written.get("mjcf")
    sections = under.get(ADD) if isinstance(under, Mapping) else None
    if sections is None:
        return ()
    path: Path = ("raw", "mjcf", ADD)
    if not isinstance(sections, Mapping):
        scope.error(
            Code.VALUE_KIND, "what `raw` adds is a mapping of sections", path, help=f"write for example `tendon: [...]`, in it {_EXAMPLE}",
        )
        return ()
    for section in sections:
        if section not in SECTIONS:
            scope.error(
                Code.RAW_UNKNOWN, f"`raw` adds nothing to `{section}`", (*path, section), key=True,
                help=did_you_mean(section, SECTIONS, what="sections"),
            )
    return tuple(
        element for section in SECTIONS if section in sections
        for element in _elements(scope, section, sections[section], (*path, section))
    )


def named_kind(attributes: Mapping[str, str], name: str) -> str | None:
    """The kind of element that an attribute of an added one names; None where it names none."""
    said = attributes.get(_OBJECTS.get(name, ""))
    return {"xbody": "body"}.get(said, said) if said is not None else _KINDS.get(name)


def text(value: object) -> str:
    """A scalar as XML has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return value if isinstance(value, str) else repr(value)


def _elements(scope: Scope, section: str, written: Any, path: Path) -> Iterator[RawElement]:
    if not isinstance(written, list):
        scope.error(Code.VALUE_KIND, f"`{path[-1]}` is a list of elements", path, help=f"write for example {_EXAMPLE}")
        return
    for number, one in enumerate(written):
        place: Path = (*path, number)
        if not (isinstance(one, Mapping) and len(one) == 1 and isinstance(next(iter(one.values())), Mapping)):
            scope.error(
                Code.VALUE_KIND, "an element is a mapping with one key, its tag, and its attributes under that", place,
                help=f"write for example {_EXAMPLE}",
            )
            continue
        ((tag, attributes),) = one.items()
        yield from _element(scope, section, tag, attributes, (*place, tag))


def _element(scope: Scope, section: str, tag: str, written: Mapping[str, Any], path: Path) -> Iterator[RawElement]:
    values: dict[str, str] = {}
    for name, value in written.items():
        if name == INSIDE:
            continue
        if isinstance(value, (Mapping, list)):
            scope.error(
                Code.VALUE_KIND, f"`{name}` of a `{tag}` is text, a number, true or false", (*path, name),
                help=f"elements in it stand in a list under `{INSIDE}`, numbers in one text: `1 2 3`",
            )
            return
        values[name] = text(value)
    inside = tuple(_elements(scope, section, written[INSIDE], (*path, INSIDE))) if INSIDE in written else ()
    yield RawElement(section=section, tag=tag, attributes=values, children=inside, origin=scope.origin(path, key=True))
