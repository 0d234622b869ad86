"""Inlay hints: behind every expression what it comes to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thingc.base.source import ScalarNode, walk
from thingc.tools.lsp.analysis import Analysis
from thingc.tools.lsp.expression_values import evaluate_expression, shown
from thingc.tools.lsp.positions import TextPlace

_TYPE = 1


def hints(analysis: Analysis, text: str, place: TextPlace, params: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The hints in the range that is asked for. While the text is broken, those of the last sound one on lines that are as they were."""
    known = analysis.known
    if known.tree is None:
        return []
    lines, before = analysis.lines(), known.lines()
    first, last = (lines.place(params["range"][end]).line for end in ("start", "end"))
    answer = []
    for path, node in walk(known.tree):
        if not isinstance(node, ScalarNode) or not isinstance(node.value, str) or not node.value.startswith("="):
            continue
        line = node.span.end_line
        if not first <= line <= last or lines.line(line) != before.line(line):
            continue
        values = evaluate_expression(known, path, node.value)
        if values:
            answer.append({
                "position": lines.position(line, node.span.end_column), "label": f"= {shown(values)}", "kind": _TYPE, "paddingLeft": True,
            })
    return answer
