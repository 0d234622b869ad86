"""Motions and the efforts that they require, against MuJoCo's inverse dynamics, closed forms, and the balance of energy."""

from __future__ import annotations

import json
import re
from math import cos, pi, sin
from pathlib import Path

import mujoco
import numpy as np
import pytest

from loops.robots import BALL, Built, compiled
from loops.test_loop_joints import FOURBAR, rocker_angle
from statics.test_statics import CRANE
from testing.rig import Workspace, two_links
from thingc.driver.testing.kinds.drive_margin import instants
from thingc.model.dynamics.inertial_loads import inertial_loads
from thingc.model.dynamics.motion_curve import MotionCurve, with_closed_loops
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.types import Robot
from thingc.model.statics.efforts import balance_loads, loads, problem
from thingc.tools.cli.main import main
from thingc.tools.diff.assembly_facts import motion_facts

NUMBERS = {"time", "speed", "available"}
"""Measured numbers that are not lengths."""

PLANAR = """\
thingc: assembly/1
name: planar
components:
  base: {frame: true}
  upper: {frame: true, mass: 0.7 kg, com: 120 0 0 mm, inertia: {ixx: 1e-3 kg*m^2, iyy: 4e-3 kg*m^2, izz: 4e-3 kg*m^2},
    mounts: {elbow: {xyz: 250 0 0 mm}}}
  lower: {frame: true, mass: 0.4 kg, com: 90 0 0 mm, inertia: {ixx: 5e-4 kg*m^2, iyy: 2e-3 kg*m^2, izz: 2e-3 kg*m^2}}
joints:
  shoulder: {type: continuous, parent: base.origin, child: upper.origin, axis: [0, -1, 0],
    dynamics: {damping: 0.02 N*m*s/rad, friction: 0.03 N*m}, drive: {kind: motor, effort: 9 N*m, armature: 5e-3 kg*m^2}}
  elbow: {type: continuous, parent: upper.elbow, child: lower.origin, axis: [0, -1, 0], drive: {kind: motor, effort: 9 N*m}}
poses: {low: {shoulder: -40 deg, elbow: 10 deg}, high: {shoulder: 70 deg, elbow: 100 deg}}
motions: {swing: [{pose: low, time: 0.5 s}, {pose: high, time: 1.3 s}, {pose: low, time: 1.7 s}]}
modes: {bench: {root: base}}
"""

MOVING_CRANE = CRANE.replace("rest: 40 deg}", "rest: 40 deg, damping: 0.1 N*m*s/rad, armature: 2e-3 kg*m^2}").replace("modes:\n", """\
poses:
  a: {swing: -50 deg, lift: 10 mm, one: 20 deg, droop: -30 deg}
  b: {swing: 40 deg, lift: 150 mm, one: -40 deg, droop: 25 deg}
motions: {work: [{pose: a, time: 0}, {pose: b, time: 0.7 s}]}
modes:
""")

TUMBLER = f"""\
thingc: assembly/1
name: tumbler
components:
  base: {{frame: true}}
  arm: {{frame: true, mass: 0.6 kg, {BALL}, com: [70 mm, 10 mm, 0], mounts: {{end: {{xyz: 150 0 20 mm, rpy: 30 40 0 deg}}}}}}
  head: {{frame: true, mass: 0.3 kg, {BALL}, com: [20 mm, -30 mm, 40 mm]}}
joints:
  hip: {{type: revolute, parent: base.origin, child: arm.origin, limit: {{lower: -2 rad, upper: 2 rad}}}}
  neck: {{type: ball, parent: arm.end, child: head.origin}}
poses:
  a: {{hip: -50 deg, neck: {{rpy: 20 -30 40 deg}}}}
  b: {{hip: 40 deg, neck: {{rpy: -60 20 80 deg}}}}
motions: {{work: [{{pose: a, time: 0}}, {{pose: b, time: 0.5 s}}]}}
modes: {{bench: {{root: base}}}}
"""


def curve_of(robot: Robot) -> MotionCurve:
    return MotionCurve(robot.assembly, robot.assembly.definition.motions[0])


def built(folder: Path, text: dict[str, str] | str) -> Built:
    found = compiled(folder, text)
    assert not found.compilation.report.failed, found.said
    return found


