"""Plan the gait of an inchworm robot: joint positions and magnet forces as functions of time.

The gait is planned once from the kinematics of the built robot, without feedback. The rooted and the free simulation
(`inchworm_physics.py`) use the same plan. Units are SI. Vectors of six joints are in the order of `JOINTS`.
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
"""Nominal adhesion force [N] of a magnet."""

SWING, PRESS, TRANSFER, RELEASE, REST = 1.5, 0.15, 0.35, 0.15, 0.2
"""Durations [s] of the phases of a step: swing of a foot, switching its magnet on, load transfer, switching the other magnet off, and
rest.
"""

DRAWN_UP = np.array([0.0, 1.5, 1.5, 0.0, 1.5, 1.5])
"""Initial joint angles (6,) [rad] for the inverse kinematics of a stance on both feet. Both knees are above the ankles."""

DEGREE, KNOTS = 24, 49
"""Degree of the polynomials that represent joint paths, and number of points to which a polynomial is fitted."""


def other(foot: str) -> str:
    """Return the name of the other foot: `front` for `rear`, and `rear` for `front`."""
    return FEET[1 - FEET.index(foot)]


def smooth(s: Array) -> Array:
    """Return a smooth step from 0 at s = 0 to 1 at s = 1. The first four derivatives of the step are 0 at both ends."""
    return s**5 * (126.0 - 420.0 * s + 540.0 * s**2 - 315.0 * s**3 + 70.0 * s**4)


@dataclass(frozen=True, slots=True, kw_only=True)
class Instant:
    """The desired state of the robot at a time: positions, velocities and accelerations of the joints (6,), magnet forces [N] by foot, and
    the phase. `share` is the fraction of the load on the landing foot, from 0 to 1.
    """

    phase: str
    q: Array
    v: Array
    a: Array
    share: float
    magnets: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing:
    """The motion of one foot while the other foot holds the robot.

    The field `path` contains the Chebyshev coefficients (degree + 1, 6) of the joint positions over s in [-1, 1]. Two durations [s] follow:
    the time in the air, and the time until the magnet holds. If `pace` is 2, all durations are halved.
    """

    holds: str
    moves: str
    path: Array
    seconds: float = SWING
    press: float = PRESS
    pace: float = 1.0

    @property
    def begin(self) -> Instant:
        """Return the desired state before the swing, with the robot on both feet."""
        still, start = np.zeros(len(JOINTS)), np.asarray(chebyshev.chebval(-1.0, self.path))
        magnets = {self.holds: PULL, self.moves: 0.0}
        return Instant(phase="stand", q=start, v=still, a=still, share=0.0, magnets=magnets)

    @property
    def end(self) -> Array:
        """Return the joint positions q (6,) [rad] when the foot touches down."""
        return np.asarray(chebyshev.chebval(1.0, self.path))

    def bent(self, begin: Array, end: Array) -> Swing:
        """Return the same motion with other initial and final joint angles (6,) [rad]."""
        over = np.linspace(-1.0, 1.0, KNOTS)
        done = chebyshev.chebfit(over, smooth(0.5 + 0.5 * over), 9)
        path = self.path.copy()
        path[: len(done)] += np.outer(done, (end - self.end) - (begin - self.begin.q))
        path[0] += begin - self.begin.q
        return replace(self, path=path)

    @property
    def duration(self) -> float:
        """Return the time [s] from lifting one foot until this foot carries the load and the other foot is free."""
        return (self.seconds + self.press + TRANSFER + RELEASE + REST) / self.pace

    def instants(self, timestep: float) -> Iterator[Instant]:
        """Yield the desired states of a step, from lifting one foot until the other foot is released."""
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
    """Solves the inverse kinematics of the legs in their plane, with Newton's method on the model that is rooted at a foot."""

    def __init__(self, model: mujoco.MjModel, holds: str) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.holds, self.moves = holds, other(holds)
        self.columns = [int(model.joint(name).dofadr[0]) for name in PITCHING]

    def solve(self, x: float, z: float, turn: float, pitch: float, near: Array) -> Array:
        """Return the joint positions q (6,) [rad] for a pose of the moving sole.

        The moving sole is at `x` and `z` [m] relative to the held sole: x points forwards, and z points out of the steel. The moving sole
        is rotated by `turn` [rad], toe up. The nose of the body is rotated upwards by `pitch` [rad]. Newton's method starts at the joint
        positions `near` (6,) [rad]. Raises `ValueError` if the iteration does not find a solution.
        """
        q = near.copy()
        for _ in range(50):
            error, jacobian = self._error(q, x, z, turn, pitch)
            if np.abs(error).max() < 1e-12:
                return q
            q[[JOINTS.index(name) for name in PITCHING]] -= np.linalg.solve(jacobian, error)
        raise ValueError(f"the legs do not reach {x:.3f} m ahead and {z:.3f} m up, turned by {turn:.3f} rad")

    def pitch(self, q: Array) -> float:
        """Return the pitch of the body [rad] at joint positions q (6,). Positive values raise the nose."""
        return -float(self._error(q, 0.0, 0.0, 0.0, 0.0)[0][3])

    def _error(self, q: Array, x: float, z: float, turn: float, pitch: float) -> tuple[Array, Array]:
        """Return the pose of the moving sole and the body (4,), and its Jacobian with respect to the four pitch joints (4, 4). The pose
        contains x, z and the pitch of the sole, and the pitch of the body.
        """
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
    """A stance on both feet: position [m] and rotation [rad] of the other foot relative to the holding foot, and pitch of the body [rad].
    A stance can also describe the position and rotation of one foot in the world.
    """

    x: float
    z: float = 0.0
    turn: float = 0.0
    pitch: float = 0.0

    def seen_from(self, held: Stance) -> Stance:
        """Return this stance relative to the stance `held` of the holding foot. Both stances must be in the world frame. The returned
        rotation is between -pi and pi.
        """
        x, z, c, s = self.x - held.x, self.z - held.z, np.cos(held.turn), np.sin(held.turn)
        turn = (self.turn - held.turn + np.pi) % (2.0 * np.pi) - np.pi
        return Stance(x=x * c + z * s, z=z * c - x * s, turn=turn, pitch=self.pitch - held.turn)


