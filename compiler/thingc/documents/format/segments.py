"""The text of a document cut into pieces: where every key and value begins and ends, and which comments stand by it.

All places are indices into the text, whose lines end with a line feed. Values in braces and brackets, and scalars, are printed from their
pieces: one space where one belongs, keys in the order of the document models (keys that a person chooses stay as they are), the same lines.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import dropwhile
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticCustomError

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.units import UnitError, parse_quantity
from thingc.documents.spec.annotation_types import FieldType, branch_of, model_keys, shape_of
from thingc.documents.spec.assembly import AssemblySpec, AtSpec, ComponentSpec, JointSpec
from thingc.documents.spec.modes import HoldSpec, ModeSpec, WorldAtSpec
from thingc.documents.spec.validation import model_of

COMMENT_GAP = 2
"""Spaces before a comment at the end of a line, at least."""


class UnsupportedStyle(Exception):
    """The text has a form that is left alone: the document stays as it is."""


@dataclass(slots=True, kw_only=True)
class EndComment:
    """A comment at the end of a line: its text, its column (from 0) and the spaces before it."""

    text: str
    column: int
    gap: int

    def after(self, line: str) -> str:
        """The line with the comment: in its old column where that is free, and where it was not simply the usual gap."""
        spaces = COMMENT_GAP if self.gap <= COMMENT_GAP else max(COMMENT_GAP, self.column - len(line))
        return line + " " * spaces + self.text


def commented(line: str, comment: EndComment | None) -> str:
    """A line with its comment, if any."""
    return line if comment is None else comment.after(line)


@dataclass(slots=True, kw_only=True)
class Item:
    """An entry of a mapping (`key` the place of its key, `name` what it says) or an item of a list (no key).

    `leading` are the comments on lines of their own above it, None for an empty line; `key_comment` stands behind the
    colon (or dash) where the value begins below, `comment` behind the value.
    """

    value: Segment
    key: tuple[int, int] | None = None
    name: str = ""
    dash: int = 0
    leading: list[str | None] = field(default_factory=list)
    key_comment: EndComment | None = None
    comment: EndComment | None = None
    verbatim: bool = False

    @property
    def start(self) -> int:
        """Where it begins."""
        return self.key[0] if self.key is not None else self.value.start


@dataclass(slots=True, kw_only=True)
class Segment:
    """A value: `scalar` (also an alias), `map` or `list`; `flow` where it is written in braces or brackets.

    `body` is where it begins behind its anchor. `names` are the anchors in it and, in `aliases`, those that it refers to.
    `trailing` are comments at the end of a block. `column` (from 0) is that of a block's keys or dashes.
    """

    kind: str
    start: int
    end: int
    body: int
    flow: bool = False
    odd: bool = False
    column: int = 0
    items: list[Item] = field(default_factory=list)
    anchors: frozenset[str] = frozenset()
    aliases: frozenset[str] = frozenset()
    trailing: list[str | None] = field(default_factory=list)

    @property
    def block(self) -> bool:
        """Whether its entries stand on lines of their own."""
        return self.kind != "scalar" and not self.flow


class Trivia(FrozenStruct):
    """What stands between two pieces: a comment at the end of the line, and lines of their own: (column, text), None for
    an empty one."""

    comment: EndComment | None
    lines: list[tuple[int, str] | None]


def gap(text: str, start: int, end: int, *, compact: bool = False) -> Trivia:
    """Read the gap from `start` to `end`; with `compact` what follows may stand on the same line (`- key: value`).

    Raises Unusual where anything but comments and empty lines stands there.
    """
    lines = text[start:end].split("\n")
    comment: EndComment | None = None
    own: list[tuple[int, str] | None] = []
    begins_line = start == 0 or text[start - 1] == "\n"
    for number, line in enumerate(lines):
        bare = line.strip(" \t")
        if bare and not bare.startswith("#"):
            raise UnsupportedStyle
        last = number == len(lines) - 1
        if last and end < len(text):  # the indentation of what follows
            if "\t" in line or (number == 0 and not begins_line and not compact):
                raise UnsupportedStyle
        elif number == 0 and not begins_line:
            if bare:
                before = line.index("#")
                comment = EndComment(text=bare, column=start + before - (text.rfind("\n", 0, start) + 1), gap=before)
        elif bare:
            own.append((line.index("#"), bare))
        else:
            own.append(None)
    if end == len(text) and own and own[-1] is None and text.endswith("\n"):
        own.pop()
    return Trivia(comment=comment, lines=own)


def tidy(lines: list[str | None]) -> list[str | None]:
    """Comment lines with never two empty lines in a row."""
    return [line for at, line in enumerate(lines) if line is not None or at == 0 or lines[at - 1] is not None]


def first_lines(lines: list[str | None]) -> list[str | None]:
    """The same, with no empty line at the beginning."""
    return list(dropwhile(lambda line: line is None, tidy(lines)))


def shifted(text: str, by: int) -> str:
    """Text over several lines with all lines after the first moved right (or left, as far as there are spaces)."""
    if by == 0 or "\n" not in text:
        return text
    first, *others = text.split("\n")
    return "\n".join([first, *(_moved(line, by) for line in others)])


def _moved(line: str, by: int) -> str:
    if not line:
        return line
    if by > 0:
        return " " * by + line
    spaces = len(line) - len(line.lstrip(" "))
    return line[min(spaces, -by) :]


_PROPERTY = re.compile(r"&[^\s\[\]{},]+\s+")


def body_of(text: str, start: int) -> int:
    """Where a value begins behind its `&anchor`, if it stands on the same line."""
    match = _PROPERTY.match(text, start)
    return match.end() if match is not None else start


FIRST: dict[type[BaseModel], tuple[str, ...]] = {
    ComponentSpec: (
        "repeat", "part", "file", "unit", "assembly", "link", "frame", "params", "parameters", "material", "mass", "com", "inertia",
        "shapes", "attach", "at", "mounts", "mirror", "collision", "visual", "process", "bom",
    ),
    JointSpec: (
        "repeat", "type", "parent", "child", "axis", "loop", "turn", "gap", "offset", "limit", "dynamics", "mimic", "drive",
    ),
    AtSpec: ("in",), WorldAtSpec: ("on",), HoldSpec: ("at",), ModeSpec: ("extends",),
    AssemblySpec: (
        "name", "description", "parameters", "materials", "defaults", "components", "joints", "tendons", "links", "mounts", "poses",
        "modes", "sensors", "names",
    ),
}
"""Models whose keys do not stand as a person reads them (those of defaults and poses come before their own): these keys first, the
others behind them in the model's order."""

