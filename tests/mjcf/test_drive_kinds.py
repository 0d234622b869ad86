"""Joints that override the kind of a part's actuator: a servo used as a wheel motor, in MuJoCo."""

from __future__ import annotations

from pathlib import Path

import mujoco
import pytest

import thingc

WHEEL = """\
thingc: assembly/1
name: wheel
materials: [thingc_stock.materials]
components:
  servo: {part: thingc_stock.dynamixel:XL430}
  wheel: {frame: true, mass: 60 g, inertia: {ixx: 40 kg*mm^2, iyy: 40 kg*mm^2, izz: 70 kg*mm^2}}
joints:
  roll: {type: continuous, parent: servo.horn, child: wheel.origin, dynamics: {friction: FRICTION}, drive: {DRIVE}}
modes:
  bench: {root: servo, base: fixed}
"""


def wheel(folder: Path, drive: str, friction: str = "0 N*m") -> mujoco.MjModel:
    (folder / "wheel.yaml").write_text(WHEEL.replace("DRIVE", drive).replace("FRICTION", friction))
    return thingc.compile(folder / "wheel.yaml").modes["bench"].model()


@pytest.mark.parametrize(("gain", "friction", "slip"), [("", 0.0, 0.0), (", kv: 20 N*m*s/rad", 0.3, 0.3 / 20)])
def test_velocity_servo_reaches_the_commanded_speed(gain: str, friction: float, slip: float, tmp_path: Path) -> None:
    """In the steady state the torque equals the friction, so the speed error is friction / kv. No torque exceeds the stall torque, 1.5 N
    m."""
    model = wheel(tmp_path, f"component: servo, kind: velocity{gain}", f"{friction} N*m")
    data = mujoco.MjData(model)
    assert model.actuator_ctrlrange[0, 1] == pytest.approx(61 * 2 * 3.141592653589793 / 60) and model.actuator_biasprm[0, 1] == 0.0
    data.ctrl[0] = 3.0
    most = 0.0
    for _ in range(1000):
        mujoco.mj_step(model, data)
        most = max(most, abs(float(data.actuator_force[0])))
    assert data.qvel[0] == pytest.approx(3.0 - slip, abs=2e-3) and data.qpos[0] > 4.0
    assert 0.5 < most <= 1.5


def test_drive_values_override_the_part(tmp_path: Path) -> None:
    drives = ("component: servo", "component: servo, kind: position", "component: servo, kp: 7 N*m/rad")
    own, same, stiff = (wheel(tmp_path, drive) for drive in drives)
    assert own.actuator_biasprm.tolist() == same.actuator_biasprm.tolist()
    assert stiff.actuator_gainprm[0, 0] == 7.0 != own.actuator_gainprm[0, 0]
    assert stiff.actuator_forcerange.tolist() == own.actuator_forcerange.tolist() and own.dof_armature[0] > 0.0
    motor = wheel(tmp_path, "component: servo, kind: motor, effort: 1 N*m")
    assert motor.actuator_ctrlrange.tolist() == [[-1.0, 1.0]] and motor.actuator_biastype[0] == mujoco.mjtBias.mjBIAS_NONE
