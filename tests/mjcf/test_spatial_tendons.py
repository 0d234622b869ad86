"""Spatial tendons: lengths equal formulas over forward kinematics and the values of MuJoCo, for each root."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from loops.robots import BALL, Array, Built, at_key, compiled
from statics.test_statics import at_rest
from thingc.model.robot.kinematics import body_poses, course_of, rates
from thingc.model.statics.efforts import problem

REEVED = f"""\
thingc: assembly/1
name: reeved
components:
  base:
    frame: true
    mass: 3 kg
    {BALL}
    mounts:
      end: {{xyz: 0 0 200 mm, rpy: 90 0 0 deg}}
      hook: {{xyz: 50 10 80 mm}}
  upper:
    frame: true
    mass: 1 kg
    {BALL}
    mounts:
      end: {{xyz: 300 0 0 mm, rpy: 0 90 0 deg}}
      eye: {{xyz: 150 40 0 mm}}
      drum: {{xyz: 290 5 0 mm, rpy: 20 0 0 deg}}
      above: {{xyz: 290 60 10 mm}}
  lower:
    frame: true
    mass: 0.5 kg
    {BALL}
    com: [0, 50 mm, 20 mm]
    mounts: {{end: {{xyz: 0 100 50 mm}}, hook: {{xyz: 20 70 40 mm}}}}
  slider: {{frame: true, mass: 0.2 kg, {BALL}, mounts: {{hook: {{xyz: 10 0 -20 mm}}}}}}
joints:
  shoulder: {{type: revolute, parent: base.end, child: upper.origin, axis: [0, 0, 1], limit: {{lower: -3 rad, upper: 3 rad}}}}
  elbow: {{type: continuous, parent: upper.end, child: lower.origin, axis: [0, 0, 1]}}
  slide: {{type: prismatic, parent: lower.end, child: slider.origin, axis: [0, 0, 1], limit: {{lower: -1 m, upper: 1 m}}}}
tendons:
  rope:
    path: [base.hook, upper.eye, {{pulley: 2}}, upper.eye, lower.hook, {{pulley: 4}}, lower.end, slider.hook]
    limit: {{lower: 50 mm, upper: 900 mm}}
    dynamics: {{stiffness: 200 N/m, rest: 150 mm, damping: 3 N*s/m}}
    drive: {{kind: position, kp: 60 N/m, effort: 9 N}}
    width: 4 mm
  belt:
    path: [base.hook, {{around: upper.drum, cylinder: 30 mm, side: upper.above}}, lower.hook]
    dynamics: {{stiffness: 50 N/m}}
    drive: {{kind: motor, effort: 30 N}}
  ball: {{path: [base.hook, {{around: upper.eye, sphere: 70 mm}}, lower.hook], drive: {{kind: position, kp: 60 N/m}}}}
poses: {{bent: {{shoulder: 0.3 rad, elbow: 0.4 rad, slide: 10 mm}}}}
simulation: {{integrator: euler}}
modes:
  m: {{root: base}}
  n: {{root: slider, base: free}}
sensors:
  rope: {{type: tendon, tendon: rope}}
