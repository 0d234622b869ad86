"""Find parts that overlap, for example because a part is duplicated, is on a wrong mount, or is too large for a bracket."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from functools import partial

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.numeric import maximum, minimum, sum_of
from thingc.base.pose import Pose, Vector
from thingc.base.primitives import Primitive
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly, Occurrence, Surface

SHARE = 0.2
"""Largest accepted overlap of two equal links with listed shapes, relative to the volume of the smaller link."""

DIGITS = 12
"""Number of decimals to which the relative poses of parts [m] are rounded. Further digits are rounding errors."""

KIND = "overlaps"
"""The kind of JSON documents in the store that contain the overlap of two parts at a relative pose."""


class PartPair(FrozenStruct, kw_only=False):
    """A pair of parts, in document order, and the pose of the part `other` in the frame of the part `one`."""

    one: Occurrence
    other: Occurrence
    at: Pose


class Overlaps:
    """Computes the intersections of parts, and caches them in memory and in the store.

    Only intersections with a mean thickness above `deep` [m] are reported. The meshes deviate from the exact surfaces by up to `tolerance`
    [m], which can cause thinner intersections.
    """

    def __init__(self, store: Store, tolerance: float, memo: Memo) -> None:
        self.deep = 2.0 * tolerance
        self._store, self._memo = store, memo

    def pairs(self, parts: Sequence[Occurrence], poses: Sequence[Pose]) -> list[PartPair]:
        """Return the pairs of parts whose bounding boxes overlap at these poses, in document order."""
        placed = sorted(
            ((pose.around(part.box), part, pose) for part, pose in zip(parts, poses, strict=True) if part.box is not None),
            key=lambda one: one[0][0][0],
        )
        found: list[PartPair] = []
        for number, (box, part, pose) in enumerate(placed):
            for beside, neighbour, at in placed[number + 1 :]:
                if beside[0][0] >= box[1][0]:
                    break
                if _thickness(box, beside) > 0.0 and not reason_to_skip(part, neighbour):
                    (one, of_one), (other, of_other) = sorted(((part, pose), (neighbour, at)), key=lambda each: each[0].index)
                    pair = PartPair(one, other, _round_pose(of_one.inverse() @ of_other))
                    found += [pair] if self._is_deep(pair) else []
        return sorted(found, key=lambda pair: (pair.one.index, pair.other.index))

    def intersection(self, pair: PartPair, *, keep: bool = True) -> tuple[float, float] | None:
        """Compute the volume [m^3] and the mean thickness [m] of the intersection of two parts.

        Return None for an intersection that is too thin to be reported.

        With `keep`, the result is also saved in the store on disk.
        """
        content = [self.deep, _made_of(pair.one), _made_of(pair.other), repr(pair.at)]
        key = hashlib.sha256(json.dumps(content).encode()).hexdigest()
        known = self._store.get_json(KIND, key) if keep else None
        volume, depth = known or self._memo(("overlap", pair.one.path, pair.other.path), lambda _: self._intersect(pair), content)
        if keep and known is None:
            self._store.note_json(KIND, key, [volume, depth])
        counts = depth > self.deep if pair.one.listed is None else volume > SHARE * minimum(_volume(pair.one), _volume(pair.other))
        return (volume, depth) if counts else None

    def _is_deep(self, pair: PartPair) -> bool:
        """Return whether the bounding boxes of two parts overlap so deeply that an intersection of the parts could be reported."""
        one, other = pair.one.box, pair.other.box
        assert one is not None and other is not None
        return minimum(_thickness(one, pair.at.around(other)), _thickness(pair.at.inverse().around(one), other)) > self.deep

    def _intersect(self, pair: PartPair) -> tuple[float, float]:
        from thingc.model.solids.shapes import Solid, solid_of

        def solid(part: Occurrence) -> Solid:
            solid = self._memo(("solid", part.definition.text), partial(solid_of, self._store, simplify=self.deep / 4.0), part.solids)
            assert solid is not None, "only closed solids have a volume"
            return solid

        return solid(pair.one).overlap(solid(pair.other).at(pair.at))


def check_overlaps(assembly: Assembly, poses: Sequence[Pose], overlaps: Overlaps, report: Report) -> None:
    """Warn of all pairs of parts that overlap at the given `poses`.

    If a document is nested several times, the same overlap is reported once. Because listed shapes of links are often approximate, only
    equal shapes on the same body are compared.
    """
    link_of = assembly.link_of
    reported: set[tuple[object, object]] = set()
    for pair in overlaps.pairs(assembly.occurrences, poses):
        on_different_links = link_of[pair.one.index] != link_of[pair.other.index]
        place = (pair.one.origin[:1], pair.other.origin[:1])
        if (pair.one.listed is not None and on_different_links) or place in reported:
            continue
        shared = overlaps.intersection(pair)
        if shared is not None and _warn(assembly, pair, shared[0], report):
            reported.add(place)


def reason_to_skip(one: Occurrence, other: Occurrence) -> str:
    """Return the reason why two parts that are designed to touch cannot be compared.

    Return an empty string if the parts can be compared.
    """
    if one.definition != other.definition and (one.listed or other.listed):
        return "shapes of links are approximate"
    for part in (one, other):
        if part.box is None or _volume(part) == 0.0 or not all(map(_is_closed, part.solids)):
            return f"`{part.path}` has no closed surface"
    return ""


def contact_places(assembly: Assembly, one: Occurrence, other: Occurrence) -> list[Note]:
    """Return the locations in documents at which the user can suppress the overlap of two parts by the key `allow`.

    The location of `other` itself is not included.
    """
    links = {assembly.link_of[one.index], assembly.link_of[other.index]}
    return [*(Note(message=f"`{one.path}` is defined here", span=span) for span in one.origin[:1]), *(
        Note(message=f"joint `{mate.name or mate.loop}` connects the two parts", span=mate.origin[0]) for mate in assembly.mates
        if (mate.joints or mate.loop) and {assembly.link_of[mate.parent], assembly.link_of[mate.child]} == links and mate.origin
    )]


def _warn(assembly: Assembly, pair: PartPair, shared: float, report: Report) -> bool:
    smaller, larger = sorted((pair.one, pair.other), key=_volume)
    share = float(f"{minimum(100.0 * shared / _volume(smaller), 100.0):.2g}")
    twice = pair.one.definition == pair.other.definition
    help = "remove one of the two parts" if twice and share >= 50.0 else "move one of the two parts, or cut a clearance into the other part"
    return report.warn(
        Code.OVERLAP, f"`{smaller.path}` overlaps `{larger.path}` by {_cubic(shared)} ({share:g} % of its volume)",
        pair.other.origin, path=pair.other.path, help=help, allow=True,
        notes=contact_places(assembly, pair.one, pair.other),
    )


def _cubic(volume: float) -> str:
    """Format a volume [m^3] for messages."""
    scale, unit = (1e6, "cm^3") if volume >= 1e-6 else (1e9, "mm^3")
    return f"{float(f'{scale * volume:.3g}'):g} {unit}"  # 1000 mm^3, not 1e+03


def _thickness(one: tuple[Vector, Vector], other: tuple[Vector, Vector]) -> float:
    """Return the smallest extent [m] of the intersection of two boxes.

    This extent is an upper bound of the mean thickness of the intersection of the parts. If the boxes do not intersect, the result is zero
    or negative.
    """
    lows, highs = map(maximum, one[0], other[0]), map(minimum, one[1], other[1])
    return minimum(high - low for low, high in zip(lows, highs, strict=True))


def _round_pose(pose: Pose) -> Pose:
    """Round a pose to `DIGITS` decimals.

    The rounded relative pose of two parts on a third part does not change if the third part becomes thicker.
    """
    a, b, c = pose.rotation
    return Pose(rotation=(_digits(a), _digits(b), _digits(c)), translation=_digits(pose.translation))


def _digits(vector: Vector) -> Vector:
    x, y, z = (round(entry, DIGITS) + 0.0 for entry in vector)
    return x, y, z


def _volume(part: Occurrence) -> float:
    """Return the volume [m^3] of a part. The volume of a link is the sum of the volumes of its shapes, even if the shapes overlap."""
    if part.record is not None:
        return part.record.volume if part.record.exact else 0.0
    return sum_of(one.solid.volume if isinstance(one.solid, Primitive) else one.volume for one in part.solids)


def _is_closed(surface: Surface) -> bool:
    return surface.solid.shape != "plane" if isinstance(surface.solid, Primitive) else surface.solid.closed


def _made_of(part: Occurrence) -> list[tuple[object, ...]]:
    """Return the data that determine the solid of a part. Parts with equal data have the same solid."""
    return [
        (one.solid.shape, one.solid.size, one.solid.pose.rotation, one.solid.pose.translation) if isinstance(one.solid, Primitive)
        else (one.solid.sha256, one.pose.rotation, one.pose.translation)
        for one in part.solids
    ]
