"""Compute allowed poses and motions of MInchW while one foot holds it. The limits are its torques, its magnet, and obstacles.

A foothold is given by a surface and a distance along the surface. Units are SI. Vectors of six joints are in the order of `JOINTS`.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import comb

import mujoco
import numpy as np
from numpy.polynomial import chebyshev

import rrt_connect
from inchworm_gait import DEGREE, FEET, JOINTS, KNOTS, PITCHING, PRESS as SHORT_PRESS, PULL, Array, Legs, Stance, Swing, other
from inchworm_physics import POLE, Dynamics, Face, World, cross
from inchworm_tunnel import PRESS, SINK, foothold
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.types import Robot
from thingc.model.statics.efforts import static_efforts

TORQUE, MAGNET = 2.0, 100.0
"""Smallest allowed static margins of a pose: the ratio limit / effort of the torques, and the unused pull [N] of the holding magnet."""

LOAD, MOVED = 0.8, 90.0
"""Limits of a motion: the largest load on the torque-speed line of a servo, and the smallest pull margin [N] during the motion."""

LIMIT, CLEARANCE, HOVER = np.radians(10.0), 0.003, 0.02
"""Smallest allowed distances: from a joint to its limits [rad], from a part to the steel [m], and from a swinging sole to its footholds
[m].
"""

SEATED, FLAT = 0.002, 0.02
"""A sole may touch the steel if it is this close to its foothold [m] along the steel, with at most this tilt [rad]."""

RESOLUTION, TRIES = 0.05, 50
"""Largest change of a joint [rad] between two poses that are checked, and maximum number of random targets when a motion is planned."""

SECONDS = (1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0)
"""Allowed durations of a swing [s], shortest first. The planner uses the shortest duration that the servos allow."""

AT_REST, LIFT, LINGER = 5, 4, (0, 1, 2)
"""Numbers of control points of a curve: at each end, between the foothold and the height `HOVER`, and repetitions at that height. The
planner uses the smallest number of repetitions for which the motion is allowed.
"""

NOSE = np.radians([0.0, 3.0, -3.0, 6.0, -6.0, 10.0, -10.0, 15.0, -15.0])
"""Changes of the pitch of the body [rad] that are tried when a foot is lifted, in this order. The planner uses the first change that is
allowed.
"""

MOVING = np.array([name in PITCHING for name in JOINTS])
"""Mask (6,) of the joints that the planner moves. The yaw joints stay at 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Foothold:
    """A position of a sole: a surface, and the distance [m] along this surface."""

    face: Face
    distance: float

    def above(self, height: float = 0.0) -> Stance:
        """Return the stance of the sole in the world, `height` [m] above the steel."""
        return foothold(self.face, self.distance, height)


@dataclass(frozen=True, slots=True, kw_only=True)
class Margins:
    """Static margins of a pose: the smallest ratio limit / effort of a servo, and the unused pull [N] of the holding magnet."""

    torque: float
    magnet: float


