"""Compute completions of keys, names, mounts and units in documents.

Most completion items are from the JSON Schema of the document at the path of the cursor. Other items are computed from the robot: frames of
mounts, units of the right physical dimension, and numbered items of a `repeat`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.kinds import KINDS
from thingc.base.units import ANGLE, LENGTH, UNITS, Dimension, Quantity, fits, parse_quantity
from thingc.documents.expressions.terms import CONSTANTS, FUNCTIONS
from thingc.tools.lsp.analysis import Analysis
from thingc.tools.lsp.cursor import Cursor, cursor_at
from thingc.tools.lsp.positions import TextPlace
from thingc.tools.lsp.schema_walk import KeyOffer, SchemaWalk
from thingc.tools.lsp.shown_values import bounds_of, evaluate_expression, mount_frame_text, parameters_of

MAX_ITEMS = 500

# `CompletionItemKind` of LSP
_FUNCTION, _VARIABLE, _CLASS, _PROPERTY, _UNIT, _VALUE, _FILE, _REFERENCE, _CONSTANT = 3, 6, 7, 10, 11, 12, 17, 18, 21

_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_MEASURED = re.compile(rf"\s*{_NUMBER}(?:\s+{_NUMBER}){{0,5}}(?P<space>\s*)(?P<unit>(?:[A-Za-z%°][\w%^*/·²³]*)?)")
_IN_EXPRESSION = re.compile(rf"(?P<number>(?<![\w.]){_NUMBER}\s*)?(?P<word>[A-Za-z]\w*)?$")
_BARE = re.compile(r"[A-Za-z./$=][\w ./$*()+^=-]*")
_LINE_ENDS = re.compile(r"[^\S\r\n]*(?:[\r\n]|\Z)")
_SPECIAL = re.compile(r"(?i)true|false|null|yes|no|on|off|~")

COMPOUND = (
    "mm^2", "cm^2", "m^2", "mm^3", "cm^3", "m^3", "kg/m^3", "g/cm^3", "mm/s", "m/s", "deg/s", "rad/s", "m/s^2", "N*m", "N*mm", "kgf*cm",
    "kg*m^2", "g*cm^2", "N*m*s/rad", "N*s/m", "N*m/rad", "N*m/deg", "N/m", "N/mm", "mm/rad", "mm/rev", "rad/m",
)
"""The compound units that completion suggests. Documents can also contain other compound units."""
_DIMENSIONS: dict[str, Dimension] = {
    **{name: unit[2] for name, unit in UNITS.items()}, **{name: parse_quantity(f"1 {name}").dimension for name in COMPOUND},
}
_FIRST = ("mm", "deg", "g", "kg", "ms", "s", "N", "N*m", "rad", "m")
"""The most common units, which are listed first."""


_USUAL = ("params", "parameters", "attach", "at", "limit", "drive", "components", "joints", "poses", "modes", "pose", "value")
"""The most common optional keys, which are listed before other optional keys."""


class CompletionItem(FrozenStruct):
    """An item of a completion list. The item replaces the characters from offset `start` up to, but not including, `end` by `text`.

    Items are sorted by ascending `rank`.
    """

    label: str
    text: str
    start: int
    end: int
    kind: int
    rank: int = 0
    detail: str = ""
    description: str = ""


def completion(analysis: Analysis, text: str, place: TextPlace, params: Mapping[str, Any]) -> dict[str, Any]:
    """Return the completion list for a position in a document, in the format of LSP."""
    lines = analysis.lines()
    found_items = items(analysis, text, lines.index(place))
    answer = [
        {
            "label": one.label, "kind": one.kind, "sortText": f"{number:04d}", "filterText": one.label, "insertTextMode": 1,
            "textEdit": {"range": lines.range_of(one.start, one.end), "newText": one.text},
            **({"detail": one.detail} if one.detail else {}),
            **({"documentation": {"kind": "markdown", "value": one.description}} if one.description else {}),
        }
        for number, one in enumerate(found_items[:MAX_ITEMS])
    ]
    return {"isIncomplete": len(found_items) > MAX_ITEMS, "items": answer}


def items(analysis: Analysis, text: str, offset: int) -> list[CompletionItem]:
    """Return the completion items for the cursor at the given offset of the text, the most likely item first."""
    cursor = cursor_at(text, offset, toml=analysis.path.lower().endswith(".toml"))
    known = analysis.known
    schema = None if cursor is None or known.available_names is None else known.available_names.schema_of(known, cursor.scalars)
    if cursor is None or schema is None:
        return []
    request = _CompletionRequest(analysis, text, offset, cursor, SchemaWalk(schema, cursor.keys, cursor.scalars))
    found_items = list(request.keys()) if cursor.role == "key" else []
    if cursor.role == "value" or cursor.either:
        found_items += request.values()
    return sorted(found_items, key=lambda one: one.rank)


class _CompletionRequest:
    """A request for completion, with the document, the position of the cursor, and the JSON Schema of the document."""

    def __init__(self, analysis: Analysis, text: str, offset: int, cursor: Cursor, walk: SchemaWalk) -> None:
        self.analysis = analysis.known
        self.text = text
        self.offset = offset
        self.cursor = cursor
        self.walk = walk
        self.reported_codes = {finding.code.code for finding in analysis.findings}

    # --- keys ---------------------------------------------------------------------------------------------------------

    def keys(self) -> Iterator[CompletionItem]:
        """Yield completion items for the keys that can be added to the mapping at the cursor."""
        for number, offer in enumerate(self.walk.key_offers(self.cursor.path)):
            if self.cursor.header and not offer.mapping:
                continue
            is_full = self.cursor.path[-1:] == ("attach",) and offer.name == "mount"
            rank = 0 if offer.required or offer.name in self.reported_codes else 3000 if is_full else 1000 if offer.name in _USUAL else 2000
            yield self._item(
                offer.name, self._key_text(offer), _PROPERTY, rank=rank + number,
                detail="required" if offer.required else "", description=offer.description,
            )
        if self.cursor.header:
            for name in self.cursor.keys.get(self.cursor.path, ()):
                yield self._item(name, self._quoted_key(name), _PROPERTY, rank=2000)

    def _key_text(self, offer: KeyOffer) -> str:
        name, cursor = self._quoted_key(offer.name), self.cursor
        if cursor.separated or cursor.header or (cursor.quote and self.text.startswith(cursor.quote, cursor.end)):
            return name
        if cursor.quote:
            name += cursor.quote
        if cursor.toml:
            return f"{name} = "
        if offer.mapping and not cursor.flow and _LINE_ENDS.match(self.text, cursor.end):
            column = cursor.start - (self.text.rfind("\n", 0, cursor.start) + 1)
            return f"{name}:\n{' ' * (column + 2)}"
        return f"{name}: "

    def _quoted_key(self, name: str) -> str:
        bare = self.cursor.quote or re.fullmatch(r"[\w-]+" if self.cursor.toml else r"[\w][\w./-]*", name)
        return name if bare else f'"{name}"'

    # --- values -------------------------------------------------------------------------------------------------------

    def values(self) -> Iterator[CompletionItem]:
        """Yield completion items for the values that are valid at the cursor and match the typed text."""
        typed = self.cursor.typed
        if typed.lstrip().startswith("="):
            yield from self._in_expression()
            return
        measured = _MEASURED.fullmatch(typed)
        if measured is not None:
            start, end = self.cursor.start + measured.end("space"), max(self.offset, self.cursor.end)
            yield from _units(start, end, self._dimensions(), close=measured["space"] == "")
            return
        if "." in typed and (inner := list(self._after_dot())):
            yield from inner
            return
        for number, (value, description) in enumerate(self.walk.value_offers(self.cursor.path).items()):
            if isinstance(value, bool):
                yield self._item(word := str(value).lower(), word, _VALUE, rank=number)
            elif not self._refers_to_edited(value):
                depth_penalty = 500 * max(0, value.count(".") - 1) if "/" not in value and ":" not in value else 0
                rank = number + depth_penalty + (2000 if self._is_used(value) else 1000 if value.endswith(".origin") else 0)
                yield self._word(value, rank=rank, description=description)
        yield from self._repeat_references()
        dimensions = self._dimensions()
        if dimensions and not (self.cursor.toml and not self.cursor.quote and typed):
            low, high = bounds_of(self.analysis, self.cursor)
            for name, quantity in self._parameters():
                if any(fits(quantity.dimension, one) for one in dimensions) and low <= quantity.value <= high:
                    yield self._item(f"={name}", self._quote(f"={name}"), _VARIABLE, rank=100, detail=quantity.format(6))

    def _word(self, word: str, *, rank: int, description: str) -> CompletionItem:
        """Create a completion item for a word that the JSON Schema suggests, such as a name, a part or a document."""
        kind, detail, text = _VALUE, "", self._quote(word)
        if self.cursor.path[-1:] == ("part",):
            kind, detail = _CLASS, ", ".join(self.walk.parameters_of(word))
            module = f"{word.partition(':')[0]}:"
            if any(path[-1:] == ("part",) and one.startswith(module) for path, one in self.cursor.scalars.items()):
                rank -= 1000  # the document already uses parts of this module
            text += self._params(word)
        elif "." in word and (frame := mount_frame_text(self.analysis, word)):
            kind, detail = _REFERENCE, frame
        elif "/" in word or word.endswith((".yaml", ".toml", ".yml")):
            kind = _FILE
        return self._item(word, text, kind, rank=rank, detail=detail, description=description)

    def _params(self, part: str) -> str:
        """Return the text of a mapping `params:` that sets the required parameters of a part to example values.

        Return an empty string if no parameter is required.
        """
        owner = self.cursor.path[:-1]
        needed = self.walk.needed_parameters(part)
        if not needed or "params" in self.cursor.keys.get(owner, ()) or self.cursor.quote:
            return ""
        if self.cursor.toml:
            pairs = ", ".join(f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {value}" for name, value in needed.items())
            return f", params = {{{pairs}}}" if self.cursor.flow else f"\nparams = {{{pairs}}}"
        pairs = ", ".join(f"{name}: {value}" for name, value in needed.items())
        if self.cursor.flow:
            return f", params: {{{pairs}}}"
        line = self.text[self.text.rfind("\n", 0, self.cursor.start) + 1 : self.cursor.start]
        return f"\n{' ' * (len(line) - len(line.lstrip()))}params: {{{pairs}}}"

    def _after_dot(self) -> Iterator[CompletionItem]:
        """Yield completion items for a reference that ends with a dot: the mounts of the component, and components nested inside."""
        head = self.cursor.typed[: self.cursor.typed.rindex(".") + 1]
        start = self.cursor.start + len(head)
        offers = {value: text for value, text in self.walk.value_offers(self.cursor.path).items() if isinstance(value, str)}
        mounts = {value: text for value, text in offers.items() if value.startswith(head) and not self._refers_to_edited(value)}
        if not mounts and self.walk.takes_mounts(self.cursor.path):  # the last parsable text does not contain the component
            mounts = dict(self.walk.mounts_of(head.rstrip(".")))
        for number, (word, description) in enumerate(mounts.items()):
            suffix = word[len(head) :]
            rank = number + (2000 if self._is_used(word) else 0) + (1000 if "." in suffix else 0) + (500 if suffix == "origin" else 0)
            item = self._item(suffix, suffix, _REFERENCE, rank=rank, detail=mount_frame_text(self.analysis, word), description=description)
            yield replace(item, start=start)
        for one in self._repeat_references():
            if one.label.startswith(head):
                yield replace(one, label=one.label[len(head) :], text=one.text[len(head) :], start=start)

    def _repeat_references(self) -> Iterator[CompletionItem]:
        """Yield references that contain the index variable of a `repeat`, such as `plate.screw_$i` for the mounts `plate.screw_0` to `_3`.
        """
        path = self.cursor.path
        index = self.cursor.scalars.get((*path[:2], "repeat", "as"), "i") if "repeat" in self.cursor.keys.get(path[:2], ()) else None
        if index is None:
            return
        numbered: dict[str, int] = {}
        for value in self.walk.value_offers(path):
            match = re.fullmatch(r"(.*_)\d+(\.\w+)?", value) if isinstance(value, str) else None
            name = "" if match is None else f"{match[1]}${index}{match[2] or ''}"
            if match is not None and not self._refers_to_edited(name):
                numbered[name] = numbered.get(name, 0) + 1
        count_values = evaluate_expression(
            self.analysis, (*path[:2], "repeat", "count"), self.cursor.scalars.get((*path[:2], "repeat", "count"), ""),
        )
        needed = count_values[0].value if count_values and isinstance(count_values[0], Quantity) else 2
        for name, count in numbered.items():
            if count >= max(2, needed):
                yield self._item(
                    name, self._quote(name), _REFERENCE, rank=1000 if name.endswith(".origin") else -1, detail=f"{count} of them",
                )

    def _refers_to_edited(self, word: str) -> bool:
        """Return whether a suggested word refers to the element that the user is editing, such as a mount of the edited component."""
        path = self.cursor.path
        if path[:1] == ("components",) and len(path) > 2 and path[2] in ("attach", "at"):
            return path[-1] != "mount" and re.fullmatch(rf"{re.escape(str(path[1]))}(_(\d+|\$\w+))?", word.partition(".")[0]) is not None
        if path[:1] == ("joints",) and path[2:] in (("parent",), ("child",)):
            other = self.cursor.scalars.get((*path[:2], "child" if path[2] == "parent" else "parent"), "")
            return word.partition(".")[0] == other.partition(".")[0]
        return len(path) > 2 and path[-1] in ("extends", "joint") and word == path[1]

    def _is_used(self, word: str) -> bool:
        """Return whether another value of the same kind already contains the word. Completion lists such words last."""
        if self.cursor.path[-1:] not in (("drive",), ("parent",), ("child",)) and self.cursor.path[2:3] != ("attach",):
            return False
        return any(
            text == word and path != self.cursor.path and path[0] in ("joints", "components") for path, text in self.cursor.scalars.items()
        )

    # --- quantities and expressions ----------------------------------------------------------------------------------

    def _dimensions(self) -> tuple[Dimension, ...]:
        """Return the physical dimensions that the value at the cursor can have.

        The dimension of joint limits depends on the kind of the joint.
        """
        path = self.cursor.path
        dimensions = self.walk.dimensions(path)
        if set(dimensions) != {ANGLE, LENGTH}:
            return dimensions
        if path[0] == "joints":
            kind = KINDS.get(self.cursor.scalars.get((*path[:2], "type"), ""))
            return tuple(dict.fromkeys(twist.coordinate for twist in kind.twists)) if kind is not None and kind.moves else dimensions
        known = [one for step in path if (one := self.analysis.facts.joints.get(str(step))) is not None and one.angle is not None]
        return ((ANGLE,) if known[-1].angle else (LENGTH,)) if known else dimensions

    def _in_expression(self) -> Iterator[CompletionItem]:
        """Yield completion items inside an expression: parameters, functions and constants, or units after a number."""
        match = _IN_EXPRESSION.search(self.cursor.typed)
        if match is None:
            return
        word = match["word"] or ""
        start = self.offset - len(word)
        typed_ahead = re.match(r"\w*", self.text[self.offset : self.cursor.end])
        end = self.offset + (typed_ahead.end() if typed_ahead is not None else 0)
        offer = partial(CompletionItem, start=start, end=end)
        if match["number"] is not None:
            yield from _units(start, end, tuple(dict.fromkeys(_DIMENSIONS.values())), close=not match["number"].endswith((" ", "\t")))
            return
        expected = self._dimensions()
        low, high = bounds_of(self.analysis, self.cursor)
        for name, value in self._parameters():
            fitting = (not expected or any(fits(value.dimension, one) for one in expected)) and low <= value.value <= high
            yield offer(
                label=name, text=name, kind=_VARIABLE, rank=0 if fitting else 100, detail=value.format(6),
                description=self.cursor.scalars.get(("parameters", name, "doc"), ""),
            )
        if "repeat" in self.cursor.keys.get(self.cursor.path[:2], ()):
            index = self.cursor.scalars.get((*self.cursor.path[:2], "repeat", "as"), "i")
            yield offer(label=index, text=index, kind=_VARIABLE, rank=10, detail="the index of this `repeat`")
        for name, (smallest, largest) in FUNCTIONS.items():
            several = f"{smallest} to {largest} values" if largest > smallest else f"{smallest} value" + ("s" if smallest > 1 else "")
            yield offer(label=name, text=f"{name}(", kind=_FUNCTION, rank=200, detail=several)
        for name, quantity in CONSTANTS.items():
            yield offer(label=name, text=name, kind=_CONSTANT, rank=201, detail=quantity.format(6))

    def _parameters(self) -> Iterator[tuple[str, Quantity]]:
        """Yield the parameters to which the expression at the cursor can refer, with their values."""
        for name, quantity in parameters_of(self.analysis).items():
            if isinstance(quantity, Quantity) and self.cursor.path[:2] != ("parameters", name):
                yield name, quantity

    # --- text ---------------------------------------------------------------------------------------------------------

    def _item(self, label: str, text: str, kind: int, *, rank: int, detail: str = "", description: str = "") -> CompletionItem:
        start = self.cursor.start
        if self.cursor.role == "value" and not self.cursor.typed and not self.cursor.quote and self.text[start - 1 : start] == ":":
            text = f" {text}"
        return CompletionItem(
            label=label, text=text, start=start, end=self.cursor.end, kind=kind, rank=rank, detail=detail, description=description,
        )

    def _quote(self, word: str) -> str:
        """Add quotes to a word if the language of the document requires quotes, as TOML always does.

        If the cursor is already inside quotes, only a missing closing quote is added.
        """
        cursor = self.cursor
        if cursor.quote:
            return word if self.text.startswith(cursor.quote, cursor.end) else f"{word}{cursor.quote}"
        plain = _BARE.fullmatch(word) and not _SPECIAL.fullmatch(word) and not word.endswith(" ")
        return word if not cursor.toml and (plain or re.fullmatch(r"[A-Za-z][\w.]*:[A-Za-z]\w*", word)) else f'"{word}"'


def _units(start: int, end: int, dimensions: tuple[Dimension, ...], *, close: bool) -> Iterator[CompletionItem]:
    """Yield completion items for the units of these physical dimensions, the most common units first.

    They replace the text from `start` to `end`. `close` specifies whether this text directly follows a number.
    """
    fitting = [name for name, one in _DIMENSIONS.items() if one in dimensions or any(fits(one, other) for other in dimensions)]
    fitting.sort(key=lambda name: _FIRST.index(name) if name in _FIRST else len(_FIRST))
    for number, unit in enumerate(fitting):
        text = f" {unit}" if close else unit
        yield CompletionItem(label=unit, text=text, start=start, end=end, kind=_UNIT, rank=number, detail=_DIMENSIONS[unit].words)