def test_minimum_jerk_rests_at_poses_and_derivatives_match(tmp_path: Path) -> None:
    curve = curve_of(built(tmp_path, PLANAR).robot("bench"))
    for time, angle in ((0.5, -40.0), (1.3, 70.0), (1.7, -40.0)):
        state = curve.at(time)
        assert state.q["shoulder"] == pytest.approx(np.radians(angle), abs=1e-12)
        assert (state.v["shoulder"], state.a["shoulder"]) == pytest.approx((0.0, 0.0), abs=1e-9)
    middle = curve.at(0.9)  # the largest speed is 15/8 of the mean speed, where the acceleration changes its sign
    assert middle.v["shoulder"] == pytest.approx(15.0 / 8.0 * np.radians(110.0) / 0.8, rel=1e-12)
    assert middle.a["shoulder"] == pytest.approx(0.0, abs=1e-9)
    h = 1e-4
    for time in (0.61, 0.77, 1.12, 1.4, 1.66):
        before, at, after = (curve.at(time + step).q["elbow"] for step in (-h, 0.0, h))
        assert curve.at(time).v["elbow"] == pytest.approx((after - before) / (2.0 * h), abs=1e-4)
        assert curve.at(time).a["elbow"] == pytest.approx((after - 2.0 * at + before) / h**2, abs=1e-4)
    samples = curve.samples()
    assert {0.5, 1.3, 1.7} <= set(samples.tolist()) and (np.diff(samples) > 0.0).all()


