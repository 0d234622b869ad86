"""Simulate a swing of the rear leg with the front foot held. The applied torques come from inverse dynamics of the rooted model."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import mujoco
import numpy as np
from formulations import Formulation, Settings, Study, Vector

DURATION = 1.0
"""Duration of the swing [s]."""
START, END = "stretched", "step_rear"
TURN = {"rear/yaw": radians(20.0)}
"""Additional rotation of joints [rad] during the swing between the two named poses."""
KP, KD = 5.0, 0.5
"""Gains of a weak feedback [N m/rad, N m s/rad], a tenth of the gains of the drives."""


@dataclass(frozen=True)
class Swing:
    """The largest errors during a swing, of any joint [deg] and of the sole of the free foot [mm]. The errors are infinite if the
    simulation is unstable.
    """

    joint: float
    tip: float


@dataclass(frozen=True)
class Plan:
    """A planned trajectory for a timestep. `q`, `v` and `tip` contain joint positions, joint velocities and exact positions of the free
    sole at the start of each step, and at the end. `torque` contains the torques in the middle of each step, which are applied during the
    whole step (second-order accurate).
    """

    q: Vector
    v: Vector
    tip: Vector
    torque: Vector


def minimum_jerk(s: float) -> tuple[float, float, float]:
    """Return the position and its first and second derivative on a minimum-jerk path from 0 to 1 (Flash and Hogan, 1985). The parameter s
    is in [0, 1], and both ends are at rest.
    """
    return (
        s**3 * (10.0 - 15.0 * s + 6.0 * s * s),
        30.0 * s * s * (1.0 - s) ** 2,
        60.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
    )


def plan(study: Study, timestep: float, gravity: str) -> Plan:
    """Plan the swing, with feed-forward torques for joints without dry friction."""
    start = study.postures[START]
    step = study.postures[END] + study.vector(TURN) - start

    def at(time: float) -> tuple[Vector, Vector, Vector]:
        x, v, a = minimum_jerk(time / DURATION)
        return start + step * x, step * v / DURATION, step * a / DURATION**2

    count = round(DURATION / timestep)
    states = [at(k * timestep) for k in range(count + 1)]
    torque = [study.inverse(*at((k + 0.5) * timestep), gravity, friction=False) for k in range(count)]
    positions = np.array([q for q, _, _ in states])
    return Plan(positions, np.array([v for _, v, _ in states]), np.array([study.tip(q) for q in positions]), np.array(torque))


def swing(formulation: Formulation, path: Plan, settings: Settings, gravity: str, feedback: bool) -> Swing:
    """Simulate a planned swing, without dry friction and without drives, and return its errors."""
    formulation.configure(settings, gravity, friction=False)
    model, data = formulation.model, formulation.stand(path.q[0])
    joint = tip = 0.0
    with np.errstate(all="ignore"):
        for k, torque in enumerate(path.torque):
            if feedback:
                torque = torque + KP * (path.q[k] - data.qpos[formulation.q]) + KD * (path.v[k] - data.qvel[formulation.v])
            formulation.torque(data, torque)
            mujoco.mj_step(model, data)
            if not np.abs(data.qvel).max() < 1e4 or data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
                return Swing(np.inf, np.inf)
            mujoco.mj_kinematics(model, data)
            joint = max(joint, float(np.abs(data.qpos[formulation.q] - path.q[k + 1]).max()))
            tip = max(tip, float(np.linalg.norm(data.site_xpos[formulation.tip] - path.tip[k + 1])))
    return Swing(float(np.degrees(joint)), 1e3 * tip)
