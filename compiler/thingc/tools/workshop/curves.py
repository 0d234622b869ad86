"""The curves of a drawing, the outlines of flat parts and the views of parts. All numbers are in SI units."""

from __future__ import annotations

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Vector

Point = tuple[float, float]


class StraightEdge(FrozenStruct, tag=True):
    """A straight edge of a drawing [m]."""

    start: Point
    end: Point


class Arc(FrozenStruct, tag=True):
    """A circular edge of a drawing [m], counterclockwise from the angle `start` to `end` [rad]. A circle extends from 0 to 2 pi."""

    centre: Point
    radius: float
    start: float
    end: float

    @property
    def full(self) -> bool:
        """Whether the arc is a circle."""
        return self.end - self.start > 6.283185


class Spline(FrozenStruct, tag=True):
    """A rational B-spline in a drawing: its control points [m] with weights, and its knots with repetitions."""

    degree: int
    points: tuple[Point, ...]
    weights: tuple[float, ...]
    knots: tuple[float, ...]


Curve = StraightEdge | Arc | Spline


class Sheet(FrozenStruct):
    """A part that can be cut from a sheet of the given `thickness` [m], seen from its upper side.

    `cut` contains the edges that pass through the sheet, and `engraved` the edges of pockets in the upper side. If the part is not flat,
    `reason` describes why, and there are no edges.
    """

    thickness: float = 0.0
    cut: tuple[Curve, ...] = ()
    engraved: tuple[Curve, ...] = ()
    reason: str = ""


VIEWS: dict[str, tuple[Vector, Vector]] = {
    "front": ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0)), "top": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)), "left": ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)),
    "isometric": ((1.0, -1.0, 1.0), (1.0, 1.0, 0.0)),
}
"""The views of a drawing: for each view, the direction towards the viewer and the direction to the right, in the frame of the part."""


class View(FrozenStruct):
    """The edges of a part in a view, in coordinates to the right and up [m]. Their origin is the origin of the part."""

    visible: tuple[Curve, ...]
    hidden: tuple[Curve, ...]


class Views(FrozenStruct):
    """The views of a part by the names in `VIEWS`."""

    by_name: dict[str, View]
