"""The features of a B-rep: cylinders and planar faces by which parts touch. All numbers are in SI units."""

from __future__ import annotations

import math

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Vector, add_scaled, dot

HOLE = 4.0
"""A hollow cylinder that covers at least this angle [rad] on average is a hole. Slots, chamfers and other holes can cut its wall."""


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
        return CentreLine(point=add_scaled(point, (x, y, z), -dot(point, (x, y, z))), axis=(x, y, z))

    def interval(self, point: Vector, axis: Vector, ends: tuple[float, float]) -> tuple[float, float]:
        """Convert distances from a point along a vector, both on this line, to distances from the point of this line."""
        shift, sign = dot(point, self.axis), math.copysign(1.0, dot(axis, self.axis))
        lower, upper = sorted(shift + sign * end for end in ends)
        return lower, upper


class Cylinder(FrozenStruct):
    """A cylindrical surface of a part, which may consist of several faces.

    The surface extends from `lower` to `upper` [m] along its axis `line`, relative to the point of the line. `sweep` [rad] is the angle
    that the surface covers on average. A `hollow` cylinder is the wall of a hole. `through` is True for a hole (see `HOLE`) that is open at
    both ends.
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
