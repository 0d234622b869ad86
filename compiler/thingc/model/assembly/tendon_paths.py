"""Compute the length and the straight segments of a tendon that passes through mounts, around spheres and cylinders, and over pulleys.

Between two mounts, the tendon is straight, or follows the shortest path around a shape. The mount `side` of the shape determines on which
side the tendon passes. Lengths after a pulley are divided by the divisor of the pulley. The result is the same as for a `spatial` tendon of
MuJoCo (Computation, "Tendon"; `mju_wrap` of its engine).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from thingc.base.numeric import acos, dist, hypot, maximum, minimum, pi, sqrt, sum_of
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import Pose, Vector, cross, dot
from thingc.model.assembly.types import LinkedMount, TendonStep

Point = tuple[float, float]
TINY = 1e-15
"""Lengths [m] below this value count as 0. The value is `mjMINVAL` of MuJoCo."""


class TendonSpan(OneLineStruct):
    """A straight segment of a tendon between two points. Each point is fixed to the part of a mount.

    The length of the segment, divided by `divisor`, is a part of the length of the tendon.
    """

    ends: tuple[LinkedMount, LinkedMount]
    points: tuple[Vector, Vector]
    divisor: float

    @property
    def length(self) -> float:
        """The length [m] of the straight segment, before the division by `divisor`."""
        return dist(*self.points)


class TendonCourse(OneLineStruct):
    """The length of a tendon [m], and its straight segments, which pull on the parts at their ends."""

    length: float
    spans: tuple[TendonSpan, ...]


def course(steps: Sequence[TendonStep], at: Mapping[str, Pose]) -> TendonCourse:
    """Compute the length and the straight segments of a tendon.

    `at` maps the paths of the mounts of the tendon to their poses in a common frame.
    """
    spans: list[TendonSpan] = []
    length, divisor = 0.0, 1.0
    last: LinkedMount | None = None
    around: TendonStep | None = None
    for step in steps:
        if step.divisor is not None:
            divisor, last = step.divisor, None
        elif step.radius is not None:
            around = step
        elif step.mount is not None:
            if last is not None:
                ends = (at[last.path].translation, at[step.mount.path].translation)
                arc = None if around is None else _around(around, at, *ends)
                if arc is None or around is None or around.mount is None:
                    segments = [TendonSpan(ends=(last, step.mount), points=ends, divisor=divisor)]
                else:
                    curve, first, second = arc
                    length += curve / divisor
                    segments = [
                        TendonSpan(ends=(last, around.mount), points=(ends[0], first), divisor=divisor),
                        TendonSpan(ends=(around.mount, step.mount), points=(second, ends[1]), divisor=divisor),
                    ]
                length = sum_of((length, *(span.length / divisor for span in segments)))
                spans += segments
            last, around = step.mount, None
    return TendonCourse(length=length, spans=tuple(spans))


def _around(step: TendonStep, at: Mapping[str, Pose], start: Vector, end: Vector) -> tuple[float, Vector, Vector] | None:
    """Return the length [m] of the arc of a tendon on a sphere or cylinder, and the two ends of the arc.

    Return None if the tendon does not touch the sphere or cylinder.
    """
    assert step.mount is not None and step.radius is not None
    shape, radius = at[step.mount.path], step.radius
    inverse = shape.inverse()
    p, q = inverse.apply(start), inverse.apply(end)
    side = None if step.side is None else inverse.apply(at[step.side.path].translation)
    if step.shape == "cylinder":
        x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    else:
        x = _unit(p)
        normal = cross(p, q)
        if sqrt(dot(normal, normal)) < TINY:  # the ends are collinear with the centre: use any plane that contains these points
            largest = max(range(3), key=lambda k: abs(x[k]))
            normal = cross(x, (float(largest != 0), float(largest != 1), float(largest != 2)))
        y = _unit(cross(_unit(normal), x))

    def flat(v: Vector) -> Point:
        return dot(v, x), dot(v, y)

    touching = _circle(flat(p), flat(q), None if side is None else _scale_to(flat(side), radius), radius)
    if touching is None:
        return None
    curve, a, b = touching

    def solid(point: Point, height: float) -> Vector:
        u, v = point
        on = (u * x[0] + v * y[0], u * x[1] + v * y[1], u * x[2] + v * y[2])
        return (on[0], on[1], height) if step.shape == "cylinder" else on

    low = high = 0.0
    if step.shape == "cylinder":  # a helix: its rise is proportional to the length of its projection
        before, after = dist(flat(p), a), dist(flat(q), b)
        slope = (q[2] - p[2]) / (before + curve + after)
        low, high = p[2] + slope * before, p[2] + slope * (before + curve)
        curve = hypot(curve, high - low)
    return curve, shape.apply(solid(a, low)), shape.apply(solid(b, high))


def _circle(p: Point, q: Point, side: Point | None, radius: float) -> tuple[float, Point, Point] | None:
    """Return the length and the two ends of the arc that a string from p to q forms on a circle about the origin.

    Return None if the string does not touch the circle.

    If `side`, a point on the circle, is given, the arc is on the side of this point. Otherwise, the string touches the circle only if the
    line from p to q intersects the circle, and the arc is the shorter of two possible arcs.
    """
    pp, qq, square = p[0] ** 2 + p[1] ** 2, q[0] ** 2 + q[1] ** 2, radius**2
    if pp < square or qq < square:
        return None
    d = (q[0] - p[0], q[1] - p[1])
    dd = d[0] ** 2 + d[1] ** 2
    if dd < TINY:
        return None
    along = minimum(1.0, maximum(0.0, -(d[0] * p[0] + d[1] * p[1]) / dd))
    near = (p[0] + along * d[0], p[1] + along * d[1])
    if near[0] ** 2 + near[1] ** 2 > square and (side is None or side[0] * near[0] + side[1] * near[1] >= 0.0):
        return None
    best: tuple[float, int, Point, Point] | None = None
    for way, sign in enumerate((1.0, -1.0)):
        s, t = sign * radius * sqrt(pp - square), sign * radius * sqrt(qq - square)
        a = ((p[0] * square + s * p[1]) / pp, (p[1] * square - s * p[0]) / pp)
        b = ((q[0] * square - t * q[1]) / qq, (q[1] * square + t * q[0]) / qq)
        if side is not None:
            middle = _scale_to((a[0] + b[0], a[1] + b[1]), 1.0)
            good = middle[0] * side[0] + middle[1] * side[1]
        else:
            good = -((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2)
        if _cross(p, a, q, b):
            good = -10000.0
        if best is None or good >= best[0]:
            best = (good, way, a, b)
    assert best is not None
    _, way, a, b = best
    if _cross(p, a, q, b):
        return None
    angle = acos(maximum(-1.0, minimum(1.0, (a[0] * b[0] + a[1] * b[1]) / square)))
    turn = a[1] * b[0] - a[0] * b[1]
    if (turn > 0.0 and way == 1) or (turn < 0.0 and way == 0):
        angle = 2.0 * pi - angle
    return radius * angle, a, b


def _cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Return whether the segments from a to b and from c to d intersect."""
    det = (d[1] - c[1]) * (b[0] - a[0]) - (d[0] - c[0]) * (b[1] - a[1])
    if abs(det) < TINY:
        return False
    u = ((d[0] - c[0]) * (a[1] - c[1]) - (d[1] - c[1]) * (a[0] - c[0])) / det
    v = ((b[0] - a[0]) * (a[1] - c[1]) - (b[1] - a[1]) * (a[0] - c[0])) / det
    return 0.0 <= u <= 1.0 and 0.0 <= v <= 1.0


def _scale_to(v: Point, length: float) -> Point:
    size = hypot(*v)
    return v if size < TINY else (v[0] * length / size, v[1] * length / size)


def _unit(v: Vector) -> Vector:
    size = sqrt(dot(v, v))
    return (1.0, 0.0, 0.0) if size < TINY else (v[0] / size, v[1] / size, v[2] / size)
