"""The gait of an inchworm: where the joints of MInchW should be at every instant, and which magnets hold.

Planned once from the kinematics of the built robot, with nothing measured: both ways of walking it (`inchworm_physics`) follow
the same plan. Units are SI; a vector of six joints is in the order of `JOINTS`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEET = ("front", "rear")
JOINTS = tuple(f"{foot}/{joint}" for foot in FEET for joint in ("yaw", "knee", "ankle"))
PITCHING = tuple(name for name in JOINTS if not name.endswith("yaw"))
PULL = 300.0
"""Nominal pull of a magnet [N]."""

SWING, PRESS, TRANSFER, RELEASE, REST = 1.5, 0.15, 0.35, 0.15, 0.2
"""How long [s] a foot is in the air, its magnet takes hold, the load moves over to it, the other magnet lets go, and all is
still."""

DRAWN_UP = np.array([0.0, 1.5, 1.5, 0.0, 1.5, 1.5])
"""Joint angles (6,) near which the robot stands on both feet, the knees above the ankles."""

DEGREE, KNOTS = 24, 49
"""Of the polynomials through the joints' paths, and how many points they are fitted to."""


def other(foot: str) -> str:
    """The foot that is not `foot`."""
    return FEET[1 - FEET.index(foot)]


def smooth(s: Array) -> Array:
    """From 0 at s = 0 to 1 at s = 1 with four derivatives 0 at both ends."""
    return s**5 * (126.0 - 420.0 * s + 540.0 * s**2 - 315.0 * s**3 + 70.0 * s**4)


@dataclass(frozen=True, slots=True, kw_only=True)
class Instant:
    """What is wanted now: `q`, `v`, `a` (6,) of the joints; `share`, how much of the robot the landing foot carries already
    (0 to 1); the magnets' forces [N] by foot; and the name of the phase."""

    phase: str
    q: Array
    v: Array
    a: Array
    share: float
    magnets: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing:
    """One foot's way through the air while the other holds: Chebyshev coefficients (degree + 1, 6) of q over s in [-1, 1];
    how long [s] it is in the air, and its magnet takes hold. At `pace` 2, everything takes half its time."""

    holds: str
    moves: str
    path: Array
    seconds: float = SWING
    press: float = PRESS
    pace: float = 1.0

    @property
    def begin(self) -> Instant:
        """Standing on both feet, before the first swing."""
        still, start = np.zeros(len(JOINTS)), np.asarray(chebyshev.chebval(-1.0, self.path))
        magnets = {self.holds: PULL, self.moves: 0.0}
        return Instant(phase="stand", q=start, v=still, a=still, share=0.0, magnets=magnets)

    @property
    def end(self) -> Array:
        """q (6,) when the foot is put down."""
        return np.asarray(chebyshev.chebval(1.0, self.path))

    def bent(self, begin: Array, end: Array) -> Swing:
        """The same way, from other joint angles (6,) to others."""
        over = np.linspace(-1.0, 1.0, KNOTS)
        done = chebyshev.chebfit(over, smooth(0.5 + 0.5 * over), 9)
        path = self.path.copy()
        path[: len(done)] += np.outer(done, (end - self.end) - (begin - self.begin.q))
        path[0] += begin - self.begin.q
        return replace(self, path=path)

    @property
    def duration(self) -> float:
        """From lifting one foot to the load on it and the other free [s]."""
        return (self.seconds + self.press + TRANSFER + RELEASE + REST) / self.pace

    def instants(self, timestep: float) -> Iterator[Instant]:
        """From lifting one foot to the load on it and the other free."""
        velocity = chebyshev.chebder(self.path) * (2.0 * self.pace / self.seconds)
        acceleration = chebyshev.chebder(velocity) * (2.0 * self.pace / self.seconds)
        for phase, duration in (
            ("swing", self.seconds), ("press", self.press), ("transfer", TRANSFER), ("release", RELEASE), ("rest", REST)
        ):
            steps = round(duration / self.pace / timestep)
            done = (1.0 + np.arange(steps)) / steps
            moving = 1.0 if phase == "swing" else 0.0
            at = 2.0 * done - 1.0 if moving else np.ones(steps)
            q, v, a = (np.asarray(chebyshev.chebval(at, c)).T for c in (self.path, velocity, acceleration))
            for step, s in enumerate(done):
                landing = {"swing": 0.0, "press": float(s)}.get(phase, 1.0) * PULL
                leaving = {"release": 1.0 - float(s), "rest": 0.0}.get(phase, 1.0) * PULL
                yield Instant(
                    phase=phase,
                    q=q[step],
                    v=moving * v[step],
                    a=moving * a[step],
                    share={"swing": 0.0, "press": 0.0, "transfer": float(smooth(s))}.get(phase, 1.0),
                    magnets={self.holds: leaving, self.moves: landing},
                )


