"""Choose mounts of imported parts at unambiguous features: bolt circles, through holes and planar faces."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import dist
from thingc.base.pose import Pose, Vector, added, along, dot
from thingc.geometry.features import Cylinder, Features, PlanarFace

MOST = 12
"""Maximum number of mounts of a part."""
_NEAR = 1e-6
_SMALL_FACE = 0.2
"""Planar faces that are smaller than this fraction of the largest planar face do not get a mount."""


class FeatureMount(FrozenStruct):
    """A mount at a feature of a part. Its z axis points out of the material. `what` describes the feature."""

    name: str
    pose: Pose
    what: str


def feature_mounts(features: Features) -> tuple[FeatureMount, ...]:
    """Return mounts for the bolt circles, the other through holes, and the planar faces of a part, at most `MOST`.

    The origin is at the end of a hole in the direction of its axis, which points along the last coordinate axis that it is not
    perpendicular to. A planar face gets a mount if it is the only outermost face in its direction.
    """
    holes = [one for one in features.cylinders if one.through]
    mounts: list[FeatureMount] = []
    for number, circle in enumerate(_circles(holes), 1):
        first = circle[0]
        line, centre = first.line, _mean([one.line.point for one in circle])
        radius = dist(centre, line.point)
        words = f"bolt circle: {len(circle)} holes of {_mm(2.0 * first.radius)} mm on {_mm(2.0 * radius)} mm"
        mounts.append(FeatureMount(name=f"bolts_{number}", pose=along(line.axis, added(centre, line.axis, first.upper)), what=words))
        holes = [one for one in holes if one not in circle]
    for number, hole in enumerate(holes, 1):
        pose = along(hole.line.axis, added(hole.line.point, hole.line.axis, hole.upper))
        mounts.append(FeatureMount(name=f"hole_{number}", pose=pose, what=f"through hole of {_mm(2.0 * hole.radius)} mm"))
    for number, face in enumerate(_outermost(features.planes), 1):
        mounts.append(FeatureMount(name=f"face_{number}", pose=along(face.normal, face.centre), what="planar face"))
    return tuple(mounts[:MOST])


def _circles(holes: Sequence[Cylinder]) -> Iterator[list[Cylinder]]:
    """Yield groups of at least three equal holes whose axes are on one circle around the centre of the group."""
    equal: dict[object, list[Cylinder]] = {}
    for hole in holes:
        equal.setdefault((hole.line.axis, *(round(value, 7) for value in (hole.radius, hole.lower, hole.upper))), []).append(hole)
    for group in equal.values():
        centre = _mean([hole.line.point for hole in group])
        rings: dict[float, list[Cylinder]] = {}
        for hole in group:
            rings.setdefault(round(dist(centre, hole.line.point), 6), []).append(hole)
        for ring in rings.values():
            if len(ring) >= 3 and dist(_mean([hole.line.point for hole in ring]), centre) < _NEAR:
                yield ring


def _outermost(planes: Sequence[PlanarFace]) -> Iterator[PlanarFace]:
    largest = max((face.area for face in planes), default=0.0)
    for face in planes:
        beside = [other for other in planes if other is not face and dist(other.normal, face.normal) < _NEAR]
        height = dot(face.normal, face.centre)
        if face.area >= _SMALL_FACE * largest and all(dot(face.normal, one.centre) < height - _NEAR for one in beside):
            yield face


def _mean(points: Sequence[Vector]) -> Vector:
    x, y, z = (math.fsum(values) / len(points) for values in zip(*points, strict=True))
    return (x, y, z)


def _mm(length: float) -> str:
    return f"{1000.0 * length:.6g}"
