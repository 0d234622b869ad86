"""Simulate designs of MInchW that climb a wall, with different lengths and gaits, in parallel with `mujoco.rollout`.

The base of the robot is free, and only the magnets hold the robot. The commands of its servos are computed before the simulation with
inverse dynamics, as in `inchworm_physics.py`. The simulation has no feedback. Units are SI.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np
from mujoco import rollout

import thingc
from inchworm_gait import DRAWN_UP, FEET, JOINTS, Array, Swing, swings

PLACE = "_wall"
STEPS = 2
"""Number of steps that each foot makes. The robot stands on both feet for `STAND` [s] before the walk."""
STAND = 0.3
LIFT, SINK = 0.025, 0.0001
SAMPLED = 25
"""Number of simulation steps between checks of the feet and the contacts."""
SLIP, TILT = 0.002, 0.02
"""Largest slip [m] and tilt [rad] of a supporting foot in a step."""

STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A design of the robot and its gait: lengths of leg and body [m], stride [m], knee angle [rad] and pace. The knee angle applies while
    both feet are close together, and the pace is relative to `make walk`.
    """

    leg: float
    body: float
    stride: float
    knee: float
    pace: float

    @property
    def settings(self) -> dict[str, float]:
        """Return the parameters of the document that define the lengths of legs and body."""
        return {"leg_length": self.leg, "body_length": self.body}


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The result of a walk: distance [m], time [s] and energy [J].

    `work` is the mechanical work of the servos: the integral of |torque * velocity|. Braking does not recover energy. `heat` is the energy
    [J] that the windings of the motors lose as heat. `failed` is the reason why the walk failed. `failed` is empty for a successful walk.
    """

    failed: str = ""
    distance: float = 0.0
    seconds: float = 0.0
    work: float = 0.0
    heat: float = 0.0
    mass: float = 0.0
    largest: float = 0.0
    """Largest load on the torque-speed line of a servo, computed as torque / stall torque + speed / no-load speed."""

    @property
    def value(self) -> float:
        """Return the distance per energy [m/J], or 0 for a failed walk."""
        return 0.0 if self.failed else self.distance / (self.work + self.heat)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A walk that is ready to be simulated: the model, the initial state, and the commands of the drives (steps, nu). `ends` contains the
    simulation step at which each swing ends, and `plan` contains the swings.
    """

    model: mujoco.MjModel
    start: Array
    control: Array
    plan: Sequence[Swing]
    ends: tuple[int, ...]


def evaluate(robots: thingc.RobotFamily, designs: Sequence[Design], threads: int) -> list[Outcome]:
    """Simulate the walks of several designs in parallel, and return their outcomes. The outcome of a design does not depend on the other
    designs.
    """
    prepared = [prepare(robots, design) for design in designs]
    walks = [one for one in prepared if isinstance(one, Prepared)]
    if not walks:
        return [one for one in prepared if isinstance(one, Outcome)]
    steps = max(len(walk.control) for walk in walks)
    control = np.stack([np.pad(walk.control, ((0, steps - len(walk.control)), (0, 0)), mode="edge") for walk in walks])
    states, _ = rollout.rollout(
        [walk.model for walk in walks], [mujoco.MjData(walks[0].model) for _ in range(threads)],
        np.stack([walk.start for walk in walks]), control,
    )
    seen = iter([judged(walk, found[: len(walk.control)]) for walk, found in zip(walks, states, strict=True)])
    return [next(seen) if isinstance(one, Prepared) else one for one in prepared]


