"""Plan the path of MInchW through a steel tunnel. The path leads along the floor, over the inner corner to the wall, up the wall, and over
the next corner to the ceiling.

Both corners use the same plan, because in both corners the new surface is rotated by 90 degrees, nose up, relative to the old surface. The
two corners differ only in the direction of gravity. The servo commands take gravity into account, but the plan does not depend on gravity.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import cos, pi, radians, sin

import mujoco

from inchworm_gait import DRAWN_UP, Legs, Stance, Swing, other, swing, swings
from inchworm_physics import Face

SHORT, STRIDE, LIFT, SINK = 0.32, 0.09, 0.025, 0.0001
"""The same parameters as in `walk.py`. The distance between the soles is slightly larger, which leaves more range for the joints in the
corners.
"""

PRESS = 1.5
"""Time [s] that a magnet needs to attach in a corner. In a corner, the impact acts on the holding foot with a long lever."""

ARRIVE, LEAVE = 0.39, 0.08
"""Distances [m] from the rear sole to a corner, before and after the robot crosses the corner. At both distances, the feet are close
together.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A step in a corner. `to` is the distance [m] of the foothold from the corner, and `beyond` is True if the foothold is after the
    corner. `pitch` [deg] is the pitch of the body relative to the steel before the corner, and `nose` [deg] is its increase during the
    swing. `lift` [m] and `seconds` [s] are the height and the duration of the swing.
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
"""Steps over a corner, found by a search over footholds and pitches. All joints stay at least 15 degrees away from their limits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tunnel:
    """A tunnel, and the swings of the robot through the tunnel. The fields contain the number of strides on the floor, the wall and the
    ceiling.
    """

    floor: int = 1
    wall: int = 1
    ceiling: int = 2

    @property
    def length(self) -> float:
        """Return the distance [m] from the initial position of the rear sole to the wall."""
        return self.floor * STRIDE + ARRIVE

    @property
    def height(self) -> float:
        """Return the distance [m] from the floor to the ceiling."""
        return LEAVE + self.wall * STRIDE + ARRIVE

    @property
    def faces(self) -> tuple[Face, Face, Face]:
        """Return the steel planes in the world frame of a robot that starts on its rear foot."""
        return (
            Face(name="floor"), Face(name="wall", x=self.length, turn=pi / 2), Face(name="ceiling", x=self.length, z=self.height, turn=pi)
        )

    def plan(self, models: Mapping[str, mujoco.MjModel]) -> list[Swing]:
        """Plan the whole path. `models` maps each foot to the MuJoCo model of the mode that is rooted at this foot."""
        way = corner(models)
        strides = {n: swings(dict(models), n, SHORT, STRIDE, LIFT, SINK) for n in {self.floor, self.wall, self.ceiling}}
        return [*strides[self.floor], *way, *strides[self.wall], *way, *strides[self.ceiling]]

    def footholds(self) -> list[Stance]:
        """Return the planned positions of the soles in the world, in the order of the swings. The positions are slightly below the surface
        of the steel.
        """
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
    """Return the stance of a sole in the world, at `distance` [m] along a surface and `height` [m] above the surface."""
    along, out = (cos(face.turn), sin(face.turn)), (-sin(face.turn), cos(face.turn))
    return Stance(
        x=face.x + distance * along[0] + height * out[0], z=face.z + distance * along[1] + height * out[1], turn=face.turn
    )


def corner(models: Mapping[str, mujoco.MjModel]) -> list[Swing]:
    """Plan the swings that move the robot over a corner. At both ends, the soles are close together. Raises `ValueError` if the legs cannot
    reach.
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
    """Return the stance of two feet at a corner, relative to the held foot. Each foot is given by whether it is beyond the corner, and by
    its distance [m] from the corner. `pitch` [rad] is the pitch of the body relative to the steel before the corner.
    """
    one, two = (
        Stance(z=distance, x=0.0, turn=pi / 2) if beyond else Stance(x=-distance) for beyond, distance in (held, moving)
    )
    return replace(two, pitch=pitch).seen_from(one)
