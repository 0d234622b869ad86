"""Static efforts, compared with MuJoCo: its inverse dynamics at rest, and the Jacobian of its equalities as the oracle for load sharing
in loops, holds and mimics."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.linalg import null_space

from loops.robots import BALL, Built, at_key, compiled, inchworm
from loops.test_loop_joints import FOURBAR
from thingc.batch.measurements import measure
from thingc.model.assembly.kinematics import coordinates, joints_of
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.types import Robot
from thingc.model.statics.efforts import balance_tree, loads, problem, static_efforts
from thingc.model.statics.load_sharing import balance_shared
from thingc.model.statics.types import DriveTransmission, Efforts

CRANE = f"""\
thingc: assembly/1
name: crane
components:
  mast: {{frame: true, mass: 3 kg, {BALL}, mounts: {{top: {{xyz: 0 10 400 mm, rpy: 20 -30 10 deg}}}}}}
  boom: {{frame: true, mass: 0.8 kg, {BALL}, com: [150 mm, 10 mm, -5 mm],
    mounts: {{low: {{rpy: 80 10 0 deg}}, end: {{xyz: 300 0 20 mm, rpy: 10 70 0 deg}}}}}}
  hook: {{frame: true, mass: 0.5 kg, {BALL}, com: [5 mm, 0, 20 mm],
    mounts: {{eye: {{rpy: 0 0 30 deg}}, a: {{xyz: 40 0 0 mm, rpy: 90 0 20 deg}}, b: {{xyz: -40 0 0 mm, rpy: -60 0 0 deg}},
      c: {{xyz: 0 40 0 mm, rpy: 0 90 0 deg}}, d: {{xyz: 0 -40 5 mm, rpy: 15 80 0 deg}}}}}}
  claw_a: {{frame: true, mass: 0.2 kg, {BALL}, com: [30 mm, 4 mm, 0]}}
  claw_b: {{frame: true, mass: 0.3 kg, {BALL}, com: [40 mm, 0, 6 mm]}}
  claw_c: {{frame: true, mass: 0.1 kg, {BALL}, com: [0, 50 mm, 0]}}
  tail: {{frame: true, mass: 0.15 kg, {BALL}, com: [60 mm, 0, 0]}}
joints:
  swing: {{type: revolute, parent: mast.top, child: boom.low, limit: {{lower: -90 deg, upper: 90 deg}},
    dynamics: {{stiffness: 0.7 N*m/rad, rest: 40 deg}}, drive: {{kind: position, kp: 50 N*m/rad, effort: 9 N*m}}}}
  lift: {{type: prismatic, parent: boom.end, child: hook.eye, limit: {{lower: -50 mm, upper: 200 mm}},
    dynamics: {{stiffness: 30 N/m, rest: -60 mm}}, drive: {{kind: motor, effort: 40 N}}}}
  one: {{type: revolute, parent: hook.a, child: claw_a.origin, limit: {{lower: -1 rad, upper: 1 rad}},
    drive: {{kind: position, kp: 5 N*m/rad, effort: 0.5 N*m}}}}
  two: {{type: revolute, parent: hook.b, child: claw_b.origin, mimic: {{joint: one, polynomial: [0, -0.5, 0.2 rad^-1, 0.1 rad^-2]}},
    limit: {{lower: -1 rad, upper: 1 rad}}, dynamics: {{stiffness: 0.2 N*m/rad, rest: 0.5 rad}},
    drive: {{kind: position, kp: 5 N*m/rad, effort: 2 N*m}}}}
  three: {{type: prismatic, parent: hook.c, child: claw_c.origin, mimic: {{joint: two, multiplier: 20 mm/rad, offset: 4 mm}},
    limit: {{lower: -1 m, upper: 1 m}}, drive: {{kind: motor, effort: 15 N}}}}
  droop: {{type: revolute, parent: hook.d, child: tail.origin, limit: {{lower: -1 rad, upper: 1 rad}}}}
modes:
  bench: {{root: mast}}
  tipped: {{root: mast, at: {{rpy: 130 -35 10 deg}}}}
  by_hook: {{root: hook, base: held, at: {{xyz: 0 0 500 mm, rpy: 10 20 30 deg}}}}
  few: {{root: mast, actuators: [swing, lift, two]}}
