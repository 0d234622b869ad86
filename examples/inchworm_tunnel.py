"""The path of MInchW through a steel tunnel: along the floor, over the inner corner onto the wall, up, over the next corner to the
ceiling, and along it.

Both corners use the same plan: relative to the old surface, the new surface is rotated by a quarter turn, nose up. Only gravity differs.
The servo commands take gravity into account; the plan does not depend on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import cos, pi, radians, sin

import mujoco

from inchworm_gait import DRAWN_UP, Legs, Stance, Swing, other, swing, swings
from inchworm_physics import Face

SHORT, STRIDE, LIFT, SINK = 0.32, 0.09, 0.025, 0.0001
"""Parameters as in `walk`, but with a slightly larger distance between the soles, which leaves more joint range in the corners."""

PRESS = 1.5
"""Time [s] for a magnet to attach in a corner, where the impact acts on the holding foot with a long lever."""

ARRIVE, LEAVE = 0.39, 0.08
"""Distances [m] of the rear sole from a corner before and after the robot crosses it, with both feet close together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A foothold in a corner: its distance from the corner [m] (before it, or `beyond`), the pitch of the body [deg] relative to the steel
    before the corner, the additional pitch during the swing, the lift of the foot [m] and its duration [s].
    """

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
"""Result of a search over footholds and pitches. All joints stay at least 15 degrees away from their limits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tunnel:
    """A tunnel with a number of strides on the floor, the wall and the ceiling, and the swings of the robot through it."""

    floor: int = 1
    wall: int = 1
    ceiling: int = 2

    @property
    def length(self) -> float:
        """Distance from the rear sole at the start to the wall [m]."""
        return self.floor * STRIDE + ARRIVE

    @property
    def height(self) -> float:
        """Distance from the floor to the ceiling [m]."""
        return LEAVE + self.wall * STRIDE + ARRIVE

    @property
    def faces(self) -> tuple[Face, Face, Face]:
        """Return the steel surfaces in the world of the robot that starts on its rear foot."""
        return (
            Face(name="floor"), Face(name="wall", x=self.length, turn=pi / 2), Face(name="ceiling", x=self.length, z=self.height, turn=pi)
        )

    def plan(self, models: Mapping[str, mujoco.MjModel]) -> list[Swing]:
        """Plan the whole path with the models of the modes rooted at a foot."""
        way = corner(models)
        strides = {n: swings(dict(models), n, SHORT, STRIDE, LIFT, SINK) for n in {self.floor, self.wall, self.ceiling}}
        return [*strides[self.floor], *way, *strides[self.wall], *way, *strides[self.ceiling]]

    def footholds(self) -> list[Stance]:
        """Return the planned positions of the soles in the world in order, pressed below the surface of the steel."""
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


def foothold(face: Face, distance: float, height: float = -SINK) -> Stance:
    """Return the point at `distance` [m] along a surface from its start and `height` [m] above it, in the world."""
    along, out = (cos(face.turn), sin(face.turn)), (-sin(face.turn), cos(face.turn))
    return Stance(
        x=face.x + distance * along[0] + height * out[0], z=face.z + distance * along[1] + height * out[1], turn=face.turn
    )


def corner(models: Mapping[str, mujoco.MjModel]) -> list[Swing]:
    """Plan the swings from before a corner to beyond it, with the soles close together at both ends. Raises `ValueError` if the legs
    cannot reach.
    """
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
    """Return the stance of two feet at a corner. Each foot is before or beyond it at a distance [m]. The body has the pitch `pitch` [rad]
    relative to the steel before the corner.
    """
    one, two = (
        Stance(z=distance, x=0.0, turn=pi / 2) if beyond else Stance(x=-distance) for beyond, distance in (held, moving)
    )
    return replace(two, pitch=pitch).seen_from(one)
