"""Positions in documents: spans, origins and the node tree that `load` produces.

Everything a person wrote keeps the place where they wrote it. A `Span` is one place, an
`Origin` is the chain of places that made a thing (innermost first: the component, then the
line of the parent document that nested it, and so on).
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
    """A stretch of one file. `file` is an absolute path; lines and columns count from 1, the end is exclusive."""

    file: str
    line: int
    column: int
    end_line: int
    end_column: int

    def holds(self, other: Span) -> bool:
        """Whether the other stretch lies in this one."""
        return (
            self.file == other.file and (self.line, self.column) <= (other.line, other.column)
            and (other.end_line, other.end_column) <= (self.end_line, self.end_column)
        )


    @property
    def option(self) -> str | None:
        """The option of the command line that says what is here, where no file does: `--set joints.elbow.limit.upper=1 deg`."""
        return self.file if self.file.startswith(SET) else None


SET = "--set "
"""What the place of a value begins with that stands in no file. (A file's name is an absolute path.)"""


def option_span(path: str, text: str) -> Span:
    """The place of a value that `--set` puts at a path of a document."""
    return line_of(f"{SET}{path}={text}")


def line_of(file: str, line: int = 1) -> Span:
    """The beginning of a line of a file."""
    return Span(file=file, line=line, column=1, end_line=line, end_column=1)


Origin = tuple[Span, ...]
"""The chain of spans that made something, innermost first; never empty for what a document made."""


class Edit(FrozenStruct):
    """A change of a document that mends something: `written`, which stands once in `span`, becomes `replacement`."""

    span: Span
    written: str
    replacement: str


class ScalarNode(FrozenStruct):
    """A leaf: its typed value (YAML 1.2 core schema or TOML), the text as written, and where.

    `damaged`: the value is a stand-in for one that cannot be (a number that is not finite), which has been reported.
    """

    value: Scalar
    text: str
    span: Span
    damaged: bool = False

    def plain(self) -> Plain:
        """The value alone."""
        return self.value


def text_of(node: Node | None) -> str:
    """What a leaf says, as it is written but for quotes; empty for nothing, and for what is no leaf."""
    if not isinstance(node, ScalarNode) or node.value is None:
        return ""
    return node.value if isinstance(node.value, str) else node.text


class SequenceNode(FrozenStruct):
    """A list and where it stands."""

    items: tuple[Node, ...]
    span: Span

    def plain(self) -> Plain:
        """The values alone, as a list."""
        return [item.plain() for item in self.items]

    def index(self, step: int | str) -> int | None:
        """The index, from 0, that a step of a path gives as a number or as text; None if it is out of range."""
        return next((index for index in range(len(self.items)) if step in (index, str(index))), None)


class MappingNode(FrozenStruct):
    """A mapping and where it stands; `entries` in the order written, `keys` the span of every key.

    `damaged`: it has a key that is none, which has been reported; nobody knows what its value should have been. `again` are further places
    of keys: TOML writes them in every header below.
    """

    entries: dict[str, Node]
    keys: dict[str, Span]
    span: Span
    damaged: bool = False
    again: tuple[tuple[str, Span], ...] = ()

    def plain(self) -> Plain:
        """The values alone, as a dict."""
        return {key: node.plain() for key, node in self.entries.items()}


Node = Union[ScalarNode, SequenceNode, MappingNode]
Path = tuple[Union[str, int], ...]


def entries_of(node: Node | None) -> Mapping[str, Node]:
    """The entries of a mapping; none of anything else."""
    return node.entries if isinstance(node, MappingNode) else {}


def dotted(path: Path) -> str:
    """A key path as a person reads it: `components.hand.at.xyz[0]`."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
    return text


def closest(paths: Iterable[str], place: str) -> str:
    """That one of the paths at which values are set which shares most of its keys, from the first on, with the path `place`."""
    return max(paths, key=lambda path: len(os.path.commonprefix([path.split("."), place.split(".")])))


def node_at(root: Node, path: Path) -> Node | None:
    """The node at `path` (keys, and indices as numbers or text, from the root); None if there is none."""
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
    """The span of the value at `path` (of its key with `key=True`).

    Where the document stops short of the path (a short form, a default) the deepest part that is there answers.
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
    """Whether a place lies within what a node says: in one of its scalars or keys, or it is the place of a whole in it.

    (The span of a TOML table may reach over other tables, which stand between its own lines.)
    """
    for _, inner in walk(node):
        if inner.span == span or (isinstance(inner, ScalarNode) and inner.span.holds(span)):
            return True
        if isinstance(inner, MappingNode) and any(key.holds(span) for key in inner.keys.values()):
            return True
    return False


def walk(node: Node, path: Path = ()) -> Iterator[tuple[Path, Node]]:
    """Every node of the tree with its path, parents before children, in the order written."""
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

    `path` is absolute; `relative` is the path inside the workspace, with `/`; `kind` is the word before the slash of
    the `thingc:` key (`assembly`, `materials`, `workspace`, `variants`); `sha256` is of the bytes read.
    """

    path: str
    relative: str
    kind: str
    tree: MappingNode
    sha256: str
    text: str = field(repr=False)
    _spans: dict[tuple[Path, bool], Span] = field(default_factory=dict, init=False, compare=False, repr=False)

    def line(self, number: int) -> str:
        """A line of the text, counted from 1; empty behind the last one."""
        lines = re.split(r"\r\n|\r|\n", self.text)
        return lines[number - 1] if number <= len(lines) else ""

    def span(self, path: Path = (), *, key: bool = False) -> Span:
        """The span at `path` in this document, see `span_at`."""
        span = self._spans.get((path, key))
        if span is None:  # a document that is compiled again is asked for the same places
            span = self._spans[path, key] = span_at(self.tree, path, key=key)
        return span