"""


@pytest.fixture(scope="module")
def reeved(tmp_path_factory: pytest.TempPathFactory) -> Built:
    built = compiled(tmp_path_factory.mktemp("reeved"), REEVED)
    assert not built.compilation.report.failed, built.said
    return built


def random_positions(count: int) -> list[dict[str, float]]:
    random = np.random.default_rng(11)
    rows = random.uniform((-3.0, -3.0, -0.2), (3.0, 3.0, 0.2), (count, 3))
    return [dict(zip(("shoulder", "elbow", "slide"), map(float, row), strict=True)) for row in rows]


def data_at(model: mujoco.MjModel, q: dict[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for path, value in q.items():
        data.joint(path).qpos[0] = value
    mujoco.mj_forward(model, data)
    return data


def tendon_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    jacobian = np.zeros((model.ntendon, model.nv))
    for row in range(model.ntendon):
        first, count = model.ten_J_rowadr[row], model.ten_J_rownnz[row]
        jacobian[row, model.ten_J_colind.ravel()[first : first + count]] = data.ten_J.ravel()[first : first + count]
    return jacobian


def turn(axis: str, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    x = {"x": [[1, 0, 0], [0, c, -s], [0, s, c]], "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]], "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]]}
    return np.array(x[axis])


def test_rope_length_is_the_sum_of_its_segments(reeved: Built) -> None:
    """The oracle is forward kinematics with the numbers of the document, written out in the test; a mode with another root gives the
    same length."""
    models = [reeved.model(mode) for mode in ("m", "n")]
    for q in random_positions(20):
        upper = turn("x", np.pi / 2) @ turn("z", q["shoulder"])
        start = np.array([0, 0, 0.2])
        lower = upper @ turn("y", np.pi / 2) @ turn("z", q["elbow"])
        end = start + upper @ [0.3, 0, 0]
        points = {
            "hook": np.array([0.05, 0.01, 0.08]), "eye": start + upper @ [0.15, 0.04, 0], "low": end + lower @ [0.02, 0.07, 0.04],
            "end": end + lower @ [0, 0.1, 0.05], "slider": end + lower @ [0.01, 0.1, 0.03 + q["slide"]],
        }
        pieces = (("hook", "eye", 1), ("eye", "low", 2), ("end", "slider", 4))
        expected = sum(float(np.linalg.norm(points[a] - points[b])) / divisor for a, b, divisor in pieces)
        for model in models:
            data = data_at(model, q)
            assert data.tendon("rope").length[0] == pytest.approx(expected, abs=1e-12)
            assert data.sensor("rope:length").data[0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("mode", ["m", "n"])
def test_tendon_lengths_and_rates_match_mujoco(reeved: Built, mode: str) -> None:
    """Lengths, also when wrapped around shapes, derivatives by each joint, commands of keyframes and spring rest lengths."""
    model, robot = reeved.model(mode), reeved.robot(mode)
    wrapped = {"belt": 0, "ball": 0, "rope": 0}
    for q in random_positions(200):
        data, poses = data_at(model, q), body_poses(robot, q)
        jacobian = tendon_jacobian(model, data)
        for tendon in reeved.compilation.assembly.tendons:  # type: ignore[union-attr]
            index = model.tendon(tendon.path).id
            found = course_of(robot, tendon, poses)
            wrapped[tendon.path] += len(found.spans) == 2 and bool(tendon.steps[1].radius)
            assert found.length == pytest.approx(data.ten_length[index], abs=1e-10), (tendon.path, q)
            ours = rates(robot, tendon, q, poses)
            for path in q:
                assert ours.get(path, 0.0) == pytest.approx(jacobian[index, model.joint(path).dofadr[0]], abs=1e-8), (tendon.path, q)
    assert wrapped["belt"] > 40 and wrapped["ball"] > 10
    data = at_key(model, "bent")
    for name in ("rope", "ball"):
        assert data.actuator(name).ctrl[0] == pytest.approx(data.tendon(name).length[0], abs=1e-12)
    rest = data_at(model, dict.fromkeys(("shoulder", "elbow", "slide"), 0.0)).tendon("belt").length[0]
    assert model.tendon_lengthspring[model.tendon("belt").id].tolist() == pytest.approx([rest, rest])
    rope = model.tendon("rope").id
    assert (*model.tendon_range[rope], float(model.tendon_width[rope])) == pytest.approx((0.05, 0.9, 0.002))


def test_static_efforts_include_tendons(reeved: Built) -> None:
    """Loads of tendon springs and drives equal MuJoCo's inverse dynamics at rest."""
    robot, model = reeved.robot("m"), reeved.model("m")
    for q in random_positions(10):
        data = mujoco.MjData(model)
        for path, value in q.items():
            data.joint(path).qpos[0] = value
        needed = at_rest(model, data)
        load, drives = problem(robot, q, body_poses(robot, q))
        assert [load[path] for path in q] == pytest.approx([-needed[model.joint(path).dofadr[0]] for path in q], rel=1e-7, abs=1e-9)
        assert [one.path for one in drives] == ["rope", "belt", "ball"]


INERTIA = "inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}"
BRANCHES = f"""\
thingc: assembly/1
name: branches
components:
  base: {{frame: true, mass: 3 kg, {INERTIA}, mounts: {{m: {{xyz: 0 100 0 mm}}, n: {{xyz: 0 -100 0 mm}}, w: {{xyz: 50 0 0 mm}}}}}}
  a: {{frame: true, mass: 1 kg, com: 100 0 0 mm, {INERTIA}, mounts: {{e: {{xyz: 200 0 30 mm}}}}}}
  b: {{frame: true, mass: 1 kg, com: 100 0 0 mm, {INERTIA}, mounts: {{e: {{xyz: 180 0 0 mm}}}}}}
  k: {{frame: true, mass: 1 kg, {INERTIA}}}
  l: {{frame: true, mass: 1 kg, com: 100 0 0 mm, {INERTIA}}}
joints:
  j1: {{type: continuous, parent: base.m, child: a.origin}}
  j2: {{type: continuous, parent: base.n, child: b.origin}}
  released: {{type: free, parent: b.e, child: k.origin}}
  j3: {{type: continuous, parent: k.origin, child: l.origin, axis: [0, 1, 0]}}
tendons:
  across: {{path: [a.e, b.e], dynamics: {{armature: 2 kg}}}}
  along: {{path: [base.w, b.e], dynamics: {{armature: 1 kg}}}}
  both: {{joints: {{j1: 1, j2: 2}}, dynamics: {{armature: 0.01 kg*m^2}}}}
  beyond: {{joints: {{j2: 1, j3: 2}}, dynamics: {{armature: 0.01 kg*m^2}}}}
modes: {{b: {{root: base}}, c: {{root: a, base: free}}, d: {{root: base, base: free}}, e: {{root: k}}}}
"""


def test_armature_that_mujoco_omits_is_an_export_loss(tmp_path: Path) -> None:
    """The mass matrix of MuJoCo contains J' J times the armature of a tendon, except for tendons across branches of the tree."""
    built = compiled(tmp_path, BRANCHES)
    assert built.artifacts is not None, built.said
    expected = {(loss.mode, loss.path) for loss in built.artifacts.losses if "branches" in loss.what}
    found = set()
    for mode in "bcde":
        model = built.model(mode)
        masses, armature = [], model.tendon_armature.copy()
        for chosen in (np.zeros(model.ntendon), *np.diag(armature)):
            model.tendon_armature[:] = chosen
            data, mass = data_at(model, {"j1": 0.3, "j2": -0.4, "j3": 0.5}), np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, mass)
            masses.append(mass)
        for index, (row, mass) in enumerate(zip(tendon_jacobian(model, data), masses[1:], strict=True)):
            if np.abs(mass - masses[0] - armature[index] * np.outer(row, row)).max() > 1e-12:
                found.add((mode, model.tendon(index).name))
    assert len(found) == 8 and found == expected
