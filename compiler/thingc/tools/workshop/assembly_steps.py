"""Find an order in which a robot can be assembled. Nested assemblies are built first, and each becomes one piece of the outer assembly.

The order is found by taking the finished assembly apart: a piece can be removed if no other piece hangs on it, and if it slides away along
an axis of its mount without collisions. If there is no such piece, a piece is removed together with all pieces that hang on it: this group
is assembled first. If this is not possible either, a piece is added together with the pieces in its way. Pieces that `order` lists are
removed in the reverse order of the list.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import chain
from math import inf

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from thingc.base.diagnostics import Code, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.grouping import group_by
from thingc.base.interfaces import Shank
from thingc.base.numeric import sum_of
from thingc.base.pose import Pose, Vector, add_scaled, transpose
from thingc.base.source import Origin
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly, Mate, Occurrence
from thingc.model.solids.shapes import Solid, Solids
from thingc.targets.bom.emit import is_listed

Array = NDArray[np.float64]

STEPS = 2.0
"""Number of positions at which a moving piece is checked, for each length of the piece."""
SLACK = 0.01
"""The part of the smaller volume by which a moving piece may overlap another piece, in addition to the overlap in place."""
SHORTEST = 1e-3
"""The smallest length [m] from which the distance of these positions is computed."""


class Piece:
    """A part of a document, a nested assembly or a group, with its occurrences and the mate that places it in the document.

    `definition` is the text of its definition. `chapter` is the key of the section in which it is assembled, or None for a part. `members`
    contains the pieces of a group, the piece that carries the others first. `rank` is the index of the piece in `order` of its document,
    or -1, and `listed` is its location there.
    """

    def __init__(self, name: str, definition: str, chapter: str | None, occurrences: Sequence[Occurrence]) -> None:
        self.name, self.definition, self.chapter, self.occurrences = name, definition, chapter, occurrences
        self.mate: Mate | None = None
        self.parent: Piece | None = None
        self.members: tuple[Piece, ...] = (self,)
        self.rank = -1
        self.listed: Origin = ()

    @property
    def first(self) -> Occurrence:
        """The first occurrence."""
        return self.occurrences[0]

    @property
    def is_screw(self) -> bool:
        """Whether the piece is a screw: the mount at which it is attached has a shank."""
        mount = None if self.mate is None else self.first.mounts.get(self.mate.child_mount)
        return mount is not None and any(isinstance(one, Shank) for one in mount.features)

    def equals(self, other: Piece) -> bool:
        """Return whether another piece has the same definition, and both are attached rigidly to the same piece, by equal mounts."""
        if self.mate is None or other.mate is None or self.mate.joints or other.mate.joints:
            return False
        return self.definition == other.definition and self.parent is other.parent and self.mate.child_mount == other.mate.child_mount


class AssemblyStep(FrozenStruct, eq=False):
    """Equal pieces that are added together, with the directions along which they are removed, in the frame of the robot.

    `blocked` contains the names of the pieces in their way if there is no such direction.
    """

    pieces: tuple[Piece, ...]
    directions: tuple[Vector | None, ...]
    blocked: tuple[str, ...] = ()


class Section(FrozenStruct, eq=False):
    """The assembly of one document or group: its key and title, the path of its first use, the number of its uses, and its steps."""

    chapter: str
    title: str
    path: str
    count: int
    steps: tuple[AssemblyStep, ...]


def sections(assembly: Assembly, store: Store, report: Report) -> list[Section]:
    """Return the assemblies to build, nested assemblies first. Equal nested assemblies have one section.

    An error is reported for each piece that cannot be added in the order of its document.
    """
    planner = _Planner(assembly, store, report)
    titles = {one.text: one.label for one in assembly.hag.definitions}
    sections_by_key: dict[str, list[Section]] = {}
    counts: dict[str, int] = {}

    def visit(path: str) -> None:
        pieces = planner.pieces(path)
        for piece in pieces:
            if piece.chapter is not None:
                visit(f"{path}/{piece.name}".lstrip("/"))
        chapter = planner.definition(path)
        counts[chapter] = counts.get(chapter, 0) + 1
        if chapter not in sections_by_key:
            groups: list[Section] = []
            steps = tuple(planner.steps(pieces, chapter, path, groups))
            sections_by_key[chapter] = [*groups, Section(chapter=chapter, title=titles[chapter], path=path, count=0, steps=steps)]

    visit("")
    return [replace(one, count=counts[chapter]) for chapter, together in sections_by_key.items() for one in together]


class _Planner:
    def __init__(self, assembly: Assembly, store: Store, report: Report) -> None:
        self._assembly, self._report = assembly, report
        self._orders = {one.text: one.order for one in assembly.definition.assemblies()}
        self._solids = Solids(store)
        self._places: dict[Piece, list[tuple[Solid, Pose]]] = {}
        self._mates = {mate.child: mate for mate in assembly.mates if mate.loop is None}

    @cached_property
    def _definitions(self) -> dict[tuple[str, str], str]:
        return {(edge.parent, edge.component): edge.child for edge in self._assembly.hag.edges}

    def definition(self, path: str) -> str:
        """Return the text of the definition of the assembly at a path."""
        text = self._assembly.hag.root
        for name in filter(None, path.split("/")):
            text = self._definitions[text, name]
        return text

    def pieces(self, path: str) -> list[Piece]:
        """Return the pieces of the assembly at a path in the order of the document, with their mates."""
        prefix = f"{path}/" if path else ""
        inside = (one for one in self._assembly.occurrences if one.path.startswith(prefix))
        members = group_by(inside, lambda one: one.path[len(prefix):].partition("/")[0])
        pieces = []
        for name, occurrences in members.items():
            first = occurrences[0]
            nested = first.path != prefix + name
            part_definition = first.definition.text if first.definition.kind in ("part", "file") else first.path
            definition = self.definition(prefix + name) if nested else part_definition
            pieces.append(Piece(name, definition, definition if nested and first.unit is None else None, occurrences))
        ranks = {one.text: (rank, one.origin) for rank, one in enumerate(self._orders.get(self.definition(path), ()))}
        for piece in pieces:
            piece.rank, piece.listed = ranks.get(piece.name, (-1, ()))
        owner = {one.index: piece for piece in pieces for one in piece.occurrences}
        for piece in pieces:
            for one in piece.occurrences:
                mate = self._mates.get(one.index)
                if mate is not None and mate.parent in owner and owner[mate.parent] is not piece:
                    piece.mate, piece.parent = mate, owner[mate.parent]
        return pieces

    def steps(self, pieces: Sequence[Piece], chapter: str, path: str, groups: list[Section]) -> list[AssemblyStep]:
        """Return the steps in which pieces are assembled. For pieces that must be assembled first, add sections to `groups`.

        Pieces without a solid, such as circuit boards with only a mass, are added as soon as their parents are there.
        """
        without_solid = [
            piece for piece in pieces
            if piece.rank < 0 and not self._solids_of(piece) and not any(other.parent is piece for other in pieces)
        ]
        steps: list[AssemblyStep] = []
        for step in reversed(self._removal_steps([piece for piece in pieces if piece not in without_solid], chapter)):
            (piece,) = step.pieces
            if len(piece.members) > 1:
                members = [*piece.members, *(one for one in without_solid if one.parent in piece.members)]
                without_solid = [one for one in without_solid if one not in members]
                group_steps = tuple(self.steps(members, piece.definition, path, groups))
                groups.append(Section(chapter=piece.definition, title=f"group {piece.name}", path=path, count=0, steps=group_steps))
            if steps and steps[-1].pieces[0].equals(piece) and steps[-1].blocked == step.blocked:
                last = steps.pop()
                step = replace(last, pieces=last.pieces + step.pieces, directions=last.directions + step.directions)
            steps.append(step)
        for piece in reversed(without_solid):
            parent_step = next((k for k, step in enumerate(steps) if piece.parent in step.pieces), len(steps) - 1)
            steps.insert(parent_step + 1, AssemblyStep(pieces=(piece,), directions=(None,)))
        return [step for step in steps if any(is_listed(one) for piece in step.pieces for one in piece.occurrences)]

    def _removal_steps(self, pieces: Sequence[Piece], chapter: str) -> list[AssemblyStep]:
        """Return the steps in which pieces and groups are removed, one at a time."""
        present = self._order_pieces(pieces)
        removed: list[AssemblyStep] = []
        while present:
            leaves = self._leaves(present)
            removable = (piece for piece in chain(leaves, self._branches(present, chapter)) if _is_last(piece, present))
            removals = ((piece, direction) for piece in removable for direction in self._free_directions(piece, present))
            step = next((AssemblyStep(pieces=(piece,), directions=(direction,)) for piece, direction in removals), None)
            if step is None:
                step = AssemblyStep(pieces=(leaves[0],), directions=(None,), blocked=self._blocking_names(leaves[0], present))
                listed = next((other for other in present if other.rank >= 0 and other.name in step.blocked), None)
                if leaves[0].rank >= 0 and listed is not None:
                    message = f"`{listed.name}` blocks the insertion of `{leaves[0].name}`"
                    help = f"list `{leaves[0].name}` before `{listed.name}`, or remove `{leaves[0].name}` from the list"
                    self._report.add(Code.ASSEMBLY_ORDER, message, leaves[0].listed, help=help)
            removed.append(step)
            present = [other for other in present if other not in step.pieces[0].members]
        return removed

    def _leaves(self, present: Sequence[Piece]) -> list[Piece]:
        """Return the pieces without other pieces attached to them that can be removed next according to `order`, the last one first.

        If there are none, report the contradiction in `order`, and return all pieces without other pieces attached to them.
        """
        leaves = [piece for piece in reversed(present) if not any(other.parent is piece for other in present)]
        allowed = [piece for piece in leaves if _is_last(piece, present)]
        if not allowed:
            leaf, carrier = next((leaf, one) for leaf in leaves for one in _carriers(leaf) if one.rank > leaf.rank)
            message, help = f"`{leaf.name}` is listed before the supporting component `{carrier.name}`", f"list `{carrier.name}` first"
            self._report.add(Code.ASSEMBLY_ORDER, message, leaf.listed, help=help)
        return allowed or leaves

    def _branches(self, present: Sequence[Piece], chapter: str) -> Iterator[Piece]:
        """Yield groups of a piece and all pieces that hang on it, the smallest first."""
        branches: list[list[Piece]] = []
        for piece in present:
            branch = [piece]
            for other in present:
                if other.parent in branch:
                    branch.append(other)
            if len(branch) > 1 and piece.parent in present:
                branches.append(branch)
        for branch in sorted(branches, key=len):
            first = branch[0]
            key = f"{chapter} {first.name}"
            group = Piece(first.name, key, key, [one for piece in branch for one in piece.occurrences])
            group.mate, group.parent, group.members = first.mate, first.parent, tuple(branch)
            yield group

    def _order_pieces(self, pieces: Sequence[Piece]) -> list[Piece]:
        """Return pieces with parents first, and each screw as soon as all parts that it passes are there."""
        others = [piece for piece in pieces if not piece.is_screw]
        passed = {piece: [other for other in others if self._meet(piece, other)] for piece in pieces if piece.is_screw}
        order: list[Piece] = []
        waiting = list(pieces)
        while waiting:
            free = [piece for piece in waiting if piece.parent not in waiting]
            screws = (piece for piece in free if piece.is_screw and all(other in order for other in passed[piece]))
            chosen = next(screws, None) or next((piece for piece in free if not piece.is_screw), free[0])
            order.append(chosen)
            waiting.remove(chosen)
        return order

    def _meet(self, piece: Piece, other: Piece) -> bool:
        """Return whether bounding boxes of parts of two pieces overlap."""
        boxes, other_boxes = ([solid.box(pose) for solid, pose in self._solids_of(one)] for one in (piece, other))
        return any(_overlap(box, other_box) for box in boxes for other_box in other_boxes)

    def _free_directions(self, piece: Piece, present: Sequence[Piece]) -> Iterator[Vector | None]:
        """Yield the directions along the axes of its mount in which a piece can be removed, first out of the part that carries it.

        A piece without a solid can be removed in any case, and has no direction.
        """
        if not self._solids_of(piece) or len(present) == 1:
            yield None
        elif piece.mate is not None:
            yield from (direction for direction in self._axes(piece.mate) if not self._collisions(piece, present, direction))

    def _axes(self, mate: Mate) -> list[Vector]:
        x, y, z = transpose((self._assembly.rest[mate.parent] @ mate.X_PJ).rotation)
        return [signed_axis for axis in (z, x, y) for signed_axis in (axis, (-axis[0], -axis[1], -axis[2]))]

    def _blocking_names(self, piece: Piece, present: Sequence[Piece]) -> tuple[str, ...]:
        assert piece.mate is not None
        return tuple(other.name for other in self._collisions(piece, present, self._axes(piece.mate)[0]))

    def _collisions(self, piece: Piece, present: Sequence[Piece], direction: Vector) -> list[Piece]:
        """Return the pieces with which a piece collides while it slides away in a direction."""
        return [other for other in present if other not in piece.members and self._collides(piece, other, np.array(direction))]

    def _collides(self, piece: Piece, other: Piece, direction: Array) -> bool:
        if not self._solids_of(other):
            return False
        box, other_box = self._box(piece), self._box(other)
        length = max(float(np.abs(direction) @ (box[1] - box[0])), SHORTEST)
        reach = float((other_box * direction).max(axis=0).sum() - (box * direction).min(axis=0).sum())
        moved = box + reach * direction
        if reach <= 0.0 or not _overlap(np.stack([np.minimum(box[0], moved[0]), np.maximum(box[1], moved[1])]), other_box):
            return False
        count = int(np.ceil(STEPS * reach / length))
        allowed = self._overlap_volume(piece, other, np.zeros(3)) + SLACK * min(self._volume(piece), self._volume(other))
        return any(self._overlap_volume(piece, other, direction * reach * k / count) > allowed for k in range(1, count + 1))

    def _solids_of(self, piece: Piece) -> list[tuple[Solid, Pose]]:
        if piece not in self._places:
            placed = [(self._solids.solid(one), self._assembly.rest[one.index]) for one in piece.occurrences]
            self._places[piece] = [(solid, pose) for solid, pose in placed if solid is not None]
        return self._places[piece]

    def _box(self, piece: Piece) -> Array:
        """Return the bounding box (2, 3) [m] of a piece with solids."""
        boxes = [solid.box(pose) for solid, pose in self._solids_of(piece)]
        return np.stack([np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)])

    def _volume(self, piece: Piece) -> float:
        return sum_of(float(solid.whole.volume()) for solid, _ in self._solids_of(piece))

    def _overlap_volume(self, piece: Piece, other: Piece, offset: Array) -> float:
        """Return the volume [m^3] in which a piece at an offset overlaps another piece."""
        total = 0.0
        for solid, pose in self._solids_of(piece):
            moved = replace(pose, translation=add_scaled(pose.translation, tuple(offset.tolist()), 1.0))
            for other_solid, other_pose in self._solids_of(other):
                if _overlap(solid.box(moved), other_solid.box(other_pose)):
                    total += solid.at(moved).overlap(other_solid.at(other_pose))[0]
        return total


def _is_last(piece: Piece, present: Sequence[Piece]) -> bool:
    """Return whether a piece or group can be removed next: `order` lists no other present piece after it."""
    lowest = min((one.rank for one in piece.members if one.rank >= 0), default=inf)
    return not any(other.rank > lowest and other not in piece.members for other in present)


def _carriers(piece: Piece) -> Iterator[Piece]:
    while piece.parent is not None:
        piece = piece.parent
        yield piece


def _overlap(one: Array, other: Array) -> bool:
    return bool((one[0] < other[1]).all() and (other[0] < one[1]).all())
