"""Simulate MInchW on steel in MuJoCo, in one of two ways. Either the model is rooted at the holding foot and switches modes, or its base is
free and only the magnets hold it.

The servos are the position drives that the document defines. The position commands of the servos are computed from the torques that the
motion requires. The torques result from inverse dynamics in the mode that is rooted at the foot that carries the robot. A servo applies
`force = kp (ctrl - q) - kv v`.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from inchworm_film import decorate_tunnel
from inchworm_gait import FEET, JOINTS, PULL, Array, Instant, Legs, Stance, Swing, other
from inchworm_scenery import decorate
from thingc.modes import Modes

TIMESTEP = 1e-3
STAND = 0.3
"""Time [s] for which the robot stands still before it starts."""

POLE = 0.025
"""Radius [m] of a magnet's face. The foot can tip over the rim of the magnet."""

SLIDE = 0.5
"""Coefficient of friction between a sole and steel, as in the materials of MInchW."""

STEEL = {
    "friction": [SLIDE, 0.005, 0.0001], "priority": 2, "solref": [0.004, 1.0], "solimp": [0.99, 0.999, 0.0005, 0.5, 2.0],
    "gap": 0.001,
}
"""Contact parameters of the beam, as attributes of a MuJoCo geom.

With MuJoCo's default contact parameters, a magnet with 300 N would penetrate the beam by 4 mm. With these parameters, the penetration is
0.03 mm. The gap lets a magnet pull in the last millimetre before contact. Without the gap, a magnet would never attach to a wall, because
gravity does not press it against the wall.
"""

LEANS = 1e-5
"""Tilt of the steel [rad].

Without this tilt, a foot that was the root would be exactly parallel to the steel. MuJoCo (3.17, plane against cylinder) would then derive
the contact direction from rounding errors, and could report a penetration of 24 mm. MuJoCo ignores tilts of less than 1e-6.
"""

