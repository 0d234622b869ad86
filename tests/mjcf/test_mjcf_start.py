"""The rules for gains, against MuJoCo's own simulation: beyond them it swings up, within what is called calm it comes to rest."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from thingc.targets.mjcf.initial_state_checks import Gains, gains_of

STEPS = 4000
INERTIA, DT = 2e-5, 2e-3


def hinge(integrator: str, kp: float, kv: float, damping: float, force: float | None = None) -> mujoco.MjModel:
    """One bar on a hinge, of `INERTIA` about it, without gravity."""
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


def seen(model: mujoco.MjModel) -> Gains:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ((name, gains),) = gains_of(model, data)
    assert name == "j"
    return gains


def swing(model: mujoco.MjModel, error: float = 1e-3) -> float:
    """How large an error [rad] has become, of which a millionth is left to a drive that is calm."""
    data = mujoco.MjData(model)
    data.qpos[0] = error
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
        if not math.isfinite(data.qpos[0]) or abs(data.qpos[0]) > 1e3 * error:
            return math.inf
    return float(abs(data.qpos[0]) / error)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
@pytest.mark.parametrize(("kv", "damping"), [(0.0, 1e-3), (2e-3, 0.0), (1e-3, 1e-3)])
def test_the_stiffest_gain_is_where_mujoco_begins_to_swing_up(integrator: str, kv: float, damping: float) -> None:
    stiffest = seen(hinge(integrator, 1.0, kv, damping)).stiffest
    if integrator == "RK4":  # the rule is that of no damping: with some, the bound lies near it
        assert swing(hinge(integrator, 0.5 * stiffest, kv, damping)) < 1e-3 and swing(hinge(integrator, 1.5 * stiffest, kv, damping)) > 1e3
        return
    assert swing(hinge(integrator, 0.98 * stiffest, kv, damping)) < 1.0
    assert swing(hinge(integrator, 1.02 * stiffest, kv, damping)) == math.inf
    over, under = (seen(hinge(integrator, share * stiffest, kv, damping)) for share in (1.02, 0.98))
    assert over.too_stiff and not under.too_stiff


def test_steps_whose_square_is_no_number_are_not_judged() -> None:
    model = hinge("implicitfast", 1e9, 0.0, 0.0)
    assert seen(model).too_stiff
    for step in (1e-300, 1e300):
        model.opt.timestep = step
        assert list(gains_of(model, mujoco.MjData(model))) == []


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast"])
def test_half_of_it_is_calm(integrator: str) -> None:
    """What the message offers."""
    stiffest = seen(hinge(integrator, 1.0, 1e-3, 5e-4)).stiffest
    assert swing(hinge(integrator, stiffest / 2.0, 1e-3, 5e-4)) < 1e-6


def speed(model: mujoco.MjModel, error: float) -> float:
    """The greatest speed [rad/s] in the last tenth of the simulation, from an error [rad]."""
    data = mujoco.MjData(model)
    data.qpos[0] = error
    fastest = 0.0
    for step in range(STEPS):
        mujoco.mj_step(model, data)
        if step > 0.9 * STEPS:
            fastest = max(fastest, abs(float(data.qvel[0])))
    return fastest


def test_a_velocity_gain_that_turns_the_velocity_round_chatters_where_it_is_explicit() -> None:
    """dt kv > 2 I diverges in Euler; from dt kv = I on the velocity changes its sign at every step."""
    quick = hinge("Euler", 0.1, 1.5 * INERTIA / DT, 0.0)
    assert seen(quick).too_quick and not seen(hinge("Euler", 0.1, 0.9 * INERTIA / DT, 0.0)).too_quick
    data = mujoco.MjData(quick)
    data.qvel[0] = 1.0
    signs = []
    for _ in range(4):
        mujoco.mj_step(quick, data)
        signs.append(float(np.sign(data.qvel[0])))
    assert signs == [-1.0, 1.0, -1.0, 1.0]
    assert not seen(hinge("implicitfast", 0.1, 100.0 * INERTIA / DT, 0.0)).too_quick  # implicit, and its force has no limit


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_the_calmest_velocity_gain_is_where_euler_stops_to_swing_up(share: float) -> None:
    """With no, some and nearly all of the stiffness that no kv at all would bear; half of it comes to rest, and turns no velocity round."""
    kp = share * 4.0 * INERTIA / DT**2
    calmest = seen(hinge("Euler", kp, 10.0 * INERTIA / DT, 0.0)).calmest
    assert calmest == pytest.approx(min(INERTIA / DT, 2.0 * (1.0 - share) * INERTIA / DT))
    assert seen(hinge("Euler", kp, 0.98 * calmest, 0.0)).calm and not seen(hinge("Euler", kp, 1.02 * calmest, 0.0)).calm
    assert speed(hinge("Euler", kp, calmest / 2.0, 0.0), 1e-3) < 1e-6
    if share == 0.9:
        assert swing(hinge("Euler", kp, 1.02 * calmest, 0.0)) == math.inf


@pytest.mark.parametrize("force", [2.0, 0.05, 0.01])
@pytest.mark.parametrize("ratio", [1.0, 1.9, 2.1, 3.8])
def test_a_force_jumps_from_limit_to_limit_for_ever_beyond_twice_the_inertia(force: float, ratio: float) -> None:
    """With kv far above I / dt, so that nothing else moves: the speed stays dt F / I, or it dies away, whatever the error was."""
    model = hinge("implicitfast", ratio * INERTIA / DT**2, 10.0 * INERTIA / DT, 0.0, force=force)
    step = DT**2 * force / INERTIA
    fastest = max(speed(model, error) for error in (0.5 * step, 0.55 * step, 0.37, 1.0, 2.1))
    gains = seen(model)
    assert not gains.too_stiff and gains.jumps == (ratio > 2.0)
    assert fastest == pytest.approx(DT * force / INERTIA) if gains.jumps else fastest < 1e-9


def test_the_inertia_is_what_moves_with_everything_else_free() -> None:
    """Two rods in a row: 1 / (M^-1)_jj of both hinges, from the mass matrix written by hand."""
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
    """A body of `MOMENTS` on a ball about its centre, with a position drive about each axis."""
    drives = "".join(
        f'<position name="b_{k}" joint="b" gear="{" ".join(map(str, gear))} 0 0 0" {gains}/>' for k, gear in enumerate(gears)
    )
    return mujoco.MjModel.from_xml_string(f"""
      <mujoco><option timestep="{DT}" gravity="0 0 0" integrator="implicitfast"/><worldbody><body>
        <inertial pos="0 0 0" mass="1" diaginertia="{" ".join(map(str, MOMENTS))}"/><joint name="b" type="ball" damping="1e-4"/>
      </body></worldbody><actuator>{drives}</actuator></mujoco>""")


def test_a_drive_of_a_ball_moves_what_turns_about_its_axis() -> None:
    """1 / (g J^-1 g), by which its stiffness is judged as a hinge's."""
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


def test_joints_that_are_tied_move_together() -> None:
    """A drive on a light joint that a heavy one mimics moves both: I1 + I2."""
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
