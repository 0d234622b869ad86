"""Compute a layered layout of an acyclic graph: the positions of boxes, labels and lines.

The method follows Sugiyama, Tagawa and Toda, "Methods for visual understanding of hierarchical system structures", 1981. The layer of a box
is given by the longest path to the box. A line has a dummy item in each layer that it crosses. Barycentres are used to reduce the number of
crossings. Labels are placed in their own layers between the layers of boxes. Therefore, boxes and labels do not overlap. The heights in a
layer are a least-squares fit to the heights of the neighbours. The fit keeps the order and the minimum distances of the items (pool
adjacent violators: Barlow et al., "Statistical Inference under Order Restrictions", 1972). The layers are columns from left to right. The
columns have this direction because graphs of assemblies are wide and shallow, and because lists of components are read downwards.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Sequence
from dataclasses import dataclass, field
from graphlib import TopologicalSorter

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import sum_of

GAP = 40.0
"""Smallest gap between two columns. The lines between the columns need this space."""
STEEP = 0.14
"""The largest height difference of a line between two columns is multiplied by this factor. The product is added to the gap between the
columns, which is at most `WIDEST`.
"""
WIDEST = 110.0
ROW = 14.0
"""Minimum gap between two boxes in a column."""
LINE_ROW = 10.0
"""Minimum gap between a line and its neighbour in a column."""
SWEEPS = 12
PORT = 9.0
"""Distance between the ends of two lines at the same side of a box."""


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


@dataclass(slots=True)
class _Item:
    """An item in a column: a box, a label, or a line that crosses the column. For an item that is a line, neither `box` nor `label` is
    set.
    """

    column: int
    size: Size
    box: int | None = None
    y: float = 0.0  # of the centre of the item
    before: list[int] = field(default_factory=list)
    after: list[int] = field(default_factory=list)


def draw(boxes: Sequence[Size], lines: Sequence[Line]) -> Drawing:
    """Compute the layout of an acyclic graph. The result is the same in every run. Raises `CycleError` if the graph has a cycle."""
    ranks = _ranks(len(boxes), lines)
    items = [_Item(column=2 * ranks[k], size=size, box=k) for k, size in enumerate(boxes)]
    chains = [_chain(items, line, ranks) for line in lines]
    columns = _first_order(items, lines, chains)
    _reduce_crossings(items, columns)
    _set_heights(items, columns)
    return _finish(items, columns, chains)


def _ranks(count: int, lines: Sequence[Line]) -> list[int]:
    """Return the column of each box. The column of a box is the length of the longest path that ends at the box."""
    before: dict[int, list[int]] = {k: [] for k in range(count)}
    for line in lines:
        before[line.target].append(line.source)
    ranks = [0] * count
    for k in TopologicalSorter(before).static_order():
        ranks[k] = max((ranks[source] + 1 for source in before[k]), default=0)
    return ranks


def _chain(items: list[_Item], line: Line, ranks: Sequence[int]) -> list[int]:
    """Return the items along a line: the source, the label, a dummy item in each column that the line crosses, and the target."""
    chain = [line.source]
    for column in range(2 * ranks[line.source] + 1, 2 * ranks[line.target]):
        size = line.label if len(chain) == 1 else Size(width=0.0, height=0.0)
        items.append(_Item(column=column, size=size))
        chain.append(len(items) - 1)
    chain.append(line.target)
    for a, b in zip(chain, chain[1:]):
        items[a].after.append(b)
        items[b].before.append(a)
    return chain


def _first_order(items: Sequence[_Item], lines: Sequence[Line], chains: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return the initial order of the items in each column. The order follows the documents, depth first."""
    columns: list[list[int]] = [[] for _ in range(1 + max((item.column for item in items), default=-1))]
    leaving: dict[int, list[int]] = {}
    entered = {line.target for line in lines}
    for number, line in enumerate(lines):
        leaving.setdefault(line.source, []).append(number)
    seen: set[int] = set()
    boxes = [k for k, item in enumerate(items) if item.box is not None]
    stack: list[tuple[int, ...]] = [(k,) for k in reversed(boxes) if k not in entered]
    while stack:
        for k in stack.pop():
            if k in seen:
                continue
            seen.add(k)
            columns[items[k].column].append(k)
            if items[k].box is not None:
                stack.extend(tuple(chains[number][1:]) for number in reversed(leaving.get(k, [])))
    return columns


def _crossings(items: Sequence[_Item], columns: Sequence[Sequence[int]]) -> int:
    """Return the number of crossings of lines between neighbouring columns.

    Two lines cross if the order of their ends is inverted. The inversions are counted by insertion.
    """
    crossings = 0
    for left, right in zip(columns, columns[1:]):
        place = {k: position for position, k in enumerate(right)}
        ends = [end for k in left for end in sorted(place[b] for b in items[k].after)]
        met: list[int] = []
        for end in ends:
            crossings += len(met) - bisect_left(met, end + 1)
            insort(met, end)
    return crossings


def _reduce_crossings(items: Sequence[_Item], columns: list[list[int]]) -> None:
    """Reorder the items of each column to reduce the number of crossings.

    The function processes the columns from left to right and from right to left, several times. In each step, the items of a column are
    sorted by the mean position of their neighbours in the previous column. At the end, the columns get the order with the fewest crossings.
    """
    best, fewest = [list(column) for column in columns], _crossings(items, columns)
    for sweep in range(SWEEPS):
        if fewest == 0:
            break
        forward = sweep % 2 == 0
        for number in range(1, len(columns)) if forward else range(len(columns) - 2, -1, -1):
            fixed = {k: float(position) for position, k in enumerate(columns[number - 1 if forward else number + 1])}
            means: dict[int, float] = {}
            for position, k in enumerate(columns[number]):
                neighbours = items[k].before if forward else items[k].after
                means[k] = sum_of(fixed[n] for n in neighbours) / len(neighbours) if neighbours else float(position)
            columns[number].sort(key=means.__getitem__)
        now = _crossings(items, columns)
        if now < fewest:
            best, fewest = [list(column) for column in columns], now
    columns[:] = best


