"""Propose joints between the components of a document from the places at which their parts touch.

A shaft in a hole can turn if no other contact prevents the rotation. A part between faces on all sides can slide. Parts with other contacts
are rigidly connected. A round part that only touches parts around its own axis is a pin or a bearing: the joint connects the parts that it
holds together. A proposal is ambiguous and has a `doubt` if the geometry also fits another connection, such as a screw.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Literal

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import dist, hypot
from thingc.base.pose import Pose, Vector, along, cross, dot, rotate
from thingc.geometry.features import CentreLine
from thingc.tools.importing.document_names import UsedNames
from thingc.tools.joints.contacts import Contact, ShaftContact, parallel, same_line

FASTENERS = re.compile(r"screw|bolt|nut(?![a-z])|washer|rivet|dowel|standoff|spacer|(?<![a-z])(iso|din|m)_?\d", re.IGNORECASE)
"""Names of parts that fasten other parts rigidly."""
_ROUND = 0.02
"""Largest relative difference of the two moments of inertia across the axis of a round part."""
DECIMALS = 6
"""Number of decimals [m] of the position and the travel of a slide, which are estimates."""
Pair = tuple[str, str]


class ComponentBody(FrozenStruct):
    """A component: its name, the names of its parts, its mass [kg], and the axes about which it is round."""

    name: str
    words: tuple[str, ...]
    mass: float
    round_about: tuple[CentreLine, ...] = ()

    @property
    def fastens(self) -> bool:
        """Whether the name of the component is the name of a fastener."""
        return any(FASTENERS.search(word) for word in (self.name, *self.words))


class JointProposal(FrozenStruct):
    """A proposed joint between two components. The motion is about or along `line`, in the frame of the robot.

    `doubt` is the reason for which the joint must be accepted by name, or None. `travel` [m] is the largest plausible travel of a slide.
    """

    name: str
    kind: Literal["revolute", "prismatic"]
    parent: str
    child: str
    line: CentreLine
    doubt: str | None
    travel: float = 0.0

    @property
    def key(self) -> tuple[str, str, str]:
        """The components and the kind of the joint, which are different for every proposal."""
        return self.parent, self.child, self.kind


class JointSearch:
    """Finds joints between components. `contacts` maps pairs of components, in document order, to their contacts.

    `rigid` contains pairs of components that the document attaches to each other, and `joined` pairs that it connects by joints.
    """

    def __init__(
        self, bodies: Sequence[ComponentBody], contacts: Mapping[Pair, Contact], rigid: Sequence[Pair] = (), joined: Sequence[Pair] = (),
    ) -> None:
        self.bodies = {body.name: body for body in bodies}
        self.order = list(self.bodies)
        self.contacts = {pair: one for pair, one in contacts.items() if one != Contact() and pair not in joined}
        self.rigid = [*rigid]
        self.joined = [*joined]
        self.released: dict[Pair, set[Pair]] = {}
        self.found: list[JointProposal] = []

    def proposals(self) -> list[JointProposal]:
        """Return the proposals. All proposals without a `doubt` can be accepted together."""
        circles = [*self._bolt_circles()]
        candidates = [*self._revolute_joints(circles), *self._prismatic_joints(), *circles]
        connected = {*self.rigid, *self.joined}
        candidates = [*{one.key: one for one in reversed(candidates) if self._pair(one.parent, one.child) not in connected}.values()][::-1]
        self.found = candidates
        while True:
            accepted = [candidate for candidate in candidates if candidate.doubt is None]
            of = {name: number for number, group in enumerate(self.groups(accepted)) for name in group}
            by_ends: dict[frozenset[int], list[JointProposal]] = {}
            for candidate in accepted:
                by_ends.setdefault(frozenset((of[candidate.parent], of[candidate.child])), []).append(candidate)
            doubts = {one.key: doubt for ends, joints in by_ends.items() for one, doubt in _doubts_between(ends, joints)}
            if not doubts:
                return _name_proposals(candidates)
            candidates = [replace(candidate, doubt=doubts.get(candidate.key, candidate.doubt)) for candidate in candidates]

    def groups(self, accepted: Sequence[JointProposal]) -> list[list[str]]:
        """Return the groups of components that are rigidly connected, except by the accepted joints.

        If a joint is accepted, parts that touch around the same axis can also turn.
        """
        axes = [one.line for one in accepted if one.kind == "revolute"]
        coaxial = [one for one in self.found if one.kind == "revolute" and any(same_line(one.line, axis) for axis in axes)]
        pairs = [self._pair(one.parent, one.child) for one in (*accepted, *coaxial)]
        return self._rigid_groups({*pairs}.union(*(self.released.get(pair, set()) for pair in pairs)))

    def _rigid_groups(self, free: Collection[Pair]) -> list[list[str]]:
        """Return the groups of components that contacts connect, except the contacts of the pairs in `free`."""
        import networkx

        graph = networkx.Graph()
        graph.add_nodes_from(self.order)
        graph.add_edges_from([*self.rigid, *(pair for pair in self.contacts if pair not in free)])
        return [sorted(group, key=self.order.index) for group in networkx.connected_components(graph)]

    def _pair(self, one: str, other: str) -> Pair:
        first, second = sorted((one, other), key=self.order.index)
        return first, second

    # --- joints that turn ---------------------------------------------------------------------------------------------

    def _revolute_joints(self, circles: Sequence[JointProposal]) -> Iterator[JointProposal]:
        """Yield the proposed revolute joints. A bolt circle around the axis of a joint may be its second bearing."""
        turns = {pair: line for pair, one in self.contacts.items() if (line := axis_of_rotation(one)) is not None}
        proposals: list[JointProposal] = []
        for line, members in self._clusters(turns):
            pins = [name for name in members if self._is_pin(name, line)]
            others = [name for name in members if name not in pins]
            by_mass = sorted(pins, key=lambda name: -self.bodies[name].mass)
            while len(others) < 2 and by_mass:
                others.append(by_mass.pop(0))
            others.sort(key=self.order.index)
            pins = [name for name in pins if name not in others]
            doubt = self._doubt(line, others, pins, members)
            releasable = {pair for pair in combinations(members, 2) if _allows_rotation(self.contacts.get(pair, Contact()), line)}
            releasable |= {self._pair(one.parent, one.child) for one in circles if same_line(one.line, line)}
            sides = [[name for name in group if name in others] for group in self._rigid_groups({*turns, *releasable})]
            first, *other_sides = [side for side in sides if side] or [others]
            for side in other_sides:
                crossing = {self._pair(one, other) for one in first for other in side}
                if crossing <= releasable:
                    doubts = doubt or (f"{len(other_sides) + 1} parts share the axis" if len(other_sides) > 1 else None)
                    proposals.append(JointProposal(name="", kind="revolute", parent=first[0], child=side[0], line=line, doubt=doubts))
                    self.released[self._pair(first[0], side[0])] = crossing | self._turning_pairs(first, side, pins)
        pairs = [(one.parent, one.child) for one in proposals]
        yield from (one for one, pair in zip(proposals, pairs, strict=True) if pairs.count(pair) == 1)

    def _clusters(self, turns: Mapping[Pair, CentreLine]) -> Iterator[tuple[CentreLine, list[str]]]:
        """Yield each axis with the components that are connected by shafts and holes, or round parts, about this axis."""
        remaining = dict(turns)
        while remaining:
            pair, line = next(iter(remaining.items()))
            members = [*pair]
            for name in members:
                for one in [one for one in remaining if name in one and same_line(remaining[one], line)]:
                    members += [other for other in one if other not in members]
            remaining = {one: of for one, of in remaining.items() if not (same_line(of, line) and one[0] in members)}
            yield line, sorted(members, key=self.order.index)

    def _is_pin(self, name: str, line: CentreLine) -> bool:
        """Return whether a component is round about an axis, and all its contacts allow a rotation about this axis."""
        touching = [one for pair, one in self.contacts.items() if name in pair]
        is_round = any(same_line(axis, line) for axis in self.bodies[name].round_about)
        return is_round and all(_allows_rotation(one, line) for one in touching) and not any(name in pair for pair in self.rigid)

    def _doubt(self, line: CentreLine, others: Sequence[str], pins: Sequence[str], members: Sequence[str]) -> str | None:
        """Return the reason why a revolute joint is not the only possible connection, or None."""
        fastener = next((name for name in members if self.bodies[name].fastens), None)
        if fastener is not None:
            return f"`{fastener}` may fasten the parts"
        inside = [one for pair, one in self.contacts.items() if pair[0] in members and pair[1] in members]
        if not any(parallel(line, face.normal) for one in inside for face in one.faces):
            return "the parts can also slide along the axis"
        loose = next((name for name in others if self._is_pin(name, line) and self._is_shaft(name, line)), None)
        if loose is not None and not pins and len(self.order) > 2:
            return f"`{loose}` may be a pin that is fixed in its hole"
        return None

    def _is_shaft(self, name: str, line: CentreLine) -> bool:
        """Return whether a component is the shaft in a contact about an axis."""
        return any(
            one.first_is_shaft == (pair[0] == name)
            for pair, touching in self.contacts.items() if name in pair for one in touching.shafts if same_line(one.line, line)
        )

    def _turning_pairs(self, first: Sequence[str], other: Sequence[str], pins: Sequence[str]) -> set[Pair]:
        """Return the pairs that can turn if each pin is connected to only one of the two sides of a joint."""
        touching = {pin: [[name for name in side if self._pair(pin, name) in self.contacts] for side in (first, other)] for pin in pins}
        free = {self._pair(pin, name) for pin, (one, two) in touching.items() if one for name in two}
        sides = {pin: bool(one) for pin, (one, two) in touching.items() if one or two}
        return free | {self._pair(one, two) for one, two in combinations(sides, 2) if sides[one] != sides[two]}

    # --- joints that slide, and bolt circles ---------------------------------------------------------------------------

    def _prismatic_joints(self) -> Iterator[JointProposal]:
        """Yield the proposed prismatic joints: parts between faces around one direction, and parts on two parallel rods."""
        for (parent, child), contact in self.contacts.items():
            lines = distinct_lines(contact.shafts)
            normals = [face.normal for face in contact.faces]
            doubt = None
            if len(lines) > 1 and not normals and all(parallel(lines[0], line.axis) for line in lines):
                line, doubt = lines[0], "the rods may be fixed in their holes"
                reach = [value for shaft in contact.shafts for value in (shaft.lower, shaft.upper)]
            else:
                axis = None if lines else _enclosed_direction(normals)
                if axis is None:
                    continue
                corners = [corner for face in contact.faces for corner in face.corners]
                x, y, z = (round((min(values) + max(values)) / 2.0, DECIMALS) for values in zip(*corners, strict=True))
                line, reach = CentreLine(point=(x, y, z), axis=axis), [dot(corner, axis) for corner in corners]
            fastener = next((name for name in (parent, child) if self.bodies[name].fastens), None)
            if fastener is not None:
                doubt = f"`{fastener}` may fasten the parts"
            travel = round((max(reach) - min(reach)) / 2.0, DECIMALS)
            yield JointProposal(name="", kind="prismatic", parent=parent, child=child, line=line, doubt=doubt, travel=travel)

    def _bolt_circles(self) -> Iterator[JointProposal]:
        """Yield revolute joints about the centres of bolt circles, such as those of horns of servos."""
        for (parent, child), contact in self.contacts.items():
            if not contact.faces or not all(dist(contact.faces[0].normal, face.normal) < 1e-6 for face in contact.faces):
                continue
            centre = _circle_centre([line for line, _ in contact.holes if parallel(line, contact.faces[0].normal)])
            if centre is not None:
                doubt = "a bolt circle also fits a rigid connection"
                yield JointProposal(name="", kind="revolute", parent=parent, child=child, line=centre, doubt=doubt)


def _name_proposals(proposals: Sequence[JointProposal]) -> list[JointProposal]:
    """Give every proposal a name that is unique."""
    used = UsedNames()
    return [replace(one, name=used.take(f"{one.parent}_to_{one.child}", "joint")) for one in proposals]


def _doubts_between(ends: frozenset[int], joints: Sequence[JointProposal]) -> Iterator[tuple[JointProposal, str]]:
    """Yield the doubts that result from the groups of rigidly connected components at the ends of joints.

    If several joints about the same axis connect the same groups, only the first has no doubt.
    """
    same_axis = all(joint.kind == "revolute" and same_line(joint.line, joints[0].line) for joint in joints)
    for number, joint in enumerate(joints):
        if len(ends) == 1:
            yield joint, "other contacts connect the same parts rigidly"
        elif len(joints) > 1 and (number > 0 or not same_axis):
            yield joint, "another joint connects the same parts"


def distinct_lines(shafts: Sequence[ShaftContact]) -> list[CentreLine]:
    """Return the different axes of shafts in holes."""
    lines: list[CentreLine] = []
    for shaft in shafts:
        if not any(same_line(line, shaft.line) for line in lines):
            lines.append(shaft.line)
    return lines


def axis_of_rotation(contact: Contact) -> CentreLine | None:
    """Return the axis about which two parts can turn, or None if their contacts do not have exactly one such axis."""
    lines = distinct_lines(contact.shafts)
    return lines[0] if len(lines) == 1 and all(parallel(lines[0], face.normal) for face in contact.faces) else None


def _allows_rotation(contact: Contact, line: CentreLine) -> bool:
    return all(same_line(line, shaft.line) for shaft in contact.shafts) and all(parallel(line, face.normal) for face in contact.faces)


def _enclosed_direction(normals: Sequence[Vector]) -> Vector | None:
    """Return the direction in which a part can slide between faces, or None if the faces do not enclose the part around one direction."""
    first = normals[0] if normals else None
    other = next((one for one in normals if first is not None and abs(dot(first, one)) < 0.999), None)
    if first is None or other is None:
        return None
    x, y, z = cross(first, other)
    size = hypot(x, y, z)
    axis = (x / size, y / size, z / size)
    if any(abs(dot(axis, one)) > 1e-6 for one in normals):
        return None
    to_axis = along(axis, (0.0, 0.0, 0.0)).inverse()
    angles = sorted(math.atan2(v[1], v[0]) for v in (rotate(to_axis.rotation, one) for one in normals))
    gaps = [after - before for before, after in zip(angles, [*angles[1:], angles[0] + 2.0 * math.pi], strict=True)]
    return axis if max(gaps) < math.pi - 1e-3 else None


def _circle_centre(lines: Sequence[CentreLine]) -> CentreLine | None:
    """Return the axis of a bolt circle, on which at least three parallel lines are evenly far from their centre."""
    points = [line.point for number, line in enumerate(lines) if not any(same_line(line, other) for other in lines[:number])]
    if len(points) < 3:
        return None
    x, y, z = (math.fsum(values) / len(points) for values in zip(*points, strict=True))
    away = [dist(point, (x, y, z)) for point in points]
    return CentreLine(point=(x, y, z), axis=lines[0].axis) if max(away) - min(away) < 1e-5 else None


def round_axes(inertia: Sequence[Sequence[float]], centre: Vector, lines: Sequence[CentreLine], pose: Pose) -> tuple[CentreLine, ...]:
    """Return the axes of outer cylinders about which the mass of a part is distributed evenly.

    The inertia is about the centre of mass, in the frame of the part; the axes are in the frame of the robot, in which the part has a pose.
    """
    axes: list[CentreLine] = []
    for line in lines:
        x, y, z = (rotate(pose.inverse().rotation, axis) for axis in zip(*along(line.axis, (0.0, 0.0, 0.0)).rotation, strict=True))

        def product(one: Vector, other: Vector) -> float:
            return math.fsum(one[i] * inertia[i][j] * other[j] for i in range(3) for j in range(3))

        largest = max(product(x, x), product(y, y), product(z, z))
        uneven = (product(x, x) - product(y, y), product(x, y), product(x, z), product(y, z))
        at = pose.apply(centre)
        offset = dist(line.point, tuple(at[k] - dot(at, line.axis) * line.axis[k] for k in range(3)))
        if max(map(abs, uneven)) <= _ROUND * largest and offset < 1e-4 and not any(same_line(line, other) for other in axes):
            axes.append(line)
    return tuple(axes)
