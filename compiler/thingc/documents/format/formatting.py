"""Format documents in the canonical layout, and verify that formatting does not change the values of a document."""

from __future__ import annotations

import re

from thingc.base.diagnostics import Code, Report
from thingc.base.source import Document, MappingNode, Node, ScalarNode, SequenceNode
from thingc.documents.format.flow_style import equal_values, is_vector, root_shape, shape_below, shape_for
from thingc.documents.format.segments import UnsupportedStyle
from thingc.documents.load.documents import document_kind, read_tree
from thingc.documents.spec.annotation_types import FieldType

MODELINE = "# yaml-language-server: $schema="
"""Prefix of the comment by which the YAML language server finds the JSON Schema of a document."""


def format_document(path: str, data: bytes, report: Report, *, schema: str | None = None, tree: MappingNode | None = None) -> bytes | None:
    """Return the bytes of a document in canonical layout. If the document is not well-formed, report the error and return None.

    The line ending of the first line is used for all lines. A byte order mark is removed. The layout of documents with unsupported syntax
    is not changed. `schema` is the path of the JSON Schema, relative to the document; it is added as a comment to YAML documents. `tree` is
    the parsed document, if the caller has already parsed it.
    """
    before = tree or read_tree(path, data, report)
    kind = None if before is None else document_kind(before, report)
    if before is None or kind is None or report.failed:
        return None
    text = data.decode("utf-8-sig")
    first_break = re.search(r"\r\n|\r|\n", text)
    line_end = first_break.group() if first_break is not None else "\n"
    shape = root_shape(kind)
    plain = re.sub(r"\r\n?", "\n", text)
    try:
        plain = _layout(path, plain, shape)
    except UnsupportedStyle:
        pass
    if schema is not None and not path.lower().endswith(".toml"):
        plain = with_modeline(plain, schema)
    formatted = plain.replace("\n", line_end).encode()
    if formatted != data:
        reparse_report = Report()
        after = read_tree(path, formatted, reparse_report)
        if after is None or reparse_report.failed or not equal(before, after, shape):
            report.add(
                Code.INTERNAL, "formatting would change the meaning of this document",
                before.span,
                help="report this bug of thingc together with the document",
            )
            return None
    return formatted


def is_formatted(document: Document) -> bool:
    """Return whether a document is already in canonical layout, except for its line endings."""
    text = re.sub(r"\r\n?", "\n", document.text)
    try:
        return _layout(document.path, text, root_shape(document.kind)) == text
    except UnsupportedStyle:
        return True


def _layout(path: str, text: str, shape: FieldType | None) -> str:
    if path.lower().endswith(".toml"):
        from thingc.documents.format.toml_layout import toml_layout

        return toml_layout(text, shape)
    from thingc.documents.format.yaml_layout import yaml_layout

    return yaml_layout(text, shape)


def with_modeline(text: str, schema: str) -> str:
    """Return the text of a YAML document with a modeline, which is a comment with the path of the JSON Schema for editors.

    An existing modeline is updated. A new modeline is added at the top.
    """
    line = MODELINE + schema
    lines = text.split("\n")
    for index, existing in enumerate(lines):
        if existing.strip() and not existing.lstrip().startswith("#"):
            break
        if re.match(r"#\s*yaml-language-server:\s*\$schema=", existing):
            return "\n".join([*lines[:index], line, *lines[index + 1 :]])
    return f"{line}\n{text}"


def schema_path(relative: str) -> str:
    """Return the path of the schema file that `thingc schema` writes, relative to the folder of a document in the workspace."""
    up = "../" * relative.count("/")
    return f"{up}.thingc/schema/{relative}.json"


def equal(before: Node, after: Node, shape: FieldType | None) -> bool:
    """Return whether two values of the type `shape` are equal. The order of keys matters only for keys that the user defines.

    Quantities with and without a space before the unit are equal.
    """
    if isinstance(before, ScalarNode) and isinstance(after, ScalarNode):
        if type(before.value) is type(after.value) and before.value == after.value:
            return True
        old, new = before.value, after.value
        differ_in_spaces = isinstance(old, str) and isinstance(new, str) and old.replace(" ", "") == new.replace(" ", "")
        return differ_in_spaces and equal_values(str(old), str(new), shape_for(shape, old))
    if isinstance(before, SequenceNode) and isinstance(after, SequenceNode):
        shape = shape_for(shape, [])
        item_shape = shape if shape is not None and is_vector(shape) else shape_below(shape, None)
        return len(before.items) == len(after.items) and all(
            equal(old_item, new_item, item_shape) for old_item, new_item in zip(before.items, after.items, strict=True)
        )
    if isinstance(before, MappingNode) and isinstance(after, MappingNode):
        shape = shape_for(shape, dict.fromkeys(before.entries))
        names, new_names = list(before.entries), list(after.entries)
        if shape is not None and shape.model is not None:
            names, new_names = sorted(names), sorted(new_names)
        return names == new_names and all(equal(before.entries[name], after.entries[name], shape_below(shape, name)) for name in names)
    return False
