"""Format scalars, and values in braces and brackets, with uniform spaces and with keys in canonical order. Line breaks are preserved.

The canonical order of keys is the order of fields in the document models. User-defined keys keep their order.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticCustomError

from thingc.base.units import UnitError, parse_quantity
from thingc.documents.format.segments import Item, Segment, indent_rest
from thingc.documents.spec.annotation_types import FieldType, branch_of, model_keys, shape_of
from thingc.documents.spec.assembly import AssemblySpec, AtSpec, ComponentSpec, JointSpec
from thingc.documents.spec.link_shapes import ShapeSpec
from thingc.documents.spec.modes import HoldSpec, ModeSpec, WorldAtSpec
from thingc.documents.spec.validation import model_of

LEADING_KEYS: dict[type[BaseModel], tuple[str, ...]] = {
    ComponentSpec: (
        "repeat", "part", "file", "unit", "assembly", "link", "frame", "params", "parameters", "material", "mass", "com", "inertia",
        "shapes", "attach", "at", "mounts", "mirror", "collision", "visual", "process", "bom",
    ),
    ShapeSpec: (
        "mesh", "unit", "scale", "decompose", "box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "at", "for", "material",
        "color",
    ),
    JointSpec: (
        "repeat", "type", "parent", "child", "axis", "loop", "turn", "gap", "offset", "limit", "dynamics", "mimic", "drive",
    ),
    AtSpec: ("in",), WorldAtSpec: ("on",), HoldSpec: ("at",), ModeSpec: ("extends",),
    AssemblySpec: (
        "name", "description", "parameters", "materials", "defaults", "components", "joints", "tendons", "transmissions", "links",
        "mounts", "poses", "motions", "modes", "sensors", "names",
    ),
}
"""Keys of document models that come first in the canonical order, before the other fields of the model.