def _separation(a: _Item, b: _Item) -> float:
    """Return the minimum distance between the centres of two items that are neighbours in a column."""
    gap = ROW if a.box is not None and b.box is not None else LINE_ROW
    return (a.size.height + b.size.height) / 2.0 + gap


def _set_heights(items: Sequence[_Item], columns: Sequence[Sequence[int]]) -> None:
    """Set the vertical positions of all items.

    Each item is placed as near to its neighbours as the order and the minimum distances allow.
    """
    for column in columns:
        for above, k in zip(column, column[1:]):
            items[k].y = items[above].y + _separation(items[above], items[k])
    for sweep in range(2 * SWEEPS):
        last = sweep == 2 * SWEEPS - 1
        order = range(len(columns)) if sweep % 2 == 0 else range(len(columns) - 1, -1, -1)
        for number in order:
            column = columns[number]
            wanted, weights = [], []
            for k in column:
                before, after = items[k].before, items[k].after
                neighbours = (before or after) if sweep % 2 == 0 else (after or before)
                if last and items[k].box is None:
                    neighbours = before + after
                wanted.append(sum_of(items[n].y for n in neighbours) / len(neighbours) if neighbours else items[k].y)
                weights.append(float(max(1, len(neighbours))) * (1.0 if items[k].box is not None else 2.0))
            separations = [_separation(items[a], items[b]) for a, b in zip(column, column[1:])]
            for k, y in zip(column, _nearest(wanted, weights, separations)):
                items[k].y = y


def _nearest(wanted: Sequence[float], weights: Sequence[float], separations: Sequence[float]) -> list[float]:
    """Return the positions that are nearest to `wanted` (weighted least squares) and satisfy `place[k + 1] >= place[k] + separations[k]`.
    """
    offsets = [0.0]
    for separation in separations:
        offsets.append(offsets[-1] + separation)
    blocks: list[tuple[float, float, int]] = []  # mean, weight, number
    for want, weight, offset in zip(wanted, weights, offsets):
        mean, total, count = want - offset, weight, 1
        while blocks and blocks[-1][0] > mean:
            other, heavy, many = blocks.pop()
            mean, total, count = (mean * total + other * heavy) / (total + heavy), total + heavy, count + many
        blocks.append((mean, total, count))
    places = [mean for mean, _, count in blocks for _ in range(count)]
    return [place + offset for place, offset in zip(places, offsets)]


def _ports(items: Sequence[_Item], k: int, neighbours: Sequence[int]) -> dict[int, float]:
    """Return the vertical position at which each line meets the side of a box.

    The positions at the box have the same order as the other ends of the lines.
    """
    ordered = sorted(neighbours, key=lambda n: (items[n].y, n))
    room = max(items[k].size.height - 14.0, 0.0)
    step = min(PORT, room / max(1, len(ordered) - 1))
    return {n: items[k].y + step * (position - (len(ordered) - 1) / 2.0) for position, n in enumerate(ordered)}


def _finish(items: Sequence[_Item], columns: Sequence[Sequence[int]], chains: Sequence[Sequence[int]]) -> Drawing:
    """Arrange the columns side by side, move the drawing to (0, 0), and compute the routes of the lines."""
    top = min((item.y - item.size.height / 2.0 for item in items), default=0.0)
    for item in items:
        item.y = round(item.y - top, 1)
    lefts, widths, x = [], [], 0.0
    for column in columns:
        widths.append(max((items[k].size.width for k in column), default=0.0))
        lefts.append(round(x, 1))
        rise = max((abs(items[k].y - items[n].y) for k in column for n in items[k].after), default=0.0)
        x += widths[-1] + min(GAP + STEEP * rise, WIDEST)
    rectangles = [
        Rectangle(
            x=lefts[item.column],
            y=round(item.y - item.size.height / 2.0, 1),
            width=item.size.width,
            height=item.size.height,
        )
        for item in items
    ]
    boxes = [k for k, item in enumerate(items) if item.box is not None]
    leaving = {k: _ports(items, k, items[k].after) for k in boxes}
    entering = {k: _ports(items, k, items[k].before) for k in boxes}
    routes = []
    for chain in chains:
        source, target = chain[0], chain[-1]
        stretches = []
        for k in chain[:-1]:
            y = items[k].y if k != source else leaving[k][chain[1]]
            begin = lefts[items[k].column] + (items[k].size.width if k == source else 0.0)
            stretches.append((begin, lefts[items[k].column] + widths[items[k].column], y))
        x_end = lefts[items[target].column]
        stretches.append((x_end, x_end, entering[target][chain[-2]]))
        routes.append(Route(stretches=tuple(stretches), label=rectangles[chain[1]]))
    return Drawing(
        width=max((left + width for left, width in zip(lefts, widths)), default=0.0),
        height=max((item.y + item.size.height / 2.0 for item in items), default=0.0),
        boxes=tuple(rectangle for rectangle, item in zip(rectangles, items) if item.box is not None),
        routes=tuple(routes),
    )
