"""Stability rules for gains, compared with MuJoCo simulations: gains beyond the limit diverge, and gains called calm come to rest."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from thingc.targets.mjcf.initial_state_checks import Gains, gains_of

STEPS = 4000
INERTIA, DT = 2e-5, 2e-3


def hinge(integrator: str, kp: float, kv: float, damping: float, force: float | None = None) -> mujoco.MjModel:
    """One bar on a hinge with inertia `INERTIA` about it, without gravity."""
    limit = f'forcerange="-{force} {force}"' if force is not None else ""
    return mujoco.MjModel.from_xml_string(f"""
      <mujoco><compiler angle="radian" autolimits="true"/>
        <option timestep="{DT}" integrator="{integrator}" gravity="0 0 0"/>
        <worldbody><body>
          <inertial pos="0 0 0" mass="1" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>
          <joint name="j" type="hinge" axis="0 0 1" damping="{damping}"/><geom size="0.01" mass="0"/>
        </body></worldbody>
        <actuator><position name="j" joint="j" kp="{kp}" kv="{kv}" {limit}/></actuator>
      </mujoco>""")


def gains_of_drive(model: mujoco.MjModel) -> Gains:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ((name, gains),) = gains_of(model, data)
    assert name == "j"
    return gains


def swing(model: mujoco.MjModel, error: float = 1e-3) -> float:
    """Growth of an initial error [rad]: the final error relative to the initial one. A calm drive leaves less than a millionth; inf if
    the error diverges."""
    data = mujoco.MjData(model)
    data.qpos[0] = error
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
        if not math.isfinite(data.qpos[0]) or abs(data.qpos[0]) > 1e3 * error:
            return math.inf
    return float(abs(data.qpos[0]) / error)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
@pytest.mark.parametrize(("kv", "damping"), [(0.0, 1e-3), (2e-3, 0.0), (1e-3, 1e-3)])
def test_stiffness_limit_is_where_mujoco_diverges(integrator: str, kv: float, damping: float) -> None:
    """Just below the limit the error does not grow, just above it diverges."""
    stiffest = gains_of_drive(hinge(integrator, 1.0, kv, damping)).stiffest
    if integrator == "RK4":  # the rule is that of no damping: with some, the bound lies near it
        assert swing(hinge(integrator, 0.5 * stiffest, kv, damping)) < 1e-3 and swing(hinge(integrator, 1.5 * stiffest, kv, damping)) > 1e3
        return
    assert swing(hinge(integrator, 0.98 * stiffest, kv, damping)) < 1.0
    assert swing(hinge(integrator, 1.02 * stiffest, kv, damping)) == math.inf
    over, under = (gains_of_drive(hinge(integrator, share * stiffest, kv, damping)) for share in (1.02, 0.98))
    assert over.too_stiff and not under.too_stiff


def test_extreme_time_steps_are_skipped() -> None:
    """If the square of the time step underflows or overflows, no gains are reported."""
    model = hinge("implicitfast", 1e9, 0.0, 0.0)
    assert gains_of_drive(model).too_stiff
    for step in (1e-300, 1e300):
        model.opt.timestep = step
        assert list(gains_of(model, mujoco.MjData(model))) == []


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast"])
def test_half_the_stiffness_limit_is_calm(integrator: str) -> None:
    """The diagnostic suggests this value."""
    stiffest = gains_of_drive(hinge(integrator, 1.0, 1e-3, 5e-4)).stiffest
    assert swing(hinge(integrator, stiffest / 2.0, 1e-3, 5e-4)) < 1e-6


def speed(model: mujoco.MjModel, error: float) -> float:
    """Largest speed [rad/s] in the last tenth of the simulation, from an initial error [rad]."""
    data = mujoco.MjData(model)
    data.qpos[0] = error
    fastest = 0.0
    for step in range(STEPS):
        mujoco.mj_step(model, data)
        if step > 0.9 * STEPS:
            fastest = max(fastest, abs(float(data.qvel[0])))
    return fastest


def test_large_explicit_velocity_gain_chatters() -> None:
    """With dt kv > 2 I, Euler diverges. From dt kv = I on, the velocity changes its sign at every step."""
    quick = hinge("Euler", 0.1, 1.5 * INERTIA / DT, 0.0)
    assert gains_of_drive(quick).too_damped and not gains_of_drive(hinge("Euler", 0.1, 0.9 * INERTIA / DT, 0.0)).too_damped
    data = mujoco.MjData(quick)
    data.qvel[0] = 1.0
    signs = []
    for _ in range(4):
        mujoco.mj_step(quick, data)
        signs.append(float(np.sign(data.qvel[0])))
    assert signs == [-1.0, 1.0, -1.0, 1.0]
    assert not gains_of_drive(hinge("implicitfast", 0.1, 100.0 * INERTIA / DT, 0.0)).too_damped  # implicit, and its force has no limit


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_velocity_gain_limit_is_where_euler_diverges(share: float) -> None:
    """With 0, 0.3 and 0.9 of the stiffness limit without kv. Half of the limit comes to rest without sign changes of the velocity."""
    kp = share * 4.0 * INERTIA / DT**2
    max_kv = gains_of_drive(hinge("Euler", kp, 10.0 * INERTIA / DT, 0.0)).max_kv
    assert max_kv == pytest.approx(min(INERTIA / DT, 2.0 * (1.0 - share) * INERTIA / DT))
    assert gains_of_drive(hinge("Euler", kp, 0.98 * max_kv, 0.0)).stable
    assert not gains_of_drive(hinge("Euler", kp, 1.02 * max_kv, 0.0)).stable
    assert speed(hinge("Euler", kp, max_kv / 2.0, 0.0), 1e-3) < 1e-6
    if share == 0.9:
        assert swing(hinge("Euler", kp, 1.02 * max_kv, 0.0)) == math.inf


@pytest.mark.parametrize("force", [2.0, 0.05, 0.01])
@pytest.mark.parametrize("ratio", [1.0, 1.9, 2.1, 3.8])
def test_force_oscillates_between_limits_at_high_gain(force: float, ratio: float) -> None:
    """With kv far above I / dt, only this effect remains: beyond twice the inertia, the speed stays at dt F / I; below, it decays. This
    holds for any initial error."""
    model = hinge("implicitfast", ratio * INERTIA / DT**2, 10.0 * INERTIA / DT, 0.0, force=force)
    step = DT**2 * force / INERTIA
    fastest = max(speed(model, error) for error in (0.5 * step, 0.55 * step, 0.37, 1.0, 2.1))
    gains = gains_of_drive(model)
    assert not gains.too_stiff and gains.jumps == (ratio > 2.0)
    assert fastest == pytest.approx(DT * force / INERTIA) if gains.jumps else fastest < 1e-9


def test_effective_inertia_with_other_joints_free() -> None:
    """Two rods in a row: 1 / (M^-1)_jj of both hinges, from a written-out mass matrix."""
    mass, length = 0.1, 0.2
    model = mujoco.MjModel.from_xml_string(f"""
      <mujoco><option timestep="{DT}" gravity="0 0 0"/><worldbody>
        <body><joint name="a" axis="0 1 0"/><inertial pos="{length / 2} 0 0" mass="{mass}" diaginertia="1e-4 1e-4 1e-4"/>
          <body pos="{length} 0 0"><joint name="b" axis="0 1 0"/>
            <inertial pos="{length / 2} 0 0" mass="{mass}" diaginertia="1e-4 1e-4 1e-4"/></body></body>
      </worldbody><actuator><position name="a" joint="a" kp="1"/><position name="b" joint="b" kp="1"/></actuator></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    own = 1e-4 + mass * length**2 / 4.0
    m22 = own
    m12 = own + mass * length**2 / 2.0
    m11 = own + 1e-4 + mass * (1.5 * length) ** 2
    inverse = np.linalg.inv(np.array([[m11, m12], [m12, m22]]))
    found = dict(gains_of(model, data))
    assert [found[name].inertia for name in "ab"] == pytest.approx([1.0 / inverse[0, 0], 1.0 / inverse[1, 1]])


