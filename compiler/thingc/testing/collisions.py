"""The true shapes of the parts and links of a robot, and which pairs of them are near each other in a pose."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from thingc.emit.request import EmitRequest
from thingc.frozen import dataclass
from thingc.graph.types import Assembly
from thingc.pose import Pose
from thingc.robot.types import Keyframe
from thingc.solids.shapes import Solid, Solids

LOOK = 0.01
"""How far [m] the smallest gap is looked for: beyond it nobody wants to know."""
TOUCH = 1e-9
"""A gap [m] that is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Near:
    """Two occurrences (indices) near each other in a keyframe: their `gap` [m]; where it is 0 the `volume` [m^3] of what they
    share and its mean thickness `depth` [m]; and the number of the allowance that they fall under."""

    one: int
    other: int
    gap: float
    depth: float
    volume: float
    allowance: int | None
    where: Keyframe

    @property
    def badness(self) -> tuple[float, float]:
        """Deeper, then nearer."""
        return self.depth, -self.gap


class Collisions:
    """The pairs of an assembly that may collide, and their shapes. `tolerance` [m] is how far each tessellated surface may be
    off the true one: an overlap counts from a mean depth of twice that."""

    def __init__(self, assembly: Assembly, shapes: Solids, tolerance: float) -> None:
        self.assembly = assembly
        self.deep = 2.0 * tolerance
        self._solids: dict[int, Solid] = {}
        for occurrence in assembly.occurrences:
            solid = shapes.solid(occurrence)
            if solid is not None:
                self._solids[occurrence.index] = solid
        near, link_of = set(_neighbours(assembly)), assembly.link_of
        indices = sorted(self._solids)
        self.pairs = [
            (a, b) for k, a in enumerate(indices) for b in indices[k + 1 :]
            if link_of[a] != link_of[b] and _ordered(link_of[a], link_of[b]) not in near
        ]
        self.hulls = [o.path for o in assembly.occurrences if o.definition.text in shapes.hulls]

    def wrong(self, near: Near, clearance: float) -> bool:
        """Whether two occurrences are nearer than they may be."""
        return near.gap < clearance - TOUCH if clearance > 0.0 else near.depth > self.deep

    def near(
        self, poses: Sequence[Pose], frame: Keyframe, clearance: float, look: float, allowed: Mapping[tuple[int, int], int],
        needed: Collection[int] = (),
    ) -> Iterator[Near]:
        """The pairs nearer than `clearance` [m], and of those that no allowance is for also the nearest within `look` [m]. Of
        allowances that are known to be `needed` nothing more is found out."""
        if not self.pairs:
            return
        boxes = {index: solid.box(poses[index]) for index, solid in self._solids.items()}
        ones, others = (np.array([boxes[pair[side]] for pair in self.pairs]) for side in (0, 1))
        between = np.maximum(others[:, 0] - ones[:, 1], ones[:, 0] - others[:, 1])
        apart = np.linalg.norm(np.maximum(between, 0.0), axis=1)
        placed: dict[int, Solid] = {}
        for number in np.argsort(apart, kind="stable"):
            pair = self.pairs[number]
            allowance = allowed.get(pair)
            within = max(clearance, TOUCH) if allowance is not None else max(clearance, look, TOUCH)
            if apart[number] > within or allowance in needed:
                continue
            for index in pair:
                if index not in placed:
                    placed[index] = self._solids[index].at(poses[index])
            one, other = (placed[index] for index in pair)
            gap = one.gap(other, within)
            if gap >= within:
                continue
            volume, depth = one.overlap(other) if gap <= 0.0 else (0.0, 0.0)
            if allowance is None:
                look = min(look, gap)
            yield Near(one=pair[0], other=pair[1], gap=gap, depth=depth, volume=volume, allowance=allowance, where=frame)


def collisions_of(request: EmitRequest) -> Collisions:
    """The pairs and shapes of the assembly, made once for all tests of a request."""
    known = request.made.get("collisions")
    if isinstance(known, Collisions):
        return known
    made = Collisions(request.assembly, Solids(request.store), request.workspace.mesh.linear)
    request.made["collisions"] = made
    return made


def _ordered(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)


def _neighbours(assembly: Assembly) -> Iterator[tuple[int, int]]:
    """Pairs of links that a joint connects, also one that closes a loop."""
    for mate in assembly.mates:
        if mate.joints or mate.loop is not None:
            yield _ordered(assembly.link_of[mate.parent], assembly.link_of[mate.child])
