"""Compute a layered layout of an acyclic graph: the positions of boxes, labels and lines.

The columns are from left to right. The column of a box is given by the longest path to the box. Each box has a row of its own, in the order
in which a depth-first search visits the boxes. The labels of the lines that lead to a box are in its row, to the left of the box. Lines
change their row only in the gap after a column, to the left of the labels. Therefore, lines do not cross boxes or labels, and boxes and
labels do not overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from graphlib import TopologicalSorter

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import maximum, sum_of

ROW = 14.0
"""Gap between two rows."""
LINE_ROW = 10.0
"""Gap between two labels in a row."""
LANE = 7.0
"""Horizontal distance between the lines of two boxes in a column, at the places where these lines change their row."""
BEND = 32.0
"""Width of the curve with which a line changes its row."""
ARROW = 24.0
"""Gap between the labels of a column and its boxes."""
PORT = 9.0
"""Distance between the ends of two lines at a box."""


class Size(FrozenStruct):
    """The size of a box or a label."""

    width: float
    height: float


class Line(FrozenStruct):
    """A line between two boxes, with the size of its label. `source` and `target` are the indices of the boxes."""

    source: int
    target: int
    label: Size


class Rectangle(FrozenStruct):
    """A rectangle. The upper left corner of the rectangle is at (`x`, `y`). The y axis of the drawing points down."""

    x: float
    y: float
    width: float
    height: float


class Route(FrozenStruct):
    """The drawn path of a line between two boxes.

    `stretches` contains horizontal segments `(x0, x1, y)`, from left to right. The segments are connected by curves. `label` is the
    rectangle of the label, which is on one of the segments.
    """

    stretches: tuple[tuple[float, float, float], ...]
    label: Rectangle


class Drawing(FrozenStruct):
    """The finished layout of a graph.

    The boxes are in the given order, and the routes are in the order of the lines. The size of the drawing is also included. The origin of
    the drawing is (0, 0).
    """

    width: float
    height: float
    boxes: tuple[Rectangle, ...]
    routes: tuple[Route, ...]


def draw(boxes: Sequence[Size], lines: Sequence[Line]) -> Drawing:
    """Compute the layout of an acyclic graph. The result is the same in every run. Raises `CycleError` if the graph has a cycle."""
    columns = _columns(len(boxes), lines)
    leaving: list[list[int]] = [[] for _ in boxes]
    entering: list[list[int]] = [[] for _ in boxes]
    for number, line in enumerate(lines):
        leaving[line.source].append(number)
        entering[line.target].append(number)
    places, labels, height = _rows(boxes, lines, leaving, entering)
    left = right = 0.0
    lanes: dict[int, float] = {}  # where the lines of a box begin to change their row
    for column in range(max(columns, default=-1) + 1):
        members = [k for k, own in enumerate(columns) if own == column]
        parents, into = [k for k in members if leaving[k]], [number for k in members for number in entering[k]]
        left = round(left + max((labels[number].width + ARROW for number in into), default=0.0), 1)
        right = left + max(places[k].width for k in members)
        places |= {k: replace(places[k], x=left) for k in members}
        labels |= {number: replace(labels[number], x=round(left - ARROW - labels[number].width, 1)) for number in into}
        lanes |= {k: right + LANE * place for place, k in enumerate(parents, 1)}
        left = right + LANE * (1 + len(parents)) + BEND
    routes = []
    for number, line in enumerate(lines):
        source, target, label = places[line.source], places[line.target], labels[number]
        begin, port = lanes[line.source], entering[line.target].index(number) - (len(entering[line.target]) - 1) / 2.0
        step = min(PORT, (target.height - PORT) / len(entering[line.target]))
        routes.append(Route(label=label, stretches=(
            (source.x + source.width, begin, source.y + source.height / 2.0),
            (begin + BEND, label.x + label.width, label.y + label.height / 2.0),
            (target.x, target.x, target.y + target.height / 2.0 + step * port),
        )))
    return Drawing(width=right, height=height, boxes=tuple(places[k] for k in range(len(boxes))), routes=tuple(routes))


def _columns(count: int, lines: Sequence[Line]) -> list[int]:
    """Return the column of each box: the length of the longest path that ends at the box."""
    before: dict[int, list[int]] = {k: [] for k in range(count)}
    for line in lines:
        before[line.target].append(line.source)
    columns = [0] * count
    for k in TopologicalSorter(before).static_order():
        columns[k] = max((columns[source] + 1 for source in before[k]), default=0)
    return columns


def _rows(
    boxes: Sequence[Size], lines: Sequence[Line], leaving: Sequence[Sequence[int]], entering: Sequence[Sequence[int]],
) -> tuple[dict[int, Rectangle], dict[int, Rectangle], float]:
    """Place the boxes and the labels of the lines vertically. Return them by number, with x = 0, and the height of all rows."""
    places: dict[int, Rectangle] = {}
    labels: dict[int, Rectangle] = {}
    bottom = -ROW
    waiting = [k for k in reversed(range(len(boxes))) if not entering[k]]
    while waiting:
        k = waiting.pop()
        if k in places:
            continue
        waiting += [lines[number].target for number in reversed(leaving[k])]
        stack = sum_of(lines[number].label.height + LINE_ROW for number in entering[k]) - LINE_ROW
        top, row = bottom + ROW, maximum(boxes[k].height, stack)
        bottom = top + row
        places[k] = Rectangle(x=0.0, y=round(top + (row - boxes[k].height) / 2.0, 1), width=boxes[k].width, height=boxes[k].height)
        top += (row - stack) / 2.0
        for number in entering[k]:
            size = lines[number].label
            labels[number] = Rectangle(x=0.0, y=round(top, 1), width=size.width, height=size.height)
            top += size.height + LINE_ROW
    return places, labels, maximum(bottom, 0.0)
