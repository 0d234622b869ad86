"""Set and remove values, given by their paths, in the text of a document. Comments, layout and all other text are preserved."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from thingc.base.diagnostics import Report
from thingc.base.source import Document, MappingNode, Node, Plain, ScalarNode, SequenceNode, node_at
from thingc.documents.load.documents import read_tree
from thingc.documents.load.text import Source
from thingc.documents.load.yaml_scalars import core_value

Keys = tuple[str, ...]
Written = str | Mapping[str, "Written"] | Sequence["Written"]
"""A value in a document: a scalar as a string (`120 mm`), or a mapping or list of such values."""


class CannotSetValue(Exception):
    """Raised if a value cannot be set or removed without changing other values.

    The message of the exception explains the reason. `span` is the location of the value.
    """

    def __init__(self, document: Document, keys: Keys, reason: str) -> None:
        super().__init__(f"`{'.'.join(keys)}` {reason}")
        self.span = document.span(keys)


def set_values(document: Document, values: Mapping[Keys, Written]) -> Document:
    """Set values at paths of a document, and return the changed document. Values are strings in the syntax of documents (`120 mm`).

    Missing entries are added after existing entries. New mappings are written in braces, except in new sections and in sections whose
    existing mappings extend over several lines. Raises `CannotSetValue` if setting a value would change other values.
    """
    set_value = _set_in_toml if _is_toml(document.path) else _set_in_yaml
    for keys, value in values.items():
        changed = _parse_document(document, set_value(document, keys, value))
        if changed is None or changed.tree.plain() != _set_item(document.tree.plain(), keys, _to_plain(value)):
            reason = "cannot be set separately (repeated by an alias or in unsupported YAML syntax)"
            raise CannotSetValue(document, keys, reason)
        document = changed
    return document


def remove_value(document: Document, keys: Keys) -> Document:
    """Remove a key and its value from a document, and return the changed document.

    The mapping with this key must contain at least one other key. Raises `CannotSetValue` if removing the key would change other values.
    """
    changed = _parse_document(document, (_remove_from_toml if _is_toml(document.path) else _remove_from_yaml)(document, keys))
    if changed is None or changed.tree.plain() != _remove_item(document.tree.plain(), keys):
        raise CannotSetValue(document, keys, "cannot be removed (repeated by an alias or in unsupported YAML syntax)")
    return changed


def _is_toml(path: str) -> bool:
    return path.lower().endswith(".toml")


def _to_plain(value: Written) -> Plain:
    """Parse a value such as `{upper: 60 deg}` to plain Python values."""
    if isinstance(value, str):
        return core_value(value)
    return {key: _to_plain(item) for key, item in value.items()} if isinstance(value, Mapping) else [_to_plain(item) for item in value]


def _parse_document(document: Document, text: str) -> Document | None:
    """Parse the changed text of a document. Return None if the text is not a well-formed mapping."""
    report = Report()
    tree = read_tree(document.path, text.encode(), report)
    return replace(document, text=text, tree=tree) if isinstance(tree, MappingNode) and not report.failed else None


def _set_item(root: Any, keys: Keys, value: Any, mapping: Callable[[], Any] = dict) -> Any:
    """Set the value at a path in nested mappings and lists, in place, and return `root`. `mapping()` creates each missing mapping."""
    inner = root
    for key in keys[:-1]:
        if isinstance(inner, dict) and not isinstance(inner.get(key), (dict, list)):
            inner[key] = mapping()
        inner = inner[_key_or_index(inner, key)]
    inner[_key_or_index(inner, keys[-1])] = value
    return root


def _key_or_index(inner: Any, key: str) -> Any:
    """Convert an element of a path to an index if `inner` is a list. For a mapping, return the key unchanged."""
    return int(key) if isinstance(inner, list) else key


def _remove_item(root: Any, keys: Keys) -> Any:
    """Remove the value at a path from nested mappings, in place, and return `root`."""
    inner = root
    for key in keys[:-1]:
        inner = inner[key]
    del inner[keys[-1]]
    return root


# --- YAML -------------------------------------------------------------------------------------------------------------


def _set_in_yaml(document: Document, keys: Keys, value: Written) -> str:
    source, text, tree = Source(document.path, document.text), document.text, document.tree
    depth = next((k for k in range(len(keys), 0, -1) if node_at(tree, keys[:k]) is not None), 0)
    node, missing_keys = node_at(tree, keys[:depth]), keys[depth:]
    assert node is not None
    start, end = source.range(node.span)
    if not missing_keys or not isinstance(node, MappingNode):  # replaces an existing value, which may be empty: `limit:`
        if isinstance(node, (MappingNode, SequenceNode)) and text[start] not in "{[":
            raise CannotSetValue(document, keys, "spans several lines: set the values inside it")
        space = "" if end > start or text[start - 1 : start].isspace() else " "
        value_text = _format_inline(value) if not missing_keys else "{" + _format_entry(missing_keys, value) + "}"
        return text[:start] + space + value_text + text[end:]
    if text[start] == "{":
        insert_at = max((source.range(line_text.span)[1] for line_text in node.entries.values()), default=start + 1)
        return text[:insert_at] + (", " if node.entries else "") + _format_entry(missing_keys, value) + text[insert_at:]
    indent = next(iter(node.keys.values())).column - 1
    line = last_line(source, node)
    insert_at = source.starts[line - 1] + len(source.line(line - 1))
    lines, line_end = _entry_lines(source, node, missing_keys, value), "\r\n" if "\r\n" in text else "\n"
    return text[:insert_at] + "".join(line_end + (" " * indent + entry if entry else "") for entry in lines) + text[insert_at:]


def _entry_lines(source: Source, node: MappingNode, missing: Keys, value: Written) -> list[str]:
    """Return the lines of a new entry of the block mapping `node`, with indentation relative to the mapping.

    `missing` is the part of the path that the document does not contain.
    """
    last = list(node.entries.values())[-1]
    if isinstance(value, Mapping) and len(missing) == 2:  # a new section
        return ["", f"{_format_scalar(missing[0])}:", f"  {_format_entry(missing[1:], value)}"]
    start, end = source.range(last.span)
    if isinstance(value, Mapping) and len(missing) == 1 and isinstance(last, MappingNode) and last.entries and source.text[start] != "{":
        pad = " " * (next(iter(last.keys.values())).column - next(iter(node.keys.values())).column)
        return [f"{_format_scalar(missing[0])}:", *(f"{pad}{_format_scalar(key)}: {_format_inline(item)}" for key, item in value.items())]
    return [_format_entry(missing, value)]


def _remove_from_yaml(document: Document, keys: Keys) -> str:
    source, text = Source(document.path, document.text), document.text
    node = node_at(document.tree, keys[:-1])
    assert isinstance(node, MappingNode)
    order = list(node.entries)
    index = order.index(keys[-1])
    key, value = node.keys[keys[-1]], node.entries[keys[-1]]
    start, end = source.range(key)[0], source.range(value.span)[1]
    if text[source.range(node.span)[0]] != "{":
        last = last_line(source, value)
        return text[: source.starts[key.line - 1]] + (text[source.starts[last] :] if last < len(source.starts) else "")
    if index + 1 < len(order):
        return text[:start] + text[source.range(node.keys[order[index + 1]])[0] :]
    previous_end = source.range(node.entries[order[index - 1]].span)[1] if index else start
    return text[:previous_end] + text[end:]


def last_line(source: Source, node: Node) -> int:
    """Return the number of the last line of a value. Line numbers start at 1."""
    start, end = source.range(node.span)
    if source.text[start : start + 1] not in ("{", "["):
        inner = list(node.entries.values()) if isinstance(node, MappingNode) else list(getattr(node, "items", ()))
        if inner:
            return max(last_line(source, child) for child in inner)
    return source.line_at(start + len(source.text[start:end].rstrip())) + 1


def _format_entry(keys: Keys, value: Written) -> str:
    """Format a new entry: `limit: {upper: 60 deg}`."""
    key, *inner_keys = keys
    return f"{_format_scalar(key)}: {'{' + _format_entry(tuple(inner_keys), value) + '}' if inner_keys else _format_inline(value)}"


def _format_inline(value: Written) -> str:
    """Format a value on one line."""
    if isinstance(value, str):
        return _format_scalar(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_format_scalar(key)}: {_format_inline(item)}" for key, item in value.items()) + "}"
    return "[" + ", ".join(map(_format_inline, value)) + "]"


def _format_scalar(text: str) -> str:
    """Format a scalar for YAML 1.2, quoted if necessary; numbers and booleans are unchanged."""
    if not isinstance(core_value(text), str):
        return text
    from ruamel.yaml import YAML

    writer = YAML(typ="safe", pure=True)
    writer.default_flow_style, writer.width, writer.allow_unicode = True, 1_000_000, True
    stream = io.StringIO()
    writer.dump([text], stream)
    return stream.getvalue().strip()[1:-1]


# --- TOML -------------------------------------------------------------------------------------------------------------


def _set_in_toml(document: Document, keys: Keys, value: Written) -> str:
    import tomlkit

    text = document.text
    line_end = "\r\n" if "\r\n" in text else "\n"
    if isinstance(value, Mapping) and len(keys) == 2 and (place := _insertion_point(document, keys)) is not None:
        insert_at, has_headers = place
        entries = (f"{tomlkit.key(key).as_string()} = {tomlkit.item(_toml_value(item)).as_string()}" for key, item in value.items())
        header = f"[{'.'.join(tomlkit.key(key).as_string() for key in keys)}]"
        inline = f"{tomlkit.key(keys[1]).as_string()} = {tomlkit.item(_toml_value(value)).as_string()}"
        return text[:insert_at] + line_end.join(("", "", header, *entries) if has_headers else ("", inline)) + text[insert_at:]
    parsed = tomlkit.parse(text.replace("\r\n", "\n"))
    section = len(keys) == 2 and isinstance(value, Mapping)
    _set_item(parsed, keys, _toml_value(value), tomlkit.table if section else tomlkit.inline_table)
    return tomlkit.dumps(parsed).replace("\n", line_end)


def _insertion_point(document: Document, keys: Keys) -> tuple[int, bool] | None:
    """Return the index at which to insert the new entry `keys` of a TOML section, and whether its last entry is a table with a header.

    The index is at the end of the last line of the last entry. Return None if the entry exists, if the section is empty, or if neither the
    section nor its last entry has a header.
    """
    source, text, node = Source(document.path, document.text), document.text, node_at(document.tree, keys[:1])
    if not isinstance(node, MappingNode) or not node.entries or keys[1] in node.entries:
        return None
    last = max(node.entries.values(), key=lambda one: source.range(one.span)[1])
    start, end = source.range(last.span)
    has_headers = isinstance(last, MappingNode) and text[start] == "["
    if not has_headers and text[source.range(node.span)[0]] != "[":
        return None
    line = source.line_at(end - 1)
    return source.starts[line] + len(source.line(line)), has_headers


def _remove_from_toml(document: Document, keys: Keys) -> str:
    import tomlkit

    line_end = "\r\n" if "\r\n" in document.text else "\n"
    return tomlkit.dumps(_remove_item(tomlkit.parse(document.text.replace("\r\n", "\n")), keys)).replace("\n", line_end)


def _toml_value(value: Written) -> Any:
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    if isinstance(value, Mapping):
        table = tomlkit.inline_table()
        for key, item in value.items():
            table[key] = _toml_value(item)
        return table
    if not isinstance(value, str):
        array = tomlkit.array()
        array.extend(_toml_value(item) for item in value)
        return array
    plain = core_value(value)
    if isinstance(plain, str) or plain is None:
        return value
    try:
        return tomlkit.value(value)
    except TOMLKitError:  # a number that is valid in YAML but not in TOML: `.5`
        return plain


def changes(document: Document, values: Mapping[Keys, str]) -> Iterator[tuple[str, str | None, str]]:
    """Yield the path, the previous text and the new text of each value in `values`. The previous text is None if the path did not exist."""
    for keys, value in values.items():
        node = node_at(document.tree, keys)
        yield ".".join(keys), None if node is None else _display_text(document, node), value


def _display_text(document: Document, node: Node) -> str:
    """Return the text of a value for display. Mappings and lists that are long or on several lines are shown as `...`."""
    if isinstance(node, ScalarNode):
        return node.text
    start, end = Source(document.path, document.text).range(node.span)
    text = document.text[start:end]
    return text if text[:1] in ("{", "[") and len(text) <= 80 and "\n" not in text else "..."
