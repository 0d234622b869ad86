"""Merge two versions of a document with a common ancestor, key by key.

The merge preserves the text, layout and comments of the version `ours`. The document `base` is from the last import, `new` is from this
import, and `ours` is `base` with edits by the user. The merge applies changes in the source to `ours`. If the source and the user changed
the same value differently, the merge keeps the user's value and reports a conflict. Mappings, and lists of mappings with equal lengths, are
merged recursively. Every other value is merged as a whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from thingc.base.diagnostics import Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import MappingNode, Node, Path, ScalarNode, SequenceNode, Span, format_path, node_at
from thingc.documents.format.value_edits import last_line
from thingc.documents.load.documents import read_tree
from thingc.documents.load.text import Source

MISSING: Any = object()
NOTHING = "missing"
"""Text that reports contain instead of a missing value."""


class Text(FrozenStruct):
    """A document to merge, as text and as a syntax tree."""

    source: Source
    tree: MappingNode

    def text_at(self, path: Path) -> str:
        """Return the text of the value at a path of keys on one line. Long texts are shortened."""
        node = node_at(self.tree, path)
        text = NOTHING if node is None else inline(self, node)
        return text if len(text) <= 80 else f"{text[:77]}..."


class Merged(FrozenStruct):
    """The result of a three-way merge: the merged text of the document, the changes that were merged, and the conflicts.

    `taken` contains each path that changed in the source, with the old and the new value. `kept` contains the paths that the user changed.
    `conflicts` contains each path that the user and the source changed differently, with the value of the user and that of the source.
    """

    text: str
    taken: tuple[tuple[Path, str, str], ...]
    kept: tuple[Path, ...]
    conflicts: tuple[tuple[Path, str, str], ...]


class MergeConflict(Exception):
    """Raised if the layout of a document prevents a correct merge. The message contains the path of the value."""


def read_text(path: str, text: str, report: Report) -> Text | None:
    """Parse the text of a document. If the text is not a well-formed mapping, report an error and return None."""
    tree = read_tree(path, text.encode(), report)
    return Text(source=Source(path, text), tree=tree) if isinstance(tree, MappingNode) and not report.failed else None


class Merge:
    """Merges the documents `new` and `ours`, which are two changed versions of the document `base`."""

    def __init__(self, base: Text, new: Text, ours: Text) -> None:
        self.base, self.new, self.ours = base, new, ours
        self.edits: list[tuple[int, int, str]] = []
        self.taken: list[tuple[Path, str, str]] = []
        self.kept: list[Path] = []
        self.conflicts: list[tuple[Path, str, str]] = []

    def merge(self) -> Merged:
        """Merge both versions of the document, and return the merged text and the conflicts. Raises `MergeConflict`."""
        expected = self._merge_value((), self.base.tree.plain(), self.new.tree.plain(), self.ours.tree.plain())
        text = self.ours.source.text
        parts, at, line_end = list[str](), 0, "\r\n" if "\r\n" in text else "\n"
        for start, end, replacement in sorted(self.edits, key=lambda edit: edit[:2]):  # insertions precede other edits at the same position
            parts += [text[at:start], replacement.replace("\n", line_end)]
            at = end
        merged = "".join([*parts, text[at:]])
        parsed = read_text(self.ours.source.file, merged, Report())
        wrong = [] if parsed is None else [*_changed_paths((), expected, parsed.tree.plain())] if parsed.tree.plain() != expected else None
        if wrong is not None:
            place = format_path(wrong[0]) if wrong else "the document"
            raise MergeConflict(f"`{place}` uses an anchor, or YAML syntax that thingc cannot edit")
        return Merged(text=merged, taken=tuple(self.taken), kept=tuple(self.kept), conflicts=tuple(self.conflicts))

    def _merge_value(self, path: Path, base: Any, new: Any, ours: Any) -> Any:
        """Merge the three versions of the value at a path, record the edits or the conflict, and return the merged value.

        A version that does not contain the path has the value `MISSING`.
        """
        if _equal(new, base) or _equal(new, ours):
            if not _equal(ours, base) and not _equal(new, ours):
                self.kept += _changed_paths(path, base, ours)
            return ours
        inner = _keys(base, new, ours)
        if inner is not None:
            return self._merge_entries(path, base, new, ours, inner)
        if _equal(ours, base):
            self.taken.append((path, self.ours.text_at(path), self.new.text_at(path)))
            return new
        self.conflicts.append((path, self.ours.text_at(path), self.new.text_at(path)))
        return ours

    def _merge_entries(self, path: Path, base: Any, new: Any, ours: Any, keys: Sequence[Any]) -> Any:
        """Merge nested mappings or lists of mappings entry by entry."""
        versions = {key: tuple(_get(one, key) for one in (base, new, ours)) for key in keys}
        merged = {key: self._merge_value((*path, key), *three) for key, three in versions.items()}
        changed = [key for key in keys if not _equal(merged[key], versions[key][2]) and _keys(*versions[key]) is None]
        node = node_at(self.ours.tree, path)
        assert node is not None
        shape_stays = all(merged[key] is not MISSING and versions[key][2] is not MISSING for key in changed)
        if changed and not shape_stays and _is_flow(self.ours, node):
            self._rewrite(path, node, [key for key in keys if merged[key] is not MISSING], changed)
        else:
            for key in changed:
                self._edit_entry(path, key, merged[key])
        if isinstance(ours, list):
            return [merged[key] for key in keys]
        return {key: value for key, value in merged.items() if value is not MISSING}

    def _rewrite(self, path: Path, node: Node, keys: Sequence[Any], changed: Sequence[Any]) -> None:
        """Replace the text of a flow mapping, such as `{a: 1, b: 2}`, by a text with changed values.

        The text of unchanged values is preserved.
        """
        node_range, inner = self.ours.source.range(node.span), []
        for key in keys:
            version = self.new if key in changed else self.ours
            value = node_at(version.tree, (*path, key))
            assert value is not None
            start, end = version.source.range(value.span)
            text = version.source.text[start:end] if version is self.ours else inline(version, value)
            if version is self.ours:  # apply and remove the edits inside this node
                for edit in sorted([edit for edit in self.edits if start <= edit[0] and edit[1] <= end], reverse=True):
                    self.edits.remove(edit)
                    text = text[: edit[0] - start] + edit[2] + text[edit[1] - start :]
            inner.append(f"{key}: {text}")
        self.edits.append((*node_range, "{" + ", ".join(inner) + "}"))

    def _edit_entry(self, path: Path, key: Any, merged: Any) -> None:
        """Record the edit that sets, adds or removes one entry of a mapping, or sets one item of a list."""
        our_node, new_node = node_at(self.ours.tree, (*path, key)), node_at(self.new.tree, (*path, key))
        parent = node_at(self.ours.tree, path)
        assert parent is not None
        if merged is MISSING:
            first, last = _lines(self.ours, parent, key)
            above = _leading(self.base, path, key)
            while above and first and self.ours.source.line(first - 1).strip() == above[-1].strip():
                above, first = above[:-1], first - 1
            self.edits.append((self._start(first), self._start(last + 1), ""))
        elif our_node is None:
            self._insert_entry(path, parent, key)
        elif isinstance(parent, SequenceNode) or _is_flow(self.ours, parent) or not (
            _is_block(self.ours, parent, key) or _is_block(self.new, node_at(self.new.tree, path), key)
        ):
            assert new_node is not None
            start, end = self.ours.source.range(our_node.span)
            plain = self.new.source.text[slice(*self.new.source.range(new_node.span))]
            self.edits.append((start, end, plain if "\n" not in plain else inline(self.new, new_node)))
        else:
            first, last = _lines(self.ours, parent, key)
            text = "".join(f"{line}\n" for line in self._entry_lines(path, parent, key)[len(_leading(self.new, path, key)) :])
            self.edits.append((self._start(first), self._start(last + 1), text))

    def _insert_entry(self, path: Path, parent: Node, key: Any) -> None:
        """Record the edit that inserts a new entry.

        The edit inserts the entry after the same entry as in `new`, or at the beginning of the mapping.
        """
        new_parent = node_at(self.new.tree, path)
        assert isinstance(parent, MappingNode) and isinstance(new_parent, MappingNode)
        order = list(new_parent.entries)
        preceding = [one for one in order[: order.index(key)] if one in parent.entries]
        line = _lines(self.ours, parent, preceding[-1])[1] + 1 if preceding else _lines(self.ours, parent, next(iter(parent.entries)))[0]
        text = "".join(f"{line}\n" for line in self._entry_lines(path, parent, key))
        start = self._start(line)
        self.edits.append((start, start, text if start == 0 or self.ours.source.text[start - 1] == "\n" else f"\n{text}"))

    def _entry_lines(self, path: Path, parent: Node, key: Any) -> list[str]:
        """Return the lines of an entry of `new`, including the comments above the entry.

        The lines are indented like the entries of the mapping `parent`.
        """
        new_parent = node_at(self.new.tree, path)
        assert isinstance(parent, MappingNode) and isinstance(new_parent, MappingNode)
        column = next(iter(parent.keys.values())).column
        if _is_flow(self.new, new_parent):
            return [f"{' ' * (column - 1)}{key}: {inline(self.new, new_parent.entries[key])}"]
        first, last = _lines(self.new, new_parent, key)
        deep = column - new_parent.keys[key].column
        lines = [*_leading(self.new, path, key), *(self.new.source.line(number) for number in range(first, last + 1))]
        return [line if not line.strip() else " " * deep + line if deep >= 0 else line[-deep:] for line in lines]

    def _start(self, line: int) -> int:
        starts = self.ours.source.starts
        return starts[line] if line < len(starts) else len(self.ours.source.text)


def inline(text: Text, node: Node) -> str:
    """Format a YAML value on one line. The text of numbers, strings and other scalars does not change."""
    match node:
        case ScalarNode():
            return text.source.text[slice(*text.source.range(node.span))]
        case SequenceNode():
            return f"[{', '.join(inline(text, one) for one in node.items)}]"
        case MappingNode():
            return "{" + ", ".join(f"{key}: {inline(text, one)}" for key, one in node.entries.items()) + "}"


def _equal(a: Any, b: Any) -> bool:
    """Return whether two values are equal and have the same type. For example, True and 1 have different types."""
    if a is MISSING or b is MISSING:
        return a is b
    return bool(a == b) and (type(a) is type(b) or not {bool} & {type(a), type(b)})


def _keys(base: Any, new: Any, ours: Any) -> list[Any] | None:
    """Return the keys of the entries to merge if all three values are mappings, or lists of mappings with equal lengths.

    Otherwise, return None. Keys are in the order of `ours`, followed by new keys. A list of numbers is merged as a whole, because merging
    single components of a vector would give a vector that is in neither version.
    """
    if all(isinstance(one, dict) for one in (base, new, ours)):
        return [*dict.fromkeys([*ours, *new, *base])]
    lists = [one for one in (base, new, ours) if isinstance(one, list) and all(isinstance(item, dict) for item in one)]
    return [*range(len(ours))] if len(lists) == 3 and len({*map(len, lists)}) == 1 else None


def _get(values: Any, key: Any) -> Any:
    return values[key] if isinstance(values, list) else values.get(key, MISSING)


def _changed_paths(path: Path, base: Any, ours: Any) -> Iterator[Path]:
    """Yield the path of each value that differs between two documents. Nested mappings are compared key by key."""
    keys = _keys(base, base, ours)
    if keys is None:
        yield path
        return
    for key in keys:
        old, new = _get(base, key), _get(ours, key)
        if not _equal(old, new):
            yield from _changed_paths((*path, key), old, new)


def _is_flow(text: Text, node: Node) -> bool:
    return not isinstance(node, ScalarNode) and text.source.text[text.source.range(node.span)[0]] in "{["


def _is_block(text: Text, parent: Node | None, key: Any) -> bool:
    """Return whether the value of a key in a YAML document starts on a line below the key."""
    assert isinstance(parent, MappingNode)
    node = parent.entries[key]
    return not isinstance(node, ScalarNode) and not _is_flow(text, node)


def _lines(text: Text, parent: Node, key: Any) -> tuple[int, int]:
    """Return the indices of the first and the last line of an entry in a YAML document."""
    assert isinstance(parent, MappingNode)
    where: Span = parent.keys[key]
    return where.line - 1, max(where.line, last_line(text.source, parent.entries[key])) - 1


def _leading(text: Text, path: Path, key: Any) -> list[str]:
    """Return the comments and blank lines between an entry and the preceding entry. Return an empty list for the first entry."""
    parent = node_at(text.tree, path)
    assert isinstance(parent, MappingNode)
    order = list(parent.entries)
    at = order.index(key)
    if at == 0 or _is_flow(text, parent):
        return []
    first, last = _lines(text, parent, order[at - 1])[1] + 1, parent.keys[key].line - 1
    return [text.source.line(number) for number in range(first, last)]
