"""Apply the values of the command-line option `--set` to a document.

An option consists of a path in the document, such as `joints.elbow.limit.upper`, and a value as a string.

The string is parsed in the same way as a value in the document. The string can be a mapping or a list on one line, such as `{on: floor}`.
The resulting tree is validated with the document models, so the rules of documents apply. The location of an inserted value is the
command-line option (`source.option_span`). Errors of all passes therefore refer to the option and not to the document.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, cast

from msgspec import structs

from thingc.base.diagnostics import Code, Diagnostic, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document, MappingNode, Node, ScalarNode, SequenceNode, Span, closest, entries_of, option_span
from thingc.base.suggestions import Hint, did_you_mean, nearest
from thingc.base.units import shorten
from thingc.documents.load.text import find_forbidden
from thingc.documents.load.yaml_scalars import core_value
from thingc.documents.load.yaml_tree import is_flow, read_flow
from thingc.documents.spec.annotation_types import FieldType, alternatives, model_keys, shape_of
from thingc.documents.spec.assembly import AssemblySpec
from thingc.documents.spec.settable_values import expand_short_form
from thingc.documents.spec.validation import validate_one
from thingc.model.resolve.document_scope import ResolveRun

FIXED = {
    "thingc": "change the key in the document",
    "name": "change the name in the document",
    "parameters": "set the parameter with `-p 'NAME=VALUE'`, or with `NAME: ...` in a variants document",
}
"""Keys of an assembly that the option `--set` cannot set, each with the reason."""


class PathNotFound(FrozenStruct, kw_only=False):
    """The message and the help text of the error for an option `--set` whose path does not exist in the document."""

    message: str
    help: Hint | None


def substitute(context: ResolveRun, document: Document, spec: AssemblySpec, values: Mapping[str, str]) -> tuple[Document, AssemblySpec]:
    """Insert values, which are strings, at paths of a document. Return the changed document and its validated model.

    If a value is invalid, or if the document itself has errors, report the errors and return the unchanged document and model.
    """
    if not values or context.doubts(document):
        return document, spec
    tree: Node = document.tree
    wrong = False
    for path, text in values.items():
        keys = tuple(path.split("."))
        place = option_span(context.from_top(path), shorten(text))
        if (inner := expand_short_form(tree, keys)) is not None:
            tree = _with_leaf(tree, *inner)
        known = context.quantities.get(context.from_top(path))
        read = _astray(document, tree, keys, text, context.from_top) or (
            _parse_setting(path, text, place) if known is None else ScalarNode(value=cast("Any", known), text=text, span=place)
        )
        if isinstance(read, PathNotFound):
            context.report_option_error(path, read.message, read.help)
            wrong = True
        else:
            tree = _with_leaf(tree, keys, read)
    if wrong or not isinstance(tree, MappingNode):
        return document, spec
    changed = replace(document, tree=tree)
    report = Report()
    sound = validate_one(changed, report)
    for fault in report.sorted_diagnostics():
        if fault.code is Code.CHOICE_OPTION:
            context.report.say(fault)
        else:  # the document is valid, but a value causes an error at another location
            context.report_option_error(closest(values, fault.path or ""), fault.message, fault.help)
    if not isinstance(sound, AssemblySpec):
        return document, spec
    return changed, sound.model_copy(update={"parameters": spec.parameters})  # parameters cannot be set by path


def _parse_setting(path: str, text: str, place: Span) -> Node | PathNotFound:
    """Parse the string of an option `--set`. `place`, the location of the option, is the location of all nodes in the result."""
    if (bad := find_forbidden(text)) is not None:
        return PathNotFound(f"`{path}`: {bad[1]}", "remove the character")
    if is_flow(text):
        tree = read_flow(text, place)
        return PathNotFound(f"`{path}` cannot be read: {tree.message}", tree.help) if isinstance(tree, Diagnostic) else tree
    try:
        return ScalarNode(value=core_value(text), text=text, span=place)
    except OverflowError:
        return PathNotFound(f"`{path}` must be a finite number, found `{shorten(text)}`", "write a finite number")


def _with_leaf(node: Node | None, keys: tuple[str, ...], leaf: Node) -> Node:
    """Return a copy of the tree `node` in which `leaf` is the value at the path `keys`. Missing mappings on the path are created."""
    if not keys:
        return leaf
    if isinstance(node, SequenceNode):
        place = node.index(keys[0])
        return structs.replace(
            node, items=tuple(_with_leaf(one, keys[1:], leaf) if k == place else one for k, one in enumerate(node.items)),
        )
    entries, spans = (dict(node.entries), dict(node.keys)) if isinstance(node, MappingNode) else ({}, {})
    if len(keys) == 1 or keys[0] not in spans:
        spans[keys[0]] = leaf.span
    entries[keys[0]] = _with_leaf(entries.get(keys[0]), keys[1:], leaf)
    return MappingNode(entries=entries, keys=spans, span=leaf.span if node is None else node.span)


def _astray(document: Document, tree: Node, keys: tuple[str, ...], text: str, from_top: Callable[[str], str]) -> PathNotFound | None:
    """Return an error with the nearest valid path if the path of an option does not exist.

    The path must be valid in the document model and, for named elements, exist in `tree`. Return None if the path is valid, or if `text` is
    a mapping or list. The function `from_top` converts a path in the document to a path that begins in the top document.
    """
    if keys[0] in FIXED:
        return PathNotFound(f"`{keys[0]}` cannot be set by a path", FIXED[keys[0]])
    node: Node | None = tree
    shape = shape_of(AssemblySpec)
    for depth, key in enumerate(keys):
        here = from_top(".".join(keys[:depth]))
        if isinstance(node, ScalarNode):
            return PathNotFound(f"the value `{shorten(node.text)}` of `{here}` has no keys", f"set `{here}`")
        branches = alternatives(shape)
        if isinstance(node, SequenceNode):
            if (index := node.index(key)) is None:
                last = len(node.items) - 1
                help = f"use an index, from `{here}.0` to `{here}.{last}`" if last >= 0 else f"set `{here}` as a whole"
                return PathNotFound(f"the list `{here}` has no item `{shorten(key)}`", help)
            listed = next((branch for branch in branches if branch.kind == "list"), None)
            node, shape = node.items[index], shape if listed is None else shape_of(listed.members[0])
            continue
        inner = next((branch for branch in branches if branch.model is not None and key in model_keys(branch.model)), None)
        if inner is not None:
            assert inner.model is not None
            shape = model_keys(inner.model)[key][0]
        elif (named := next((branch for branch in branches if branch.kind == "dict"), None)) is not None:
            written = entries_of(node)
            shape = shape_of(named.members[0])
            if shape.kind in ("model", "dict") and key not in written:
                return _no_such(document, keys, depth, written, from_top)
        elif keys[0] == "raw":  # this key accepts all values that its target accepts
            return None
        elif any(branch.model is not None for branch in branches):
            keys_here = [key for one in branches if one.model is not None for key in model_keys(one.model)]
            return _no_such(document, keys, depth, keys_here, from_top)
        else:
            return PathNotFound(f"the value of `{here}` has no keys", f"set `{here}`")
        node = node.entries.get(key) if isinstance(node, MappingNode) else None
    return None if is_flow(text) else _incomplete_path_error(from_top(".".join(keys)), shape, node)


def _no_such(document: Document, keys: tuple[str, ...], depth: int, known: Iterable[str], from_top: Callable[[str], str]) -> PathNotFound:
    """Return the error for an unknown key in a path.

    `depth` is the index of the key in the path, and `known` contains the valid keys at this position.
    """
    known, key = list(known), keys[depth]
    sections = [name for name, node in document.tree.entries.items() if isinstance(node, MappingNode) and keys[0] in node.entries]
    near = nearest(key, known)
    if depth == 0 and sections:
        help: Hint = f"did you mean `{from_top('.'.join((sections[0], *keys)))}`?"
    elif near is not None:
        help = f"did you mean `{from_top('.'.join((*keys[:depth], near, *keys[depth + 1:])))}`?"
    else:
        help = did_you_mean(key, known, what=keys[0] if depth == 1 else "keys")
    here = f"`{from_top('.'.join(keys[:depth]))}` has" if depth else "an assembly has"
    return PathNotFound(f"{here} no key `{shorten(key)}`", help)


def _incomplete_path_error(path: str, shape: FieldType, node: Node | None) -> PathNotFound | None:
    """Return the error for a path that ends at a mapping or at a list of mappings instead of a value."""
    branches = alternatives(shape)
    kinds = {branch.kind for branch in branches}
    if not kinds & {"model", "dict"} or kinds - {"model", "dict", "list"}:
        return None
    inside = [key for branch in branches if branch.model is not None for key in model_keys(branch.model)]
    inside += entries_of(node)
    named = [f"`{path}.{key}`" for key in dict.fromkeys(inside[:6])]
    help = f"set one of {', '.join(named)}, or the whole mapping: `{path}={{...}}`" if named else f"set the whole mapping: `{path}={{...}}`"
    return PathNotFound(f"expected the path of a value, found the mapping `{path}`", help)
