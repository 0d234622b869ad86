"""Resolve raw attributes, which are copied to files of one format, and raw elements of MuJoCo models (`raw: {mjcf: {add: ...}}`)."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from thingc.base.diagnostics import Code
from thingc.base.one_line_repr import format_count
from thingc.base.source import Path
from thingc.base.suggestions import did_you_mean, near_hint
from thingc.model.resolve.raw_protected import find_protected, fixed_in_all
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import RawAttribute, RawElement

ADD, INSIDE = "add", "in"
"""The key of added elements, and the key of an element's children."""

ORDER, ORDERED = "order", ("actuator", "sensor")
"""The key that sets the order of elements in MuJoCo models, and the kinds of elements that can be ordered."""
IN_ORDER = "[order]"
"""Last key in the path of an internal attribute that contains the position of an element in the order. Documents cannot contain this key.
"""

SECTIONS = ("contact", "custom", "tendon", "equality", "actuator", "sensor")
"""Sections of MJCF to which documents can add elements. An element can refer to elements in preceding sections."""

_KINDS = {
    **dict.fromkeys(("joint", "joint1", "joint2", "jointinparent"), "joint"),
    **dict.fromkeys(("site", "site1", "site2", "cranksite", "slidersite", "refsite", "sidesite"), "site"),
    **dict.fromkeys(("body", "body1", "body2", "subtree1", "subtree2"), "body"), **dict.fromkeys(("geom", "geom1", "geom2"), "geom"),
    **dict.fromkeys(("tendon", "tendon1", "tendon2"), "tendon"), "actuator": "actuator", "camera": "camera",
}
"""Attributes whose value is the name of another element, with the kind of this element."""

_OBJECTS = {"objname": "objtype", "refname": "reftype"}
"""Attributes whose value is the name of an element, with the attribute that contains the kind of this element."""

KINDS = frozenset(_KINDS.values())
"""The kinds of elements to which attributes can refer."""

_EXAMPLE = "`- fixed: {name: grip, in: [{joint: {joint: left, coef: 1}}]}`"


def added_elements(scope: Scope, written: Mapping[str, Any]) -> tuple[RawElement, ...]:
    """Return the elements that `raw: {mjcf: {add: ...}}` adds to MuJoCo models, section by section. Invalid entries are reported."""
    under = written.get("mjcf")
    sections = under.get(ADD) if isinstance(under, Mapping) else None
    if sections is None:
        return ()
    path: Path = ("raw", "mjcf", ADD)
    if not isinstance(sections, Mapping):
        scope.error(
            Code.VALUE_KIND, "`add` must be a mapping of sections", path,
            help=f"write, for example, a section `tendon:` with elements such as {_EXAMPLE}",
        )
        return ()
    for section in sections:
        if section not in SECTIONS:
            scope.error(
                Code.RAW_UNKNOWN, f"`raw` cannot add elements to `{section}`", (*path, section), key=True,
                help=did_you_mean(section, SECTIONS, what="sections"),
            )
    return tuple(
        element for section in SECTIONS if section in sections
        for element in _elements(scope, section, sections[section], (*path, section))
    )


def named_kind(attributes: Mapping[str, str], name: str) -> str | None:
    """Return the type of element (`body`, `joint`) to which an attribute of an added MuJoCo element refers.

    Return None if the attribute is not a reference.
    """
    kind = attributes.get(_OBJECTS.get(name, ""))
    return {"xbody": "body"}.get(kind, kind) if kind is not None else _KINDS.get(name)


