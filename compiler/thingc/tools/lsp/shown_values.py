"""Compute the values that an editor displays: parameters, expressions, inlay hints and frames of mounts."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

from thingc.base.pose import Pose, Vector, axis_name, transpose
from thingc.base.source import MappingNode, Path, ScalarNode, node_at, text_of, walk
from thingc.base.units import Quantity, UnitError, parse_quantity
from thingc.documents.expressions.evaluation import ExpressionValue, evaluate
from thingc.documents.expressions.parsing import parse_expression
from thingc.documents.expressions.terms import ExpressionError
from thingc.geometry.record import PartDefinition, PartRecord, PartSchema
from thingc.model.resolve.types import AssemblyDefinition
from thingc.tools.lsp.analysis import Analysis
from thingc.tools.lsp.cursor import Cursor
from thingc.tools.lsp.positions import TextPlace
from thingc.tools.schemas.parameter_schemas import symbols_of

MAX_ITEMS = 1000
"""Maximum number of items of a `repeat`. Further items are ignored."""


def parameters_of(analysis: Analysis) -> Mapping[str, ExpressionValue]:
    """Return the names and the values of all parameters of the document."""
    return analysis.known.compute_once("parameters", lambda: _parameter_values(analysis.known.tree))


def evaluate_expression(analysis: Analysis, path: Path, text: str) -> tuple[ExpressionValue, ...]:
    """Evaluate the quantity or expression at a path in the document. Return an empty tuple for an invalid text.

    Inside a `repeat`, return the values for the first and the last item if these values differ.
    """
    parameters, tree = parameters_of(analysis), analysis.known.tree
    expression = text.lstrip().startswith("=")
    repeat = node_at(tree, (*path[:2], "repeat")) if expression and tree is not None else None
    if not isinstance(repeat, MappingNode) or path[2:3] == ("repeat",):
        values = parse_expression_value(text, parameters)
        return () if values is None else (values,)
    index = text_of(repeat.entries.get("as")) or "i"
    count = parse_expression_value(text_of(repeat.entries.get("count")), parameters)
    last = min(count.value, MAX_ITEMS) - 1 if isinstance(count, Quantity) else 0
    ends = [
        parse_expression_value(text, {**parameters, index: Quantity(float(number))}) for number in dict.fromkeys((0, max(0, int(last))))
    ]
    return tuple(dict.fromkeys(one for one in ends if one is not None))


def bounds_of(analysis: Analysis, cursor: Cursor) -> tuple[float, float]:
    """Return the lower and upper bound, in SI units, of the parameter at the cursor, which belongs to a part or nested document.

    Unknown bounds are infinite.
    """
    path, known = cursor.path, analysis.known
    low = high = None
    if len(path) == 4 and path[0] == "components" and path[2] == "params":
        part = known.schemas.get(cursor.scalars.get((*path[:2], "part"), ""))
        parameter = next((one for one in part.parameters if one.name == path[3]), None) if isinstance(part, PartSchema) else None
        if parameter is not None:
            low, high = (None if bound is None else float(bound) for bound in (parameter.minimum, parameter.maximum))
    elif len(path) == 4 and path[0] == "components" and path[2] == "parameters":
        name = cursor.scalars.get((*path[:2], "assembly"), "")
        document = known.document(os.path.normpath(os.path.join(os.path.dirname(known.path), name)))
        ends = [None if document is None else node_at(document.tree, ("parameters", str(path[3]), end)) for end in ("min", "max")]
        values = [parse_expression_value(text_of(end), {}) for end in ends]
        low, high = (value.value if isinstance(value, Quantity) else None for value in values)
    return -math.inf if low is None else low, math.inf if high is None else high


def parse_expression_value(text: str, names: Mapping[str, ExpressionValue]) -> ExpressionValue | None:
    """Parse a quantity, or evaluate an expression that can contain the given names. Return None if the text is invalid."""
    try:
        stripped = text.strip()
        return evaluate(parse_expression(stripped), names) if stripped.startswith("=") else parse_quantity(stripped)
    except (ExpressionError, UnitError):
        return None


def format_values(values: tuple[ExpressionValue, ...]) -> str:
    """Format values on one line: `42 mm`, `50 g ... 100 g`."""
    return " ... ".join(
        one.format(6) if isinstance(one, Quantity) else str(one).lower() if isinstance(one, bool) else one for one in values
    )


def _parameter_values(tree: MappingNode | None) -> dict[str, ExpressionValue]:
    texts = {} if tree is None else {name: one.value for name, one in symbols_of(tree).parameters.items()}
    known: dict[str, ExpressionValue] = {}
    count = -1
    while count < len(known):  # parameters can be in any order: each iteration evaluates parameters whose names are known
        count = len(known)
        for name, text in texts.items():
            if name not in known and (value := parse_expression_value(text, known)) is not None:
                known[name] = value
    return known


_TYPE = 1


def hints(analysis: Analysis, text: str, place: TextPlace, params: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the inlay hints for a range of the document, which show the values of expressions.

    If the text cannot be parsed, hints for unchanged lines are computed from the last parsable text.
    """
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
                "position": lines.position(line, node.span.end_column), "label": f"= {format_values(values)}", "kind": _TYPE,
                "paddingLeft": True,
            })
    return answer


Steps = tuple[str, ...]


def mount_frame_text(analysis: Analysis, reference: str) -> str:
    """Format the frame of the mount `component.mount` relative to its component: `(12, 0, 30) mm, z along +y`.

    Return an empty string for an unknown mount. For a mount in a nested assembly, the text contains the part to which the frame is
    relative.
    """
    model = analysis.known.model
    place = None if model is None else _find_frame(analysis.known, model, reference.split("."), ())
    if place is None:
        return ""
    pose, owner = place
    return format_frame(pose) + (f" of `{'.'.join(owner)}`" if len(owner) > 1 else "")


def format_frame(pose: Pose) -> str:
    """Format the origin of a frame and the direction of its z axis on one line."""
    return f"{format_position(pose.translation)}, z along {format_direction(transpose(pose.rotation)[2])}"


def format_position(vector: Vector) -> str:
    """Convert a position from metres to a text in millimetres, such as `(12, 0, 30) mm`."""
    return f"({', '.join(_format_number(1000.0 * value) for value in vector)}) mm"


def _find_frame(analysis: Analysis, model: AssemblyDefinition, steps: Sequence[str], outer: Steps) -> tuple[Pose, Steps] | None:
    """Return the frame of a mount, and the path of the component to which the frame is relative. Return None for an unknown mount."""
    component = next((one for one in model.components if one.name == steps[0]), None)
    rest = steps[1:]
    if component is None or not rest:
        return None
    owner = (*outer, component.name)
    definition = component.definition
    if rest[0] in component.mounts and len(rest) == 1:
        return component.mounts[rest[0]].pose, owner
    if isinstance(definition, AssemblyDefinition):
        exported = definition.mounts.get(rest[0]) if len(rest) == 1 else None
        return _find_frame(analysis, definition, exported.text.split(".") if exported is not None else rest, owner)
    record = analysis.records.get(definition.text) if isinstance(definition, PartDefinition) else None
    if len(rest) > 1 or not isinstance(record, PartRecord) or not record.exact or rest[0] not in record.mounts:
        return None
    return record.mounts[rest[0]].pose, owner


def format_direction(direction: Vector) -> str:
    """Format a unit vector as a direction: `+x`, `-z`, `(0.6, 0, 0.8)`."""
    return axis_name(direction) or f"({', '.join(_format_number(value) for value in direction)})"


def _format_number(value: float) -> str:
    return f"{value:z.4g}"
