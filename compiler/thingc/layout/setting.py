"""Values written into the text of a document at their paths: everything else of the text, comments and layout, stays as it is."""

from __future__ import annotations

import copy
import io
from collections.abc import Iterator, Mapping
from typing import Any

from thingc.diagnostics import Report
from thingc.load import read_tree
from thingc.load.scalars import core_value
from thingc.load.text import Source
from thingc.source import Document, MappingNode, Node, Plain, ScalarNode, SequenceNode, Span, node_at

Keys = tuple[str, ...]


class Unsettable(Exception):
    """A value that cannot be written at its place without changing something else; the message says why."""


def with_values(document: Document, values: Mapping[Keys, str]) -> str:
    """The text of a document in which each value (as a document has it: `120 mm`) stands at its keys. What was not there is added behind
    what is there, as a mapping in braces where that needs one.

    Raises `Unsettable` where the text would then say something else than what it said with those values.
    """
    set_one = _in_toml if document.path.lower().endswith(".toml") else _in_yaml
    text = document.text
    for keys, value in values.items():
        expected = _plain_with(_tree(document.path, text).plain(), keys, core_value(value))
        text = set_one(document.path, text, keys, value)
        if _said(document.path, text) != expected:
            what = "what stands there is used elsewhere, too, or written in a way of its own"
            raise Unsettable(f"`{'.'.join(keys)}` cannot be set alone: {what}")
    return text


def _tree(path: str, text: str) -> MappingNode:
    tree = read_tree(path, text.encode(), Report())
    if not isinstance(tree, MappingNode):
        raise Unsettable("the document is no mapping")
    return tree


def _said(path: str, text: str) -> Plain:
    """What a text says; None where it is not well-formed."""
    report = Report()
    tree = read_tree(path, text.encode(), report)
    return None if tree is None or report.failed else tree.plain()


def _plain_with(plain: Plain, keys: Keys, value: Any) -> Plain:
    """The values of a document with one more, or another one."""
    whole = copy.deepcopy(plain)
    inner: Any = whole
    for key in keys[:-1]:
        if not isinstance(inner.get(key), dict):
            inner[key] = {}
        inner = inner[key]
    inner[keys[-1]] = value
    return whole


# --- YAML -------------------------------------------------------------------------------------------------------------


def _in_yaml(path: str, text: str, keys: Keys, value: str) -> str:
    source = Source(path, text)
    tree: Node = _tree(path, text)
    depth = next((k for k in range(len(keys), 0, -1) if node_at(tree, keys[:k]) is not None), 0)
    node, rest = node_at(tree, keys[:depth]), keys[depth:]
    assert node is not None
    start, end = _place(source, node.span)
    if not rest or not isinstance(node, MappingNode):  # instead of what is there, which may be nothing: `limit:`
        if isinstance(node, (MappingNode, SequenceNode)) and text[start] not in "{[":
            raise Unsettable(f"`{'.'.join(keys)}` is written over several lines: set the values in it")
        space = "" if end > start or text[start - 1 : start].isspace() else " "
        written = _scalar(value) if not rest else "{" + _entry(rest, value) + "}"
        return text[:start] + space + written + text[end:]
    if text[start] == "{":
        at = max((_place(source, one.span)[1] for one in node.entries.values()), default=start + 1)
        return text[:at] + (", " if node.entries else "") + _entry(rest, value) + text[at:]
    indent = next(iter(node.keys.values())).column - 1
    line = _last_line(source, node)
    at = source.starts[line - 1] + len(source.line(line - 1))
    return text[:at] + ("\r\n" if "\r\n" in text else "\n") + " " * indent + _entry(rest, value) + text[at:]


def _place(source: Source, span: Span) -> tuple[int, int]:
    return source.starts[span.line - 1] + span.column - 1, source.starts[span.end_line - 1] + span.end_column - 1


def _last_line(source: Source, node: Node) -> int:
    """The line (from 1) on which a value ends."""
    start, end = _place(source, node.span)
    if source.text[start : start + 1] not in ("{", "["):
        inner = list(node.entries.values()) if isinstance(node, MappingNode) else list(getattr(node, "items", ()))
        if inner:
            return max(_last_line(source, one) for one in inner)
    return source.line_at(start + len(source.text[start:end].rstrip())) + 1


def _entry(keys: Keys, value: str) -> str:
    """`limit: {upper: 60 deg}`."""
    first, *rest = keys
    return f"{_scalar(first)}: {'{' + _entry(tuple(rest), value) + '}' if rest else _scalar(value)}"


def _scalar(text: str) -> str:
    """A text of a document as YAML 1.2 has it, quoted where it must be; a number and a flag as they are."""
    if not isinstance(core_value(text), str):
        return text
    from ruamel.yaml import YAML

    writer = YAML(typ="safe", pure=True)
    writer.default_flow_style, writer.width, writer.allow_unicode = True, 1_000_000, True
    stream = io.StringIO()
    writer.dump([text], stream)
    return stream.getvalue().strip()[1:-1]


# --- TOML -------------------------------------------------------------------------------------------------------------


def _in_toml(path: str, text: str, keys: Keys, value: str) -> str:
    import tomlkit

    line_end = "\r\n" if "\r\n" in text else "\n"
    document = tomlkit.parse(text.replace("\r\n", "\n"))
    table: Any = document
    for key in keys[:-1]:
        if not isinstance(table.get(key), Mapping):
            table[key] = tomlkit.inline_table()
        table = table[key]
    table[keys[-1]] = _toml_value(value)
    return tomlkit.dumps(document).replace("\n", line_end)


def _toml_value(text: str) -> Any:
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    value = core_value(text)
    if isinstance(value, str) or value is None:
        return text
    try:
        return tomlkit.value(text)
    except TOMLKitError:  # a number as only YAML writes it: `.5`
        return value


def changes(document: Document, values: Mapping[Keys, str]) -> Iterator[tuple[str, str | None, str]]:
    """Each path, what stood there (None: nothing), and what will."""
    for keys, value in values.items():
        node = node_at(document.tree, keys)
        yield ".".join(keys), node.text if isinstance(node, ScalarNode) else None if node is None else "...", value
