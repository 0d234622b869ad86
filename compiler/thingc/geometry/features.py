"""The features of a B-rep: cylinders and planar faces by which parts touch, and the outlines of flat parts. All numbers are in SI units."""

from __future__ import annotations

import math

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Pose, Vector, added, dot


class CentreLine(FrozenStruct):
    """A line: its closest point to the origin, and its direction, of which the last coordinate that is not zero is positive."""

    point: Vector
    axis: Vector

    @staticmethod
    def through(point: Vector, axis: Vector) -> CentreLine:
        """Return the line through a point in the direction of a unit vector."""
        x, y, z = (round(value, 12) + 0.0 for value in axis)
        if next(value for value in (z, y, x) if value) < 0.0:
            x, y, z = -x + 0.0, -y + 0.0, -z + 0.0
        return CentreLine(point=added(point, (x, y, z), -dot(point, (x, y, z))), axis=(x, y, z))

    def interval(self, point: Vector, axis: Vector, ends: tuple[float, float]) -> tuple[float, float]:
        """Convert distances from a point along a vector, both on this line, to distances from the point of this line."""
        shift, sign = dot(point, self.axis), math.copysign(1.0, dot(axis, self.axis))
        lower, upper = sorted(shift + sign * end for end in ends)
        return lower, upper


class Cylinder(FrozenStruct):
    """A cylindrical surface of a part, which may consist of several faces.

    The surface extends from `lower` to `upper` [m] along its axis `line`, relative to the point of the line. `sweep` [rad] is the angle
    that the surface covers on average. A `hollow` cylinder is the wall of a hole. `through` is True for a hole that is open at both ends.
    """

    line: CentreLine
    radius: float
    lower: float
    upper: float
    sweep: float
    hollow: bool
    through: bool


class PlanarFace(FrozenStruct):
    """A planar face of a part: its outward `normal`, its centre, its area [m^2], and its boundary as polygons."""

    normal: Vector
    centre: Vector
    area: float
    loops: tuple[tuple[Vector, ...], ...]


class Features(FrozenStruct):
    """The cylinders and planar faces of a part, in a deterministic order."""

    cylinders: tuple[Cylinder, ...] = ()
    planes: tuple[PlanarFace, ...] = ()


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


class StepPart(FrozenStruct):
    """A part of a STEP assembly. `sha256` is the digest of its own STEP file in the store.

    `colors` contains the colours of the part (`#rrggbb`), the colour of the largest area first. `density` is in [kg/m^3].
    """

    name: str
    sha256: str
    colors: tuple[str, ...]
    material: str | None
    density: float | None
    features: Features


class StepChild(FrozenStruct):
    """A part or a nested assembly in an assembly: its name, its pose in the assembly, and its index in `parts` or `assemblies`."""

    name: str
    pose: Pose
    part: int | None = None
    assembly: int | None = None


class StepGroup(FrozenStruct):
    """An assembly, and its parts and nested assemblies."""

    name: str
    children: tuple[StepChild, ...]


class StepAssembly(FrozenStruct):
    """The content of a STEP file. `root` is the index of the outermost assembly. `left_out` lists shapes without solids by name.

    `merged` maps the names of parts to the names of equal parts that replace them.
    """

    parts: tuple[StepPart, ...]
    assemblies: tuple[StepGroup, ...]
    root: int
    left_out: tuple[str, ...] = ()
    merged: dict[str, str] = {}
