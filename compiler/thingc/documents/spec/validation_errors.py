"""Convert the validation errors of pydantic to diagnostics with positions in the document, and find the valid entries of the document.

This module is imported only for invalid documents.

pydantic validates the plain values and reports locations in the model. This module converts these locations to positions in the document by
following the annotations (`annotation_types`). The branch of the union that the user probably intended is determined from the value, and
only errors of this branch are reported.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from msgspec.structs import replace
from pydantic_core import PydanticCustomError, ValidationError

from thingc.base.diagnostics import Code, Report
from thingc.base.source import Document, MappingNode, Path, ScalarNode, Span, node_at
from thingc.base.suggestions import Hint, Suggestion
from thingc.base.units import shorten
from thingc.documents.spec.annotation_types import FieldType, branch_of, model_keys, shape_of
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import decimal_point
from thingc.documents.spec.invalid_entries import InvalidEntries
from thingc.documents.spec.pruning import ROUNDS, Fault, prune, remove_entry, value_at
from thingc.documents.spec.unknown_keys import combine_faults
from thingc.documents.spec.validation_messages import KINDS, MAX_FAULTS, FaultReporter, format_path


def valid_entries(
    document: Document, model: type[Model], plain: dict[str, Any], error: ValidationError | None, empty: Mapping[Path, ScalarNode],
    damaged: frozenset[Path], report: Report,
) -> tuple[Model | None, InvalidEntries]:
    """Report the errors of a document. Return the model of its valid entries, and the removed entries.

    The model is None if no useful entries remain. `plain` contains the values of the document; invalid entries are removed in place.
    `error` is the exception that pydantic raised for these values. `empty` maps the paths of null values to their nodes. `damaged` contains
    the paths of errors that `load` has already reported.
    """
    wrong = _report_empty(document, empty, report)
    faults: list[Fault] = []
    if error is not None:
        faults = combine_faults(document, model, list(_faults(shape_of(model), plain, (), error)))
        FaultReporter(document=document, root=model, report=report, empty=wrong, damaged=damaged).report_all(faults)
    if document.kind == "workspace":
        return None, InvalidEntries()
    return _validate(model, plain, faults, wrong | damaged)


def _validate(model: type[Model], plain: dict[str, Any], faults: list[Fault], bad: frozenset[Path]) -> tuple[Model | None, InvalidEntries]:
    """Remove all invalid entries from a document. Return the model of the remaining document, and the removed entries.

    `plain` contains the values of the document and is modified in place. In addition to the entries with `faults`, the values at the paths
    `bad` are removed. The model is None if the remaining document is still invalid.
    """
    removed_paths: set[Path] = set()
    pruned = prune(plain, faults)
    for path in bad:
        removed = remove_entry(plain, path)
        if pruned is None or removed is None:
            return None, InvalidEntries()
        pruned.add(removed)
    for _ in range(ROUNDS):
        if pruned is None:
            break
        removed_paths |= pruned
        try:
            return model.model_validate(plain, strict=True), InvalidEntries(paths=frozenset(removed_paths))
        except ValidationError as error:
            pruned = prune(plain, list(_faults(shape_of(model), plain, (), error)))
    return None, InvalidEntries()


def _report_empty(document: Document, empty: Mapping[Path, ScalarNode], report: Report) -> frozenset[Path]:
    """Report keys without a value, because null is not allowed.

    Return the paths of these keys, and the paths of values that were split by a decimal comma.
    """
    paths: set[Path] = set()
    for path, node in empty.items():
        paths.add(path)
        owner = next((f"`{shorten(step)}`" for step in reversed(path) if isinstance(step, str)), "the document")
        help: Hint = "write a value after the colon, indent the following lines, or remove the key"
        key = document.span(path, key=True)
        after_key = document.line(key.end_line)[key.end_column - 1 :]
        comment = re.match(r":?\s+(#[0-9a-fA-F]{3,8})\b", after_key)
        if comment is not None:
            help = f'put the value in quotes: `"{comment.group(1)}"`'
        elif re.match(r"\s*[,}]", after_key):
            help = "put a string that contains a comma in quotes"
        message = f"an item of {owner} has no value" if path and isinstance(path[-1], int) else f"{owner} has no value"
        span = document.span(path, key=True) if node.text == "" else node.span
        code, decimal_comma = Code.NO_VALUE, _decimal_comma(document, path)
        if decimal_comma is not None:
            paths.add(decimal_comma[0])
            code, message, span, help = Code.BAD_QUANTITY, _DECIMAL_COMMA, decimal_comma[1], decimal_comma[2]
        if len(paths) > MAX_FAULTS:
            continue
        report.add(code, message, span, help=help, path=format_path(path))
    return frozenset(paths)


_DECIMAL_COMMA = "use a decimal point, not a comma"


def _decimal_comma(document: Document, path: Path) -> tuple[Path, Span, Suggestion] | None:
    """Detect a decimal comma such as in `{gap: 1,5 mm}`, which YAML parses as `gap: 1` and a key `5 mm`.

    Return the path of the value, the span of the text with the comma, and a hint with the correct value.
    """
    mapping = node_at(document.tree, path[:-1])
    if not isinstance(mapping, MappingNode) or not isinstance(path[-1], str) or not path[-1][:1].isdigit():
        return None
    keys = list(mapping.entries)
    before = mapping.entries[keys[max(0, keys.index(path[-1]) - 1)]]
    key = mapping.keys[path[-1]]
    if not isinstance(before, ScalarNode) or not re.fullmatch(r"[-+]?\d+", before.text):
        return None
    if (before.span.end_line, before.span.end_column + 1) != (key.line, key.column):
        return None
    span = replace(before.span, end_line=key.end_line, end_column=key.end_column)
    return (*path[:-1], keys[keys.index(path[-1]) - 1]), span, decimal_point(f"{before.text},{path[-1]}", before.text, path[-1])


def _faults(shape: FieldType, value: Any, path: Path, error: ValidationError) -> Iterator[Fault]:
    """Yield the validation errors of the value at `path`, whose expected type is `shape`.

    For a union, only errors of the branch that the user probably intended are yielded.
    """
    unions: set[Path] = set()
    for entry in error.errors(include_url=False):
        steps, inner_shape, key, union = _document_path(shape, entry["loc"], entry["type"])
        if union:
            if steps not in unions:
                unions.add(steps)
                yield from _union_faults(inner_shape, value_at(value, steps), (*path, *steps))
            continue
        context = dict(entry.get("ctx", {}))
        if entry["type"] not in KINDS:
            context.setdefault("message", entry["msg"])
        for kind, error_context in _split_errors(entry["type"], context):
            yield Fault(path=(*path, *steps), kind=kind, context=error_context, value=entry["input"], shape=inner_shape, key=key)


def _split_errors(kind: str, context: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the type and the context of a validation error from `spec.fields`, and then of each error in `others` of this context."""
    other_errors: list[PydanticCustomError] = context.pop("others", [])
    yield kind, context
    for other in other_errors:
        yield other.type, dict(other.context or {})