def prepare(robots: thingc.RobotFamily, design: Design) -> Prepared | Outcome:
    """Plan the walk of a design, and compute the commands of its drives. Return an outcome with the reason if the legs cannot reach a
    foothold, or if the document rejects the lengths.
    """
    held: dict[str, mujoco.MjModel] = {}
    for foot in FEET:
        model = robots.model(design.settings, mode=f"{foot}_foot{PLACE}", visual=False)
        if not model:
            return Outcome(failed=f"the document refuses it: {model.problems[0].message}")
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        held[foot] = model
    free = robots.model(design.settings, mode=f"crawl{PLACE}", visual=False, floor=True)
    drawn_up = DRAWN_UP * design.knee / DRAWN_UP.max()
    try:
        plan = swings(held, 1, _apart(held["rear"], drawn_up), design.stride, LIFT, SINK)
    except (ValueError, np.linalg.LinAlgError):
        return Outcome(failed="the legs do not reach")
    ranges = np.array([free.joint(name).range for name in JOINTS])
    for swing in plan:
        over = np.polynomial.chebyshev.chebval(np.linspace(-1.0, 1.0, 50), swing.path).T
        if ((over < ranges[:, 0]) | (over > ranges[:, 1])).any():
            return Outcome(failed="a joint is at its limit")
    return _commanded(free, held, plan, design.pace)


def _apart(model: mujoco.MjModel, q: Array) -> float:
    """Return the distance between the soles [m] at joint angles (6,)."""
    data = _placed(model, q)
    return float(np.linalg.norm(data.site("front/sole").xpos - data.site("rear/sole").xpos))


def _placed(model: mujoco.MjModel, q: Array) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for name, value in zip(JOINTS, q, strict=True):
        data.joint(name).qpos = value
    mujoco.mj_kinematics(model, data)
    return data


def _commanded(free: mujoco.MjModel, held: dict[str, mujoco.MjModel], plan: list[Swing], pace: float) -> Prepared:
    """Compute the walk of a plan and the position commands of its servos, which produce the required torque: force = kp (ctrl - q) - kv v.
    """
    drives = [free.actuator(name).id for name in JOINTS]
    kp, kv = free.actuator_gainprm[drives, 0], -free.actuator_biasprm[drives, 2]
    magnets = [(foot, free.actuator(f"{foot}/sole").id) for foot in FEET]
    needs = {foot: _Inverse(model) for foot, model in held.items()}

    def row(holds: str, now: object) -> Array:
        torque = needs[holds].torque(now.q, now.v, now.a)
        if now.share:
            moves = next(foot for foot in FEET if foot != holds)
            torque = (1.0 - now.share) * torque + now.share * needs[moves].torque(now.q, now.v, now.a)
        made = np.zeros(free.nu)
        made[drives] = now.q + (torque + kv * now.v) / kp
        for foot, drive in magnets:
            made[drive] = now.magnets[foot]
        return made

    timestep = float(free.opt.timestep)
    stand = [row(plan[0].holds, plan[0].begin)] * round(STAND / timestep)
    paced = [[row(swing.holds, now) for now in _at_pace(swing, pace).instants(timestep)] for swing in plan]
    rows = [stand, *(paced * STEPS)]
    ends = tuple(itertools.accumulate(map(len, rows)))
    data, first = mujoco.MjData(free), _placed(held[plan[0].holds], plan[0].begin.q)
    for name, value in zip(JOINTS, plan[0].begin.q, strict=True):
        data.joint(name).qpos = value
    base = int(free.jnt_qposadr[free.body_jntadr[free.body("body").id]])
    data.qpos[base: base + 7] = *first.body("body").xpos, *first.body("body").xquat
    start = np.empty(mujoco.mj_stateSize(free, STATE))
    mujoco.mj_getState(free, data, start, STATE)
    return Prepared(model=free, start=start, control=np.concatenate(rows), plan=plan * STEPS, ends=ends)


def _at_pace(swing: Swing, pace: float) -> Swing:
    return Swing(holds=swing.holds, moves=swing.moves, path=swing.path, seconds=swing.seconds, press=swing.press, pace=pace)


@dataclass(slots=True)
class _Inverse:
    """Computes the inverse dynamics of a mode that is rooted at a foot, without contacts."""

    model: mujoco.MjModel
    data: mujoco.MjData = field(init=False)
    qpos: list[int] = field(init=False)
    dofs: list[int] = field(init=False)
    still: dict[bytes, Array] = field(init=False)

    def __post_init__(self) -> None:
        self.data = mujoco.MjData(self.model)
        self.qpos = [int(self.model.joint(name).qposadr[0]) for name in JOINTS]
        self.dofs = [int(self.model.joint(name).dofadr[0]) for name in JOINTS]
        self.still = {}

    def torque(self, q: Array, v: Array, a: Array) -> Array:
        """Return the joint torques (6,) [N m] for positions q, velocities v and accelerations a (6,). The torques include friction and
        damping of the joints.
        """
        key = b"" if v.any() else q.tobytes()
        if key in self.still:
            return self.still[key]
        self.data.qpos[self.qpos], self.data.qvel[self.dofs], self.data.qacc[self.dofs] = q, v, a
        mujoco.mj_inverse(self.model, self.data)
        found = np.array(self.data.qfrc_inverse[self.dofs])
        if key:
            self.still[key] = found
        return found


