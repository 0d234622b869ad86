"""Simulate a robot at rest. The foot is held, and the applied torques balance gravity, so nothing should move."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, degrees

import mujoco
import numpy as np
from formulations import Formulation, Settings, Vector

REST, NEARLY = 1e-6, 1e-3
"""Upper bounds of max |qvel| [rad/s, m/s] below which the robot counts as at rest, and as nearly at rest."""
HORIZON = 4.0
"""Simulated time [s]."""
TRIED = (0.3, 0.4, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0)
"""Time constants of the stiff weld that are tried, in timesteps. By default, MuJoCo uses a time constant of at least 2 timesteps
(`refsafe`). The study disables this limit.
"""


@dataclass(frozen=True)
class Stand:
    """Results of one simulation of a robot at rest.

    `steps` and `nearly` are the numbers of steps after which max |qvel| stays below the two bounds `REST` and `NEARLY`. `steps` and
    `nearly` are None if max |qvel| does not stay below the bound. The next fields are the largest deviations from the initial state.
    `drift` [mm] and `turn` [deg] refer to the held sole, `ankle` [mm] to the ankle, `tip` [mm] to the free sole, and the field `energy` is
    in mJ. `speeds` contains max |qvel| after each step.
    """

    steps: int | None
    nearly: int | None
    drift: float
    turn: float
    ankle: float
    tip: float
    energy: float
    speeds: Vector


def _from(speeds: Vector, limit: float) -> int | None:
    moving = np.flatnonzero(~(speeds < limit))
    steps = 0 if not len(moving) else int(moving[-1]) + 1
    return None if steps == len(speeds) else steps


def stand(
    formulation: Formulation, q: Vector, torque: Vector, settings: Settings, gravity: str, friction: bool, drives: bool = False,
    horizon: float = HORIZON, kick: float = 0.0,
) -> Stand:
    """Simulate `horizon` seconds, beginning at rest at joint positions `q`. If `kick` is set, all joints begin with this speed [rad/s]."""
    formulation.configure(settings, gravity, friction, drives)
    model, data = formulation.model, formulation.stand(q)
    formulation.torque(data, torque)
    data.qvel[formulation.v] = kick
    points, rotation = formulation.places(data)
    mujoco.mj_energyPos(model, data)
    energy = data.energy[0]
    count = round(horizon / settings.timestep)
    speeds = np.full(count, np.inf)
    moved, turn, change = np.zeros(len(points)), 0.0, 0.0
    sample = max(1, count // 200)
    with np.errstate(all="ignore"):
        for k in range(count):
            mujoco.mj_step(model, data)
            speeds[k] = np.abs(data.qvel).max()
            if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or not speeds[k] < 1e4:
                return Stand(None, None, *[np.inf] * 5, speeds)
            if k % sample == 0 or k == count - 1:
                now, turned = formulation.places(data)
                moved = np.maximum(moved, np.linalg.norm(now - points, axis=1))
                turn = max(turn, angle(rotation.T @ turned))
                mujoco.mj_energyPos(model, data)
                mujoco.mj_energyVel(model, data)
                change = max(change, abs(data.energy.sum() - energy))
    sole, ankle, tip = (1e3 * float(far) for far in moved)
    return Stand(_from(speeds, REST), _from(speeds, NEARLY), sole, turn, ankle, tip, 1e3 * change, speeds)


def angle(rotation: Vector) -> float:
    """Return the angle of a rotation matrix [deg], which is also accurate for small angles."""
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    return degrees(atan2(float(np.linalg.norm(axis)), float(np.trace(rotation)) - 1.0))


def is_stable(formulation: Formulation, settings: Settings) -> bool:
    """Return whether every posture remains stable after an initial joint speed of 0.2 rad/s, under both gravities and with dry friction.
    The foot must move less than 1 mm, and the final joint speeds must be below 1 % of the initial speed.
    """
    study = formulation.study
    for gravity in ("floor", "wall"):
        for q in study.postures.values():
            run = stand(formulation, q, study.holding(q, gravity), settings, gravity, True, horizon=0.6, kick=0.2)
            if not (run.ankle < 1.0 and run.speeds[-len(run.speeds) // 6 :].max() < 0.002):
                return False
    return True


@dataclass(frozen=True)
class Inverse:
    """The result of MuJoCo's inverse dynamics (`mj_inverse`) for a robot at rest.

    `exact` is the largest joint torque [N m] of the rooted model. `error` is the largest error of a joint torque [N m] of the model. `base`
    is the force [N] that the model requires at its free base, where no force acts. `projected` is the error [N m] after the weld forces are
    chosen such that the base requires no force.
    """

    exact: float
    error: float
    base: float
    projected: float


def inverse(formulation: Formulation, q: Vector, gravity: str) -> Inverse:
    """Compare the inverse dynamics of a model at rest at joint positions `q` with the inverse dynamics of the rooted model."""
    exact = formulation.study.holding(q, gravity)
    formulation.configure(Settings(0.002, "implicitfast"), gravity, friction=False)
    model, data = formulation.model, formulation.stand(q)
    data.qvel[:] = data.qacc[:] = 0.0
    mujoco.mj_inverse(model, data)
    needed = data.qfrc_inverse.copy()
    largest, error = float(np.abs(exact).max()), float(np.abs(needed[formulation.v] - exact).max())
    if not formulation.free:
        return Inverse(largest, error, 0.0, error)
    jacobian = np.zeros((data.nefc, model.nv))
    for row in range(data.nefc):
        unit = np.zeros(data.nefc)
        unit[row] = 1.0
        mujoco.mj_mulJacTVec(model, data, jacobian[row], unit)
    weld = jacobian[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]
    force = np.linalg.solve(weld[:, :6].T, needed[:6])
    projected = needed - weld.T @ force
    return Inverse(largest, error, float(np.linalg.norm(needed[:3])), float(np.abs(projected[formulation.v] - exact).max()))