class Mode:
    """A mode of the robot in which one foot is held. `world` contains the MuJoCo model of the mode, and `robots` the robot of the mode on
    each surface.
    """

    def __init__(self, holds: str, world: World, robots: Mapping[str, Robot]) -> None:
        self.holds, self.moves, self.world, self.robots = holds, other(holds), world, robots
        self.model = copy.copy(world.model)
        steel = self.model.geom_bodyid == 0
        self.model.geom_gap[:], self.model.geom_margin[:] = 0.0, np.where(steel, CLEARANCE, 0.0)
        self.data = mujoco.MjData(self.model)
        self.legs, self.dynamics = Legs(self.model, holds), Dynamics(world)
        self.lower, self.upper = (self.model.jnt_range[[self.model.joint(name).id for name in JOINTS]] + [LIMIT, -LIMIT]).T
        self.root = (self.data.mocap_pos[0].copy(), self.data.mocap_quat[0].copy())
        self.held: Foothold | None = None

    def hold(self, held: Foothold) -> None:
        """Place the robot with its root on a foothold."""
        at = held.above()
        turned, rotated = np.array([np.cos(at.turn / 2), 0.0, -np.sin(at.turn / 2), 0.0]), np.zeros(3)
        mujoco.mju_rotVecQuat(rotated, self.root[0], turned)
        mujoco.mju_mulQuat(self.data.mocap_quat[0], turned, self.root[1])
        self.data.mocap_pos[0] = rotated + [at.x, 0.0, at.z]
        self.held = held

    def solve(self, target: Stance, near: Array) -> Array:
        """Return the joint positions q (6,) at which the other sole and the pitch of the body are at `target` in the world. Raises
        `ValueError` if the legs cannot reach the target.
        """
        assert self.held is not None
        to = target.seen_from(self.held.above())
        return (self.legs.solve(to.x, to.z, to.turn, to.pitch, near) + np.pi) % (2.0 * np.pi) - np.pi

    def on(self, face: Face, q: Array) -> list[tuple[Array, float]]:
        """Return poses with the free sole flat on a surface, each with the distance [m] of the sole along the surface. In each pose (6,),
        the joints of the holding leg have the values in `q`.

        There are at most two poses, because the thigh can have two angles. The axes of knee and ankle are perpendicular to a plane that
        contains the leg and the sole.
        """
        q = np.where([name.startswith(self.moves) for name in JOINTS], 0.0, q)
        self.data.qpos[self.world.qpos] = q
        mujoco.mj_kinematics(self.model, self.data)
        (knee, knee_sign), (ankle, ankle_sign) = (
            (self.data.joint(name).xanchor[::2], self.data.joint(name).xaxis[1]) for name in (f"{self.moves}/knee", f"{self.moves}/ankle")
        )
        thigh, foot = ankle - knee, self.data.site(f"{self.moves}/sole").xpos[::2] - ankle
        along, out = (np.array([np.cos(face.turn + a), np.sin(face.turn + a)]) for a in (0.0, np.pi / 2))
        start = np.array([face.x, face.z])
        rise = (np.hypot(*foot) - SINK - (knee - start) @ out) / np.hypot(*thigh)
        found = []
        for side in (1.0, -1.0) if abs(rise) <= 1.0 else ():
            turned = face.turn + np.pi / 2 + side * np.arccos(rise) - np.arctan2(thigh[1], thigh[0])
            tilt = face.turn - np.pi / 2 - np.arctan2(foot[1], foot[0]) - turned
            pose = q.copy()
            pose[[JOINTS.index(f"{self.moves}/{name}") for name in ("knee", "ankle")]] = -knee_sign * turned, -ankle_sign * tilt
            c, s = np.cos(turned), np.sin(turned)
            at = knee + np.array([c * thigh[0] - s * thigh[1], s * thigh[0] + c * thigh[1]])
            found.append(((pose + np.pi) % (2.0 * np.pi) - np.pi, float((at - start) @ along)))
        return found

    def pitch(self, q: Array) -> float:
        """Return the pitch of the body in the world [rad]."""
        assert self.held is not None
        return self.legs.pitch(q) + self.held.face.turn

    def margins(self, q: Array) -> Margins:
        """Return the static margins of the pose `q`, computed from the static efforts of thingc."""
        assert self.held is not None
        robot = self.robots[self.held.face.name]
        by_joint = dict(zip(JOINTS, q.tolist(), strict=True))
        bodies = body_poses(robot, by_joint)
        efforts = static_efforts(robot, by_joint, bodies)
        gravity, moment, mass = np.array(robot.gravity), np.zeros(3), 0.0
        for body, pose in zip(robot.bodies, bodies, strict=True):
            own = robot.assembly.links[body.link].properties
            mass += own.mass
            moment += own.mass * np.array(pose.apply(own.centre))
        tipping = cross(moment, gravity)
        pull = float(np.hypot(tipping[0], tipping[1])) / POLE + mass * float(gravity[2])
        return Margins(torque=float(efforts.least_margin or 0.0), magnet=PULL - pull)

    def refusal(self, q: Array, seats: Sequence[Foothold] = ()) -> str:
        """Return the reason why a pose is not allowed, or an empty string if the pose is allowed. The free sole may touch the steel at the
        footholds `seats`.
        """
        if not (np.all(self.lower <= q) and np.all(q <= self.upper)):
            return "joint limit"
        return "collision" if self.collides(q, seats) else self.weakness(q)

    def weakness(self, q: Array) -> str:
        """Return the name of the static margin that is too small in a pose, or an empty string."""
        margins = self.margins(q)
        return "torque margin" if margins.torque < TORQUE else "magnet margin" if margins.magnet < MAGNET else ""

    def collides(self, q: Array, seats: Sequence[Foothold]) -> bool:
        """Return whether the robot collides with the steel or with itself in a pose."""
        assert self.held is not None
        self.data.qpos[self.world.qpos] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        allowed = {frozenset((self.held.face.name, f"{self.holds}/magnet:collision"))}
        allowed |= {frozenset((seat.face.name, f"{self.moves}/magnet:collision")) for seat in seats if self._seated(seat)}
        return any(frozenset(self.world.names[geom] for geom in pair) not in allowed for pair in self.data.contact.geom.tolist())

    def _seated(self, seat: Foothold) -> bool:
        """Return whether the free sole is above a foothold and parallel to the surface of the steel."""
        sole, at, turn = self.data.site(f"{self.moves}/sole"), seat.above(), seat.face.turn
        along = (sole.xpos[0] - at.x) * np.cos(turn) + (sole.xpos[2] - at.z) * np.sin(turn)
        tilt = sole.xmat[2::3] @ [np.cos(turn), 0.0, np.sin(turn)]
        return bool(abs(along) < SEATED and abs(tilt) < FLAT)

    def press(self, q: Array, seat: Foothold) -> float:
        """Return the pull [N] on the holding magnet that results when the free sole lands. The servos aim `SINK` below the surface of the
        steel.

        In this computation, the servos are springs. The steel keeps the sole at its surface, without a tilt.
        """
        self.data.qpos[self.world.qpos] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, linear, angular, self.model.site(f"{self.moves}/sole").id)
        rows = np.vstack([linear[0], linear[2], angular[1]])[:, self.world.dofs]
        out = np.array([-np.sin(seat.face.turn), np.cos(seat.face.turn)])
        force = np.linalg.solve((rows / self.world.kp) @ rows.T, np.array([*(SINK * out), 0.0]))
        lever = self.data.site(f"{self.moves}/sole").xpos - self.data.site(f"{self.holds}/sole").xpos
        return abs(float(force[2] + lever[2] * force[0] - lever[0] * force[1])) / POLE

    def spread(self, q: Array) -> float:
        """Return the sine of the angle between the thighs. If this sine is 0, the legs cannot correct the position of a sole."""
        front, rear = (q[JOINTS.index(f"{foot}/knee")] for foot in FEET)
        return abs(float(np.sin(front + rear)))

    def clear(self, begin: Array, end: Array) -> bool:
        """Return whether all poses on the straight line between two joint positions are allowed. Both joint positions must be within the
        joint limits.
        """
        poses = np.linspace(begin, end, int(np.ceil(np.abs(end - begin).max() / RESOLUTION)) + 1)
        return not any(self.collides(q, ()) for q in poses) and not any(map(self.weakness, poses))

    def motion(self, begin: Array, end: Array, seats: tuple[Foothold, Foothold], rng: np.random.Generator) -> Swing | None:
        """Return a swing of the free foot from the first foothold to the second, or None if the planner finds no motion. The foot leaves
        and reaches the steel along its normal.
        """
        up, down = (self._lifted(seat, q) for seat, q in zip(seats, (begin, end), strict=True))
        if not up or not down:
            return None
        way = rrt_connect.connect(up[-1], down[-1], self.lower * MOVING, self.upper * MOVING, self.clear, rng, TRIES)
        if way is None:
            return None
        return self._smooth([begin, *up], rrt_connect.shorten(way, self.clear), [*down[::-1], end], seats)

    def _lifted(self, seat: Foothold, q: Array) -> list[Array]:
        """Return poses that lift the free foot from a foothold along the normal, beginning at the pose `q`. Return an empty list if no such
        motion is allowed.
        """
        for nose in NOSE:
            try:
                found = [
                    self.solve(replace(seat.above(part**2 * HOVER), pitch=self.pitch(q) + part**2 * nose), q)
                    for part in np.linspace(0.0, 1.0, LIFT + 1)[1:].tolist()
                ]
            except (ValueError, np.linalg.LinAlgError):
                continue
            if not self.refusal(found[-1]):
                return found
        return []

    def _smooth(self, up: list[Array], way: list[Array], down: list[Array], seats: tuple[Foothold, Foothold]) -> Swing | None:
        """Return the fastest allowed swing along a path with rounded corners, or None if no such swing is allowed."""
        assert self.held is not None
        far = len({self.held.face, *(seat.face for seat in seats)}) > 1
        for linger in LINGER:
            path = curve(up + [up[-1]] * linger, way, [down[0]] * linger + down)
            plan = Swing(holds=self.holds, moves=self.moves, path=path, press=PRESS if far else SHORT_PRESS)
            poses = [now.q for now in plan.instants(0.02) if now.phase == "swing"]
            if not any(self.refusal(q, seats) for q in poses):
                timed = (replace(plan, seconds=seconds) for seconds in SECONDS)
                return next((one for one in timed if self._slow_enough(one)), None)
        return None

    def _slow_enough(self, plan: Swing) -> bool:
        load, margin = self.loads(plan)
        return load <= LOAD and margin >= MOVED

    def loads(self, plan: Swing) -> tuple[float, float]:
        """Return the largest load on the torque-speed line of a servo during a swing, and the smallest pull margin [N]. Both values are
        computed with inverse dynamics.
        """
        assert self.held is not None
        gravity = np.array(self.robots[self.held.face.name].gravity)
        found = [self.dynamics.load(now, gravity) for now in plan.instants(0.02) if now.phase == "swing"]
        return max(load for load, _ in found), PULL - max(pull for _, pull in found)


def curve(up: Sequence[Array], way: Sequence[Array], down: Sequence[Array]) -> Array:
    """Return the Chebyshev coefficients of a Bezier curve that is at rest at both ends. The control points are `up`, additional points at
    equal distances along `way`, and `down`.
    """
    head, tail = [up[0]] * (AT_REST - 1) + list(up), list(down) + [down[-1]] * (AT_REST - 1)
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(np.array(way), axis=0), axis=1))])
    at = np.linspace(0.0, lengths[-1], DEGREE + 3 - len(head) - len(tail))[1:-1]
    control = np.vstack([head, np.array([np.interp(at, lengths, column) for column in np.array(way).T]).T, tail])
    s = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, KNOTS))
    basis = [comb(DEGREE, k) * s**k * (1.0 - s) ** (DEGREE - k) for k in range(DEGREE + 1)]
    return np.asarray(chebyshev.chebfit(2.0 * s - 1.0, np.array(basis).T @ control, DEGREE))
