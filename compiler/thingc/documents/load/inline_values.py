"""A mapping or a list on one line, typed in place of what a document says: `{on: floor}`."""

from __future__ import annotations

from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic, Report
from thingc.base.source import MappingNode, Node, SequenceNode, Span
from thingc.documents.load.text import Source


def is_flow(text: str) -> bool:
    """Whether a text is written as a mapping or a list in YAML's flow style, well or not: `[draft] arm` is not."""
    return text.startswith("{") or text.startswith("[") and text.endswith("]")


def read_flow(text: str, place: Span) -> Node | Diagnostic:
    """The tree of such a text, all of it at one place; else the first thing that is wrong with it."""
    from thingc.documents.load.yaml_tree import read_yaml

    report = Report()
    tree = read_yaml(Source("", text), report)
    return report.diagnostics[0] if tree is None or report.failed else _at(tree, place)


def _at(node: Node, place: Span) -> Node:
    if isinstance(node, MappingNode):
        entries = {key: _at(one, place) for key, one in node.entries.items()}
        return replace(node, entries=entries, keys=dict.fromkeys(entries, place), span=place)
    if isinstance(node, SequenceNode):
        return replace(node, items=tuple(_at(one, place) for one in node.items), span=place)
    return replace(node, span=place)