Watch = Callable[[mujoco.MjModel, mujoco.MjData, float], None]
"""A callback that runs after every simulation step. The last argument of the callback is the pull margin [N] of the feet that carry the
robot.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Face:
    """A steel plane: a point [m] on the plane, and the rotation [rad] about y relative to a floor. The x axis of the plane points
    forwards.
    """

    name: str
    x: float = 0.0
    z: float = 0.0
    turn: float = 0.0


BEAM = (Face(name="steel"),)


@dataclass(slots=True, kw_only=True)
class Seen:
    """Extreme values of a simulated walk in SI units, and the distance that the robot has moved."""

    steps: int = 0
    progress: float = 0.0
    slips: dict[str, float] = field(default_factory=lambda: {"standing": 0.0, "landing": 0.0})
    pull: float = 0.0
    """Largest pull [N] that a holding foot requires. A tipping moment is converted to an equivalent force at the rim of the magnet."""
    pulled: str = ""
    """Name of the phase with the largest required pull."""
    shear: float = 0.0
    """Largest ratio of the tangential force to the friction limit."""
    torque: dict[str, float] = field(default_factory=lambda: dict.fromkeys(JOINTS, 0.0))
    """Largest torque of each servo, relative to its stall torque."""
    speed: float = 0.0
    """Largest load on the torque-speed line of a servo, computed as torque / stall torque + speed / no-load speed."""
    tracking: float = 0.0
    tilt: float = 0.0
    removed: float = 0.0
    """Largest velocity [m/s or rad/s] that a foot has when it becomes the root."""
    removed_angular: float = 0.0
    touches: set[str] = field(default_factory=set)
    """Pairs of geoms in contact, except the contacts between soles and steel."""


def on_steel(folder: Path, mode: str, faces: Sequence[Face] = BEAM) -> mujoco.MjModel:
    """Return the MuJoCo model of a mode on the surface of a beam (z = 0), or between the planes `faces`."""
    spec = mujoco.MjSpec.from_file(str(folder / "mjcf" / f"minchw_{mode}.xml"))
    spec.option.timestep = TIMESTEP
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    for geom in spec.geoms:
        geom.margin = 0.0  # the geoms of the steel have a gap instead
    for face in faces:
        turned = np.zeros(4)
        mujoco.mju_mulQuat(turned, np.array([np.cos(face.turn / 2), 0, -np.sin(face.turn / 2), 0]), np.array([1, LEANS / 2, 0, 0]))
        spec.worldbody.add_geom(
            name=face.name, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05], pos=[face.x, 0, face.z], quat=turned, rgba=[0, 0, 0, 0],
            group=4, **STEEL
        )
    if faces is BEAM:
        decorate(spec, next((place for place in ("wall", "ceiling") if mode.endswith(place)), "floor"))
    else:
        decorate_tunnel(spec, max(face.x for face in faces), max(face.z for face in faces))
    return spec.compile()


class World:
    """The MuJoCo model of a mode, and its simulation state."""

    def __init__(self, folder: Path, mode: str, faces: Sequence[Face] = BEAM) -> None:
        self.mode, self.model = mode, on_steel(folder, mode, faces)
        self.stood_on = {frozenset((face.name, f"{foot}/magnet:collision")) for face in faces for foot in FEET}
        self.data = mujoco.MjData(self.model)
        self.feet = {foot: self.model.body(f"{foot}/foot").id for foot in FEET}
        self.soles = {foot: self.data.site(f"{foot}/sole") for foot in FEET}
        self.magnets = {foot: self.data.actuator(f"{foot}/sole") for foot in FEET}
        self.names = [self.model.geom(number).name for number in range(self.model.ngeom)]
        self.qpos = [int(self.model.joint(name).qposadr[0]) for name in JOINTS]
        self.dofs = [int(self.model.joint(name).dofadr[0]) for name in JOINTS]
        self.drives = [self.model.actuator(name).id for name in JOINTS]
        self.stall = self.model.actuator_forcerange[self.drives, 1]
        self.kp, self.kv = self.model.actuator_gainprm[self.drives, 0], -self.model.actuator_biasprm[self.drives, 2]

    def joints(self) -> Array:
        """Return the current joint positions (6,) [rad]."""
        return np.array(self.data.qpos[self.qpos])

    def sole(self, foot: str) -> Array:
        """Return the position of the centre of a sole in the world (3,) [m]."""
        return np.array(self.soles[foot].xpos)

    def normal(self, foot: str) -> Array:
        """Return the unit normal (3,) of the steel under a foot, which points towards the robot. The normal is along an axis of the
        world.
        """
        return -np.round(self.soles[foot].xmat[2::3])

    def turn(self, foot: str) -> float:
        """Return the rotation [rad] of a sole relative to a floor. Positive values raise the toe."""
        x, _, z = self.soles[foot].xmat[2::3]
        return float(np.arctan2(x, -z))

    def gravity(self, foot: str) -> Array:
        """Return the gravity vector (3,) in the frame of the steel under a foot. The z axis points from the steel to the robot, and the x
        axis points forwards. The vector equals the gravity of the modes `..._wall` and `..._ceiling` in the document.
        """
        normal, gravity = self.normal(foot), self.model.opt.gravity
        return np.array([normal[2] * gravity[0] - normal[0] * gravity[2], gravity[1], gravity @ normal])

    def tilt(self, foot: str) -> float:
        """Return the angle [rad] between a sole and the steel."""
        return float(np.linalg.norm(cross(self.soles[foot].xmat[2::3], self.normal(foot))))

    def contacts(self) -> Iterator[frozenset[str]]:
        """Yield the names of the two geoms of each contact."""
        for pair in self.data.contact.geom.tolist():
            yield frozenset(self.names[geom] for geom in pair)

    def reaction(self, foot: str) -> tuple[float, float, float]:
        """Return the load of the steel on the sole of a foot: normal force towards the robot [N], tangential force [N], and tipping moment
        [N m].

        For a held foot, the load is computed from the accelerations of the robot. For any other foot, it is computed from contacts.
        """
        centre, wrench = self.sole(foot), np.zeros(6)
        body = self.feet[foot]
        if self.model.body_mocapid[body] >= 0:
            wrench = root_wrench(self.model, self.data, body, centre)
            # The wrench includes contact forces, but not the adhesion force of a magnet, which is an actuator force.
            _, force, moment = self.hold(other(foot), centre)
            wrench -= np.concatenate([force, moment])
        else:
            wrench[:3], wrench[3:] = sum_of(self.on_sole(foot, centre))
            _, force, moment = self.hold(foot, centre)
            wrench += np.concatenate([force, moment])
        normal = self.normal(foot)
        along, tipping = (float(np.linalg.norm(cross(part, normal))) for part in (wrench[:3], wrench[3:]))
        return float(wrench[:3] @ normal), along, tipping

    def on_sole(self, foot: str, centre: Array) -> Iterator[tuple[Array, Array]]:
        """Yield the force [N] and the moment about `centre` [N m] of each contact between a foot and the steel."""
        body, found = self.feet[foot], self.data.contact
        for index, bodies in enumerate(self.model.geom_bodyid[found.geom].tolist()):
            if sorted(bodies) == [0, body]:
                local = np.zeros(6)
                mujoco.mj_contactForce(self.model, self.data, index, local)
                force = found.frame[index].reshape(3, 3).T @ local[:3] * (1.0 if bodies[1] == body else -1.0)
                yield force, cross(found.pos[index] - centre, force)

    def hold(self, foot: str, centre: Array) -> tuple[int, Array, Array]:
        """Return the number of contacts of a magnet, the pull [N] of the magnet, and the moment of the pull about `centre` [N m]. MuJoCo
        distributes the pull evenly over the contacts.
        """
        bodies = self.model.geom_bodyid[self.data.contact.geom].tolist()
        touching = [index for index, pair in enumerate(bodies) if sorted(pair) == [0, self.feet[foot]]]
        if not touching:
            return 0, np.zeros(3), np.zeros(3)
        points = self.data.contact.pos[touching]
        force = -float(self.magnets[foot].force[0]) * self.normal(foot)
        return len(points), force, cross(points.mean(axis=0) - centre, force)

    def drive(self, now: Instant, torque: Array) -> None:
        """Set the position commands so that the servos apply `torque` (6,) [N m], and set the forces of the magnets."""
        self.data.ctrl[self.drives] = now.q + (torque + self.kv * now.v) / self.kp
        for foot, force in now.magnets.items():
            self.magnets[foot].ctrl = force


def root_wrench(model: mujoco.MjModel, data: mujoco.MjData, body: int, centre: Array) -> Array:
    """Return the force [N] and the moment about `centre` [N m] that the world exerts on the root, as an array (6,). Force and moment are
    computed from the accelerations in `data`.
    """
    mujoco.mj_rnePostConstraint(model, data)
    moment, force = data.cfrc_int[body][:3], data.cfrc_int[body][3:]
    return np.concatenate([force, moment + cross(data.subtree_com[model.body_rootid[body]] - centre, force)])


def cross(a: Array, b: Array) -> Array:
    """Return the cross product of two vectors (3,). `numpy.cross` accepts more shapes, but is slower."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def sum_of(parts: Iterator[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Return the sum of the forces (3,) and the sum of the moments (3,)."""
    found = list(parts)
    return sum((force for force, _ in found), np.zeros(3)), sum((moment for _, moment in found), np.zeros(3))


