"""Functions that create shapes for several parts of the robot."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

from build123d import Axis, Edge, Face, Location, Plane, Solid, Wire

from thingc_stock.dynamixel import XSeries
from thingc_stock.fasteners import Hole, Screw


def block(length: float, width: float, height: float) -> Solid:
    """Return a box on the plane z = 0, centred in x and y [mm]."""
    return Solid.make_box(length, width, height, Plane((-length / 2, -width / 2, 0)))


def slab(length: float, width: float, height: float, radius: float) -> Solid:
    """Return a box on the plane z = 0, centred in x and y, with rounded vertical edges [mm]."""
    x, y, r = length / 2, width / 2, radius
    c = r * (1 - 0.5**0.5)
    corners = [
        Edge.make_three_point_arc((x - r, y), (x - c, y - c), (x, y - r)),
        Edge.make_three_point_arc((x, r - y), (x - c, c - y), (x - r, -y)),
        Edge.make_three_point_arc((r - x, -y), (c - x, c - y), (-x, r - y)),
        Edge.make_three_point_arc((-x, y - r), (c - x, y - c), (r - x, y)),
    ]
    sides = [Edge.make_line(corners[k] @ 1, corners[(k + 1) % 4] @ 0) for k in range(4)]
    return Solid.extrude(Face(Wire([edge for pair in zip(corners, sides) for edge in pair])), (0, 0, height))


def stadium(length: float, width: float, height: float) -> Solid:
    """Return a plate on the plane z = 0 around the segment from the origin to (0, length), with semicircular ends [mm]."""
    r = width / 2
    right, left = Edge.make_line((r, 0), (r, length)), Edge.make_line((-r, length), (-r, 0))
    far = Edge.make_three_point_arc((r, length), (0, length + r), (-r, length))
    near = Edge.make_three_point_arc((-r, 0), (0, -r), (r, 0))
    return Solid.extrude(Face(Wire([right, far, left, near])), (0, 0, height))


def tongue(length: float, width: float, height: float) -> Solid:
    """Return a plate on the plane z = 0 from the z axis to x = length, with a semicircular end around the z axis [mm]."""
    r = width / 2
    outline = Wire.make_polygon([(0, r), (length, r), (length, -r), (0, -r)], close=False)
    return Solid.extrude(Face(Wire([*outline.edges(), Edge.make_three_point_arc((0, -r), (-r, 0), (0, r))])), (0, 0, height))


def turned(outline: Sequence[tuple[float, float]]) -> Solid:
    """Return the solid of revolution of an outline of (radius, z) about z [mm]."""
    return Solid.revolve(Face(Wire.make_polygon([(x, 0, z) for x, z in outline])), 360, Axis.Z)


def cut_away(screws: Sequence[Screw]) -> list[Solid]:
    """Return the solids to subtract from a part for its screws: clearance holes and heads."""
    return [screw.clearance_hull for screw in screws]


def sunk(hole: Hole, thickness: float, below: float) -> Screw:
    """Return the screw into `hole` through a plate of this thickness, with its head countersunk `below` the plate's face [mm]."""
    return hole(thickness - hole(1).head_height - below)


def swing(servo: XSeries) -> float:
    """Return the distance [mm] from the axis of the servo to the corners of its case next to the output.

    A part that turns around the short end of the servo must stay outside this radius.
    """
    return hypot(servo.p.width / 2, servo.top.location.position.Y)


def placed(x: float, z_dir: tuple[float, float, float], x_dir: tuple[float, float, float], z: float = 0.0) -> Location:
    """Return the location at (x, 0, z) with the given directions of its z and x axes."""
    return Location(Plane((x, 0, z), x_dir=x_dir, z_dir=z_dir))