def test_two_link_arm_in_closed_form(tmp_path: Path) -> None:
    """Siciliano et al., Robotics, section 7.3.2, with gravity along -z and angles up from the x axis."""
    robot = built(tmp_path, PLANAR).robot("bench")
    curve = curve_of(robot)
    m1, m2, l1, c1, c2, i1, i2, g = 0.7, 0.4, 0.25, 0.12, 0.09, 4e-3, 2e-3, 9.81
    for time in np.linspace(0.5, 1.7, 25).tolist():
        state = curve.at(time)
        t1, t2 = state.q["shoulder"], state.q["elbow"]
        v1, v2, a1, a2 = state.v["shoulder"], state.v["elbow"], state.a["shoulder"], state.a["elbow"]
        h = m2 * l1 * c2
        m11 = i1 + m1 * c1**2 + i2 + m2 * (l1**2 + c2**2) + 2.0 * h * cos(t2)
        m12 = i2 + m2 * c2**2 + h * cos(t2)
        bent = m2 * g * c2 * cos(t1 + t2)
        elbow = m12 * a1 + (i2 + m2 * c2**2) * a2 + h * sin(t2) * v1**2 + bent
        shoulder = m11 * a1 + m12 * a2 - h * sin(t2) * (2.0 * v1 * v2 + v2**2) + (m1 * c1 + m2 * l1) * g * cos(t1) + bent
        shoulder += 5e-3 * a1 + 0.02 * v1 + (0.03 * float(np.sign(v1)) if abs(v1) > 1e-9 else 0.0)
        bodies = body_poses(robot, state.q)
        efforts = balance_loads(robot, state.q, bodies, *problem(robot, state.q, bodies, inertial_loads(robot, bodies, state))).by_joint
        assert efforts == pytest.approx({"shoulder": shoulder, "elbow": elbow}, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("mode", ["bench", "tipped", "by_hook"])
def test_motion_loads_match_mujoco_inverse_dynamics(tmp_path: Path, mode: str) -> None:
    """With slides, springs, polynomial mimics, and a root in the middle of the tree."""
    found = built(tmp_path, MOVING_CRANE)
    robot, model = found.robot(mode), found.model(mode)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data, curve = mujoco.MjData(model), curve_of(robot)
    for time in np.linspace(0.0, 0.7, 15).tolist():
        state = curve.at(time)
        for path in state.q:
            joint = model.joint(path)
            data.qpos[joint.qposadr], data.qvel[joint.dofadr], data.qacc[joint.dofadr] = state.q[path], state.v[path], state.a[path]
        mujoco.mj_inverse(model, data)
        expected = {path: -float(data.qfrc_inverse[model.joint(path).dofadr[0]]) for path in state.q}
        bodies = body_poses(robot, state.q)
        moving, still = inertial_loads(robot, bodies, state), loads(robot, state.q, bodies)
        assert {path: still[path] + moving[path] for path in still} == pytest.approx(expected, rel=1e-9, abs=1e-9)


def energy(robot: Robot, curve: MotionCurve, time: float) -> float:
    """Return the kinetic energy [J] of the links at a time of a motion, from finite differences of body poses."""
    h = 1e-5
    before, at, after = (
        [np.array(pose.rows()) for pose in body_poses(robot, curve.at(time + step).q)] for step in (-h, 0.0, h)
    )
    total = 0.0
    for index, body in enumerate(robot.bodies):
        own = robot.assembly.links[body.link].properties
        rate, turn = (after[index] - before[index]) / (2.0 * h), at[index][:3, :3]
        turning = rate[:3, :3] @ turn.T
        spin = np.array([turning[2, 1] - turning[1, 2], turning[0, 2] - turning[2, 0], turning[1, 0] - turning[0, 1]]) / 2.0
        speed = rate[:3, :3] @ np.array(own.centre) + rate[:3, 3]
        total += 0.5 * own.mass * float(speed @ speed) + 0.5 * float(spin @ turn @ np.array(own.inertia) @ turn.T @ spin)
    return total


def power(robot: Robot, curve: MotionCurve, time: float) -> float:
    """Return the rate of change of the kinetic energy [W]."""
    return (energy(robot, curve, time + 1e-4) - energy(robot, curve, time - 1e-4)) / 2e-4


def test_power_of_ball_joint_loads_is_the_energy_change(tmp_path: Path) -> None:
    robot = built(tmp_path, TUMBLER).robot("bench")
    curve = curve_of(robot)
    for time in np.linspace(0.05, 0.45, 9).tolist():
        state = curve.at(time)
        moving = inertial_loads(robot, body_poses(robot, state.q), state)
        assert -sum(moving[path] * state.v[path] for path in moving) == pytest.approx(power(robot, curve, time), rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("mode", ["bench", "other", "third"])
def test_power_of_a_loop_drive_is_the_energy_change(tmp_path: Path, mode: str) -> None:
    """A planar four-bar with gravity normal to the plane, so gravity does no work. The joint where the loop is cut has damping."""
    motions = "motions: {turn: [{pose: at_20, time: 0}, {pose: at_130, time: 0.4 s}, {pose: at_20, time: 0.8 s}]}\nmodes:\n"
    robot = built(tmp_path, FOURBAR.replace("modes:\n", motions)).robot(mode)
    closed = with_closed_loops(robot, robot.assembly.definition.motions[0])
    assert closed is not None
    curve = MotionCurve(robot.assembly, closed)
    assert curve.at(0.2).q["pivot"] == pytest.approx(rocker_angle(curve.at(0.2).q["drive"]), abs=1e-9)
    found = {round(one.time, 6): one for one in instants(robot, closed, None)}
    for time in (0.1, 0.2, 0.3, 0.5, 0.6, 0.7):
        state = curve.at(time)
        lost = 0.001 * (state.v["elbow"] ** 2 + state.v["wrist"] ** 2)
        one = found[time]
        assert one.path == "drive" and one.stuck is None
        assert one.effort * one.speed == pytest.approx(power(robot, curve, time) + lost, rel=2e-3, abs=2e-4)


FLAT = two_links().replace("  level:", "  up: {shoulder: -90 deg}\n  level:").replace("modes:\n", """\
motions:
  rest: [{pose: level, time: 0}, {pose: level, time: 1 s}]
  lift: [{pose: level, time: 0}, {pose: up, time: SECONDS}]
modes:
  float: {root: upper, base: free}
  wall: {root: ground, at: {rpy: 90 0 0 deg}}
""").replace("effort: 1 N*m}", "effort: 1 N*m, velocity: 3 rad/s}").replace("{frame: true,", f"{{frame: true, mass: 50 g, {BALL},")


def test_motion_at_rest_requires_the_static_efforts(rig: Workspace) -> None:
    tests = "  moving: {drive_margin: {motion: rest, min: 1, mode: bench}}\n  static: {torque_margin: {drive: '*', min: 1, mode: bench}}\n"
    answer = rig.test(FLAT.replace("SECONDS", "1 s"), tests, others=NUMBERS)
    moving, static = (answer["by_name"][name]["measured"] for name in ("moving", "static"))
    assert answer["code"] == 0 and moving["drive"] == static["drive"] == "shoulder"
    assert (moving["margin"], moving["effort"]) == pytest.approx((static["margin"], static["effort"]), rel=1e-12)


def test_too_fast_motion_is_found_in_every_mode(rig: Workspace) -> None:
    """A rigid bar starts level: its moment of inertia and its weight are in closed form, sampled densely."""
    test = "  follow: {drive_margin: {motion: lift, min: 2}}\n"
    assert rig.test(FLAT.replace("SECONDS", "2 s"), test, others=NUMBERS)["code"] == 0
    answer = rig.test(FLAT.replace("SECONDS", "1 s"), test, others=NUMBERS)
    assert answer["code"] == 1 and [one["mode"] for one in answer["tests"]] == ["wall", "bench"]
    parts = ((0.04, 0.1, 0.05), (0.024, 0.06, 0.13))  # mass, length and distance of the centre
    inertia = sum(m * (length**2 + 0.02**2) / 12.0 + m * far**2 for m, length, far in parts)
    weight = sum(m * 9.81 * far for m, _, far in parts)
    s = np.linspace(0.0, 1.0, 200001)
    q = pi / 2 * (10 * s**3 - 15 * s**4 + 6 * s**5)
    v = pi / 2 * (30 * s**2 - 60 * s**3 + 30 * s**4) 
    effort = inertia * pi / 2 * (60 * s - 180 * s**2 + 120 * s**3) + weight * np.cos(q)
    margin = np.where(effort > 0, 1.0 - v / 3.0, 1.0) / np.abs(effort)
    bench = answer["tests"][1]
    assert bench["measured"]["margin"] == pytest.approx(margin.min(), rel=1e-3)
    assert bench["measured"]["time"] == pytest.approx(s[margin.argmin()], abs=0.01)
    (found, *_) = answer["diagnostics"]
    assert found["code"] == "TC668" and "mode `bench`" in found["message"]
    assert f"the margin of drive `shoulder` ({margin.min():.3g}) is below the minimum (2)" in found["message"]
    assert found["notes"][0]["message"].startswith(f"required: {abs(effort[margin.argmin()]):.2g}")


def test_stall_torque_starts_the_torque_speed_line(rig: Workspace) -> None:
    """The voltage allows 4 N m at rest, and the current 1 N m: the line falls below 1 N m near its end."""
    text = FLAT.replace("SECONDS", "1 s").replace("velocity: 3 rad/s", "velocity: 3 rad/s, stall: 4 N*m")
    drive = "{motion: lift, min: 0.1, mode: bench, drive: shoulder}"
    (found,) = rig.test(text, f"  follow: {{drive_margin: {drive}}}\n", others=NUMBERS)["tests"]
    measured = found["measured"]
    assert measured["available"] == pytest.approx(min(1.0, 4.0 * (1.0 - abs(measured["speed"]) / 3.0)))


def test_drive_has_no_effort_above_its_velocity(rig: Workspace) -> None:
    answer = rig.test(FLAT.replace("SECONDS", "0.5 s"), "  follow: {drive_margin: {motion: lift, min: 0.1, mode: bench}}\n", others=NUMBERS)
    assert answer["code"] == 1 and answer["tests"][0]["measured"]["margin"] == 0.0
    (found,) = answer["diagnostics"]
    assert "the margin of drive `shoulder` (0) is below the minimum (0.1)" in found["message"]
    assert "; available: 0 N*m at " in found["notes"][0]["message"]


def test_joint_without_a_drive_cannot_follow(rig: Workspace) -> None:
    text = FLAT.replace("SECONDS", "1 s").replace(",\n    drive: {kind: position, kp: 5 N*m/rad, effort: 0.5 N*m}", "")
    answer = rig.test(text, "  follow: {drive_margin: {motion: lift, min: 0.1, mode: bench}}\n", others=NUMBERS)
    (found,) = answer["diagnostics"]
    assert found["code"] == "TC668" and "no drive moves joint `elbow`" in found["message"]


LEG = f"""\
thingc: assembly/1
name: leg
components:
  hip: {{frame: true, mounts: {{top: {{}}}}}}
  shin: {{frame: true, mass: 0.2 kg, {BALL}, com: [20 mm, 10 mm, -100 mm], mounts: {{low: {{xyz: 0 0 -200 mm, rpy: 10 20 0 deg}}}}}}
  foot: {{frame: true, mass: 0.1 kg, {BALL}, com: [30 mm, 5 mm, -10 mm]}}
joints:
  knee: {{type: continuous, parent: hip.top, child: shin.origin, axis: [0, 1, 0], drive: {{kind: motor, effort: 3 N*m}}}}
  ankle: {{type: continuous, parent: shin.low, child: foot.origin, axis: [0, 1, 0], drive: {{kind: motor, effort: 3 N*m}}}}
mounts: {{top: hip.top}}
poses: {{bent: {{knee: 40 deg, ankle: -70 deg}}, straight: {{}}}}
"""
PAIR = """\
thingc: assembly/1
name: pair
parameters: {slow: {value: 1, min: 0.1, max: 10}}
components:
  base: {frame: true, mounts: {a: {xyz: 0 50 0 mm}, b: {xyz: 0 -50 0 mm}}}
  left: {assembly: leg.yaml, attach: {top: base.a}}
  right: {assembly: leg.yaml, mirror: y, attach: {top: base.b}}
poses: {bent: {left: bent, right: bent}, straight: {}}
motions: {kick: [{pose: straight, time: 0}, {pose: bent, time: =slow * 0.3 s}]}
modes: {bench: {root: base}, weightless: {root: base, gravity: [0, 0, 0]}}
"""


def test_mirrored_legs_require_equal_efforts(tmp_path: Path) -> None:
    """Nested documents and a parameter: without gravity, a motion at half the speed requires a quarter of the effort."""
    efforts: dict[str, dict[tuple[str, int], float]] = {}
    for slow in ("1", "2"):
        folder = tmp_path / slow
        folder.mkdir()
        found = built(folder, {"pair.yaml": PAIR.replace("value: 1", f"value: {slow}"), "leg.yaml": LEG})
        for mode in ("bench", "weightless"):
            robot = found.robot(mode)
            listed = list(instants(robot, robot.assembly.definition.motions[0], None))
            efforts[slow + mode] = {(one.path, k // 4): one.effort for k, one in enumerate(listed)}
            for joint in ("knee", "ankle"):
                left, right = ([abs(one.effort) for one in listed if one.path == f"{side}/{joint}"] for side in ("left", "right"))
                assert max(left) > 1e-3 and left == pytest.approx(right, rel=1e-9, abs=1e-12)
    for key, effort in efforts["1weightless"].items():
        assert efforts["2weightless"][key] == pytest.approx(effort / 4.0, rel=1e-9, abs=1e-12)


CSV = "time,shoulder [deg],elbow\n0,0,0\n0.4,20,0.1\n1,45,0\n"


def file_motion(rig: Workspace, csv: str, test: str = "  follow: {drive_margin: {motion: log, min: 1}}\n") -> dict[str, object]:
    (rig.folder / "log.csv").write_text(csv)
    return rig.test(FLAT.replace("SECONDS", "1 s").replace("motions:\n", "motions:\n  log: {file: log.csv}\n"), test, others=NUMBERS)


def test_motion_file_passes_through_its_rows(rig: Workspace) -> None:
    assert file_motion(rig, CSV)["code"] == 0
    assert file_motion(rig, CSV.replace("45", "170"))["code"] == 1


@pytest.mark.parametrize(("written", "wrong", "line", "column", "words"), [
    ("1,45,0\n", "0.4,45,0\n", 4, 1, "the times of a motion must increase, found 0.4 s after 0.4 s"),
    ("0,0,0\n", "-0.1,0,0\n", 2, 1, "the times of a motion must not be negative, found -0.1 s"),
    ("elbow", "elbw", 1, 21, "there is no joint `elbw`"),
    (",elbow", "", 1, 1, "missing columns: `elbow [deg]`"),
    ("time", "times", 1, 1, "there is no joint `times`"),
    ("45", "190", 4, 3, "the value of `shoulder` (190 deg) is outside its limits (-170 deg to 170 deg)"),
    ("20", "x", 3, 5, "expected a number in the column `shoulder`, found `x`"),
    ("20", "", 3, 4, "expected a number in the column `shoulder`, found an empty cell"),
    ("[deg]", "[mm]", 1, 6, "wrong unit of a column: expected an angle (such as 30 deg), found a length (`mm`)"),
    ("0.4,20,0.1", "0,4,20,0,1", 3, 8, "expected 3 cells as in the header, found `0` in cell 4"),
    ("elbow", "shoulder", 1, 21, "the column `shoulder` occurs twice"),
    ("0.4,20,0.1\n1,45,0\n", "", 1, 1, "a motion needs at least two rows with numbers"),
])
def test_invalid_motion_file_is_reported_at_its_cell(rig: Workspace, written: str, wrong: str, line: int, column: int, words: str) -> None:
    answer = file_motion(rig, CSV.replace(written, wrong, 1), "")
    found = answer["diagnostics"]
    assert isinstance(found, list) and len(found) == 1, found
    place = found[0]["location"] if "location" in found[0] else found[0]
    assert (found[0]["code"], place["file"].rpartition("/")[2], place["line"], place["column"]) == ("TC368", "log.csv", line, column)
    assert words in found[0]["message"]


def test_motion_diff_ignores_joint_names(tmp_path: Path) -> None:
    def fact(text: str) -> object:
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        assembly = built(folder, text).compilation.assembly
        assert assembly is not None
        return motion_facts(assembly.definition)["motions.swing"].value

    assert fact(PLANAR) == fact(PLANAR.replace("shoulder", "hip"))
    assert len({fact(PLANAR), fact(PLANAR.replace("1.3 s", "1.4 s")), fact(PLANAR.replace("70 deg", "71 deg"))}) == 3


def test_rezero_refuses_joints_used_in_a_motion_file(rig: Workspace, capsys: pytest.CaptureFixture[str]) -> None:
    assert file_motion(rig, CSV)["code"] == 0
    assert main(["rezero", str(rig.folder / "rig.yaml"), "elbow=10 deg"]) == 2
    assert "the file of motion `log` contains positions of joint `elbow`" in capsys.readouterr().out


def test_schema_lists_poses_and_motions(rig: Workspace) -> None:
    document = rig.write(FLAT.replace("SECONDS", "1 s"))
    assert main(["schema", str(document)]) == 0
    definitions = json.loads((rig.folder / ".thingc/schema/rig.yaml.json").read_text())["$defs"]
    for model, key, names in (("DriveMarginTest", "motion", {"rest", "lift"}), ("MotionPoseSpec", "pose", {"level", "up"})):
        offered = definitions[model]["properties"][key]["anyOf"]
        assert {one["const"] for one in offered if "const" in one} == names


def test_rotors_of_a_differential_are_accelerated(tmp_path: Path) -> None:
    """The rotors turn with A qdd, so they require the efforts I A qdd, which are A' I A qdd at the joints."""
    bare = re.sub(r",\s+dynamics: \{[^}]*\}|, drive: \{[^}]*\}", "", PLANAR)
    motor = "{kind: motor, effort: 1 N*m, armature: 2e-3 kg*m^2}"
    text = bare.replace("poses:", f"transmissions:\n  wrist: {{differential: {{actuators: [{motor}, {motor}], joints: [shoulder, elbow], "
                                  "matrix: [[2, 1], [2, -3]]}}\nposes:")
    robots = []
    for name, document in (("bare", bare), ("geared", text)):
        (tmp_path / name).mkdir()
        robots.append(built(tmp_path / name, document).robot("bench"))
    curve, A = curve_of(robots[0]), np.array([[2.0, 1.0], [2.0, -3.0]])
    for time in (0.6, 0.9, 1.5):
        state = curve.at(time)
        bodies = body_poses(robots[0], state.q)
        bare_loads, loads_of = (inertial_loads(robot, bodies, state) for robot in robots)
        added = A.T @ A @ [state.a["shoulder"], state.a["elbow"]] * -2e-3
        assert [loads_of[path] - bare_loads[path] for path in ("shoulder", "elbow")] == pytest.approx(added, rel=1e-8, abs=1e-10)
        moving = [loads(robots[0], state.q, bodies)[path] + loads_of[path] for path in ("shoulder", "elbow")]
        efforts = balance_loads(robots[1], state.q, bodies, *problem(robots[1], state.q, bodies, loads_of)).by_joint
        assert A.T @ [efforts["wrist_0"], efforts["wrist_1"]] == pytest.approx([-one for one in moving], rel=1e-8)