"""
"""Rotations and slides, springs, three drives on one coordinate with separate limits (the third with another unit), and a joint without
a drive."""

LIMITS = {"swing": 9.0, "lift": 40.0, "one": 0.5, "two": 2.0, "three": 15.0}


@pytest.fixture(scope="module")
def crane(tmp_path_factory: pytest.TempPathFactory) -> Built:
    found = compiled(tmp_path_factory.mktemp("crane"), CRANE)
    assert not found.compilation.report.failed, found.said
    return found


def at_rest(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Generalized forces that hold the state of `data` without equalities and contacts, by MuJoCo's inverse dynamics."""
    flags = model.opt.disableflags
    model.opt.disableflags = flags | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data.qvel[:] = data.qacc[:] = 0.0
    mujoco.mj_inverse(model, data)
    model.opt.disableflags = flags
    return np.array(data.qfrc_inverse)


def free_velocities(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """A basis of the velocities that MuJoCo's equalities (holds, loops, mimics, a held base) leave free."""
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    mujoco.mj_forward(model, data)
    J = np.array(data.efc_J).reshape(data.nefc, model.nv)[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]
    return null_space(J, rcond=1e-7) if len(J) else np.eye(model.nv)


def oracle(model: mujoco.MjModel, data: mujoco.MjData, weights: dict[str, float]) -> tuple[dict[str, float], float, int]:
    """Drive efforts with the smallest sum of (effort / weight)^2 that hold the state, by the normal equations; the remaining load
    relative to the largest; and the dimension of the set of solutions."""
    N, f = free_velocities(model, data), at_rest(model, data)
    paths = [model.joint(model.actuator_trnid[k, 0]).name for k in range(model.nu)]
    paths = [path for k, path in enumerate(paths) if model.actuator_trntype[k] == mujoco.mjtTrn.mjTRN_JOINT]
    S = np.zeros((model.nv, len(paths)))
    for k, path in enumerate(paths):
        S[model.joint(path).dofadr[0], k] = 1.0
    A = N.T @ S
    W = np.diag([weights[path] ** 2 for path in paths])
    t = W @ A.T @ np.linalg.pinv(A @ W @ A.T, rcond=1e-11, hermitian=True) @ (N.T @ f)
    left = float(np.abs(N @ (N.T @ f - A @ t)).max()) / float(np.abs(f).max())
    return dict(zip(paths, t.tolist(), strict=True)), left, len(paths) - int(np.linalg.matrix_rank(A, tol=1e-7))


def assert_equal_efforts(found: Efforts, other: Efforts, size: float) -> None:
    """Assert that two computations of the efforts agree."""
    assert found.by_joint == pytest.approx(other.by_joint, rel=1e-9, abs=1e-12 * size)
    assert found.choices == other.choices and found.unheld == pytest.approx(other.unheld, rel=1e-9, abs=1e-11)
    if found.unheld > 1e-9:
        assert found.where == other.where


def solve_both_ways(robot: Robot, q: dict[str, float]) -> tuple[Efforts, Efforts]:
    """Efforts of a tree by the closed form and by least squares without loops."""
    bodies = body_poses(robot, q)
    load, drives = problem(robot, q, bodies)
    return balance_tree(load, drives), balance_shared(robot, q, bodies, load, drives)


@pytest.mark.parametrize("mode", ["bench", "tipped", "by_hook", "few"])
def test_tree_efforts_match_least_squares_and_mujoco(crane: Built, mode: str) -> None:
    """Random poses. In `few`, joint `one`, which `two` mimics, has no drive of its own."""
    robot, model = crane.robot(mode), crane.model(mode)
    joints = joints_of(robot.assembly)
    source = np.random.default_rng(7)
    data = mujoco.MjData(model)
    for _ in range(12):
        q = coordinates(joints, {
            name: float(source.uniform(*span)) for name, span in
            {"swing": (-1.5, 1.5), "lift": (-0.05, 0.2), "one": (-1, 1), "droop": (-1, 1)}.items()
        })
        for path, value in q.items():
            data.joint(path).qpos[0] = value
        held = at_rest(model, data)
        by_joint = {path: -float(held[model.joint(path).dofadr[0]]) for path in q}
        assert loads(robot, q, body_poses(robot, q)) == pytest.approx(by_joint, rel=1e-9, abs=1e-9)
        closed, squares = solve_both_ways(robot, q)
        assert_equal_efforts(closed, squares, 10.0)
        expected, left, choices = oracle(model, data, LIMITS)
        assert closed.by_joint == pytest.approx(expected, rel=1e-6, abs=1e-8)
        assert closed.choices == choices == {"few": 0}.get(mode, 2)
        assert closed.where == "droop" and closed.unheld == pytest.approx(
            abs(by_joint["droop"]) / max(abs(value) for value in problem(robot, q, body_poses(robot, q))[0].values()), rel=1e-9,
        ) and left > 0.0
        assert closed.margins == pytest.approx({path: LIMITS[path] / abs(expected[path]) for path in expected}, rel=1e-5)


def test_batch_and_document_tests_use_the_same_margin(tmp_path: Path) -> None:
    """Three drives on one coordinate determine the margin. A batch shares the load by the same rule as document tests."""
    limits = {**LIMITS, "swing": 900.0, "lift": 4000.0}
    built = compiled(tmp_path, CRANE.replace("effort: 9 N*m", "effort: 900 N*m").replace("effort: 40 N", "effort: 4000 N"))
    for mode in ("bench", "tipped"):
        robot, model = built.robot(mode), built.model(mode)
        data = mujoco.MjData(model)
        for path, value in coordinates(joints_of(robot.assembly), {}).items():
            data.joint(path).qpos[0] = value
        efforts, _, _ = oracle(model, data, limits)
        margins = {path: limits[path] / abs(value) for path, value in efforts.items()}
        assert min(margins, key=lambda path: margins[path]) in ("one", "two", "three")
        assert measure(robot, None, None)["torque_margin"] == pytest.approx(min(margins.values()), rel=1e-6)


def test_margins_without_limit_or_load(tmp_path: Path) -> None:
    """A drive without a limit has no margin, and a drive without load has an infinite one."""
    text = CRANE.replace(", effort: 9 N*m", "").replace(", effort: 40 N", "").replace(", effort: 15 N", "")
    text = text.replace(", rest: 40 deg", "").replace(", rest: 0.5 rad", "")
    text = text.replace("bench: {root: mast}", "bench: {root: mast}\n  afloat: {root: mast, gravity: [0, 0, 0 m/s^2]}")
    built = compiled(tmp_path, text)
    assert not built.compilation.report.failed, built.said
    robot = built.robot("bench")
    q = coordinates(joints_of(robot.assembly), {})
    found = static_efforts(robot, q, body_poses(robot, q))
    assert set(found.by_joint) == set(LIMITS) and set(found.margins) == {"one", "two"}
    assert found.by_joint["swing"] != 0.0 and found.least_margin == min(found.margins.values())
    afloat = built.robot("afloat")
    assert static_efforts(afloat, q, body_poses(afloat, q)).by_joint["swing"] == 0.0  # its spring is at rest at 0
    turned = coordinates(joints_of(afloat.assembly), {"swing": 1.0, "one": 0.0})
    found = static_efforts(afloat, turned, body_poses(afloat, turned))
    assert found.by_joint["swing"] == pytest.approx(0.7, rel=1e-12)
    assert found.margins == {"one": math.inf, "two": math.inf} and found.unheld == 0.0


# --- loops -----------------------------------------------------------------------------------------------------------

TIPPED = "at: {rpy: 70 15 0 deg}"  # the axes of the linkage are level, nearly
LOOPED = FOURBAR.replace("bench: {root: ground}", f"bench: {{root: ground, {TIPPED}}}").replace(
    "other: {root: ground, ", f"other: {{root: ground, {TIPPED}, ").replace(
    "kv: 0.05 N*m*s/rad}", "kv: 0.05 N*m*s/rad, effort: 2 N*m}").replace(
    "upper: 175 deg}}", "upper: 175 deg}, dynamics: {stiffness: 0.3 N*m/rad}, drive: {kind: motor, effort: 0.6 N*m}}")
LOOPED = LOOPED.replace("base: held, cut", f"base: held, {TIPPED}, cut")


def test_four_bar_efforts_match_mujoco(tmp_path: Path) -> None:
    """Two drives on one degree of freedom, one with a spring. The result does not depend on the cut joint or the root."""
    built = compiled(tmp_path, LOOPED)
    assert not built.compilation.report.failed, built.said
    tried = 0
    for mode in ("bench", "third"):
        robot, model = built.robot(mode), built.model(mode)
        assert robot.closures
        for frame in robot.keyframes:
            found = static_efforts(robot, frame.q, body_poses(robot, frame.q, frame.base))
            expected, left, choices = oracle(model, at_key(model, frame.name), {"drive": 2.0, "pivot": 0.6})
            assert found.by_joint == pytest.approx(expected, rel=1e-5, abs=1e-7) and set(expected) == {"drive", "pivot"}
            assert found.choices == choices == 1 and found.unheld < 1e-8 and left < 1e-6
            tried += 1
    assert tried >= 6
    # MuJoCo knows no drive and no spring of a joint that was cut; statics does, and the answer is that of the other tree.
    bench, other = built.robot("bench"), built.robot("other")
    assert [closure.path for closure in other.closures] == ["pivot"]
    by_name = {frame.name: frame for frame in bench.keyframes}
    for frame in other.keyframes:
        one = static_efforts(other, frame.q, body_poses(other, frame.q, frame.base)).by_joint
        same = by_name[frame.name]
        assert one == pytest.approx(static_efforts(bench, same.q, body_poses(bench, same.q)).by_joint, rel=1e-6, abs=1e-9)


def worm(folder: Path) -> Built:
    """An inchworm with all joints driven, on its front foot (a tree) and with the rear foot held in place (a loop)."""
    modes = "  front: {root: front.sole, base: fixed, pose: arched}\n  stay: {extends: front, hold: {rear.sole: here}}\n"
    text = inchworm(modes=modes)
    lines = [
        line.replace("}}", "}, drive: {kind: position, kp: 50 N*m/rad, effort: 7 N*m}}") if line.strip().startswith("hip_r:") else line
        for line in text.splitlines()
    ]
    built = compiled(folder, "\n".join(lines) + "\n")
    assert not built.compilation.report.failed, built.said
    return built


def test_hold_reduces_the_efforts(tmp_path: Path) -> None:
    """On one foot, efforts equal inverse dynamics. On two feet they differ only by forces that the hold takes (MuJoCo's Jacobian), and
    the sum of squares is smaller."""
    built = worm(tmp_path)
    limits = {"ankle_f": 20.0, "knee_f": 20.0, "hip_f": 20.0, "hip_r": 7.0, "knee_r": 20.0, "ankle_r": 20.0}
    on_one, on_two = built.robot("front"), built.robot("stay")
    assert not on_one.closures and on_two.closures
    frame, same = on_one.keyframes[0], on_two.keyframes[0]
    assert frame.q == pytest.approx(same.q, abs=1e-9)
    bodies = body_poses(on_one, frame.q)
    tree = static_efforts(on_one, frame.q, bodies)
    assert_equal_efforts(*solve_both_ways(on_one, frame.q), 10.0)
    model = built.model("front")
    held = at_rest(model, at_key(model, frame.name))
    assert tree.by_joint == pytest.approx({path: held[model.joint(path).dofadr[0]] for path in limits}, rel=1e-9, abs=1e-9)

    looped = static_efforts(on_two, same.q, body_poses(on_two, same.q, same.base))
    model = built.model("stay")
    data = at_key(model, same.name)
    expected, left, choices = oracle(model, data, limits)
    assert looped.by_joint == pytest.approx(expected, rel=1e-5, abs=1e-7)
    assert looped.choices == choices > 0 and looped.unheld < 1e-8 and left < 1e-6
    difference = np.zeros(model.nv)
    for path in limits:
        difference[model.joint(path).dofadr[0]] = looped.by_joint[path] - tree.by_joint[path]
    assert np.abs(difference).max() > 1e-3
    assert np.abs(free_velocities(model, data).T @ difference).max(initial=0.0) < 1e-6
    assert weighted_sum_of_squares(looped, limits) < weighted_sum_of_squares(tree, limits)


def weighted_sum_of_squares(efforts: Efforts, limits: dict[str, float]) -> float:
    """The sum of squares that statics minimizes."""
    return sum((value / limits[path]) ** 2 for path, value in efforts.by_joint.items())


def test_hold_in_another_branch_has_no_effect(tmp_path: Path) -> None:
    """Two arms on one stand, one of them held at its hand. The other arm has the same efforts as without the hold."""
    arm = (
        "  {0}_upper: {{frame: true, mass: 0.4 kg, BALL, com: [50 mm, 0, 5 mm], mounts: {{low: {{rpy: 90 0 0 deg}}, "
        "high: {{xyz: 100 0 0 mm, rpy: -90 0 0 deg}}}}}}\n"
        "  {0}_lower: {{frame: true, mass: 0.2 kg, BALL, com: [40 mm, 3 mm, 0], mounts: {{low: {{rpy: 90 0 0 deg}}, "
        "hand: {{xyz: 80 0 0 mm}}}}}}\n"
    ).replace("BALL", BALL.replace("{", "{{").replace("}", "}}"))
    joint = (
        "  {0}_shoulder: {{type: revolute, parent: stand.{0}, child: {0}_upper.low, limit: {{lower: -170 deg, upper: 170 deg}}, "
        "drive: {{kind: position, kp: 5 N*m/rad, effort: 3 N*m}}}}\n"
        "  {0}_elbow: {{type: revolute, parent: {0}_upper.high, child: {0}_lower.low, limit: {{lower: -170 deg, upper: 170 deg}}, "
        "drive: {{kind: position, kp: 5 N*m/rad, effort: 1 N*m}}}}\n"
    )
    text = (
        f"thingc: assembly/1\nname: arms\ncomponents:\n  stand: {{frame: true, mass: 1 kg, {BALL}, "
        "mounts: {left: {xyz: 0 100 300 mm, rpy: -80 0 0 deg}, right: {xyz: 0 -100 300 mm, rpy: -95 5 0 deg}}}\n"
        + arm.format("left") + arm.format("right") + "joints:\n" + joint.format("left") + joint.format("right")
        + "poses:\n  out: {left_shoulder: 30 deg, left_elbow: -70 deg, right_shoulder: -20 deg, right_elbow: 50 deg}\n"
        "modes:\n  loose: {root: stand, pose: out}\n  tied: {extends: loose, hold: {right_lower.hand: here}}\n"
    )
    built = compiled(tmp_path, text)
    assert not built.compilation.report.failed, built.said
    loose, tied = built.robot("loose"), built.robot("tied")
    assert not loose.closures and tied.closures
    free, held = (
        static_efforts(robot, frame.q, body_poses(robot, frame.q, frame.base))
        for robot in (loose, tied) for frame in robot.keyframes
    )
    left = ("left_shoulder", "left_elbow")
    assert {path: held.by_joint[path] for path in left} == pytest.approx({path: free.by_joint[path] for path in left}, rel=1e-9)
    assert {path: held.margins[path] for path in left} == pytest.approx({path: free.margins[path] for path in left}, rel=1e-9)
    # the held one hangs on its hand: nothing moves, and its drives need give nothing
    assert {path: held.by_joint[path] for path in ("right_shoulder", "right_elbow")} == pytest.approx(
        {"right_shoulder": 0.0, "right_elbow": 0.0}, abs=1e-9)
    assert abs(free.by_joint["right_shoulder"]) > 0.1 and held.choices == 2 and free.choices == 0


def test_tree_statics_do_not_import_numpy() -> None:
    """A batch worker measures every variant and starts without numpy."""
    program = "import sys, json, thingc.batch.measurements, thingc.model.statics; print(json.dumps(sorted(sys.modules)))"
    loaded: Any = json.loads(subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout)
    assert not {name.split(".")[0] for name in loaded} & {"numpy", "scipy", "mujoco", "build123d", "OCP", "pyarrow"}
    assert "thingc.model.statics.load_sharing" not in loaded and "thingc.model.statics.efforts" in loaded


@pytest.mark.parametrize("unit", [1e-300, 1.0, 1e300])
def test_load_sharing_depends_on_limit_ratios(unit: float) -> None:
    """Two drives on a coordinate share its load as 1 to 4, by the squares of their limits. A single drive carries all of it."""
    drives = [
        DriveTransmission(path, ((coordinate, 1.0),), limit * unit, limit * unit)
        for path, coordinate, limit in (("a", "x", 1.0), ("b", "x", 2.0), ("c", "y", 3.0))
    ]
    found = balance_tree({"x": -10.0, "y": 6.0}, drives)
    assert found.by_joint == pytest.approx({"a": 2.0, "b": 8.0, "c": -6.0}) and found.unheld == 0.0
    assert found.margins == pytest.approx({"a": 0.5 * unit, "b": 0.25 * unit, "c": 0.5 * unit})
