"""Find the names in the text of a document: its sections, the keys that repeats create, and strings that declare or use names.

The field types of document models determine the kind of name to which a string refers (`documents/spec/name_types.py`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document, MappingNode, Node, Path, ScalarNode, SequenceNode, Span, entries_of, node_at, walk
from thingc.documents.load.text import narrow_span
from thingc.documents.spec.annotation_types import FieldType, alternatives, branch_of, model_keys, shape_of
from thingc.documents.spec.assembly import AssemblySpec
from thingc.documents.spec.name_types import DeclaresName, RefersTo
from thingc.documents.spec.settable_values import split_nested
from thingc.documents.spec.validation import model_of

EXPRESSION = RefersTo("expression")


class NameOccurrence(FrozenStruct):
    """A string that declares a name or refers to a name: the key at `path` if `key` is True, otherwise the scalar at `path`."""

    path: Path
    key: bool
    text: str
    names: DeclaresName | RefersTo


class SettingWord(FrozenStruct):
    """A name in the path of a setting: `leg` or `knee` in `components.leg.joints.knee.limit.upper`.

    `offset` is the start index of the name in this path. `through` contains the nested components that lead to the document of the element
    (`leg` for `knee`). `path` is the path of the element in that document.
    """

    offset: int
    through: tuple[str, ...]
    path: Path
    names: DeclaresName | RefersTo


def find_occurrences(document: Document) -> Iterator[NameOccurrence]:
    """Yield all strings in a document that declare names or refer to names, in source order.

    Values that do not belong to the document model are skipped.
    """
    model = model_of(document.kind)
    if model is not None:
        yield from _find_in(document.tree, shape_of(model), ())


def _find_in(node: Node, shape: FieldType, path: Path) -> Iterator[NameOccurrence]:
    if isinstance(node, ScalarNode):
        if isinstance(node.value, str):
            names = _names_in_text(node.value, shape)
            if names is not None:
                yield NameOccurrence(path=path, key=False, text=node.value, names=names)
    elif isinstance(node, SequenceNode):
        list_branch = next((alternative for alternative in alternatives(shape) if alternative.kind == "list"), None)
        inner = shape if list_branch is None else shape_of(list_branch.members[0])  # a vector is one field, and contains expressions
        for index, item in enumerate(node.items):
            yield from _find_in(item, inner, (*path, index))
    elif RefersTo("raw") in {alternative.names for alternative in alternatives(shape)}:
        yield from _in_raw(node, path)
    else:
        branch = branch_of(shape, node.entries)
        if branch is not None and branch.model is not None:
            keys = model_keys(branch.model)
            for key, value in node.entries.items():
                if key in keys:
                    yield from _find_in(value, keys[key][0], (*path, key))
        elif branch is not None:
            names, inner = shape_of(branch.key).names, shape_of(branch.members[0])
            for key, value in node.entries.items():
                if names is not None:
                    yield NameOccurrence(path=(*path, key), key=True, text=key, names=names)
                yield from _find_in(value, inner, (*path, key))


def _names_in_text(text: str, shape: FieldType) -> DeclaresName | RefersTo | None:
    branches = alternatives(shape)
    if text.lstrip().startswith("=") and any(branch.kind == "field" for branch in branches):
        return EXPRESSION
    if any(text in branch.choices for branch in branches):
        return None
    return next((branch.names for branch in branches if branch.names is not None), None)


def _in_raw(node: MappingNode, path: Path) -> Iterator[NameOccurrence]:
    """Yield the strings in `raw` that refer to elements: keys (`raw: {mjcf: {joint: {NAME: ...}}}`), and values under `add` and `order`."""
    for kind, elements in node.entries.items():
        if kind in ("add", "order"):
            for value_path, value in walk(elements, (*path, kind)):
                if isinstance(value, ScalarNode) and isinstance(value.value, str) and (kind == "order" or referenced_kind(value_path)):
                    yield NameOccurrence(path=value_path, key=False, text=value.value, names=RefersTo("raw"))
            continue
        for name in entries_of(elements):
            yield NameOccurrence(path=(*path, kind, name), key=True, text=name, names=RefersTo("raw"))


def referenced_kind(path: Path) -> str | None:
    """Return the type of the MuJoCo element that is named by the attribute at `path`, inside an element under `raw: {mjcf: {add: ...}}`.

    The type is `joint`, `site`, `body`, or `object` for any element. Return None if the attribute does not name an element.
    """
    key = str(path[-1]).rstrip("12")
    if key in ("objname", "refname"):
        return "object"
    return REFERRED.get(key)


REFERRED = {
    **dict.fromkeys(("joint", "jointinparent", "actuator"), "joint"), **dict.fromkeys(("body", "subtree", "geom"), "body"),
    **dict.fromkeys(("site", "cranksite", "slidersite", "refsite", "sidesite"), "site"),
}
"""Attributes of added MuJoCo elements that can refer to an element of the document, with the kind of this element."""


def setting_words(text: str) -> Iterator[SettingWord]:
    """Yield the names in the path of a setting, such as `leg` and `knee` in `components.leg.joints.knee.limit.upper`."""
    offset = 0
    through: list[str] = []
    rest: str | None = text
    while rest is not None:
        inner = split_nested(rest)
        words = rest.split(".") if inner is None else ["components", inner[0]]
        shape: FieldType | None = shape_of(AssemblySpec)
        position = offset
        for depth, word in enumerate(words):
            branches = alternatives(shape) if shape is not None else ()
            models = (model_keys(branch.model) for branch in branches if branch.model is not None)
            model = next((keys for keys in models if word in keys), None)
            named_entries = next((branch for branch in branches if branch.kind == "dict"), None)
            names = shape_of(named_entries.key).names if model is None and named_entries is not None else None
            if names is not None:
                yield SettingWord(offset=position, through=tuple(through), path=tuple(words[: depth + 1]), names=names)
            shape = model[word][0] if model is not None else shape_of(named_entries.members[0]) if named_entries is not None else None
            position += len(word) + 1
        offset, rest = position, None
        if inner is not None:
            through.append(inner[0])
            rest = inner[1]


GLOB = re.compile(r"[*?\[]")
"""Regular expression of the characters that occur only in patterns."""
SPECIAL = re.compile(r"[*?\[$]")
"""Regular expression of the characters that occur only in patterns and in indices of repeats."""
_ITEMS = 100
"""Number of items that pattern matching assumes for a repeat whose count is an expression."""


@cache
def pattern_of(text: str, index: str) -> re.Pattern[str]:
    """Convert a pattern in a reference to a regular expression.

    The pattern may contain `*`, `?`, `[...]` and the index of a repeat (`$i`).
    """
    from fnmatch import translate

    if index:
        text = re.sub(rf"\$(?:\{{{index}\}}|{index}(?![A-Za-z0-9]))", "\0", text)
    return re.compile(translate(text).replace("\\\0", r"\d+").replace("\0", r"\d+"))


class DocumentNames:
    """A parsed document, with the lines of its text, and with all `occurrences`: strings that declare names or refer to names."""

    def __init__(self, document: Document) -> None:
        self.document, self.path = document, document.path
        self.lines = re.split(r"\r\n|\r|\n", document.text)
        self.occurrences = tuple(find_occurrences(document))

    def section(self, name: str) -> Mapping[str, Node]:
        """Return the entries of a section of the document, such as `joints`. Return an empty mapping if the section does not exist."""
        return entries_of(self.document.tree.entries.get(name))

    def text(self, *path: str | int) -> str | None:
        """Return the string at a path of the document. Return None if there is no string at this path."""
        node = node_at(self.document.tree, path)
        return node.value if isinstance(node, ScalarNode) and isinstance(node.value, str) else None

    def repeat(self, section: str, key: str) -> Mapping[str, Node] | None:
        """Return the mapping `repeat` of a component or joint. Return None for a component or joint without `repeat`."""
        node = node_at(self.document.tree, (section, key, "repeat"))
        return node.entries if isinstance(node, MappingNode) else None

    def repeat_index(self, path: Path) -> str:
        """Return the name of the index of the `repeat` that encloses a path of the document. The default name is `i`.

        Return an empty string outside a repeat.
        """
        if len(path) < 2 or path[0] not in ("components", "joints") or self.repeat(str(path[0]), str(path[1])) is None:
            return ""
        return self.text(path[0], path[1], "repeat", "as") or "i"

    def item_names(self, section: str, key: str) -> list[str]:
        """Return the names that an entry of `components` or `joints` creates.

        An entry with `repeat` creates the names of all items. Other entries create only the name that is their key.
        """
        repeat = self.repeat(section, key)
        if repeat is None:
            return [key]
        count = repeat.get("count")
        number = count.value if isinstance(count, ScalarNode) and isinstance(count.value, int) else _ITEMS
        return [f"{key}_{item}" for item in range(min(number, 10 * _ITEMS))]

    def matching_keys(self, section: str, word: str, index: str = "") -> list[str]:
        """Return the keys of the section `components` or `joints` that match `word`, a word of a reference, which may be a pattern.

        `index` is the name of the repeat index that the word may contain (`hip_$i`).
        """
        entries = self.section(section)
        if not SPECIAL.search(word):
            stem, _, number = word.rpartition("_")
            if word in entries and self.repeat(section, word) is None:
                return [word]
            return [stem] if number.isdigit() and stem in entries and self.repeat(section, stem) is not None else []
        pattern = pattern_of(word, index)
        return [key for key in entries if any(pattern.match(item) for item in self.item_names(section, key))]

    def starts_with_key(self, section: str, key: str, word: str) -> bool:
        """Return whether a word of a reference begins with `key`, so that only this part must change if the key is renamed."""
        rest = word[len(key):]
        return word.startswith(key) and (not rest or rest[0] in "*?[$" or (rest[0] == "_" and self.repeat(section, key) is not None))

    def span_of(self, occurrence: NameOccurrence) -> Span:
        """Return the span of the key or the scalar in the document that contains a name."""
        return self.document.span(occurrence.path, key=occurrence.key)

    def narrow_span(self, span: Span, text: str, start: int, end: int) -> Span | None:
        """Return the span of the characters from `start` to `end` in the string at `span`. Return None if the string contains escapes."""
        if span.file != self.path or span.line != span.end_line:
            return None
        return narrow_span(span, self.lines[span.line - 1], text, start, end)
