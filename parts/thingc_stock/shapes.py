"""Shapes that several stock parts are made of; all in mm."""

from __future__ import annotations

from collections.abc import Sequence

from build123d import Axis, Face, Location, Plane, Pos, Solid, Wire

Point = tuple[float, float]


def block(size: tuple[float, float, float], centre: tuple[float, float, float] = (0, 0, 0), corner: float = 0.0) -> Solid:
    """A box around a centre, its upright edges cut off by `corner` at 45 deg."""
    x, y, z = (extent / 2 for extent in size)
    outline = [
        (x, corner - y), (x, y - corner), (x - corner, y), (corner - x, y),
        (-x, y - corner), (-x, corner - y), (corner - x, -y), (x - corner, -y),
    ] if corner else [(x, -y), (x, y), (-x, y), (-x, -y)]
    return prism([(centre[0] + u, centre[1] + v) for u, v in outline], centre[2] - z, size[2])


def prism(outline: Sequence[Point], bottom: float, height: float) -> Solid:
    """An outline in x and y from z = `bottom` up."""
    return Solid.extrude(Face(Wire.make_polygon([(x, y, bottom) for x, y in outline])), (0, 0, height))


def turned(outline: Sequence[Point]) -> Solid:
    """An outline of (radius, z) once around z."""
    return Solid.revolve(Face(Wire.make_polygon([(r, 0, z) for r, z in outline])), 360, Axis.Z)


def disc(diameter: float, height: float, bottom: float = 0.0, x: float = 0.0, y: float = 0.0) -> Solid:
    """An upright cylinder from z = `bottom` up."""
    return Solid.make_cylinder(diameter / 2, height, Plane((x, y, bottom)))


def bevelled(diameter: float, height: float, bevel: float, bottom: float = 0.0, bore: float = 0.0) -> Solid:
    """A disc or ring from z = `bottom` up whose outer edges are cut off by `bevel` at 45 deg."""
    r, top = diameter / 2, bottom + height
    return turned([(bore / 2, bottom), (r - bevel, bottom), (r, bottom + bevel), (r, top - bevel), (r - bevel, top), (bore / 2, top)])


def spots(diameter: float, count: int, start: float = 0.0) -> list[Location]:
    """`count` places around a circle, the first at `start` [deg] from x, on towards +y."""
    return [Location((0, 0, 0), (0, 0, start + 360.0 * k / count)) * Pos(diameter / 2, 0, 0) for k in range(count)]
