"""The gait of an inchworm: where the joints of MInchW should be at every instant, and which magnets hold.

Planned once from the kinematics of the built robot, with nothing measured: both ways of walking it (`inchworm_physics`) follow
the same plan. Units are SI; a vector of six joints is in the order of `JOINTS`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

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
    """One foot's way through the air while the other holds: Chebyshev coefficients (degree + 1, 6) of q over s in [-1, 1]."""

    holds: str
    moves: str
    path: Array

    @property
    def begin(self) -> Instant:
        """Standing on both feet, before the first swing."""
        still, start = np.zeros(len(JOINTS)), np.asarray(chebyshev.chebval(-1.0, self.path))
        magnets = {self.holds: PULL, self.moves: 0.0}
        return Instant(phase="stand", q=start, v=still, a=still, share=0.0, magnets=magnets)

    def instants(self, timestep: float) -> Iterator[Instant]:
        """From lifting one foot to the load on it and the other free."""
        velocity = chebyshev.chebder(self.path) * (2.0 / SWING)
        acceleration = chebyshev.chebder(velocity) * (2.0 / SWING)
        for phase, duration in (
            ("swing", SWING), ("press", PRESS), ("transfer", TRANSFER), ("release", RELEASE), ("rest", REST)
        ):
            steps = round(duration / timestep)
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

    def solve(self, distance: float, height: float, pitch: float, near: Array) -> Array:
        """q (6,) with the moving sole `distance` [m] along x from the held one, `height` [m] above it and level, and the body's
        nose `pitch` [rad] up. `near` (6,) is where the search starts. Raises `ValueError` where there is no such q."""
        q = near.copy()
        for _ in range(50):
            error, jacobian = self._error(q, distance, height, pitch)
            if np.abs(error).max() < 1e-12:
                return q
            q[[JOINTS.index(name) for name in PITCHING]] -= np.linalg.solve(jacobian, error)
        raise ValueError(f"the legs do not reach {distance:.3f} m apart with a foot lifted by {height:.3f} m")

    def _error(self, q: Array, distance: float, height: float, pitch: float) -> tuple[Array, Array]:
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
        side = 1.0 if self.moves == "front" else -1.0
        # A turn by `a` about the world's y takes the sole's -z towards -x, and the body's x towards -z.
        error = [
            between[0] - side * distance, between[2] - height, np.arctan2(-down[0], -down[2]), np.arctan2(-ahead[2], ahead[0]) + pitch
        ]
        rows = np.vstack([linear[0], linear[2], angular[1], turning[1]])
        return np.array(error), rows[:, self.columns]


def swings(models: dict[str, mujoco.MjModel], steps: int, short: float, stride: float, lift: float, sink: float) -> list[Swing]:
    """`steps` steps forward: the front foot goes ahead by `stride` [m], the rear one follows.

    `models` are those of the modes that a foot holds, by foot. The soles are `short` [m] apart when the robot is drawn up; a
    foot is lifted by `lift` [m], which the body does with half its pitch and the legs with the rest, and put down `sink` [m] below
    the steel: the servos press it on gently, before its magnet would snatch it.
    """
    start = np.array([0.0, 1.5, 1.5, 0.0, 1.5, 1.5])
    found = {}
    s = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, KNOTS))
    for holds, begin, end in (("rear", short, short + stride), ("front", short + stride, short)):
        legs, side = Legs(models[holds], holds), 1.0 if holds == "rear" else -1.0
        q, knots = start, []
        between, up = begin + (end - begin) * smooth(s), lift * 64.0 * (s * (1.0 - s)) ** 3
        height = up + sink * (1.0 - 2.0 * smooth(s))  # the foot that moves now is the one that the other was pressed down from
        for row in zip(between, height, side * up / short, strict=True):
            q = legs.solve(*(float(value) for value in row), q)
            knots.append(q)
        start = knots[-1]
        path = np.asarray(chebyshev.chebfit(2.0 * s - 1.0, np.array(knots), DEGREE), dtype=float)
        found[holds] = Swing(holds=holds, moves=other(holds), path=path)
    return [found[holds] for _ in range(steps) for holds in ("rear", "front")]
