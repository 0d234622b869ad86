"""Report the validation errors of a document as diagnostics, each with its position in the document and a help text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace
from pydantic_core import PydanticCustomError

from thingc.base.diagnostics import Code, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document, MappingNode, Node, Path, ScalarNode, SequenceNode, Span, node_at
from thingc.base.suggestions import Hint, Suggestion, near_hint
from thingc.base.units import shorten
from thingc.documents.load.text import narrow_span
from thingc.documents.spec.annotation_types import FieldType, alternatives, format_choice, model_keys, one_of
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import describe, read_value
from thingc.documents.spec.foreign_keywords import choice_hint, mapping_text
from thingc.documents.spec.pruning import MISPLACED, Fault
from thingc.documents.spec.settable_values import dimension_at
from thingc.documents.spec.unknown_keys import UnknownKey, message_of as misplaced_message

MAX_FAULTS = 200
"""Maximum number of errors reported for one document."""

KINDS: dict[str, Code] = {
    "unit": Code.BAD_UNIT, "dimension": Code.WRONG_DIMENSION, "quantity": Code.BAD_QUANTITY, "expression": Code.BAD_EXPRESSION,
    "name": Code.BAD_NAME, "reference": Code.BAD_REFERENCE, "color": Code.BAD_COLOR, "vector": Code.WRONG_LENGTH,
    "type": Code.WRONG_TYPE, "rule": Code.BROKEN_RULE, "choice": Code.UNKNOWN_CHOICE,
}
"""Diagnostic codes of the validation errors that `spec.fields` and the rules of models raise."""


class FaultReporter(FrozenStruct, eq=False):
    """Reports the validation errors of a document. `root` is the model of the document.

    `empty` contains the paths of keys without a value, which have already been reported. `damaged` contains the paths at which `load` has
    already reported an error: invalid values that were replaced by a placeholder, and mappings with an invalid key.
    """

    document: Document
    root: type[Model]
    report: Report
    empty: frozenset[Path]
    damaged: frozenset[Path]

    def report_all(self, faults: list[Fault]) -> None:
        """Report all validation errors, in the order of the document."""
        unknown = {fault.path: UnknownKey(self.document, self.root, fault) for fault in faults if fault.kind == "extra_forbidden"}
        intended = {(*path[:-1], unknown_key.intended) for path, unknown_key in unknown.items() if unknown_key.intended is not None}
        parents = {path[:-1] for path in self.empty}
        reported_before = len(self.report.diagnostics)
        for fault in faults:
            if fault.path in self.empty or self._is_placeholder(fault.path) or (fault.kind == "missing" and fault.path in intended):
                continue
            if fault.kind == "rule" and (fault.path in parents or fault.path in self.damaged):
                continue
            if (fault.kind == "missing" and fault.path[:-1] in self.damaged) or (fault.kind == "too_short" and fault.path in self.damaged):
                continue
            if len(self.report.diagnostics) - reported_before >= MAX_FAULTS:
                message = f"more than {MAX_FAULTS} errors in one document (further errors are not shown)"
                self._add(Code.TOO_LARGE, message, self._place(fault.path), fault.path, None)
                return
            if fault.path in unknown:
                place = f" in `{format_path(fault.path[:-1])}`" if len(fault.path) > 1 else ""
                message = f"unknown key `{shorten(str(fault.path[-1]))}`{place}"
                self._add(Code.UNKNOWN_KEY, message, self._place(fault.path, key=True), fault.path, unknown[fault.path].help)
            else:
                self._report_fault(fault)

    def _is_placeholder(self, path: Path) -> bool:
        """Return whether the value at a path contains a placeholder for an invalid value, or is one."""
        damaged_paths = (damaged_path for damaged_path in self.damaged if damaged_path[: len(path)] == path)
        return any(isinstance(node_at(self.document.tree, damaged_path), ScalarNode) for damaged_path in damaged_paths)

    def _report_fault(self, fault: Fault) -> None:
        if fault.kind == "missing":
            self._missing_key(fault)
        elif fault.kind == MISPLACED:
            message, help = misplaced_message(fault, toml=self.document.path.endswith(".toml"))
            self._add(Code.UNKNOWN_KEY, message, self._place(fault.path, key=True), fault.path, help)
        elif fault.kind == "literal_error":
            self._unknown_choice(fault)
        elif fault.kind in ("too_short", "too_long"):
            self._wrong_length(fault)
        elif fault.kind in KINDS and "message" in fault.context:
            self._report_with_message(fault)
        else:
            self._wrong_type(fault)

    def _add(self, code: Code, message: Hint, span: Span, path: Path, help: Hint | None) -> None:
        self.report.add(code, message, span, help=help or None, path=format_path(path) or None)

    def _place(self, path: Path, *, key: bool = False) -> Span:
        """Return the span of the value at a path in the document.

        If the value is missing or on several lines, return the span of its key.
        """
        node = node_at(self.document.tree, path)
        if node is None or not path:
            start = next(iter(self.document.tree.keys.values()), self.document.tree.span)
            return self.document.span(path, key=True) if path else start
        long = node.span.line != node.span.end_line and not isinstance(node, ScalarNode)
        return self.document.span(path, key=key or (long and isinstance(path[-1], str)))

    def _missing_key(self, fault: Fault) -> None:
        key, parent = str(fault.path[-1]), fault.path[:-1]
        owner = f"`{format_path(parent)}`" if parent else "the document"
        assert fault.shape.model is not None
        help = f"add the key `{key}` ({model_keys(fault.shape.model)[key][0].description})"
        by_default = ("defaults", str(parent[0])[:-1], *parent[2:]) if parent and parent[0] in ("joints", "components") else ()
        if by_default and node_at(self.document.tree, (*by_default, key)) is not None:
            help += f"; {owner} replaces all keys of `{format_path(by_default)}`"
        self._add(Code.MISSING_KEY, f"the key `{key}` is missing in {owner}", self._place(parent, key=True), parent, help)

    def _unknown_choice(self, fault: Fault) -> None:
        choices = [format_choice(choice) for choice in fault.shape.choices]
        text = format_choice(fault.value)
        self._add(
            Code.UNKNOWN_CHOICE, f"expected {one_of(choices)}, found {describe(fault.value)}", self._place(fault.path), fault.path,
            (near_hint(text, choices) if isinstance(fault.value, str) else None) or choice_hint(text, choices),
        )

    def _wrong_length(self, fault: Fault) -> None:
        if isinstance(fault.value, dict):
            message = f"expected at least one entry in `{format_path(fault.path)}`, found none"
        else:
            minimum, maximum = fault.context.get("min_length"), fault.context.get("max_length")
            count = maximum if minimum is None else minimum
            expected = "a list with at least one item" if minimum == 1 and maximum is None else f"a list of {count} items"
            message = f"expected {expected}, found {describe(fault.value)}"
        self._add(Code.WRONG_LENGTH, message, self._place(fault.path), fault.path, None)

    def _report_with_message(self, fault: Fault) -> None:
        """Report an error that already contains its message, from a field type or from a rule of a document model."""
        path = (*fault.path, *fault.context.get("path", ()))
        if fault.kind == "unit":
            fault = self._with_joint_dimension(fault)
        span = self._place(path, key=fault.key or fault.kind == "rule")
        offset = fault.context.get("offset")
        if offset is not None and not fault.key:
            span = span_within(self.document, path, int(offset), int(fault.context["end"])) or span
        help = fault.context.get("help")
        if fault.kind in ("type", "quantity") and not help:
            help = _space_hint(fault.value) or _unwrapped_hint(path, fault)
        self._add(KINDS[fault.kind], fault.context["message"], span, path, help)

    def _with_joint_dimension(self, fault: Fault) -> Fault:
        """Return a more exact error about a missing unit: the type of the joint determines whether an angle or a length is expected."""
        dimension = dimension_at(self.document, fault.path)
        if dimension is not None:
            try:
                read_value(fault.value, (dimension,), dimension.words, dimension.example)
            except PydanticCustomError as narrower:
                return replace(fault, kind=narrower.type, context=dict(narrower.context or {}))
        return fault

    def _wrong_type(self, fault: Fault) -> None:
        shape, value = fault.shape, fault.value
        help: Hint | None = _mapping_hint(self.document, fault.path, value, shape) if shape.kind in ("model", "dict", "union") else None
        if shape.kind == "text" and isinstance(value, (int, float)):
            node = node_at(self.document.tree, fault.path)
            if isinstance(node, ScalarNode):
                quoted = f'"{node.text}"'
                help = Suggestion(f"write `{shorten(quoted)}`", (node.text, quoted))
        elif shape.kind == "flag" and isinstance(value, str) and value.lower() in ("yes", "no", "on", "off"):
            flag = "true" if value.lower() in ("yes", "on") else "false"
            help = Suggestion(f"write `{flag}`", (value, flag))
        elif isinstance(value, str) and value.lower() == "none":
            help = "remove the key to omit the value"
        elif help is None and isinstance(value, dict) and len(value) == 1 and any(member.kind == "list" for member in alternatives(shape)):
            help = f"write a list with one item per key: `[{{{shorten(str(next(iter(value))))}: ...}}]`"
        elif help is None and isinstance(value, str) and any(member.kind == "list" for member in alternatives(shape)):
            numbers = re.fullmatch(r"[-+.\deE\s]+", value)  # `0 0 1` is a list of three numbers, `mass < 2 kg` is a single rule
            axis = _AXES.get(value) if fault.path[-1:] in (("axis",), ("up",)) else None
            help = f"write `[{axis or shorten(', '.join(value.split()) if numbers else value)}]`"
        elif help is None and isinstance(value, bool):
            choices = [format_choice(choice) for alternative in alternatives(shape) for choice in alternative.choices]
            help = choice_hint(format_choice(value), choices)
        self._add(Code.WRONG_TYPE, f"expected {shape.description}, found {describe(value)}", self._place(fault.path), fault.path, help)


_AXES = {"x": "1, 0, 0", "y": "0, 1, 0", "z": "0, 0, 1", "-x": "-1, 0, 0", "-y": "0, -1, 0", "-z": "0, 0, -1"}


def _mapping_hint(document: Document, path: Path, value: Any, shape: FieldType) -> str | None:
    """Return a hint for a value that was written in place of a mapping, or None if the intended mapping is unclear."""
    node = node_at(document.tree, path)
    if isinstance(node, SequenceNode):
        texts = [one.text if isinstance(one, ScalarNode) else "" for one in node.items]
    else:
        texts = [node.text] if isinstance(node, ScalarNode) else []
    if isinstance(value, str) and path[:-1] == ("components",) and re.fullmatch(r"[\w.]+:[\w.]+", value):
        return f"write `{{part: {shorten(value)}}}`"
    space = _space_hint(value)
    if space is not None:
        return space
    if path[-1:] == ("attach",) and all(texts) and len(texts) in (1, 2):
        return f"write `{{{'my_mount' if len(texts) == 1 else shorten(texts[0])}: {shorten(texts[-1])}}}`"
    if path[:-1] == ("poses",) and all(texts) and texts:
        return f"write the positions of joints: `{{JOINT: {shorten(texts[0])}}}`"
    for branch in alternatives(shape):
        long_form = mapping_text(branch.model, texts, value) if branch.model is not None else None
        if long_form is not None:
            return f"write `{long_form}`"
    if isinstance(node, SequenceNode) and any(one.kind == "dict" for one in alternatives(shape)):
        entries: Mapping[str, Node] = node.items[0].entries if node.items and isinstance(node.items[0], MappingNode) else {}
        name_node, key = entries.get("name"), next(iter(entries), "")
        if isinstance(name_node, ScalarNode):
            return f"write `{shorten(name_node.text)}:` instead of `- name: {shorten(name_node.text)}`"
        if len(entries) == 1:
            return f"write `{shorten(key)}:` instead of `- {shorten(key)}:`"
        return f"write a mapping: `{path[-1]}: {{NAME: ...}}`"
    return None


def _unwrapped_hint(path: Path, fault: Fault) -> str | None:
    """Return a hint for a mapping with one string, in a place where only the string is expected. Otherwise, return None."""
    if not isinstance(fault.value, dict) or len(path) != len(fault.path) or fault.shape.field is None:
        return None
    if path[:1] == ("links",):
        return "write only a component, such as `base_link: plate`"
    strings = [text for text in fault.value.values() if isinstance(text, str)]
    if len(fault.value) != 1 or not strings:
        return None
    mount = ".MOUNT" if fault.shape.field.description == "a reference" and strings[0].isidentifier() else ""
    return f"write `{shorten(strings[0])}{mount}`"


def _space_hint(value: Any) -> str | None:
    """Return a hint for a string `key:value` in which a space after the colon is missing."""
    match = re.fullmatch(r"([A-Za-z_]\w*):(\S.*)", value) if isinstance(value, str) else None
    return f"add a space after the colon: `{match.group(1)}: {shorten(match.group(2))}`" if match else None


def format_path(path: Path) -> str:
    """Format a path for messages: `components.plate.at.xyz[0]`."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{shorten(step)}" if text else shorten(step)
    return text


def span_within(document: Document, path: Path, offset: int, end: int) -> Span | None:
    """Return the span of the characters from `offset` to `end` (exclusive) in the scalar at `path`.

    Return None if the scalar is on several lines or contains escapes, so that the span cannot be determined.
    """
    node = node_at(document.tree, path)
    if not isinstance(node, ScalarNode) or not node.text or node.span.line != node.span.end_line or node.span.file != document.path:
        return None
    start = min(offset, len(node.text) - 1)
    return narrow_span(node.span, document.line(node.span.line), node.text, start, max(min(end, len(node.text)), start + 1))