By default, inherited fields would come first.
"""

HEADER_KEYS = ("$schema", "thingc")
"""Keys that are always at the beginning of a document."""


@cache
def _keys(model: type[BaseModel]) -> tuple[dict[str, int], dict[str, FieldType]]:
    """Return two mappings for the keys of a document model: the position in the canonical order, and the type of the value."""
    keys = model_keys(model)
    first = [key for key in LEADING_KEYS.get(model, ()) if key in keys]
    names = [*first, *(key for key in keys if key not in first)]
    if "thingc" in keys:
        names = [*HEADER_KEYS, *(name for name in names if name != "thingc")]
    return {name: rank for rank, name in enumerate(names)}, {key: shape for key, (shape, _) in keys.items()}


def root_shape(kind: str | None) -> FieldType | None:
    """Return the type of all documents of a kind such as `assembly`. Return None for an unknown kind."""
    model = model_of(kind or "")
    return None if model is None else shape_of(model)


def shape_for(shape: FieldType | None, value: Any) -> FieldType | None:
    """Return the branch of a union type that matches the Python type and the keys of `value` best. Return other types unchanged."""
    return branch_of(shape, value) if shape is not None and shape.kind == "union" else shape


def shape_below(shape: FieldType | None, key: str | None) -> FieldType | None:
    """Return the type of the value of the key `key` in a mapping of the type `shape`. Return None if the type is unknown.

    If `key` is None, return the type of the items of a list.
    """
    if shape is None:
        return None
    if shape.model is not None:
        return None if key is None else _keys(shape.model)[1].get(key)
    if (shape.kind == "dict") == (key is not None) and shape.kind in ("dict", "list"):
        return shape_of(shape.members[0])
    return None


def canonical_order(names: Sequence[str], shape: FieldType | None) -> list[int]:
    """Return the indices of `names`, which are the keys of a mapping, in canonical order.

    A key that the document model does not define stays behind the key that precedes it in the document.
    """
    if shape is None or shape.model is None:
        return list(range(len(names)))
    ranks = _keys(shape.model)[0]
    ranked: list[tuple[int, int]] = []
    rank = -1
    for index, name in enumerate(names):
        rank = ranks.get(name, rank)
        ranked.append((rank, index))
    return [index for _, index in sorted(ranked)]


_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_GLUED = re.compile(rf"({_NUMBER}(?: {_NUMBER})*)( *)((?:[^\W\d_]|%).*)", re.ASCII)


def space_units(text: str, shape: FieldType | None) -> str:
    """Insert a space before each unit: `120mm` becomes `120 mm`, and `0 0 4mm` becomes `0 0 4 mm`. Other strings are unchanged."""
    match = _GLUED.fullmatch(text)
    if match is None or match.group(2) == " " or shape is None:
        return text
    spaced = f"{match.group(1)} {match.group(3)}"
    return spaced if equal_values(text, spaced, shape) else text


def equal_values(text: str, other: str, shape: FieldType | None) -> bool:
    """Return whether two strings for the same field represent the same quantity."""
    if shape is not None and shape.field is not None:
        try:
            value = shape.field.validate(text)
            return not isinstance(value, str) and bool(value == shape.field.validate(other))
        except PydanticCustomError:
            pass
    if shape is None or not is_vector(shape):
        return False
    try:
        return parse_quantity(text) == parse_quantity(other)
    except UnitError:
        return False


def is_vector(shape: FieldType) -> bool:
    """Return whether a field is a vector, so that the items of its list are quantities."""
    if shape.field is None:
        return False
    try:
        return isinstance(shape.field.validate("0 0 0"), tuple)
    except PydanticCustomError:
        return False


class Inline:
    """Formats the values of a document. `separator` is the string between key and value (`: ` or ` = `)."""

    def __init__(self, text: str, separator: str) -> None:
        self.text = text
        self.separator = separator

    def value(self, piece: Segment, shape: FieldType | None, indent: int) -> str:
        """Format a value of the document. All lines except the first are indented by `indent` additional columns."""
        source_text = self.text[piece.start : piece.end]
        if piece.kind == "scalar":
            return self.scalar(piece, source_text, shape, indent)
        if piece.verbatim:
            return indent_rest(source_text, indent)
        # an alias may be among user-defined keys, which keep their order
        shape = None if piece.body > piece.start else shape_for(shape, outline(piece))
        head = self.text[piece.start : piece.body].rstrip()
        opening, closing = self.text[piece.body], self.text[piece.end - 1]
        gaps = self.gaps(piece)
        order = list(range(len(piece.items)))
        if piece.kind == "map" and not any("#" in gap for gap in gaps):
            order = order_of(piece.items, shape)
        texts = [self.entry(piece.items[index], shape, indent) for index in order]
        if not any("\n" in gap for gap in gaps):
            body = ", ".join(texts)
        else:
            tidy_gaps = [self.tidy_gap(gap, index in (0, len(texts)), indent) for index, gap in enumerate(gaps)]
            body = tidy_gaps[0] + "".join(text + after for text, after in zip(texts, tidy_gaps[1:], strict=True))
        return f"{head}{' ' if head else ''}{opening}{body}{closing}"

    def entry(self, item: Item, shape: FieldType | None, indent: int) -> str:
        """Format one entry of a mapping (`key: value`) or one item of a list."""
        if item.key is None:
            vector = shape is not None and is_vector(shape)
            return self.value(item.value, shape if vector else shape_below(shape, None), indent)
        key = self.text[item.key[0] : item.key[1]]
        return key + self.separator + self.value(item.value, shape_below(shape, item.name), indent)

    def scalar(self, piece: Segment, source_text: str, shape: FieldType | None, indent: int) -> str:
        """Format a scalar, with a space between its number and its unit."""
        if "\n" in source_text:
            return indent_rest(source_text, indent)
        if not source_text or shape is None or piece.aliases or piece.anchors:
            return source_text
        body = self.text[piece.body : piece.end]
        quote = body[0] if body[0] in "\"'" and len(body) > 1 and body[-1] == body[0] and "\\" not in body else ""
        inner = body[len(quote) : len(body) - len(quote)]
        if inner[:1] not in "0123456789+-.":
            return source_text
        shape = shape_for(shape, inner)
        return self.text[piece.start : piece.body] + quote + space_units(inner, shape) + quote

    def gaps(self, piece: Segment) -> list[str]:
        """Return the pieces of source text before, between and after the entries of a mapping or list in braces or brackets."""
        start = piece.body + 1
        gaps: list[str] = []
        for item in piece.items:
            gaps.append(self.text[start : item.start])
            start = item.value.end
        return [*gaps, self.text[start : piece.end - 1]]

    def tidy_gap(self, gap: str, outer: bool, indent: int) -> str:
        """Remove trailing spaces from the text between two entries of a multi-line value."""
        if "\n" not in gap:
            return ("," if "," in gap else "") if outer else ", "
        first, *other_lines = gap.split("\n")
        first = first.rstrip() if "#" in first else first.strip()
        lines = [line.rstrip() for line in other_lines[:-1]]
        return indent_rest("\n".join([first, *lines, other_lines[-1]]), indent)


def outline(piece: Segment) -> Any:
    """Return an empty Python value of the same type as a segment, and with its keys. It is the argument `value` of `shape_for`."""
    if piece.kind == "map":
        return {item.name: None for item in piece.items}
    return [] if piece.kind == "list" else ""


def order_of(items: list[Item], shape: FieldType | None) -> list[int]:
    """Sort the entries `items` of a mapping into canonical order, and return their indices.

    If a YAML alias would precede its anchor in canonical order, return the order of the document.
    """
    order = canonical_order([item.name for item in items], shape)
    if order == sorted(order):
        return order
    new_index = {index: new for new, index in enumerate(order)}
    for index, item in enumerate(items):
        for later in range(index + 1, len(items)):
            later_value = items[later].value
            shared = (item.value.anchors & (later_value.anchors | later_value.aliases)) | (item.value.aliases & later_value.anchors)
            if shared and new_index[index] > new_index[later]:
                return sorted(order)
    return order