def swing(legs: Legs, near: Array, begin: Stance, end: Stance, *, lift: float, nose: float, sink: float, seconds: float = SWING) -> Swing:
    """Plan a swing from the stance `begin` to the stance `end`. The inverse kinematics start at joint angles `near` (6,) [rad].

    The foot is lifted by `lift` [m], while the nose of the body rises by `nose` [rad]. After that, the foot is lowered to `sink` [m] below
    the surface of the steel. The servos therefore press the foot gently onto the steel before the magnet is switched on. Raises
    `ValueError` if the legs cannot reach.
    """
    q, knots = near, []
    s = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, KNOTS))
    done, up = smooth(s), 64.0 * (s * (1.0 - s)) ** 3
    turn, pitch = (a + (b - a) * done for a, b in ((begin.turn, end.turn), (begin.pitch, end.pitch)))
    # `leaving` is the distance from the old surface, and `coming` the distance from the new surface. At the start, the moving foot is
    # `sink` above the old surface, because the previous swing pressed the holding foot down by `sink`.
    leaving, coming = lift * up * (1.0 - done), (lift * up - sink) * done
    x = begin.x + (end.x - begin.x) * done - leaving * np.sin(begin.turn) - coming * np.sin(end.turn)
    z = begin.z + (end.z - begin.z) * done + leaving * np.cos(begin.turn) + coming * np.cos(end.turn) + sink * (1.0 - done)
    for row in zip(x, z, turn, pitch + nose * up, strict=True):
        q = legs.solve(*(float(value) for value in row), q)
        knots.append(q)
    path = np.asarray(chebyshev.chebfit(2.0 * s - 1.0, np.array(knots), DEGREE), dtype=float)
    return Swing(holds=legs.holds, moves=legs.moves, path=path, seconds=seconds)


def swings(models: dict[str, mujoco.MjModel], steps: int, short: float, stride: float, lift: float, sink: float) -> list[Swing]:
    """Plan `steps` steps forward. In each step, the front foot moves by `stride` [m], and the rear foot follows.

    `models` maps each foot to the MuJoCo model of the mode that is rooted at this foot. When the feet are close together, the distance
    between the soles is `short` [m]. A foot is lifted by `lift` [m] and then lowered to `sink` [m] below the surface of the steel. Half of
    the lift comes from the pitch of the body, and half comes from the legs.
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