MOMENTS = np.array([1e-5, 4e-5, 4.5e-5])


def ball(gains: str, gears: list[tuple[float, ...]]) -> mujoco.MjModel:
    """A body with `MOMENTS` on a ball joint about its centre, with a position drive for each axis in `gears`."""
    drives = "".join(
        f'<position name="b_{k}" joint="b" gear="{" ".join(map(str, gear))} 0 0 0" {gains}/>' for k, gear in enumerate(gears)
    )
    return mujoco.MjModel.from_xml_string(f"""
      <mujoco><option timestep="{DT}" gravity="0 0 0" integrator="implicitfast"/><worldbody><body>
        <inertial pos="0 0 0" mass="1" diaginertia="{" ".join(map(str, MOMENTS))}"/><joint name="b" type="ball" damping="1e-4"/>
      </body></worldbody><actuator>{drives}</actuator></mujoco>""")


def test_effective_inertia_of_ball_drives() -> None:
    """The inertia is 1 / (g J^-1 g), and the stiffness limit is that of a hinge with this inertia."""
    axes = [(1.0, 0.0, 0.0), (0.0, 0.6, 0.8)]
    model = ball('kp="1"', axes)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = dict(gains_of(model, data))
    assert [found[f"b_{k}"].inertia for k in range(2)] == pytest.approx([1.0 / float(np.square(axis) @ (1.0 / MOMENTS)) for axis in axes])
    assert [found[f"b_{k}"].damping for k in range(2)] == pytest.approx([1e-4, 1e-4])
    stiffest = found["b_0"].stiffest
    for share in (0.98, 1.02):
        model = ball(f'kp="{share * stiffest}"', axes[:1])
        data = mujoco.MjData(model)
        data.qpos[:] = [math.cos(5e-4), math.sin(5e-4), 0.0, 0.0]
        for _ in range(STEPS):
            mujoco.mj_step(model, data)
            if abs(data.qpos[1]) > 0.1:
                break
        assert (abs(data.qpos[1]) > 0.1) == (share > 1.0)


def test_effective_inertia_includes_mimic_joints() -> None:
    """The drive on a light joint that a heavy one mimics moves both: I1 + I2."""
    model = mujoco.MjModel.from_xml_string(f"""
      <mujoco><option timestep="{DT}" gravity="0 0 0"/><worldbody>
        <body><joint name="a" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1e-5 1e-5 1e-5"/></body>
        <body><joint name="b" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/></body>
      </worldbody><equality><joint joint1="b" joint2="a"/></equality>
      <actuator><position joint="a" kp="1"/></actuator></mujoco>""")
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ((_, gains),) = gains_of(model, data)
    assert gains.inertia == pytest.approx(1.01e-3)