class Dynamics:
    """Computes joint torques with inverse dynamics, without contacts, in the mode that is rooted at a foot."""

    def __init__(self, world: World) -> None:
        self.world, self.model = world, on_no_steel(world.model)
        self.data = mujoco.MjData(self.model)

    def torque(self, now: Instant, gravity: Array) -> Array:
        """Return the joint torques (6,) [N m] for the state `now`. The torques include friction and damping of the joints. `gravity` (3,)
        is expressed in the frame of the steel under the foot.
        """
        self.model.opt.gravity[:] = gravity
        self.data.qpos[self.world.qpos] = now.q
        self.data.qvel[self.world.dofs], self.data.qacc[self.world.dofs] = now.v, now.a
        mujoco.mj_inverse(self.model, self.data)
        return np.array(self.data.qfrc_inverse[self.world.dofs])

    def load(self, now: Instant, gravity: Array) -> tuple[float, float]:
        """Return the largest load on the torque-speed line of a servo, and the pull [N] that the magnet of the root requires.

        The arguments are the same as in `torque`.
        """
        torque, world = self.torque(now, gravity), self.world
        foot = next(foot for foot in FEET if self.model.body_mocapid[world.feet[foot]] >= 0)
        _, _, z, *moment = root_wrench(self.model, self.data, world.feet[foot], self.data.site(f"{foot}/sole").xpos)
        return float(((np.abs(torque) + np.abs(now.v) * world.kv) / world.stall).max()), float(np.hypot(*moment[:2])) / POLE - float(z)


