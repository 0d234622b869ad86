"""Compose a page of SVG text in millimetres: lines, curves of views, and labels that do not overlap each other."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from importlib import resources

import numpy as np
from scipy.interpolate import BSpline

from thingc.base.numeric import dist
from thingc.base.safe_text import html_text
from thingc.tools.workshop.curves import Arc, Curve, Point, Spline, StraightEdge

STYLE = resources.files(__package__).joinpath("drawing.css").read_text(encoding="utf-8")
PIECES = 48
"""Number of straight pieces for a spline. A spline with many knots has at least two pieces for each knot span."""
Box = tuple[float, float, float, float]


class Placement:
    """The place of a view on the page: `scale` in [mm] of the page for each metre, and the place of the origin of the view on the page."""

    def __init__(self, scale: float, origin: Point) -> None:
        self.scale, self.origin = scale, origin

    def point(self, point: Point) -> Point:
        """Convert a point of the view [m] to a point of the page [mm]."""
        return self.origin[0] + self.scale * point[0], self.origin[1] - self.scale * point[1]

    def path(self, curves: Iterable[Curve]) -> str:
        """Return the data of a path with all curves."""
        return "".join(map(self._curve, curves))

    def _curve(self, curve: Curve) -> str:
        match curve:
            case StraightEdge(start=start, end=end):
                return _polyline([self.point(start), self.point(end)])
            case Arc(centre=centre, radius=radius, start=first, end=last):
                angles = [first, (first + last) / 2.0, last]
                places = [self.point((centre[0] + radius * math.cos(a), centre[1] + radius * math.sin(a))) for a in angles]
                size = number(radius * self.scale)
                return f"M{pair(places[0])}" + "".join(f"A{size} {size} 0 0 0 {pair(place)}" for place in places[1:])
            case Spline():
                return _polyline([self.point(point) for point in _sample(curve)])


def _sample(curve: Spline) -> list[Point]:
    weights = np.array(curve.weights)[:, None]
    spline = BSpline(np.array(curve.knots), np.hstack([np.array(curve.points) * weights, weights]), curve.degree)
    knots = np.unique(curve.knots)
    steps = np.linspace(0.0, len(knots) - 1.0, max(PIECES, 2 * (len(knots) - 1)) + 1)
    return [(float(x / w), float(y / w)) for x, y, w in spline(np.interp(steps, np.arange(len(knots)), knots))]


def number(value: float) -> str:
    """Format a length on the page, rounded to 1 um."""
    return f"{round(value, 3) + 0.0:g}"


def pair(point: Point) -> str:
    """Format a point on the page."""
    return f"{number(point[0])} {number(point[1])}"


def _polyline(points: Sequence[Point]) -> str:
    return "M" + "L".join(map(pair, points))


class SvgPage:
    """A page whose elements are added in order. `taken` contains the boxes of labels, which other labels avoid."""

    def __init__(self, width: float, height: float, title: str) -> None:
        self.size = (width, height)
        self.taken: list[Box] = []
        self._lines = [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" viewBox="0 0 {width:g} {height:g}">',
            f"<title>{html_text(title)}</title>", f"<style>{STYLE}</style>",
        ]

    def path(self, data: str, kind: str = "") -> None:
        """Add a path with a class of `STYLE`, unless it is empty."""
        if data:
            self._lines.append(f'<path class="{kind}" d="{data}"/>' if kind else f'<path d="{data}"/>')

    def line(self, *points: Point, kind: str = "") -> None:
        """Add a line through points."""
        self.path(_polyline(points), kind)

    def rectangle(self, box: Box, kind: str = "") -> None:
        """Add a rectangle between two corners."""
        x, y, right, bottom = box
        self.path(f"M{pair((x, y))}H{number(right)}V{number(bottom)}H{number(x)}Z", kind)

    def circle(self, centre: Point, radius: float, kind: str = "") -> None:
        """Add a circle."""
        self._lines.append(f'<circle class="{kind}" cx="{number(centre[0])}" cy="{number(centre[1])}" r="{number(radius)}"/>')

    def text(self, place: Point, text: str, kind: str = "", anchor: str = "start", *, upright: bool = False) -> None:
        """Add text, which is rotated by 90 degrees if `upright` is True. `anchor` is `start`, `middle` or `end`."""
        x, y = map(number, place)
        turn = f' transform="rotate(-90 {x} {y})"' if upright else ""
        self._lines.append(f'<text class="{kind}" x="{x}" y="{y}" text-anchor="{anchor}"{turn}>{html_text(text)}</text>')

    def dimension(self, first: Point, last: Point, offset: float, text: str) -> None:
        """Add a dimension between two points on a horizontal or vertical line, at a distance from them."""
        upright = first[0] == last[0]
        x, y = (offset, 0.0) if upright else (0.0, offset)
        a, b = (first[0] + x, first[1] + y), (last[0] + x, last[1] + y)
        over = math.copysign(1.5, offset)
        for start, end in ((first, a), (last, b)):
            self.line(start, (end[0] + over, end[1]) if upright else (end[0], end[1] + over))
        self.line(a, b)
        for tip, sign in ((a, 1.0), (b, -1.0)):
            along = math.copysign(2.5, (b[1] - a[1]) if upright else (b[0] - a[0])) * sign
            corners = ((-0.5, along), (0.5, along)) if upright else ((along, -0.5), (along, 0.5))
            self.path(_polyline([tip, *((tip[0] + dx, tip[1] + dy) for dx, dy in corners)]) + "Z", "solid")
        middle = ((a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0)
        self.text((middle[0] - 1.0, middle[1]) if upright else (middle[0], middle[1] - 1.0), text, "", "middle", upright=upright)

    def origin(self, place: Point) -> None:
        """Add the symbol of the origin: a circle with two black quarters."""
        x, y = map(number, place)
        self.circle(place, 1.2)
        self.path(f"M{x} {y}v-1.2a1.2 1.2 0 0 1 1.2 1.2zM{x} {y}v1.2a1.2 1.2 0 0 1 -1.2 -1.2z", "solid")

    def label(self, place: Point, text: str, distance: float, *, boxed: bool) -> None:
        """Add a label at a free place near a point, with a line from the point. Its box keeps a distance from the point."""
        width, height = 1.5 + 1.7 * len(text), 3.6
        angles = [math.radians(45.0 + 30.0 * k) for k in range(12)]
        boxes = [
            (x - width / 2.0, y - height / 2.0, x + width / 2.0, y + height / 2.0)
            for radius in range(12) for angle in angles
            for x, y in [(
                place[0] + (distance + 2.5 * radius + 3.0) * math.cos(angle), place[1] - (distance + 2.5 * radius + 3.0) * math.sin(angle),
            )]
        ]
        box = next((one for one in boxes if not any(_overlap(one, other) for other in self.taken)), boxes[0])
        self.taken.append(box)
        centre = ((box[0] + box[2]) / 2.0, (box[1] + box[3]) / 2.0)
        far = dist(place, centre)
        start = (place[0] + (centre[0] - place[0]) * distance / far, place[1] + (centre[1] - place[1]) * distance / far)
        self.line(start, centre)
        self.rectangle(box, "label" if boxed else "number")
        self.text((centre[0], centre[1] + 1.05), text, "", "middle")

    def table(self, place: Point, widths: Sequence[float], rows: Sequence[Sequence[str]], bottom: float) -> float:
        """Add a table, whose first row is its head. Return its lower end, which is above `bottom` for any number of rows."""
        pitch = min(4.6, (bottom - place[1]) / len(rows))
        for index, row in enumerate(rows):
            y = place[1] + pitch * (index + 1)
            x = place[0]
            for width, cell in zip(widths, row, strict=True):
                self.text((x + 1.0, y - 0.3 * pitch), cell[: int(width / 1.45)], "head" if index == 0 else "small" if pitch < 4.0 else "")
                x += width
            self.line((place[0], y), (x, y))
        return place[1] + pitch * len(rows)

    def content(self) -> bytes:
        """Return the content of the SVG file."""
        return "\n".join([*self._lines, "</svg>", ""]).encode()


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