def _union_faults(shape: FieldType, value: Any, path: Path) -> Iterator[Fault]:
    """Yield the errors of a value that does not match any branch of a union, for the branch that the user probably intended."""
    branch = branch_of(shape, value)
    if branch is None:
        yield Fault(path=path, kind="type", context={}, value=value, shape=shape)
    elif branch.field is not None:
        try:
            branch.field.validate(value)
        except PydanticCustomError as fault:
            for kind, context in _split_errors(fault.type, dict(fault.context or {})):
                yield Fault(path=path, kind=kind, context=context, value=value, shape=branch)
    else:
        from pydantic import TypeAdapter

        try:
            TypeAdapter(branch.annotation).validate_python(value, strict=True)
        except ValidationError as error:
            yield from _faults(branch, value, path, error)


def _document_path(shape: FieldType, location: tuple[int | str, ...], kind: str) -> tuple[Path, FieldType, bool, bool]:
    """Convert the location of a pydantic error to a path in the document.

    Return the path, the type at this path, whether the error is about the key, and whether the search stopped at a union.
    """
    path: list[int | str] = []
    for index, step in enumerate(location):
        if shape.kind == "union":
            return tuple(path), shape, False, True
        if shape.model is not None:
            path.append(step)
            field = model_keys(shape.model).get(str(step))
            if field is None or (kind == "missing" and index == len(location) - 1):
                return tuple(path), shape, kind == "extra_forbidden", False
            shape = field[0]
        elif shape.kind in ("dict", "list"):
            if step == "[key]" and index == len(location) - 1 and path:
                return tuple(path), shape, True, False
            path.append(step)
            if location[index + 1 :] != ("[key]",):
                shape = shape_of(shape.members[0])
        else:
            break
    return tuple(path), shape, False, shape.kind == "union" and kind != "missing"
