"""Source positions in documents, and the tree of nodes into which a document is parsed.

Every value of a document has a source position. A `Span` is a single range in a file. An `Origin` is a tuple of the spans that created an
element of the robot, innermost first. For example, the span of a component is followed by the line of the parent document that nests this
component.
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
    """A range of characters in a file. Lines and columns count from 1, and the end is exclusive. `file` is an absolute path."""

    file: str
    line: int
    column: int
    end_line: int
    end_column: int

    def holds(self, other: Span) -> bool:
        """Return whether the span `other` is completely inside this span."""
        return (
            self.file == other.file and (self.line, self.column) <= (other.line, other.column)
            and (other.end_line, other.end_column) <= (self.end_line, self.end_column)
        )

    @property
    def option(self) -> str | None:
        """The command line option that set a value, such as `--set joints.elbow.limit.upper=1 deg`.

        None for a value that was read from a file.
        """
        return self.file if self.file.startswith(SET) else None


SET = "--set "
"""Prefix of `Span.file` for values that are not in a file. (File names are absolute paths.)"""


def option_span(path: str, text: str) -> Span:
    """Return a span for a value that the option `--set` assigns to a path of a document. The span does not refer to a file."""
    return line_of(f"{SET}{path}={text}")


def line_of(file: str, line: int = 1, column: int = 1) -> Span:
    """Return an empty span, by default at the beginning of a line of a file."""
    return Span(file=file, line=line, column=column, end_line=line, end_column=column)


Origin = tuple[Span, ...]
"""The origin of an element: the spans in nested documents that created the element, innermost first. For elements that a document defines,
the tuple contains at least one span.
"""


class Edit(FrozenStruct):
    """An automatic fix of a document. The fix replaces the text `written`, which occurs once in `span`, by the text `replacement`."""

    span: Span
    written: str
    replacement: str


class ScalarNode(FrozenStruct):
    """A scalar value in a document, with its Python value, its source text and its span.

    The type of the value is determined by the YAML 1.2 core schema or by TOML. `damaged` is true if the document contains an invalid value
    at this position, such as an infinite number, that has been reported and replaced.
    """

    value: Scalar
    text: str
    span: Span
    damaged: bool = False

    def plain(self) -> Plain:
        """Return the Python value of this scalar."""
        return self.value


def text_of(node: Node | None) -> str:
    """Return the source text of a scalar without quotes. For null, and for nodes that are not scalars, return an empty string."""
    if not isinstance(node, ScalarNode) or node.value is None:
        return ""
    return node.value if isinstance(node.value, str) else node.text


class SequenceNode(FrozenStruct):
    """A list in a document, with its span."""

    items: tuple[Node, ...]
    span: Span

    def plain(self) -> Plain:
        """Return the values of this list, converted to plain Python values."""
        return [item.plain() for item in self.items]

    def index(self, step: int | str) -> int | None:
        """Convert a step of a key path, such as `2` or `"2"`, to an index of this list. Return None if the index is out of range."""
        return next((index for index in range(len(self.items)) if step in (index, str(index))), None)


class MappingNode(FrozenStruct):
    """A mapping in a document, with its span. `entries` is in document order, and `keys` contains the span of every key.

    `damaged` is true if the mapping has an invalid key that has been reported, so that its intended content is unknown. `again` contains
    further spans of a key, because TOML repeats a key in the headers of subtables.
    """

    entries: dict[str, Node]
    keys: dict[str, Span]
    span: Span
    damaged: bool = False
    again: tuple[tuple[str, Span], ...] = ()

    def plain(self) -> Plain:
        """Return this mapping as a dict of plain Python values."""
        return {key: node.plain() for key, node in self.entries.items()}


Node = Union[ScalarNode, SequenceNode, MappingNode]
Path = tuple[Union[str, int], ...]


def entries_of(node: Node | None) -> Mapping[str, Node]:
    """Return the entries of a mapping node. Return an empty mapping for nodes that are not mappings."""
    return node.entries if isinstance(node, MappingNode) else {}


def format_path(path: Path) -> str:
    """Format a key path with dots and indices, such as `components.hand.at.xyz[0]`."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
    return text


def closest(paths: Iterable[str], place: str) -> str:
    """Return the key path in `paths` that has the longest common prefix with the key path `place`."""
    return max(paths, key=lambda path: len(os.path.commonprefix([path.split("."), place.split(".")])))


def node_at(root: Node, path: Path) -> Node | None:
    """Return the node at a key path, or None if the document does not contain the path. An index in a list can be a number or a string."""
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
    """Return the span of the value at a key path. With `key=True`, return the span of the key instead.

    If the document does not contain the path, for example for a default value, return the span of the longest part of the path that exists.
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
    """Return whether a span is inside a scalar or a key of this node, or is equal to the span of a nested node.

    The span of the node itself is not compared, because the span of a TOML table can include lines of other tables.
    """
    for _, inner in walk(node):
        if inner.span == span or (isinstance(inner, ScalarNode) and inner.span.holds(span)):
            return True
        if isinstance(inner, MappingNode) and any(key.holds(span) for key in inner.keys.values()):
            return True
    return False


def walk(node: Node, path: Path = ()) -> Iterator[tuple[Path, Node]]:
    """Yield every node of a tree together with its key path, in document order. Parents are yielded before their children."""
    yield path, node
    if isinstance(node, MappingNode):
        for key, child in node.entries.items():
            yield from walk(child, (*path, key))
    elif isinstance(node, SequenceNode):
        for index, child in enumerate(node.items):
            yield from walk(child, (*path, index))


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """A loaded document: its tree of nodes with source positions, before the values are interpreted.

    `path` is the absolute path of the file, and `relative` the path inside the workspace with `/`. `kind` is the kind of document in the
    `thingc:` key, such as `assembly`, `materials`, `workspace` or `variants`. `sha256` is the hash of the bytes that were read.
    """

    path: str
    relative: str
    kind: str
    tree: MappingNode
    sha256: str
    text: str = field(repr=False)
    _spans: dict[tuple[Path, bool], Span] = field(default_factory=dict, init=False, compare=False, repr=False)

    def line(self, number: int) -> str:
        """Return a line of the document, counted from 1. If the number is larger than the number of lines, return an empty string."""
        lines = re.split(r"\r\n|\r|\n", self.text)
        return lines[number - 1] if number <= len(lines) else ""

    def span(self, path: Path = (), *, key: bool = False) -> Span:
        """Return the span of the value, or with `key=True` of the key, at a key path of this document."""
        span = self._spans.get((path, key))
        if span is None:  # cached, because repeated compilations request the same spans
            span = self._spans[path, key] = span_at(self.tree, path, key=key)
        return span