FREE = ("$schema", "thingc")
"""Keys that stand above all others of a document."""


@cache
def _keys(model: type[BaseModel]) -> tuple[dict[str, int], dict[str, FieldType]]:
    """The rank and the shape of every key of a model."""
    keys = model_keys(model)
    first = [key for key in FIRST.get(model, ()) if key in keys]
    names = [*first, *(key for key in keys if key not in first)]
    if "thingc" in keys:
        names = [*FREE, *(name for name in names if name != "thingc")]
    return {name: rank for rank, name in enumerate(names)}, {key: shape for key, (shape, _) in keys.items()}


def root_shape(kind: str | None) -> FieldType | None:
    """The shape of a document of a kind; None where no model is known."""
    model = model_of(kind or "")
    return None if model is None else shape_of(model)


def shape_for(shape: FieldType | None, value: Any) -> FieldType | None:
    """The shape of what is written: of a union the branch that was meant. `value` needs the right type and keys only."""
    if shape is None or shape.kind != "union":
        return shape
    return branch_of(shape, value)


def shape_below(shape: FieldType | None, key: str | None) -> FieldType | None:
    """The shape of an entry (or, without a key, of an item) of a value of this shape, if it is known."""
    if shape is None:
        return None
    if shape.model is not None and shape.kind == "model":
        return None if key is None else _keys(shape.model)[1].get(key)
    if (shape.kind == "dict") == (key is not None) and shape.kind in ("dict", "list"):
        return shape_of(shape.members[0])
    return None


def ordered(names: Sequence[str], shape: FieldType | None) -> list[int]:
    """The canonical order of the keys of a mapping, as indices into `names`.

    A key that the model does not know stays behind the key that it stands behind.
    """
    if shape is None or shape.kind != "model" or shape.model is None:
        return list(range(len(names)))
    ranks = _keys(shape.model)[0]
    places: list[tuple[int, int]] = []
    rank = -1
    for at, name in enumerate(names):
        rank = ranks.get(name, rank)
        places.append((rank, at))
    return [at for _, at in sorted(places)]


_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_GLUED = re.compile(rf"({_NUMBER}(?: {_NUMBER})*)( *)((?:[^\W\d_]|%).*)", re.ASCII)


def spaced(text: str, shape: FieldType | None) -> str:
    """`120mm` as `120 mm`, `0 0 4mm` as `0 0 4 mm`; any other text, and any text that is no quantity here, as it is."""
    match = _GLUED.fullmatch(text)
    if match is None or match.group(2) == " " or shape is None:
        return text
    better = f"{match.group(1)} {match.group(3)}"
    return better if equal_values(text, better, shape) else text


