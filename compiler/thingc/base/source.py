"""Positions in documents, and the tree of nodes into which a document is parsed.

All values of documents contain their position. A `Span` is one location. An `Origin` is the chain of locations that created an element,
innermost first: the component, then the line of the parent document that nests it, and so on.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Union

from thingc.base.frozen_struct import FrozenStruct

Scalar = Union[str, int, float, bool, None]
Plain = Union[Scalar, list["Plain"], dict[str, "Plain"]]


class Span(FrozenStruct):
    """A range of characters in a file, which is given by an absolute path. Lines and columns count from 1; the end is exclusive."""

    file: str
    line: int
    column: int
    end_line: int
    end_column: int

    def holds(self, other: Span) -> bool:
        """Return whether another span is inside this span."""
        return (
            self.file == other.file and (self.line, self.column) <= (other.line, other.column)
            and (other.end_line, other.end_column) <= (self.end_line, self.end_column)
        )


    @property
    def option(self) -> str | None:
        """The command line option for a value that is not in a file: `--set joints.elbow.limit.upper=1 deg`."""
        return self.file if self.file.startswith(SET) else None


SET = "--set "
"""Prefix of `Span.file` for values that are not in a file. (File names are absolute paths.)"""


def option_span(path: str, text: str) -> Span:
    """Return the span of a value that `--set` assigns to a path of a document."""
    return line_of(f"{SET}{path}={text}")


def line_of(file: str, line: int = 1) -> Span:
    """Return the span of the beginning of a line."""
    return Span(file=file, line=line, column=1, end_line=line, end_column=1)


Origin = tuple[Span, ...]
"""The origin of an element: the spans in nested documents that created the element, innermost first. The origin of an element of a document
is never empty.
"""


class Edit(FrozenStruct):
    """A fix of a document: replaces `written`, which occurs once in `span`, by `replacement`."""

    span: Span
    written: str
    replacement: str


class ScalarNode(FrozenStruct):
    """A scalar in a document: its typed value (YAML 1.2 core schema or TOML), its source text, and its span.

    `damaged` means that the value replaces an invalid value (a number that is not finite) that has been reported.
    """

    value: Scalar
    text: str
    span: Span
    damaged: bool = False

    def plain(self) -> Plain:
        """Return the value of the scalar."""
        return self.value


def text_of(node: Node | None) -> str:
    """Return the source text of a scalar without quotes. Return "" for null and for other nodes."""
    if not isinstance(node, ScalarNode) or node.value is None:
        return ""
    return node.value if isinstance(node.value, str) else node.text


class SequenceNode(FrozenStruct):
    """A list in a document, with its span."""

    items: tuple[Node, ...]
    span: Span

    def plain(self) -> Plain:
        """Return the values as a list."""
        return [item.plain() for item in self.items]

    def index(self, step: int | str) -> int | None:
        """Return the index (from 0) for a path step that is a number or a string. Return None for an index out of range."""
        return next((index for index in range(len(self.items)) if step in (index, str(index))), None)


class MappingNode(FrozenStruct):
    """A mapping in a document, with its span. `entries` is in document order, and `keys` contains the span of every key.

    `damaged` means that the mapping has an invalid key that has been reported, so its intended content is unknown. `again` contains other
    places of the keys, because TOML repeats keys in the headers of subtables.
    """

    entries: dict[str, Node]
    keys: dict[str, Span]
    span: Span
    damaged: bool = False
    again: tuple[tuple[str, Span], ...] = ()

    def plain(self) -> Plain:
        """Return the values as a dict."""
        return {key: node.plain() for key, node in self.entries.items()}


Node = Union[ScalarNode, SequenceNode, MappingNode]
Path = tuple[Union[str, int], ...]


def entries_of(node: Node | None) -> Mapping[str, Node]:
    """Return the entries of a mapping. The result is empty for other nodes."""
    return node.entries if isinstance(node, MappingNode) else {}


def dotted(path: Path) -> str:
    """Format a key path: `components.hand.at.xyz[0]`."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
    return text


def closest(paths: Iterable[str], place: str) -> str:
    """Return the path in `paths` that shares the most leading keys with `place`."""
    return max(paths, key=lambda path: len(os.path.commonprefix([path.split("."), place.split(".")])))


def node_at(root: Node, path: Path) -> Node | None:
    """Return the node at `path`, or None if it does not exist. `path` contains keys, and indices as numbers or strings."""
    node: Node | None = root
    for step in path:
        if isinstance(node, MappingNode) and isinstance(step, str):
            node = node.entries.get(step)
        elif isinstance(node, SequenceNode) and (index := node.index(step)) is not None:
            node = node.items[index]
        else:
            return None
    return node


def span_at(root: Node, path: Path, *, key: bool = False) -> Span:
    """Return the span of the value at `path` (of its key with `key=True`).

    If the path does not exist (a short form, a default), return the span of its deepest existing part.
    """
    node: Node = root
    span = root.span
    for step in path:
        if isinstance(node, MappingNode) and isinstance(step, str) and step in node.entries:
            span = node.keys[step] if key else node.entries[step].span
            node = node.entries[step]
        elif isinstance(node, SequenceNode) and isinstance(step, int) and 0 <= step < len(node.items):
            node = node.items[step]
            span = node.span
        else:
            break
    return span


def stands_in(node: Node, span: Span) -> bool:
    """Return whether a span is in the content of a node: inside one of its scalars or keys, or equal to the span of a nested node.

    (The span of a TOML table may include other tables between its own lines.)
    """
    for _, inner in walk(node):
        if inner.span == span or (isinstance(inner, ScalarNode) and inner.span.holds(span)):
            return True
        if isinstance(inner, MappingNode) and any(key.holds(span) for key in inner.keys.values()):
            return True
    return False


def walk(node: Node, path: Path = ()) -> Iterator[tuple[Path, Node]]:
    """Yield every node of the tree with its path, in document order, parents before children."""
    yield path, node
    if isinstance(node, MappingNode):
        for key, child in node.entries.items():
            yield from walk(child, (*path, key))
    elif isinstance(node, SequenceNode):
        for index, child in enumerate(node.items):
            yield from walk(child, (*path, index))


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """A loaded document: its tree with positions, before any interpretation.

    `path` is absolute; `relative` is the path inside the workspace, with `/`. `kind` is the word before the slash of the `thingc:` key
    (`assembly`, `materials`, `workspace`, `variants`). `sha256` is the hash of the bytes that were read.
    """

    path: str
    relative: str
    kind: str
    tree: MappingNode
    sha256: str
    text: str = field(repr=False)
    _spans: dict[tuple[Path, bool], Span] = field(default_factory=dict, init=False, compare=False, repr=False)

    def line(self, number: int) -> str:
        """Return a line of the text, counted from 1, or "" after the last line."""
        lines = re.split(r"\r\n|\r|\n", self.text)
        return lines[number - 1] if number <= len(lines) else ""

    def span(self, path: Path = (), *, key: bool = False) -> Span:
        """Return the span at `path` in this document (see `span_at`)."""
        span = self._spans.get((path, key))
        if span is None:  # cached, because repeated compilations request the same spans
            span = self._spans[path, key] = span_at(self.tree, path, key=key)
        return span
