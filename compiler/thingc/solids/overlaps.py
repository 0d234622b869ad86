"""Parts, and links of shapes, of one body that are in one place: a part given twice, or put onto the wrong mount."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from functools import partial

from thingc.diagnostics import Code, Note, Report, allow_hint
from thingc.frozen import dataclass
from thingc.graph.types import Assembly, Occurrence, Surface
from thingc.memo import Memo
from thingc.pose import Pose, Vector
from thingc.primitives import Primitive
from thingc.realize.store.local import Store
from thingc.summing import plain_sum

SHARE = 0.2
"""How much of the smaller of two parts the other may take: screws in their holes and cells in their holders take a twentieth."""
LEAST = 1e-8
"""[m^3] What two parts may share however small they are."""

DIGITS = 12
"""To how many digits [m] the poses of parts to each other are taken: what is behind them is rounding."""

KIND = "overlaps"
"""Documents in the store: pairs of parts, with their poses to each other, none of which lies in the other."""


@dataclass(frozen=True, slots=True)
class _Pair:
    """Two parts of a body that may share too much, and where the other one is in the frame of the one."""

    one: Occurrence
    other: Occurrence
    at: Pose

    @property
    def smaller(self) -> Occurrence:
        """The part with less volume."""
        return min((self.one, self.other), key=_volume)


def check_overlaps(assembly: Assembly, store: Store, report: Report, memo: Memo) -> None:
    """A warning for each two parts of a link that share more than `SHARE` of the smaller one, and more than `LEAST`.

    Boxes say which can; those are looked at exactly, unless all of them have been before.
    """
    pairs: list[_Pair] = []
    for link in assembly.links:
        parts = tuple(assembly.occurrences[member] for member in link.members)
        pairs += memo(("overlaps", link.name), _candidates, parts, link.poses)
    if not pairs:
        return
    content = [[_made_of(pair.one), _made_of(pair.other), repr(pair.at)] for pair in pairs]
    key = hashlib.sha256(json.dumps([SHARE, LEAST, content]).encode()).hexdigest()
    if store.get_json(KIND, key) is None and not _look(pairs, store, report, memo):
        store.note_json(KIND, key, True)


def _look(pairs: Sequence[_Pair], store: Store, report: Report, memo: Memo) -> bool:
    """Whether any of the pairs is one too many; each such place of the documents is said once, however often it is used."""
    overlapping = False
    said: set[tuple[object, object]] = set()
    for pair in pairs:
        where = ("overlap", pair.one.path, pair.other.path)
        shared = memo(where, partial(_shared, pair, store, memo), pair.one.solids, pair.other.solids, pair.at)
        if shared <= max(LEAST, SHARE * _volume(pair.smaller)):
            continue
        overlapping = True
        place = (pair.one.origin[:1], pair.other.origin[:1])
        if place not in said and _warn(pair, shared, report):
            said.add(place)
    return overlapping


def _shared(pair: _Pair, store: Store, memo: Memo, *_: object) -> float:
    """The volume [m^3] that two parts share."""
    from thingc.solids.shapes import Solid, solid_of

    def solid(part: Occurrence) -> Solid:
        made = memo(("solid", part.path), partial(solid_of, store), part.solids)
        assert made is not None, "candidates have a volume"
        return made

    return solid(pair.one).overlap(solid(pair.other).at(pair.at))[0]


def _warn(pair: _Pair, shared: float, report: Report) -> bool:
    smaller = pair.smaller
    larger = pair.other if smaller is pair.one else pair.one
    share = f"{min(100.0 * shared / _volume(smaller), 100.0):.0f} %"
    twice = pair.one.definition == pair.other.definition
    help = "take one of them away" if twice else "put one of them onto another mount"
    return report.warn(
        Code.OVERLAP,
        f"`{pair.other.path}` and `{pair.one.path}` are in one place: {share} of `{smaller.path}` is inside `{larger.path}` "
        f"({_cubic(shared)})" + (f", which is a `{larger.definition.label}`, too" if twice else ""),
        pair.other.origin, path=pair.other.path, help=f"{help}; {allow_hint(Code.OVERLAP)}",
        notes=[Note(message=f"`{pair.one.path}` is here", span=span) for span in pair.one.origin[:1]],
    )


def _cubic(volume: float) -> str:
    """A volume [m^3] for people."""
    scale, unit = (1e6, "cm^3") if volume >= 1e-6 else (1e9, "mm^3")
    return f"{float(f'{scale * volume:.3g}'):g} {unit}"  # 1000 mm^3, not 1e+03


def _candidates(members: tuple[Occurrence, ...], poses: tuple[Pose, ...]) -> list[_Pair]:
    """The pairs of a body's parts of which the boxes share as much as would be too much. What has a surface with gaps has no inside. Of
    links those alone that list the same: others lie within each other rightly, for their shapes are rough ones that collide."""
    pairs: list[_Pair] = []
    parts = [
        (part, pose, pose.around(part.box)) for part, pose in zip(members, poses, strict=True)
        if part.box is not None and _volume(part) > 0.0 and all(map(_is_closed, part.solids))
    ]
    for number, (one, at_one, box) in enumerate(parts):
        for other, at_other, beside in parts[number + 1 :]:
            if one.definition != other.definition and (one.listed or other.listed):
                continue
            common = 1.0
            for axis in range(3):
                common *= max(0.0, min(box[1][axis], beside[1][axis]) - max(box[0][axis], beside[0][axis]))
            if common > max(LEAST, SHARE * min(_volume(one), _volume(other))):
                pairs.append(_Pair(one, other, _rounded(at_one.inverse() @ at_other)))
    return pairs


def _rounded(pose: Pose) -> Pose:
    """A pose to `DIGITS`: two parts that a third one carries lie to each other as before when that has become thicker."""
    a, b, c = pose.rotation
    return Pose(rotation=(_digits(a), _digits(b), _digits(c)), translation=_digits(pose.translation))


def _digits(vector: Vector) -> Vector:
    x, y, z = (round(entry, DIGITS) + 0.0 for entry in vector)
    return x, y, z


def _volume(part: Occurrence) -> float:
    """What it holds [m^3]; of a link all its shapes, also where they overlap."""
    if part.record is not None:
        return part.record.volume if part.record.exact else 0.0
    return plain_sum(one.solid.volume if isinstance(one.solid, Primitive) else one.volume for one in part.solids)


def _is_closed(surface: Surface) -> bool:
    return surface.solid.shape != "plane" if isinstance(surface.solid, Primitive) else surface.solid.closed


def _made_of(part: Occurrence) -> list[tuple[object, ...]]:
    """What its solid depends on."""
    return [
        (one.solid.shape, one.solid.size, one.solid.pose.rotation, one.solid.pose.translation) if isinstance(one.solid, Primitive)
        else (one.solid.sha256, one.pose.rotation, one.pose.translation)
        for one in part.solids
    ]