def equal_values(text: str, other: str, shape: FieldType | None) -> bool:
    """Whether two texts are one quantity to the field that takes them (no field: None, or an item of a vector)."""
    if shape is not None and shape.kind == "field" and shape.field is not None:
        try:
            value = shape.field.validate(text)
            return not isinstance(value, str) and bool(value == shape.field.validate(other))
        except PydanticCustomError:
            pass
    if shape is None or not takes_vectors(shape):
        return False
    try:
        return parse_quantity(text) == parse_quantity(other)
    except UnitError:
        return False


def takes_vectors(shape: FieldType) -> bool:
    """Whether a field takes three values, so that the items of a list there are quantities."""
    if shape.kind != "field" or shape.field is None:
        return False
    try:
        return isinstance(shape.field.validate("0 0 0"), tuple)
    except PydanticCustomError:
        return False


class Inline:
    """Prints the values of one text; `separator` stands between key and value (`: ` or ` = `)."""

    def __init__(self, text: str, separator: str) -> None:
        self.text = text
        self.separator = separator

    def value(self, piece: Segment, shape: FieldType | None, by: int) -> str:
        """The value as it should be written, its further lines moved by `by` columns."""
        written = self.text[piece.start : piece.end]
        if piece.kind == "scalar":
            return self.scalar(piece, written, shape, by)
        if piece.odd:
            return shifted(written, by)
        # an alias may stand where a person chooses the keys, and there their order counts
        shape = None if piece.body > piece.start else shape_for(shape, outline(piece))
        head = self.text[piece.start : piece.body].rstrip()
        opening, closing = self.text[piece.body], self.text[piece.end - 1]
        gaps = self.gaps(piece)
        order = list(range(len(piece.items)))
        if piece.kind == "map" and not any("#" in gap for gap in gaps):
            order = order_of(piece.items, shape)
        texts = [self.entry(piece.items[at], shape, by) for at in order]
        if not any("\n" in gap for gap in gaps):
            body = ", ".join(texts)
        else:
            tidied = [self.tidied(gap, at in (0, len(texts)), by) for at, gap in enumerate(gaps)]
            body = tidied[0] + "".join(text + after for text, after in zip(texts, tidied[1:], strict=True))
        return f"{head}{' ' if head else ''}{opening}{body}{closing}"

    def entry(self, item: Item, shape: FieldType | None, by: int) -> str:
        """`key: value`, or an item of a list."""
        if item.key is None:
            vector = shape is not None and takes_vectors(shape)
            return self.value(item.value, shape if vector else shape_below(shape, None), by)
        key = self.text[item.key[0] : item.key[1]]
        return key + self.separator + self.value(item.value, shape_below(shape, item.name), by)

    def scalar(self, piece: Segment, written: str, shape: FieldType | None, by: int) -> str:
        """A scalar as it is written, with a space before its unit."""
        if "\n" in written:
            return shifted(written, by)
        if not written or shape is None or piece.aliases or piece.anchors:
            return written
        body = self.text[piece.body : piece.end]
        quote = body[0] if body[0] in "\"'" and len(body) > 1 and body[-1] == body[0] and "\\" not in body else ""
        inner = body[len(quote) : len(body) - len(quote)]
        if inner[:1] not in "0123456789+-.":
            return written
        shape = shape_for(shape, inner)
        return self.text[piece.start : piece.body] + quote + spaced(inner, shape) + quote

    def gaps(self, piece: Segment) -> list[str]:
        """What stands before, between and behind the entries."""
        at = piece.body + 1
        gaps: list[str] = []
        for item in piece.items:
            gaps.append(self.text[at : item.start])
            at = item.value.end
        return [*gaps, self.text[at : piece.end - 1]]

    def tidied(self, gap: str, outer: bool, by: int) -> str:
        """A gap of a value over several lines: its lines stay, with no spaces at their ends."""
        if "\n" not in gap:
            return ("," if "," in gap else "") if outer else ", "
        first, *others = gap.split("\n")
        first = first.rstrip() if "#" in first else first.strip()
        lines = [line.rstrip() for line in others[:-1]]
        return shifted("\n".join([first, *lines, others[-1]]), by)


def outline(piece: Segment) -> Any:
    """What `shape_for` needs to know of a value: its type and its keys."""
    if piece.kind == "map":
        return {item.name: None for item in piece.items}
    return [] if piece.kind == "list" else ""


def order_of(items: list[Item], shape: FieldType | None) -> list[int]:
    """The canonical order of the entries of a mapping; theirs, where another would part an alias from its anchor."""
    order = ordered([item.name for item in items], shape)
    if order == sorted(order):
        return order
    place = {at: new for new, at in enumerate(order)}
    for at, item in enumerate(items):
        for later in range(at + 1, len(items)):
            other = items[later].value
            shared = (item.value.anchors & (other.anchors | other.aliases)) | (item.value.aliases & other.anchors)
            if shared and place[at] > place[later]:
                return sorted(order)
    return order
