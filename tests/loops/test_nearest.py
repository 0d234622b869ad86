"""Loops close at the values nearest to those of the pose, as found by MuJoCo's own constraints."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import mujoco
import numpy as np
import pytest

import thingc
from importing.as_original import closed_residual, nearest_closed
from loops.robots import BALL
from thingc.base.diagnostics import Report
from thingc.model.robot.loop_solver import Loops
from thingc.tools.importing.importing import import_robot

LEG = """\
<mujoco model="leg">
  <compiler angle="radian"/>
  <worldbody>
    <body name="thigh" pos="0 0 1">
      <joint name="hip" axis="0 1 0" range="-1 1"/><geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.02" mass="1"/>
      <body name="achilles" pos="-0.05 0 -0.1">
        <joint name="achilles" type="ball"/><geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.01" mass="0.1"/>
      </body>
      <body name="shin" pos="0 0 -0.4">
        <joint name="knee" axis="0 1 0" range="-1 1"/><geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.02" mass="1"/>
        <body name="spring" pos="0 0 -0.1">
          <joint name="spring" axis="0 1 0" stiffness="100"/><geom type="capsule" fromto="0 0 0 -0.05 0 0" size="0.01" mass="0.1"/>
        </body>
        <body name="crank" pos="-0.05 0 -0.2">
          <joint name="crank" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 -0.06 0 0" size="0.01" mass="0.1"/>
          <body name="plantar" pos="-0.06 0 0">
            <joint name="plantar" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.03 0 -0.2" size="0.01" mass="0.1"/>
          </body>
        </body>
        <body name="foot" pos="0 0 -0.4">
          <joint name="foot" axis="0 1 0" range="-1 {upper}"/><geom type="capsule" fromto="0 0 0 -0.08 0 0" size="0.02" mass="0.3"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>
    <connect name="heel" body1="achilles" body2="spring" anchor="0 0 -0.4"/>
    <connect name="toe" body1="plantar" body2="foot" anchor="0.03 0 -0.2"/>
  </equality>
  <keyframe><key name="home" qpos="{values}"/></keyframe>
</mujoco>
"""
OPENED = "0.2 0.9998 0.002 0.02 -0.001 0 0.01 0.012 -0.02 {foot}"


@pytest.mark.parametrize(("foot", "upper"), [(0.0, 1.0), (0.02, 0.02)])
def test_keyframe_closes_at_the_nearest_values(foot: float, upper: float, tmp_path: Path) -> None:
    """Zeros of a keyframe count as values, and a joint at its limit stays there. Changed values are a warning and are listed by the
    import."""
    source = tmp_path / "leg.xml"
    source.write_text(LEG.format(values=OPENED.format(foot=foot), upper=upper))
    theirs = mujoco.MjModel.from_xml_path(str(source))
    expected, found = nearest_closed(theirs, theirs.key_qpos[0]), import_robot(str(source), Report())
    assert found is not None and closed_residual(theirs, theirs.key_qpos[0]) > 1e-3 > 1e-9 > closed_residual(theirs, expected)
    for name, content in found.files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(content)
    compiled = thingc.compile(tmp_path / found.document)
    ours = compiled.modes["source"].model()
    for number in range(theirs.njnt):
        at = int(theirs.jnt_qposadr[number])
        here = int(ours.joint(theirs.joint(number).name).qposadr[0])
        n = 4 if theirs.jnt_type[number] == 1 else 1
        # Distances of balls are those of rotation vectors there, and of turns here, which is the same to the square of what they turn.
        assert ours.key_qpos[0][here : here + n] == pytest.approx(expected[at : at + n], abs=2e-5)
    said = [one.message for one in compiled.diagnostics if one.code.code == "TC618"]
    assert len(said) == 1 and "in pose `home`" in said[0]
    lost = [one["what"] for one in json.loads(found.files["import.json"])["losses"]]
    assert [what for what in lost if what.startswith("the values of keyframe `home`: loop `heel` has a gap of ")]


FOUR_BAR = f"""\
thingc: assembly/1
name: bars
components:
  ground: {{frame: true, mass: 1 kg, mounts: {{a: {{xyz: 0 0 0 mm}}, d: {{xyz: 200 0 0 mm}}, e: {{xyz: 400 0 0 mm}}}}}}
  crank: {{frame: true, mass: 0.1 kg, {BALL}, mounts: {{low: {{rpy: 180 0 -90 deg}}, high: {{xyz: 60 0 0 mm}}}}}}
  coupler: {{frame: true, mass: 0.1 kg, {BALL}, mounts: {{low: {{rpy: 180 0 -90 deg}}, high: {{xyz: 180 0 0 mm}}}}}}
  rocker: {{frame: true, mass: 0.1 kg, {BALL}, mounts: {{low: {{rpy: 180 0 -90 deg}}, high: {{xyz: 120 0 0 mm, rpy: 180 0 -90 deg}},
    out: {{xyz: 100 0 0 mm}}}}}}
  coupler_2: {{frame: true, mass: 0.1 kg, {BALL}, mounts: {{low: {{rpy: 180 0 -90 deg}}, high: {{xyz: 190 0 0 mm}}}}}}
  rocker_2: {{frame: true, mass: 0.1 kg, {BALL}, mounts: {{low: {{rpy: 180 0 -90 deg}}, high: {{xyz: 110 0 0 mm, rpy: 180 0 -90 deg}}}}}}
