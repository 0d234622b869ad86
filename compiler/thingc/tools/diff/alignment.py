"""Express the old robot of a comparison in the link frames, joint zeros and directions of the new robot.

If both robots are the same mechanism, the remaining differences are those that the map between the mechanisms does not explain.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from msgspec.structs import replace

from thingc.base.inertia import MassProperties, named_moments, total
from thingc.base.pose import NO_POSE, Pose, make_pose, rpy_of
from thingc.base.primitives import Primitive
from thingc.model.assembly.kinematics import forward_kinematics, neighbourhood
from thingc.model.assembly.types import Assembly, Listed
from thingc.model.resolve.overrides import MOMENTS
from thingc.tools.diff.name_mapping import NameMapping, equal, largest
from thingc.tools.diff.snapshot import Fact, Named, OccurrenceSnapshot, Snapshot, SnapshotElement, Value
from thingc.tools.same.comparison import TOLERANCE, JointMatch

MOTION = frozenset({"axis", "turn", "gap", "offset", "reverse", "mimic.multiplier", "mimic.offset", "mimic.polynomial"})
"""Properties of a joint that can only differ together with others if the joints of the two mechanisms move equally."""
PLACEMENT = frozenset({"xyz", "rpy", "turn", "gap"})


class Alignment:
    """The conversion of the snapshot `old` of the first of two `robots` to the frames and the joint coordinates of the other, `new`.

    Values that are then equal up to `TOLERANCE` are those of `new`. `joints` contains the same joint of the new robot for each old path.
    `links` contains the names of a link in both robots, and the pose of its old frame in its new frame.
    """

    def __init__(
        self, old: Snapshot, new: Snapshot, robots: Sequence[Assembly], joints: Mapping[str, JointMatch], links: tuple[str, str, Pose],
    ) -> None:
        self.old, self.new, self.pairing = old, new, NameMapping(old, new)
        self.joints = {path: one for path, one in joints.items() if self.pairing.path("joint", path) == one.other}
        self.heads = [{link.name: link.frame for link in side.links} for side in (old, new)]
        mates, occurrences, q = robots[0].mates, robots[0].occurrences, {path: -one.sign * one.zero for path, one in joints.items()}
        placed = forward_kinematics(mates, neighbourhood(len(occurrences), mates), robots[0].base, NO_POSE, q)
        places = {one.path: placed[one.index] for one in occurrences}
        to_new = _place(new.occurrences[self.heads[1][links[1]]]) @ links[2] @ places[self.heads[0][links[0]]].inverse()
        self.shapes = [{one.path: one.listed for one in robot.occurrences} for robot in robots]
        self.moves: dict[str, Pose] = {}
        """The pose of the old frame of a component in its new frame."""
        self.occurrences = {path: self._occurrence(one, to_new @ places[path]) for path, one in old.occurrences.items()}
        used = {kind: {*_names(one for one in old.things.values() if (one.what == "joint") is kind)} for kind in (True, False)}
        self.only_of_joints = used[True] - used[False]

    def snapshot(self) -> Snapshot:
        """Return the converted snapshot."""
        pairs = {(pair.old.what, pair.old.path): pair.new for pair in self.pairing.pairs}
        return replace(
            self.old, things={key: self._thing(one, pairs[key]) if key in pairs else one for key, one in self.old.things.items()},
            occurrences=self.occurrences, whole=self._total(self.occurrences, NO_POSE),
            links=tuple(replace(one, properties=self._total(one.members, _place(self.occurrences[one.frame]))) for one in self.old.links),
            rows=tuple(replace(one, definition=self.occurrences[one.members[0]].definition) for one in self.old.rows),
            nodes=tuple(one if one.place is None else replace(one, place=self.occurrences[one.path].place) for one in self.old.nodes),
        )

    def _occurrence(self, one: OccurrenceSnapshot, place: Pose) -> OccurrenceSnapshot:
        other = self.new.occurrences.get(self.pairing.path("component", one.path) or "")
        move = NO_POSE if other is None else _place(other).inverse() @ place
        # the frame of a link without part geometry is arbitrary; any other component has moved if its frame has moved
        is_frame = other is not None and one.shape is None and one.path in self.heads[0].values() and other.path in self.heads[1].values()
        if other is None or one.properties is None or other.properties is None or not (is_frame or _equal(move, NO_POSE)):
            return replace(one, place=place)
        self.moves[one.path], seen, theirs = move, one.properties.seen_from(move), other.properties
        inertia = theirs.inertia if _equal(seen.inertia, theirs.inertia, largest(seen.inertia)) else seen.inertia
        centre = theirs.centre if _equal(seen.centre, theirs.centre) else seen.centre
        properties = MassProperties(mass=seen.mass, centre=centre, inertia=inertia)
        ours, others = _shapes(self.shapes[0][one.path], move), _shapes(self.shapes[1][other.path], NO_POSE)
        definition = other.definition if ours and _equal(ours, others) else one.definition
        return replace(one, place=other.place, properties=properties, definition=definition)

    def _total(self, paths: Iterable[str], frame: Pose) -> MassProperties:
        """Return the mass properties of several components in a frame."""
        parts = (self.occurrences[path] for path in paths)
        return total(one.properties.seen_from(frame.inverse() @ _place(one)) for one in parts if one.properties is not None)

    def _thing(self, old: SnapshotElement, new: SnapshotElement) -> SnapshotElement:
        """Return an element of the old document with converted values."""
        facts = dict(old.facts)
        default = 0.0 if old.what == "pose" else None
        for key, value in self._values(old, {key: fact.value for key, fact in facts.items()}, new):
            theirs = new.facts.get(self.joints[key].other if old.what == "pose" else key, Fact(value=default))
            scale = largest(value) if key == "inertia.value" else 1.0
            if _equal(value, theirs.value, scale):
                facts[key] = theirs
            elif key not in facts or not _equal(value, facts[key].value, scale):
                facts[key] = Fact(value=value, span=facts[key].span if key in facts else None)
        return replace(old, facts=facts)

    def _values(self, old: SnapshotElement, values: Mapping[str, Any], new: SnapshotElement) -> Iterator[tuple[str, Value]]:
        """Yield the properties of an element that depend on frames or joint coordinates, with their converted values.

        Properties that are equal because the mechanisms are equal have the values of the new element.
        """
        joint, move, taken = self.joints.get(old.path), self.moves.get(old.of), frozenset[str]()
        if old.what == "joint" and joint is not None:
            ends, taken = ("limit.lower", "limit.upper"), MOTION
            for key, source in (*zip(ends, ends[:: joint.sign], strict=True), ("dynamics.rest", "dynamics.rest")):
                yield key, _shift(joint, values.get(source))
        elif old.what == "pose":
            yield from ((path, _shift(one, values.get(path, 0.0))) for path, one in self.joints.items() if one.sign < 0 or one.zero)
        elif old.what == "mount" and move is not None and PLACEMENT & values.keys() & new.facts.keys():
            theirs: Any = [new.facts[key].value for key in ("xyz", "rpy")]
            pose = move @ make_pose(values["xyz"], values["rpy"])
            if old.path in self.only_of_joints or _equal(pose, make_pose(*theirs)):
                taken = PLACEMENT
            else:
                yield from (("xyz", pose.translation), ("rpy", rpy_of(pose.rotation)))
        elif old.what == "component" and move is not None and (properties := self.occurrences[old.path].properties) is not None:
            moments = tuple(named_moments(properties.inertia)[name] for name in MOMENTS)
            converted: tuple[tuple[str, Value], ...] = ("com.value", properties.centre), ("inertia.value", moments)
            yield from ((key, value) for key, value in converted if values.get(key) is not None)
        elif old.what == "mate" and old.path in self.moves:
            taken = PLACEMENT
        yield from ((key, new.facts[key].value) for key in taken & new.facts.keys())


def _place(one: OccurrenceSnapshot) -> Pose:
    return one.place or NO_POSE


def _shapes(listed: Listed | None, move: Pose) -> Value:
    """Return the shapes of a link as a value that can be compared, in a frame in which the link has the pose `move`."""
    surfaces = () if listed is None else (*listed.drawn, *listed.touching, *listed.solids)
    solids = (((one.solid.shape, one.solid.size), one.solid.pose) if isinstance(one.solid, Primitive) else (one.solid.sha256, one.pose)
              for one in surfaces)
    return tuple((solid, (move @ pose).translation, (move @ pose).rotation) for solid, pose in solids)


def _shift(joint: JointMatch, value: Any) -> Value:
    """Convert a coordinate of the old joint to a coordinate of the new joint."""
    return None if value is None else joint.sign * value + joint.zero


def _names(things: Iterable[SnapshotElement]) -> Iterator[str]:
    """Yield the paths of the mounts that elements use, such as `hand/cap/pen`."""
    waiting: list[Value] = [fact.value for thing in things for fact in thing.facts.values()]
    for value in waiting:
        waiting += value if isinstance(value, tuple) else ()  # extends the list during the iteration
        if isinstance(value, (Named, str)):
            yield (value if isinstance(value, str) else value.text).replace(".", "/")


def _equal(one: Value | Pose, other: Value | Pose, scale: float = 1.0) -> bool:
    """Return whether two values are equal up to the tolerance of `thingc same`."""
    values = [(value.translation, value.rotation) if isinstance(value, Pose) else value for value in (one, other)]
    return equal(values[0], values[1], scale, TOLERANCE)
