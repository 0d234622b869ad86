"""Compare the declared mating features of a mount with the cylinders and planar faces of the part."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.interfaces import HOLES, SAME, Bolts, Bore, Boss, MatingFeature, Shank, mm, nominal
from thingc.base.numeric import dist, hypot, inf
from thingc.base.pose import Pose, rotate, transpose
from thingc.geometry.features import Features


class _Round(FrozenStruct):
    """A cylinder parallel to the z axis of a mount, at `x` and `y` in the frame of the mount, from `low` to `high` along z."""

    x: float
    y: float
    low: float
    high: float
    diameter: float

    def away(self, x: float, y: float) -> float:
        """Return the distance of the axis to a point in the frame of the mount."""
        return hypot(self.x - x, self.y - y)


def contradictions(features: Iterable[MatingFeature], mount: Pose, measured: Features) -> tuple[str, ...]:
    """Describe how the geometry of a part differs from the declared features of a mount with the pose `mount`.

    The first difference of each feature is returned. Connectors are not compared.
    """
    holes, solids = (list(_rounds(mount, measured, hollow)) for hollow in (True, False))
    faces = [mount.inverse().apply(one.centre) for one in measured.planes if dist(one.normal, transpose(mount.rotation)[2]) <= SAME]
    tops = [*(one.high for one in solids if one.away(0.0, 0.0) <= SAME), *(w for u, v, w in faces if hypot(u, v) <= SAME)]
    comparisons = ((one, _difference(one, holes, solids, tops)) for one in features)
    return tuple(f"`{one}`: {difference}" for one, difference in comparisons if difference is not None)


def _rounds(mount: Pose, measured: Features, hollow: bool) -> Iterable[_Round]:
    to_mount = mount.inverse()
    for one in measured.cylinders:
        x, y, z = rotate(to_mount.rotation, one.line.axis)
        if one.hollow == hollow and hypot(x, y) <= 1e-9 and one.sweep > 3.0:
            u, v, w = to_mount.apply(one.line.point)
            low, high = sorted((w + z * one.lower, w + z * one.upper))
            yield _Round(x=u, y=v, low=low, high=high, diameter=2.0 * one.radius)


def _difference(feature: MatingFeature, holes: Sequence[_Round], solids: Sequence[_Round], tops: Sequence[float]) -> str | None:
    """Describe how the geometry differs from a feature, or return None."""
    if isinstance(feature, Bolts):
        size = nominal(feature.thread)
        sizes = (0.0, inf) if size is None else (HOLES[0] * size, HOLES[1] * size)
        sizes = sizes if feature.hole is None else (feature.hole - SAME, feature.hole + SAME)
        return next(filter(None, (_hole(x, y, sizes, feature.depth, holes) for x, y in feature.points)), None)
    if isinstance(feature, Bore):
        return _hole(0.0, 0.0, (feature.diameter - SAME, feature.diameter + SAME), feature.depth, holes)
    if isinstance(feature, Boss):
        diameters = [one.diameter for one in solids if one.high > SAME and one.away(0.0, 0.0) <= SAME]
        closest = min(diameters, key=lambda one: abs(one - feature.diameter), default=None)
        if closest is None or abs(closest - feature.diameter) > SAME:
            return "no cylinder on the axis of the mount" if closest is None else f"found a diameter of {mm(closest)}"
    if isinstance(feature, (Boss, Shank)) and (length := feature.length) is not None:
        top = min(tops, key=lambda one: abs(one - length), default=0.0)
        return f"expected a length of {mm(length)}, found {mm(top)}" if abs(top - length) > SAME else None
    return None


def _hole(x: float, y: float, sizes: tuple[float, float], depth: float | None, holes: Sequence[_Round]) -> str | None:
    """Describe how the hole at a point of the mount differs from a declared hole, or return None.

    The hole may begin below a chamfer, and consist of several cylinders with chamfers between them.
    """
    place, open_holes = mm(x, y), [one for one in holes if one.low < -SAME and one.high >= -one.diameter]
    at_point = [one for one in open_holes if one.away(x, y) <= SAME]
    if not at_point:
        closest = min(open_holes, key=lambda one: one.away(x, y), default=None)
        if closest is None:
            return f"no hole at {place}"
        circle = mm(2.0 * closest.away(0.0, 0.0))
        return f"no hole at {place} (closest hole: {mm(closest.x, closest.y)}, on a circle of {circle})"
    if not any(sizes[0] <= one.diameter <= sizes[1] for one in at_point):
        return f"the hole at {place} has a diameter of {mm(at_point[0].diameter)}"
    reach = 0.0
    for one in sorted((one for one in holes if one.away(x, y) <= SAME), key=lambda one: -one.high):
        reach = max(reach, -one.low) if one.high >= -reach - one.diameter else reach
    return f"expected a depth of {mm(depth)} at {place}, found {mm(reach)}" if depth is not None and depth > reach + SAME else None