joints:
  drive: {{type: continuous, parent: ground.a, child: crank.low}}
  pin: {{type: continuous, parent: crank.high, child: coupler.low}}
  pivot: {{type: continuous, parent: ground.d, child: rocker.low}}
  close: {{type: continuous, parent: coupler.high, child: rocker.high, loop: true}}
  pin_2: {{type: continuous, parent: rocker.out, child: coupler_2.low}}
  pivot_2: {{type: continuous, parent: ground.e, child: rocker_2.low}}
  close_2: {{type: continuous, parent: coupler_2.high, child: rocker_2.high, loop: true}}
poses:
  POSE
modes:
  bench: {{root: ground, pose: set, cut: [close, close_2]}}
"""


def planar_gap(q: np.ndarray) -> np.ndarray:
    """Distances between the ends of both loops [m] for `drive`, `pin`, `pivot`, `pin_2` and `pivot_2` [rad], with complex numbers."""
    drive, pin, pivot, pin_2, pivot_2 = np.exp(1j * q)
    first = 0.06 * drive + 0.18 * drive * pin - 0.2 - 0.12 * pivot
    second = 0.2 + 0.1 * pivot + 0.19 * pivot * pin_2 - 0.4 - 0.11 * pivot_2
    return np.array([first.real, first.imag, second.real, second.imag])


@pytest.mark.parametrize("given", [("drive", "pivot", "pivot_2"), ("drive", "pin", "pivot", "pin_2", "pivot_2")])
def test_given_values_change_least(given: tuple[str, ...], tmp_path: Path) -> None:
    """Values in the pose change as little as possible; other joints are free. The oracle is constrained minimization in SciPy."""
    from scipy.optimize import minimize

    names = ("drive", "pin", "pivot", "pin_2", "pivot_2")
    closed = minimize(lambda q: planar_gap(q) @ planar_gap(q), [1.2, -1.0, 1.4, -1.2, 1.2], tol=1e-16).x
    start = dict(zip(names, closed + [0.03, -0.02, -0.05, 0.04, 0.02], strict=True))
    pose = ", ".join(f"{name}: {start[name]!r} rad" for name in given)
    (tmp_path / "bars.yaml").write_text(FOUR_BAR.replace("POSE", f"set: {{{pose}}}").replace("np.float64(", "").replace(")", ""))
    compiled = thingc.compile(tmp_path / "bars.yaml")
    model = compiled.modes["bench"].model()
    ours = np.array([model.key_qpos[0][int(model.joint(name).qposadr[0])] for name in names])
    picked = [names.index(name) for name in given]
    wanted = np.array([start[name] for name in given])
    best = minimize(
        lambda q: ((q[picked] - wanted) ** 2).sum(), closed, constraints={"type": "eq", "fun": planar_gap},
        options={"ftol": 1e-16, "maxiter": 500},
    )
    assert np.abs(planar_gap(ours)).max() < 1e-9 and np.abs(planar_gap(best.x)).max() < 1e-9
    assert ours[picked] == pytest.approx(best.x[picked], abs=2e-5)
    assert [one.code.code for one in compiled.diagnostics] == ["TC618"]


def test_search_ends_when_the_closed_state_is_already_the_nearest(root: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    steps, original = Counter[str](), Loops._step
    monkeypatch.setattr(Loops, "_step", lambda *given: (steps.update(["steps"]), original(*given))[1])
    assert thingc.compile(str(root / "assemblies/minchw/minchw.yaml"), store=shared_store).modes
    assert 0 < steps.total() < 100
