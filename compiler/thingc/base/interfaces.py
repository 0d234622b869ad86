"""Mating features of mounts: bolt patterns, bores, bosses, screws and connectors, and whether two of them fit together.

Part records and documents contain SI units. Part code creates the same classes with millimetres and degrees, which the geometry worker
converts. Angles are counted in the frame of the mount from x towards y.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Annotated, Any, Literal, Self

from msgspec import Meta
from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import atan2, cos, degrees, dist, hypot, sin, sqrt
from thingc.base.pose import Pose

THREAD = r"^\s*([^\sMm]|[Mm]([^0-9]|$|0*[1-9][0-9]{0,2}([^0-9]|$)|0*\.0*[1-9])).*$"
"""A regular expression of threads. Metric threads have a diameter above 0 and below 1 m."""
Thread = Annotated[str, Meta(pattern=THREAD)]
Text = Annotated[str, Meta(min_length=1)]
Number = Annotated[float, Meta(gt=-1e6, lt=1e6)]
Size = Annotated[float, Meta(gt=0, lt=1e6)]
Conversion = Callable[[float], float]
Mismatch = tuple[str, str, str]
"""The values of two features that do not fit together, and a comparison of both values, or an empty string."""

SAME = 1e-6 + 1e-12
"""Largest difference [m] of two equal lengths."""
SAME_PLACE = 1e-5
"""Largest distance [m] of the axes of two holes for one screw."""
MOST_BOLTS = 200
"""Maximum number of holes of a pattern, because each hole is compared with each hole of another pattern."""
HOLES = (0.75, 1.7)
"""Smallest and largest diameter of a hole for a thread, relative to its nominal diameter: from a tap drill to the hole of an insert."""


class MountPair(FrozenStruct):
    """Two mounts that meet. `pose` is the pose of the second mount in the frame of the first mount, with the joint at 0.

    `turns` and `slides` are True if a joint rotates or translates the mounts relative to each other.
    """

    pose: Pose
    turns: bool = False
    slides: bool = False


class MountFeature(FrozenStruct, tag=True, omit_defaults=True):
    """The base class of mating features."""

    def in_units(self, length: Conversion, angle: Conversion) -> Self:
        """Return the same feature in other units."""

        def change(name: str, value: Any) -> Any:
            if isinstance(value, (list, tuple)):
                return tuple(change(name, item) for item in value)
            if value is None or isinstance(value, str) or name == "count":
                return value
            return angle(value) if name == "start" else length(value)

        return replace(self, **{name: change(name, getattr(self, name)) for name in self.__struct_fields__})

    def mirror_image(self) -> Self:
        """Return the feature in the frame of a mirrored mount, whose y axis is reversed. Round features do not change."""
        return self

    def check_lengths(self) -> None:
        """Raise `ValueError` if lengths [m] contradict each other."""

    def meets(self, other: MatingFeature, pair: MountPair) -> list[Mismatch] | None:
        """Return the differences to a feature of another mount, or None if this class cannot compare the features."""
        return None


class Bolts(MountFeature, kw_only=False):
    """Holes for screws of one `thread`, parallel to the z axis of the mount.

    By default, one hole is at the origin of the mount. `count` holes are evenly spaced on a circle of the diameter `circle`, and the first
    hole is at the angle `start`. `at` lists the positions of other patterns. `depth` is the depth of a threaded hole, or None for a
    clearance hole. `hole` is the diameter of the holes. Raises `ValueError` for values that contradict each other.
    """

    thread: Thread
    count: Annotated[int, Meta(ge=1)] = 1
    circle: Size | None = None
    start: Number = 0.0
    at: tuple[tuple[Number, Number], ...] = ()
    depth: Size | None = None
    hole: Size | None = None

    def __post_init__(self) -> None:
        if max(self.count, len(self.at)) > MOST_BOLTS:
            raise ValueError(f"a pattern must have at most {MOST_BOLTS} holes, found {max(self.count, len(self.at))}")
        if self.circle is None and (self.start or self.count > 1):
            raise ValueError("`count` and `start` require `circle`")
        if self.at and self.circle is not None:
            raise ValueError("a bolt pattern cannot have both `circle` and `at`")

    def __str__(self) -> str:
        return f"{len(self.at) or self.count} x {self.thread}" + ("" if self.circle is None else f" on {mm(self.circle)}")

    @property
    def points(self) -> tuple[tuple[float, float], ...]:
        """The positions of the holes in the frame of the mount."""
        if self.circle is None:
            return self.at or ((0.0, 0.0),)
        angles = [self.start + 2.0 * math.pi * k / self.count for k in range(self.count)]
        return tuple((self.circle / 2.0 * cos(angle), self.circle / 2.0 * sin(angle)) for angle in angles)

    def check_lengths(self) -> None:
        """Raise `ValueError` if a hole is too small for the thread, or if two holes overlap."""
        size = nominal(self.thread) or 0.0
        closest = min(combinations(self.points, 2), key=_squared_distance, default=None)  # the exact distance takes longer
        smallest_distance = math.inf if closest is None else dist(*closest)
        if self.hole is not None and self.hole < HOLES[0] * size:
            raise ValueError(f"a hole of {mm(self.hole)} is too small for the thread {self.thread}")
        if smallest_distance <= (self.hole or size):
            raise ValueError(f"holes of {mm(self.hole or size)} overlap at a distance of {mm(smallest_distance)}")

    def mirror_image(self) -> Bolts:
        """Return the pattern in the frame of a mirrored mount, whose y axis is reversed."""
        return replace(self, start=-self.start + 0.0, at=tuple((x, -y + 0.0) for x, y in self.at))

    def meets(self, other: MatingFeature, pair: MountPair) -> list[Mismatch] | None:
        """Compare the threads, the counts, the circles and the positions of the holes."""
        if not isinstance(other, (Bolts, Shank)):
            return None
        mismatches = [(f"thread {self.thread}", f"thread {other.thread}", "")] if self.thread.casefold() != other.thread.casefold() else []
        if isinstance(other, Shank):
            return mismatches
        smaller, larger = sorted((self, other), key=lambda bolts: len(bolts.points))
        if not (self.at or other.at):
            if larger.count % smaller.count:
                mismatches.append((f"{self.count} bolts", f"{other.count} bolts", ""))
            if not abs((self.circle or 0.0) - (other.circle or 0.0)) <= SAME:
                mismatches.append((f"bolt circle {mm(self.circle or 0.0)}", f"bolt circle {mm(other.circle or 0.0)}", ""))
        return mismatches if mismatches or pair.turns else self._compare_holes(other, pair)

    def _compare_holes(self, other: Bolts, pair: MountPair) -> list[Mismatch]:
        """Return a mismatch for the first hole of the smaller pattern that is not at a hole of the larger pattern."""
        mine, theirs = self.points, [pair.pose.apply((x, y, 0.0))[:2] for x, y in other.points]
        swapped = len(theirs) < len(mine)
        smaller, larger = (theirs, mine) if swapped else (mine, theirs)
        for x, y in smaller:
            square, u, v = min(((x - u) * (x - u) + (y - v) * (y - v), u, v) for u, v in larger)
            if square > SAME_PLACE**2:
                angles = [round(degrees(atan2(b, a)), 6) + 0.0 for a, b in ((x, y), (u, v))]
                lengths = mm(hypot(x, y)), mm(hypot(u, v))
                found, expected = (f"bolt at {angle:.6g} deg, {length}" for angle, length in zip(angles, lengths, strict=True))
                comparison = f"distance {mm(sqrt(square))}, in the frame of the first mount"
                return [(expected, found, comparison) if swapped else (found, expected, comparison)]
        return []


def _squared_distance(ends: tuple[tuple[float, float], tuple[float, float]]) -> float:
    """Return the squared distance between two points in a plane."""
    (x, y), (u, v) = ends
    return (x - u) * (x - u) + (y - v) * (y - v)


class RoundFeature(MountFeature, kw_only=False):
    """A cylinder along the z axis of the mount. `clearance` contains the smallest and the largest difference to the other diameter."""

    diameter: Size
    clearance: tuple[Number, Number] | None = None

    def __post_init__(self) -> None:
        if self.clearance is not None and not (self.diameter > self.clearance[0] <= self.clearance[1]):
            raise ValueError("`clearance` must be a range [smallest, largest] below the `diameter`")

    def __str__(self) -> str:
        return f"{type(self).__name__.lower()} {mm(self.diameter)}"


class Bore(RoundFeature, kw_only=False):
    """A round hole along the z axis of the mount, with its `diameter` and its `depth`, or None for a through hole.

    `clearance` contains the smallest and the largest difference to the diameter of a boss. By default, the boss must not be larger.
    """

    depth: Size | None = None

    def meets(self, other: MatingFeature, pair: MountPair) -> list[Mismatch] | None:
        """Compare the diameter with that of a boss or a thread. Two bores can share a pin."""
        if isinstance(other, Shank):
            return [(str(self), f"thread {other.thread}", "")] if (nominal(other.thread) or 0.0) > self.diameter + SAME else []
        if not isinstance(other, Boss):
            return [] if isinstance(other, Bore) else None
        play, mismatches = self.diameter - other.diameter, []
        for least, most in [bounds for bounds in (self.clearance, other.clearance) if bounds is not None] or [(0.0, math.inf)]:
            if not least - SAME <= play <= most + SAME:
                expected = "at least 0" if most == math.inf else f"{1e3 * least:.6g} to {mm(most)}"
                mismatches.append((str(self), str(other), f"clearance {mm(play)}, expected {expected}"))
        inserted = None if other.length is None or pair.slides else other.length - pair.pose.translation[2]
        if inserted is not None and self.depth is not None and inserted > self.depth + SAME:
            mismatches.append((f"bore {mm(self.depth)} deep", f"boss {mm(inserted)} long", ""))
        return mismatches


class Boss(RoundFeature, kw_only=False):
    """A cylinder along the z axis of the mount, such as a shaft, with its `diameter` and its `length` above the mount.

    `clearance` contains the smallest and the largest difference to the diameter of a bore. By default, the bore must not be smaller.
    """

    length: Size | None = None


class Shank(MountFeature, kw_only=False):
    """The shank of a screw along the z axis of the mount, with its `thread` and its `length` below the head."""

    thread: Thread
    length: Size

    def __str__(self) -> str:
        return f"{self.thread} x {mm(self.length)}"


class Connector(MountFeature, kw_only=False):
    """An electrical or other connector, by its `name`.

    A plug meets a socket of the same name, or the connector `counterpart`. A connector without a `side` meets its own kind.
    """

    name: Text
    side: Literal["plug", "socket"] | None = None
    counterpart: Text | None = None

    def __str__(self) -> str:
        return f"{self.side or 'connector'} {self.name}"

    def meets(self, other: MatingFeature, pair: MountPair) -> list[Mismatch] | None:
        """Compare the names and the sides of two connectors."""
        if not isinstance(other, Connector):
            return None
        named = self.counterpart in (None, other.name) and other.counterpart in (None, self.name)
        named = named and (self.name == other.name or self.counterpart is not None or other.counterpart is not None)
        return [] if named and (self.side is None or self.side != other.side) else [(str(self), str(other), "")]


MatingFeature = Bolts | Bore | Boss | Shank | Connector


def compare(first: Sequence[MatingFeature], second: Sequence[MatingFeature], pair: MountPair) -> list[Mismatch]:
    """Return the differences between the features of two mounts that are mated. A mount without features fits any other mount.

    Each feature of the mount with fewer features is compared with the feature of the other mount that fits best. A feature without a
    counterpart is skipped, unless no feature has a counterpart.
    """
    table = [[_meet(mine, theirs, pair) for theirs in second] for mine in first]
    rows = table if len(first) <= len(second) else list(map(list, zip(*table, strict=True)))
    best = [min(comparisons, key=len) for row in rows if (comparisons := [mismatches for mismatches in row if mismatches is not None])]
    if not best and first and second:
        return [(", ".join(map(str, first)), ", ".join(map(str, second)), "")]
    return [mismatch for mismatches in best for mismatch in mismatches]


def _meet(first: MatingFeature, second: MatingFeature, pair: MountPair) -> list[Mismatch] | None:
    mismatches = first.meets(second, pair)
    swapped = second.meets(first, pair) if mismatches is None else None
    return mismatches if swapped is None else [(mine, theirs, comparison) for theirs, mine, comparison in swapped]


def nominal(thread: str) -> float | None:
    """Return the nominal diameter [m] of a metric thread such as `M2.5` or `M8x1`, or None for other threads."""
    metric = re.match(r"M(\d+(?:\.\d+)?)(?![\d.])", thread, re.IGNORECASE | re.ASCII)
    return None if metric is None else float(metric[1]) / 1e3


def mm(*values: float) -> str:
    """Format lengths [m] in millimetres, such as `3 mm` or `10, 3 mm`."""
    return ", ".join(f"{round(1e3 * value, 9) + 0.0:.6g}" for value in values) + " mm"  # without rounding errors and `-0`


def format_interface(interface: str | None, features: Sequence[MatingFeature]) -> str:
    """Format the name and the features of an interface, or return an empty string."""
    return ", ".join([*filter(None, [interface]), *map(str, features)])
