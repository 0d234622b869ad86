"""Functions that create shapes for several stock parts. All lengths are in mm."""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, cos, sin

from build123d import Axis, Edge, Face, Location, Plane, Pos, Solid, Wire

Point = tuple[float, float]


def block(size: tuple[float, float, float], centre: tuple[float, float, float] = (0, 0, 0), corner: float = 0.0) -> Solid:
    """Return a box around a centre, with its vertical edges chamfered by `corner` at 45 deg."""
    x, y, z = (extent / 2 for extent in size)
    outline = [
        (x, corner - y), (x, y - corner), (x - corner, y), (corner - x, y),
        (-x, y - corner), (-x, corner - y), (corner - x, -y), (x - corner, -y),
    ] if corner else [(x, -y), (x, y), (-x, y), (-x, -y)]
    return prism([(centre[0] + u, centre[1] + v) for u, v in outline], centre[2] - z, size[2])


def prism(outline: Sequence[Point], bottom: float, height: float) -> Solid:
    """Return the solid that is extruded from an outline in the x-y plane, starting at z = `bottom`."""
    return Solid.extrude(Face(Wire.make_polygon([(x, y, bottom) for x, y in outline])), (0, 0, height))


def turned(outline: Sequence[Point]) -> Solid:
    """Return the solid of revolution of an outline of (radius, z) about z."""
    return Solid.revolve(Face(Wire.make_polygon([(r, 0, z) for r, z in outline])), 360, Axis.Z)


def disc(diameter: float, height: float, bottom: float = 0.0, x: float = 0.0, y: float = 0.0) -> Solid:
    """Return a vertical cylinder that starts at z = `bottom`."""
    return Solid.make_cylinder(diameter / 2, height, Plane((x, y, bottom)))


def bevelled(diameter: float, height: float, bevel: float, bottom: float = 0.0, bore: float = 0.0) -> Solid:
    """Return a disc or ring that starts at z = `bottom`, with its outer edges chamfered by `bevel` at 45 deg."""
    r, top = diameter / 2, bottom + height
    return turned([(bore / 2, bottom), (r - bevel, bottom), (r, bottom + bevel), (r, top - bevel), (r - bevel, top), (bore / 2, top)])


def spots(diameter: float, count: int, start: float = 0.0) -> list[Location]:
    """Return `count` evenly spaced positions on a circle, starting at the angle `start` [deg] from x and continuing towards +y."""
    return [Location((0, 0, 0), (0, 0, start + 360.0 * k / count)) * Pos(diameter / 2, 0, 0) for k in range(count)]


def bar(length: float, start: float, end: float, thickness: float, bottom: float = 0.0) -> Solid:
    """Return a flat link along y that starts at z = `bottom`.

    The link is the hull of two discs: one with radius `start` at the origin, and one with radius `end` at y = `length`.
    """
    lean = acos((start - end) / length)
    corners = [(start * sin(lean), start * cos(lean)), (end * sin(lean), length + end * cos(lean))]
    (x0, y0), (x1, y1) = corners
    outline = [
        Edge.make_line((x0, y0, bottom), (x1, y1, bottom)),
        Edge.make_three_point_arc((x1, y1, bottom), (0, length + end, bottom), (-x1, y1, bottom)),
        Edge.make_line((-x1, y1, bottom), (-x0, y0, bottom)),
        Edge.make_three_point_arc((-x0, y0, bottom), (0, -start, bottom), (x0, y0, bottom)),
    ]
    return Solid.extrude(Face(Wire(outline)), (0, 0, thickness))


def softened(solid: Solid, size: float, axis: Axis = Axis.Z) -> Solid:
    """Return a copy of a solid in which the edges of the two end faces along an axis are chamfered by `size` at 45 deg."""
    faces = solid.faces().filter_by(axis).sort_by(axis)
    return solid.chamfer(size, None, [*faces[0].outer_wire().edges(), *faces[-1].outer_wire().edges()])