def judged(walk: Prepared, states: Array) -> Outcome:
    """Evaluate a walk from the states of the simulation after every step (steps, nstate)."""
    model, begin = walk.model, walk.ends[0]
    if not np.isfinite(states).all():
        return Outcome(failed="the simulation is unstable")
    before = np.concatenate((walk.start[None], states[:-1]))
    q, v = before[:, 1: 1 + model.nq], before[:, 1 + model.nq: 1 + model.nq + model.nv]
    drives = [model.actuator(name).id for name in JOINTS]
    asked = np.clip(walk.control[:, drives], *model.actuator_ctrlrange[drives].T)
    kp, kv, stall = model.actuator_gainprm[drives, 0], -model.actuator_biasprm[drives, 2], model.actuator_forcerange[drives, 1]
    speed = v[:, [int(model.joint(name).dofadr[0]) for name in JOINTS]]
    at = q[:, [int(model.joint(name).qposadr[0]) for name in JOINTS]]
    torque = np.clip(kp * (asked - at) - kv * speed, -stall, stall)
    # kv is stall torque / no-load speed, which for a motor is the square of its constant over the resistance of its winding.
    line = np.abs(torque[begin:]) / stall + np.abs(speed[begin:]) / (stall / kv)
    timestep = float(model.opt.timestep)
    failed, distance = _watched(walk, states)
    if not failed and line.max() > 1.0:
        failed = "a servo exceeds its torque-speed line"
    return Outcome(
        failed=failed, distance=distance, seconds=(len(states) - begin) * timestep, mass=float(model.body_mass.sum()),
        work=float(np.abs(torque[begin:] * speed[begin:]).sum() * timestep), heat=float((torque[begin:] ** 2 / kv).sum() * timestep),
        largest=float(line.max()),
    )


def _watched(walk: Prepared, states: Array) -> tuple[str, float]:
    """Return the reason of a failure (empty for a successful walk), and the distance [m] that the midpoint between the soles has moved."""
    model, data = walk.model, mujoco.MjData(walk.model)
    soles = {frozenset((model.geom("floor").id, model.geom(f"{foot}/magnet:collision").id)) for foot in FEET}
    first = None
    for swing, begin, end in zip(walk.plan, walk.ends, walk.ends[1:]):
        stood = None
        for step in (*range(begin - 1, end - 1, SAMPLED), end - 1):
            mujoco.mj_setState(model, data, states[step], STATE)
            mujoco.mj_fwdPosition(model, data)
            if stood is None:
                stood = np.array(data.site(f"{swing.holds}/sole").xpos)
                if first is None:
                    first = _middle(data)
            for contact in range(data.ncon):
                if data.contact.dist[contact] < 0.0 and frozenset(data.contact.geom[contact].tolist()) not in soles:
                    return "something besides the soles touches", 0.0
            if np.linalg.norm(data.site(f"{swing.holds}/sole").xpos - stood) > SLIP and step < end - 1:
                return "the supporting foot slips or detaches", 0.0
        if abs(data.site(f"{swing.moves}/sole").xpos[2]) > SLIP or _lean(data, swing.moves) > TILT:
            return "a foot does not land", 0.0
    assert first is not None
    return "", float((_middle(data) - first)[0])


def _middle(data: mujoco.MjData) -> Array:
    return np.array(data.site("front/sole").xpos + data.site("rear/sole").xpos) / 2.0


def _lean(data: mujoco.MjData, foot: str) -> float:
    """Return the angle [rad] between a sole and the steel."""
    return float(np.linalg.norm(data.site(f"{foot}/sole").xmat.reshape(3, 3)[:2, 2]))
