"""Find where two placed parts touch: shafts in holes, and planar faces on each other. Lengths are in metres, in the frame of the robot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import dist
from thingc.base.pose import Pose, Vector, along, dot, rotate
from thingc.geometry.features import CentreLine, Features, PlanarFace

CLEARANCE = 3e-4
"""Largest difference of the radii of a hole and of a shaft in it."""
TOUCHING = 1e-5
"""Largest distance of coplanar faces, and of the axes of a hole and of a shaft in it."""
PARALLEL = 1e-8
"""Largest difference from 1 of the cosine of the angle between parallel vectors."""
SHORTEST, SMALLEST = 2e-4, 1e-7
"""Smallest overlap of a hole and a shaft [m], and of two planar faces [m^2]."""


class ShaftContact(FrozenStruct):
    """A shaft in a hole. `first_is_shaft` is True if the shaft belongs to the first part. The overlap is from `lower` to `upper`."""

    line: CentreLine
    radius: float
    lower: float
    upper: float
    first_is_shaft: bool


class FaceContact(FrozenStruct):
    """Two planar faces on each other: the outward normal of the first part, and the corners of the common area."""

    normal: Vector
    corners: tuple[Vector, ...]


class Contact(FrozenStruct):
    """All places at which two parts touch. `holes` are the axes of through holes that continue from one part into the other."""

    shafts: tuple[ShaftContact, ...] = ()
    faces: tuple[FaceContact, ...] = ()
    holes: tuple[tuple[CentreLine, float], ...] = ()


def place_features(features: Features, pose: Pose) -> Features:
    """Transform the features of a part to the frame of the robot."""
    cylinders = []
    for one in features.cylinders:
        point, axis = pose.apply(one.line.point), rotate(pose.rotation, one.line.axis)
        line = CentreLine.through(point, axis)
        lower, upper = line.interval(point, axis, (one.lower, one.upper))
        cylinders.append(replace(one, line=line, lower=lower, upper=upper))
    planes = tuple(
        PlanarFace(
            normal=rotate(pose.rotation, one.normal), centre=pose.apply(one.centre), area=one.area,
            loops=tuple(tuple(map(pose.apply, loop)) for loop in one.loops),
        )
        for one in features.planes
    )
    return Features(cylinders=tuple(cylinders), planes=planes)


def same_line(one: CentreLine, other: CentreLine) -> bool:
    """Return whether two lines are equal up to the tolerances."""
    return parallel(one, other.axis) and dist(one.point, other.point) < TOUCHING


def parallel(line: CentreLine, direction: Vector) -> bool:
    """Return whether a unit vector is parallel to a line."""
    return abs(dot(line.axis, direction)) > 1.0 - PARALLEL


def contact(first: Features, other: Features) -> Contact:
    """Return the places at which two placed parts touch."""
    return Contact(shafts=tuple(_shafts(first, other)), faces=tuple(_faces(first, other)), holes=tuple(_holes(first, other)))


def _shafts(first: Features, other: Features) -> Iterator[ShaftContact]:
    for one, two in product(first.cylinders, other.cylinders):
        shaft, hole = (two, one) if one.hollow else (one, two)
        if one.hollow == two.hollow or hole.sweep < math.pi + 0.1 or shaft.sweep < math.pi / 2.0:
            continue
        lower, upper = max(one.lower, two.lower), min(one.upper, two.upper)
        is_fitting = -TOUCHING <= hole.radius - shaft.radius <= CLEARANCE and upper - lower >= SHORTEST
        if is_fitting and same_line(hole.line, shaft.line):
            yield ShaftContact(line=hole.line, radius=shaft.radius, lower=lower, upper=upper, first_is_shaft=not one.hollow)


def _holes(first: Features, other: Features) -> Iterator[tuple[CentreLine, float]]:
    for one, two in product(first.cylinders, other.cylinders):
        gap = max(one.lower, two.lower) - min(one.upper, two.upper)
        equal = abs(one.radius - two.radius) < 2.0 * CLEARANCE and same_line(one.line, two.line)
        if one.hollow and two.hollow and equal and gap < SHORTEST:
            yield one.line, one.radius


def _faces(first: Features, other: Features) -> Iterator[FaceContact]:
    for one, two in product(first.planes, other.planes):
        opposed = dot(one.normal, two.normal) < PARALLEL - 1.0
        if opposed and abs(dot(one.normal, two.centre) - dot(one.normal, one.centre)) < TOUCHING:
            corners = _common_area(one, two)
            if corners:
                yield FaceContact(normal=one.normal, corners=corners)


def _common_area(one: PlanarFace, two: PlanarFace) -> tuple[Vector, ...]:
    """Return the corners of the intersection of two coplanar faces, or an empty tuple if its area is too small."""
    from manifold3d import CrossSection, FillRule

    plane = along(one.normal, one.centre)
    back = plane.inverse()
    sections = []
    for face in (one, two):
        loops = [[back.apply(point)[:2] for point in loop] for loop in face.loops if len(loop) > 2]
        sections.append(CrossSection([[(1e3 * x, 1e3 * y) for x, y in loop] for loop in loops], FillRule.EvenOdd))
    common = sections[0] ^ sections[1]
    if common.area() * 1e-6 < SMALLEST:
        return ()
    return tuple(plane.apply((float(x) / 1e3, float(y) / 1e3, 0.0)) for polygon in common.to_polygons() for x, y in polygon)