class Legs:
    """Inverse kinematics in the plane of the legs, by Newton's method on the model of a mode that a foot holds."""

    def __init__(self, model: mujoco.MjModel, holds: str) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.holds, self.moves = holds, other(holds)
        self.columns = [int(model.joint(name).dofadr[0]) for name in PITCHING]

    def solve(self, x: float, z: float, turn: float, pitch: float, near: Array) -> Array:
        """q (6,) with the moving sole at `x` and `z` [m] from the held one, as this stands on its steel (x ahead, z out of the
        steel), turned from it by `turn` [rad], toe up, and the body's nose `pitch` [rad] up. `near` (6,) is where the search
        starts. Raises `ValueError` where there is no such q."""
        q = near.copy()
        for _ in range(50):
            error, jacobian = self._error(q, x, z, turn, pitch)
            if np.abs(error).max() < 1e-12:
                return q
            q[[JOINTS.index(name) for name in PITCHING]] -= np.linalg.solve(jacobian, error)
        raise ValueError(f"the legs do not reach {x:.3f} m ahead and {z:.3f} m up, turned by {turn:.3f} rad")

    def pitch(self, q: Array) -> float:
        """Of the body [rad], nose up, at q (6,)."""
        return -float(self._error(q, 0.0, 0.0, 0.0, 0.0)[0][3])

    def _error(self, q: Array, x: float, z: float, turn: float, pitch: float) -> tuple[Array, Array]:
        """(4,) and (4, 4): x and z of the moving sole, its pitch, and that of the body, by the four joints that pitch."""
        for name, value in zip(JOINTS, q, strict=True):
            self.data.joint(name).qpos = value
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        sole, body = self.data.site(f"{self.moves}/sole"), self.data.body("body")
        linear, angular, turning = (np.zeros((3, self.model.nv)) for _ in range(3))
        mujoco.mj_jacSite(self.model, self.data, linear, angular, self.model.site(f"{self.moves}/sole").id)
        mujoco.mj_jacBody(self.model, self.data, None, turning, self.model.body("body").id)
        down, ahead = sole.xmat.reshape(3, 3)[:, 2], body.xmat.reshape(3, 3)[:, 0]
        between = sole.xpos - self.data.site(f"{self.holds}/sole").xpos
        # A turn by `a` about the world's y takes the sole's -z towards x, and the body's x towards -z.
        error = [
            between[0] - x, between[2] - z, np.arctan2(-down[0], -down[2]) + turn, np.arctan2(-ahead[2], ahead[0]) + pitch
        ]
        rows = np.vstack([linear[0], linear[2], angular[1], turning[1]])
        return np.array(error), rows[:, self.columns]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stance:
    """Standing on both feet, seen from the one that holds: where the other one is [m], how it is turned from it, and the pitch of the
    body [rad], as `Legs.solve` has them."""

    x: float
    z: float = 0.0
    turn: float = 0.0
    pitch: float = 0.0


def swing(legs: Legs, near: Array, begin: Stance, end: Stance, *, lift: float, nose: float, sink: float, seconds: float = SWING) -> Swing:
    """From one stance to another, from the joint angles `near` (6,) on.

    The foot is lifted by `lift` [m] from its steel, with the nose of the body `nose` [rad] further up than between the stances, and put
    down `sink` [m] below the steel: the servos press it on gently, before its magnet would snatch it. Raises `ValueError` where the
    legs do not reach.
    """
    q, knots = near, []
    s = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, KNOTS))
    done, up = smooth(s), 64.0 * (s * (1.0 - s)) ** 3
    turn, pitch = (a + (b - a) * done for a, b in ((begin.turn, end.turn), (begin.pitch, end.pitch)))
    # Away from the steel that is left and from the one that is come to. The foot that moves now is the one that the other was pressed
    # down from, by `sink` along the normal of the steel under the foot that holds.
    leaving, coming = lift * up * (1.0 - done), (lift * up - sink) * done
    x = begin.x + (end.x - begin.x) * done - leaving * np.sin(begin.turn) - coming * np.sin(end.turn)
    z = begin.z + (end.z - begin.z) * done + leaving * np.cos(begin.turn) + coming * np.cos(end.turn) + sink * (1.0 - done)
    for row in zip(x, z, turn, pitch + nose * up, strict=True):
        q = legs.solve(*(float(value) for value in row), q)
        knots.append(q)
    path = np.asarray(chebyshev.chebfit(2.0 * s - 1.0, np.array(knots), DEGREE), dtype=float)
    return Swing(holds=legs.holds, moves=legs.moves, path=path, seconds=seconds)


def swings(models: dict[str, mujoco.MjModel], steps: int, short: float, stride: float, lift: float, sink: float) -> list[Swing]:
    """`steps` steps forward: the front foot goes ahead by `stride` [m], the rear one follows.

    `models` are those of the modes that a foot holds, by foot. The soles are `short` [m] apart when the robot is drawn up; a
    foot is lifted by `lift` [m], which the body does with half its pitch and the legs with the rest, and put down `sink` [m] below
    the steel.
    """
    start = DRAWN_UP
    found = {}
    for holds, begin, end in (("rear", short, short + stride), ("front", short + stride, short)):
        side = 1.0 if holds == "rear" else -1.0
        found[holds] = swing(
            Legs(models[holds], holds), start, Stance(x=side * begin), Stance(x=side * end), lift=lift, nose=side * lift / short, sink=sink
        )
        start = found[holds].end
    return [found[holds] for _ in range(steps) for holds in ("rear", "front")]