def text(value: object) -> str:
    """Format a number, a boolean or a string from a document as the value of an XML attribute."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return value if isinstance(value, str) else repr(value)


def _elements(scope: Scope, section: str, written: Any, path: Path) -> Iterator[RawElement]:
    if not isinstance(written, list):
        scope.error(Code.VALUE_KIND, f"`{path[-1]}` must be a list of elements", path, help=f"write, for example, {_EXAMPLE}")
        return
    for number, one in enumerate(written):
        place: Path = (*path, number)
        if not (isinstance(one, Mapping) and len(one) == 1 and isinstance(next(iter(one.values())), Mapping)):
            scope.error(
                Code.VALUE_KIND, "an element must be a mapping from its tag to its attributes", place,
                help=f"write, for example, {_EXAMPLE}",
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
                Code.VALUE_KIND, f"`{name}` of a `{tag}` must be a string, a number or a boolean", (*path, name),
                help=f"write child elements as a list under `{INSIDE}`, and several numbers as one string: `1 2 3`",
            )
            return
        values[name] = text(value)
    inside = tuple(_elements(scope, section, written[INSIDE], (*path, INSIDE))) if INSIDE in written else ()
    yield RawElement(section=section, tag=tag, attributes=values, children=inside, origin=scope.origin(path, key=True))


EXAMPLES = {
    "mjcf": "{solreflimit: 0.01 1}", "urdf": "{limit: {effort: 20}}", "sdf": "{axis: {limit: {effort: 20}}}",
    "usd": '{"physics:breakForce": 20.0}',
}
"""The targets that accept raw attributes, each with an example of an attribute of a joint."""

IN_PLACE = {"ros": "write the attributes under `urdf`", "mjz": "write the attributes under `mjcf`"}
"""Hints for targets that contain files of other targets."""


def raw(scope: Scope, written: Mapping[str, Any]) -> tuple[RawAttribute, ...]:
    """Return every raw attribute of the section `raw:` in document order. Unknown output formats and protected attributes are reported."""
    flattened: list[RawAttribute] = []
    for target, attributes in written.items():
        path: Path = ("raw", target)
        if target not in EXAMPLES:
            *first, last = (f"`{one}`" for one in EXAMPLES)
            message = f"`raw` expects {', '.join(first)} or {last}, found `{target}`"
            scope.error(Code.RAW_TARGET, message, path, key=True, help=IN_PLACE.get(target) or near_hint(target, EXAMPLES))
            continue
        if not isinstance(attributes, Mapping):
            scope.error(
                Code.VALUE_KIND, f"raw attributes of `{target}` must be a mapping, found `{text(attributes)}`", path,
                help=f"write, for example, `{target}: {{joint: {{yaw: {EXAMPLES[target]}}}}}`",
            )
            continue
        copied = {key: one for key, one in attributes.items() if target != "mjcf" or key not in (ADD, ORDER)}  # see `added_elements`
        flattened.extend(_flatten(scope, target, copied, path, ()))
        if len(copied) < len(attributes):
            flattened.extend(_order_attributes(scope, attributes.get(ORDER, {}), (*path, ORDER)))
    return tuple(flattened)


def _order_attributes(scope: Scope, written: Any, path: Path) -> Iterator[RawAttribute]:
    """Yield an internal attribute with the position of each element that `raw: {mjcf: {order: ...}}` lists.

    All other entries are reported as errors.
    """
    for kind, names in written.items() if isinstance(written, Mapping) else [("", written)]:
        if kind not in ORDERED or not isinstance(names, list) or any(isinstance(one, (Mapping, list)) for one in names):
            message = f"`{ORDER}` must list the names of {' or '.join(f'`{one}`' for one in ORDERED)} elements"
            where = (*path, kind) if kind else path
            scope.error(Code.VALUE_KIND, message, where, help="write, for example, `order: {actuator: [hip, knee]}`")
            continue
        for number, name in enumerate(names):
            origin = scope.origin((*path, kind, number))
            yield RawAttribute(target="mjcf", path=(kind, text(name), IN_ORDER), value=str(number), origin=origin)


def _flatten(scope: Scope, target: str, node: Any, path: Path, keys: tuple[str, ...]) -> Iterator[RawAttribute]:
    if isinstance(node, Mapping):
        for key, child in node.items():
            yield from _flatten(scope, target, child, (*path, key), (*keys, key))
    elif isinstance(node, list) and (target != "usd" or any(isinstance(one, (Mapping, list)) for one in node)):
        scope.error(
            Code.VALUE_KIND, f"`{keys[-1]}` must be a string, a number or a boolean in `{target}`, "
            f"found a list of {format_count(len(node), 'item')}", path,
            help=f"write `{' '.join(map(text, node))}`" if not any(isinstance(one, (Mapping, list)) for one in node)
            else "add elements under `raw: mjcf: add:`",
        )
    else:
        refused = find_protected(keys) if target == "mjcf" else fixed_in_all(target, keys)
        if refused is not None:
            message, instead = refused
            scope.error(Code.RAW_FIXED, message, path, key=True, help=instead)
            return
        first = len(path) - len(keys)
        yield RawAttribute(
            target=target, path=keys, value=json.dumps(node) if target == "usd" else text(node), origin=scope.origin(path),
            keys=tuple(scope.span(path[: first + depth], key=True) for depth in range(1, len(keys) + 1)),
        )
