"""MInchW's way through a tunnel of steel: along the floor, over the inner corner onto the wall, up, over the corner under the
ceiling, and along that.

Both corners are one and the same plan: seen from the steel that is left, the steel that is come to is a quarter turn further, nose
up. What differs is where gravity pulls, which the servos are told and the plan is not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import cos, pi, radians, sin

import mujoco

from inchworm_gait import DRAWN_UP, Legs, Stance, Swing, other, swing, swings
from inchworm_physics import Face

SHORT, STRIDE, LIFT, SINK = 0.32, 0.09, 0.025, 0.0001
"""As in `walk`; a little less drawn up, which leaves the joints more room in the corners."""

PRESS = 1.5
"""How long [s] a magnet takes hold in a corner: there the foot that holds bears the jolt at the end of a long lever."""

ARRIVE, LEAVE = 0.39, 0.08
"""How far [m] the rear sole is from a corner when the robot, drawn up, begins to cross it, and when it has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One foot in a corner: how far from it [m] it is put down, before it or `beyond`; the pitch of the body [deg] then, from the steel
    before the corner, and how much further up the nose is on the way; how far the foot is lifted [m], and for how long [s]."""

    moves: str
    beyond: bool
    to: float
    pitch: float
    nose: float
    lift: float
    seconds: float


CORNER = (
    Step(moves="front", beyond=True, to=0.34, pitch=44.0, nose=8.0, lift=0.03, seconds=3.0),
    Step(moves="rear", beyond=False, to=0.33, pitch=46.0, nose=-4.0, lift=0.025, seconds=1.5),
    Step(moves="front", beyond=True, to=0.40, pitch=54.0, nose=4.0, lift=0.025, seconds=1.5),
    Step(moves="rear", beyond=True, to=LEAVE, pitch=90.0, nose=-10.0, lift=0.03, seconds=3.0),
)
"""Found by a search over footholds and pitches: no joint comes closer than 15 degrees to its limit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tunnel:
    """A floor, a wall and a ceiling for so many strides on each, and the swings that lead through it."""

    floor: int = 1
    wall: int = 1
    ceiling: int = 2

    @property
    def length(self) -> float:
        """From the rear sole at the start to the wall [m]."""
        return self.floor * STRIDE + ARRIVE

    @property
    def height(self) -> float:
        """From floor to ceiling [m]."""
        return LEAVE + self.wall * STRIDE + ARRIVE

    @property
    def faces(self) -> tuple[Face, Face, Face]:
        """Of steel, in the world of the robot that starts on its rear foot."""
        return (
            Face(name="floor"), Face(name="wall", x=self.length, turn=pi / 2), Face(name="ceiling", x=self.length, z=self.height, turn=pi)
        )

    def plan(self, models: Mapping[str, mujoco.MjModel]) -> list[Swing]:
        """The whole way, by the models of the modes that a foot holds."""
        way = corner(models)
        strides = {n: swings(dict(models), n, SHORT, STRIDE, LIFT, SINK) for n in {self.floor, self.wall, self.ceiling}}
        return [*strides[self.floor], *way, *strides[self.wall], *way, *strides[self.ceiling]]

    def footholds(self) -> list[Stance]:
        """Where the soles should land in the world, in the order of the plan: pressed below the steel."""
        found, faces = [], self.faces
        for k, (strides, start, length) in enumerate(
            ((self.floor, 0.0, self.length), (self.wall, LEAVE, self.height), (self.ceiling, LEAVE, 0.0))
        ):
            face, following = faces[k], faces[min(k + 1, 2)]
            for stride in range(1, strides + 1):
                found += [foothold(face, start + SHORT + stride * STRIDE), foothold(face, start + stride * STRIDE)]
            if face is not following:
                found += [foothold(following, step.to) if step.beyond else foothold(face, length - step.to) for step in CORNER]
        return found


def foothold(face: Face, distance: float) -> Stance:
    """In the world, `distance` [m] along a face from where it begins."""
    along, out = (cos(face.turn), sin(face.turn)), (-sin(face.turn), cos(face.turn))
    return Stance(
        x=face.x + distance * along[0] - SINK * out[0], z=face.z + distance * along[1] - SINK * out[1], turn=face.turn
    )


def corner(models: Mapping[str, mujoco.MjModel]) -> list[Swing]:
    """From drawn up before a corner to drawn up beyond it. Raises `ValueError` where the legs do not reach."""
    at = {"front": (False, ARRIVE - SHORT), "rear": (False, ARRIVE)}
    found: list[Swing] = []
    q, pitch = DRAWN_UP, 0.0
    for step in CORNER:
        holds = other(step.moves)
        legs, after = Legs(models[holds], holds), {**at, step.moves: (step.beyond, step.to)}
        begin, end = (stance(feet[holds], feet[step.moves], radians(p)) for feet, p in ((at, pitch), (after, step.pitch)))
        way = swing(legs, q, begin, end, lift=step.lift, nose=radians(step.nose), sink=SINK, seconds=step.seconds)
        found.append(replace(way, press=PRESS))
        q, at, pitch = found[-1].end, after, step.pitch
    return found


def stance(held: tuple[bool, float], moving: tuple[bool, float], pitch: float) -> Stance:
    """Of two feet at a corner, each beyond it or not and so far from it [m], with the body at `pitch` [rad] from the steel before it."""
    (xh, zh, turn), (xm, zm, turned) = (
        (0.0, distance, pi / 2) if beyond else (-distance, 0.0, 0.0) for beyond, distance in (held, moving)
    )
    x, z = xm - xh, zm - zh
    return Stance(x=x * cos(turn) + z * sin(turn), z=z * cos(turn) - x * sin(turn), turn=turned - turn, pitch=pitch - turn)
