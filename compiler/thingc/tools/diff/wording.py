"""Values for people, where their dimension is known: as they are written, or as their joint or the bounds of their parameter say."""

from __future__ import annotations

from thingc.base.joints.kinds import KINDS
from thingc.base.units import Dimension, Quantity, UnitError, parse_quantity
from thingc.tools.diff.name_mapping import Pair
from thingc.tools.diff.snapshot import Fact, Snapshot, SnapshotElement, Value

POSITIONS = frozenset({"limit.lower", "limit.upper", "limit.cone", "offset"})
LONGEST = 40
"""Characters of what is shown as it is written."""


def worded(pair: Pair, key: str, old: Fact | None, new: Fact | None, robots: tuple[Snapshot, Snapshot]) -> tuple[str, str] | None:
    """The values of a fact in both robots; None where nobody knows their dimension."""
    words = tuple(_said(fact) for fact in (old, new))
    if words[0] is not None and words[1] is not None:
        return (words[0], words[1])
    dimensions = [_dimension(thing, key, robot) for thing, robot in zip((pair.old, pair.new), robots, strict=True)]
    values = [fact.value if fact is not None else None for fact in (old, new)]
    if dimensions[0] is None or dimensions[0] != dimensions[1]:
        return None
    return (_number(values[0], dimensions[0]), _number(values[1], dimensions[0]))


def _said(fact: Fact | None) -> str | None:
    if fact is None:
        return None
    if fact.words is not None:
        return fact.words
    written = fact.written
    plain = written is not None and "=" not in written and len(written) <= LONGEST and not written.startswith(("[", "{"))
    return written if plain and isinstance(fact.value, (int, float)) and not isinstance(fact.value, bool) else None


def _dimension(thing: SnapshotElement, key: str, robot: Snapshot) -> Dimension | None:
    if thing.what == "pose" or thing.what == "joint" and key in POSITIONS:
        joint = robot.things.get(("joint", key)) if thing.what == "pose" else thing
        return None if joint is None else _coordinate(joint)
    if thing.what == "parameter":
        for fact in thing.facts.values():
            try:
                return parse_quantity(fact.written or "").dimension
            except UnitError:
                continue
    return None


def _coordinate(joint: SnapshotElement) -> Dimension | None:
    """Of q of a joint, or of one coordinate of it, whose path ends with its number: `wrist_1`."""
    kind = KINDS.get(joint.label or "")
    if kind is None or kind.coordinate is not None:
        return kind.coordinate if kind is not None else None
    number = joint.path.rpartition("_")[2]
    return kind.twists[int(number)].coordinate if number.isdecimal() and int(number) < len(kind.twists) else None


def _number(value: Value, dimension: Dimension) -> str:
    return str(Quantity(float(value), dimension)) if isinstance(value, (int, float)) else "nothing"