def on_no_steel(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy of a MuJoCo model with contacts disabled."""
    found = copy.copy(model)
    found.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return found


class Climb:
    """Simulates the climb of a robot, and measures its forces, slips and contacts. The robot is on a floor (`where=""`), on a wall
    (`"_wall"`), under a ceiling (`"_ceiling"`), or between several surfaces.
    """

    def __init__(self, folder: Path, where: str, faces: Sequence[Face] = BEAM) -> None:
        self.robot = Modes.load(folder)
        self.held = {foot: World(folder, f"{foot}_foot{where}", faces) for foot in FEET}
        self.free = World(folder, f"crawl{where}", faces)
        self.dynamics = {foot: Dynamics(world) for foot, world in self.held.items()}
        self.models = {foot: world.model for foot, world in self.held.items()}
        self.legs = {foot: Legs(model, foot) for foot, model in self.models.items()}

    def rooted(self, plan: list[Swing], watch: Watch | None = None, footholds: Sequence[Stance] | None = None) -> Seen:
        """Simulate a walk in which the model is rooted at the holding foot. After the other foot has landed and carries the robot, this
        foot becomes the root.

        `footholds` contains the planned positions of the soles in the world. If `footholds` is given, each swing is corrected for the
        actual position of the root.
        """
        seen = Seen(steps=len(plan) // 2)
        world = self._start(plan[0])
        begin, q = self._stand(world, plan[0]), plan[0].begin.q
        for k, planned in enumerate(plan):
            swing = planned if footholds is None else self._aimed(world, planned, q, footholds[k])
            q = swing.end
            self._follow(world, swing, seen, watch)
            following = self.held[swing.moves]
            switched = self.robot.switch((world.mode, world.data), (following.mode, following.data), on_motion="impact")
            mujoco.mj_forward(following.model, following.data)
            seen.removed = max(seen.removed, float(np.linalg.norm(switched.removed[:3])))
            seen.removed_angular = max(seen.removed_angular, float(np.linalg.norm(switched.removed[3:])))
            world = following
        seen.progress = float(((world.sole("front") + world.sole("rear")) / 2 - begin)[0])
        return seen

    def adhering(self, plan: list[Swing], watch: Watch | None = None, footholds: Sequence[Stance] | None = None) -> Seen:
        """Simulate a walk with a free base. Only the magnets hold the feet."""
        seen = Seen(steps=len(plan) // 2)
        first = self._start(plan[0])
        self.robot.switch((first.mode, first.data), (self.free.mode, self.free.data))
        mujoco.mj_forward(self.free.model, self.free.data)
        begin, q = self._stand(self.free, plan[0]), plan[0].begin.q
        for k, planned in enumerate(plan):
            swing = planned if footholds is None else self._aimed(self.free, planned, q, footholds[k])
            q = swing.end
            self._follow(self.free, swing, seen, watch)
        seen.progress = float(((self.free.sole("front") + self.free.sole("rear")) / 2 - begin)[0])
        return seen

    def _start(self, swing: Swing) -> World:
        """Set the initial state: the robot on both feet, with the soles close together. Return the world that is rooted at the first
        holding foot.
        """
        world, now = self.held[swing.holds], swing.begin
        mujoco.mj_resetDataKeyframe(world.model, world.data, 0)
        world.data.qpos[world.qpos] = now.q
        mujoco.mj_kinematics(world.model, world.data)
        world.drive(now, self._torque(world, swing, now))
        mujoco.mj_forward(world.model, world.data)
        return world

    def _stand(self, world: World, swing: Swing) -> Array:
        """Simulate `STAND` seconds in which the robot comes to rest on both feet. Return the midpoint between the soles (3,) [m]."""
        world.drive(swing.begin, self._torque(world, swing, swing.begin))
        for _ in range(round(STAND / TIMESTEP)):
            mujoco.mj_step(world.model, world.data)
        return (world.sole("front") + world.sole("rear")) / 2

    def _follow(self, world: World, swing: Swing, seen: Seen, watch: Watch | None) -> None:
        stood = world.sole(swing.holds)
        landed: Array | None = None
        for now in swing.instants(TIMESTEP):
            world.drive(now, self._torque(world, swing, now))
            mujoco.mj_step(world.model, world.data)
            pull = self._measure(world, swing, now, seen)
            if now.phase == "transfer" and landed is None:
                landed = world.sole(swing.moves)
            if watch is not None:
                watch(world.model, world.data, PULL - pull)
        assert landed is not None
        seen.tilt = max(seen.tilt, world.tilt(swing.moves))
        for what, before, foot in (("standing", stood, swing.holds), ("landing", landed, swing.moves)):
            slip = float(np.linalg.norm(cross(world.sole(foot) - before, world.normal(foot))))
            seen.slips[what] = max(seen.slips[what], slip)

    def _aimed(self, world: World, swing: Swing, q: Array, foothold: Stance) -> Swing:
        """Return the swing to a foothold in the world. The swing begins at the joint angles `q` (6,) at the end of the previous swing."""
        legs, (x, _, z) = self.legs[swing.holds], world.sole(swing.holds)
        to = foothold.seen_from(Stance(x=x, z=z, turn=world.turn(swing.holds)))
        return swing.bent(q, legs.solve(to.x, to.z, to.turn, legs.pitch(swing.end), swing.end))

    def _torque(self, world: World, swing: Swing, now: Instant) -> Array:
        """Return the torques (6,) [N m] that the servos require, computed in the mode that is rooted at the foot that carries the robot.
        During load transfer, the torques are interpolated between the two feet.
        """
        torque = self.dynamics[swing.holds].torque(now, world.gravity(swing.holds))
        if now.share == 0.0:
            return torque
        return (1.0 - now.share) * torque + now.share * self.dynamics[swing.moves].torque(now, world.gravity(swing.moves))

    def _measure(self, world: World, swing: Swing, now: Instant, seen: Seen) -> float:
        """Update the extreme values in `seen`, and return the largest pull [N] that a foot that carries the robot requires."""
        data, most = world.data, -np.inf
        carrying = [swing.holds] if now.share == 0.0 else [swing.moves] if now.share == 1.0 else FEET
        for foot in carrying:
            held = world.model.body_mocapid[world.feet[foot]] >= 0
            if not held and world.hold(foot, world.sole(foot))[0] == 0:
                seen.pull, seen.pulled, most = np.inf, now.phase, np.inf  # the foot has detached
                continue
            normal, along, tipping = world.reaction(foot)
            most = max(most, tipping / POLE - normal)
            if most > seen.pull:
                seen.pull, seen.pulled = most, now.phase
            seen.shear = max(seen.shear, along / (SLIDE * max(PULL + normal, 1e-9)))
        torque, speed = np.abs(data.actuator_force[world.drives]) / world.stall, np.abs(data.qvel[world.dofs])
        for name, part in zip(JOINTS, torque.tolist(), strict=True):
            seen.torque[name] = max(seen.torque[name], part)
        no_load = world.stall / world.kv
        seen.speed = max(seen.speed, float((torque + speed / no_load).max()))
        seen.tracking = max(seen.tracking, float(np.abs(world.joints() - now.q).max()))
        for pair in world.contacts():
            if pair not in world.stood_on:
                seen.touches |= {" and ".join(sorted(pair))}
        return most

