"""Mass, centre, reach, points and torque against formulas for bars, and against MuJoCo for the arm."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path

import mujoco
import numpy as np
import pytest

from testing.rig import PARALLELOGRAM, SLIDERS, Workspace, two_links
from thingc import compile
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.testing.poses import keyframe, pose_robot
from thingc.model.resolve.types import NamedPose
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.types import Robot
from thingc.model.statics.efforts import static_efforts

G = 9.81


def test_masses_of_bars(rig: Workspace) -> None:
    """At 1000 kg/m^3 the bars are 40 g and 24 g."""
    answer = rig.test(two_links(), "  all: {mass: {min: 64 g, max: 64.001 g}}\n  one: {mass: {of: lower, max: 20 g}}\n"
                                   "  both: {mass: {of: '*er', min: 63.9 g}}\n")
    found = answer["by_name"]
    assert found["all"]["measured"]["mass"] == pytest.approx(0.064, rel=1e-9) and found["all"]["passed"]
    assert found["one"]["measured"]["mass"] == pytest.approx(0.024, rel=1e-9) and not found["one"]["passed"]
    assert found["both"]["passed"] and answer["code"] == 1
    assert [d["code"] for d in answer["diagnostics"]] == ["TC651"]
    assert "the mass (24 g) exceeds the maximum (20 g)" in answer["diagnostics"][0]["message"]


def test_centre_of_two_bars(rig: Workspace) -> None:
    """Stretched: (40 g * 50 mm + 24 g * 130 mm) / 64 g along x. A single part, and another frame, are also tested."""
    x = (40 * 50 + 24 * 130) / 64
    answer = rig.test(two_links(), f"  world: {{centre: {{within: {{x: [{x - 0.001} mm, {x + 0.001} mm], y: [0, 0], z: [0 mm, 0 mm]}}}}}}\n"
                                   "  tip: {centre: {of: lower, in: tip, within: {z: [-31 mm, -29 mm]}}}\n"
                                   "  high: {centre: {within: {z: [=2 * 5 mm, 60 mm]}}}\n")
    found = answer["by_name"]
    assert found["world"]["measured"]["centre"] == pytest.approx([x / 1000, 0, 0], abs=1e-12)
    assert found["tip"]["passed"] and found["tip"]["measured"]["centre"] == pytest.approx([0, 0, -0.03], abs=1e-12)
    assert not found["high"]["passed"]
    said = answer["diagnostics"][-1]
    assert "z of the centre of mass (0 mm) is below the minimum (10 mm)" in said["message"]
    assert said["code"] == "TC652"


def test_massless_selection_has_no_centre(rig: Workspace) -> None:
    answer = rig.test(two_links(), "  none: {centre: {of: ground, within: {x: [-1 m, 1 m]}}}\n")
    assert not answer["by_name"]["none"]["passed"] and "the mass of the components is 0" in answer["diagnostics"][0]["message"]


@pytest.mark.parametrize(("lower", "upper", "nearest"), [(-150, 150, 0), (60, 120, 60), (-120, -90, 90)])
def test_reach_follows_the_law_of_cosines(rig: Workspace, lower: int, upper: int, nearest: int) -> None:
    expected = math.sqrt(0.1**2 + 0.06**2 + 2 * 0.1 * 0.06 * math.cos(math.radians(nearest)))
    at = f"{lower if lower > 0 else upper if upper < 0 else 0} deg"
    far = f"  far: {{reach: {{of: tip, from: base, min: {expected - 1e-9} m}}}}\n"
    answer = rig.test(two_links(f"{lower} deg", f"{upper} deg", at), far + "  short: {reach: {of: tip, from: base, max: 50 mm}}\n")
    assert answer["by_name"]["far"]["measured"]["reach"] == pytest.approx(expected, abs=1e-9)
    assert answer["by_name"]["far"]["passed"] and not answer["by_name"]["short"]["passed"]


def test_reach_of_a_closed_loop(rig: Workspace) -> None:
    """The coupler of a parallelogram stays level: its end is 200 mm from that of the crank. It is farthest from the ground's hinge if
    the crank is closest to level, at its limit of 20 deg."""
    text = PARALLELOGRAM.replace("DRIVE", "").replace("level: {}", "level: {crank: 20 deg}")
    text = text.replace("child: crank.near, limit: {lower: -60 deg", "child: crank.near, limit: {lower: 20 deg")
    answer = rig.test(text, "  far: {reach: {of: middle, from: ground.hinge, min: 200 mm}}\n")
    expected = math.hypot(0.2 + 0.1 * math.cos(math.radians(20)), 0.1 * math.sin(math.radians(20)))
    assert answer["by_name"]["far"]["measured"]["reach"] == pytest.approx(expected, abs=1e-6)


def test_points_reached_by_two_links(rig: Workspace) -> None:
    """All points inside the ring from 40 to 160 mm are reached; outside, the distance to the ring remains."""
    answer = rig.test(two_links(), "  inside: {point: {mount: tip, at: 60 0 -70 mm, within: 1 um}}\n"
                                   "  beyond: {point: {mount: tip, at: 150 0 -200 mm, within: 1 mm}}\n"
                                   "  beside: {point: {mount: tip, at: 60 25 -70 mm, in: ground.origin, within: 1 mm}}\n")
    found = answer["by_name"]
    assert found["inside"]["passed"] and found["inside"]["measured"]["distance"] < 1e-6
    assert found["beyond"]["measured"]["distance"] == pytest.approx(0.25 - 0.16, abs=1e-7) and not found["beyond"]["passed"]
    assert found["beside"]["measured"]["distance"] == pytest.approx(0.025, abs=1e-7) and not found["beside"]["passed"]
    shoulder, elbow = (found["inside"]["measured"]["joints"][name] for name in ("shoulder", "elbow"))
    tip = [0.1 * math.cos(shoulder) + 0.06 * math.cos(shoulder + elbow), -0.1 * math.sin(shoulder) - 0.06 * math.sin(shoulder + elbow)]
    assert tip == pytest.approx([0.06, -0.07], abs=1e-6)
    message = answer["diagnostics"][0]["message"]
    assert "the distance from `tip` to the point (90 mm) exceeds the maximum (1 mm)" in message.replace("lower.tip", "tip")


def test_joint_limits_restrict_reachable_points(rig: Workspace) -> None:
    """With the elbow between 60 and 120 deg the ring ends at 140 mm."""
    answer = rig.test(two_links("60 deg", "120 deg", "60 deg"), "  out: {point: {mount: tip, at: 160 0 0 mm, within: 1 mm}}\n")
    assert answer["by_name"]["out"]["measured"]["distance"] == pytest.approx(0.02, abs=1e-7)
    assert math.degrees(answer["by_name"]["out"]["measured"]["joints"]["elbow"]) == pytest.approx(60, abs=1e-4)


def test_points_reached_by_a_closed_loop(rig: Workspace) -> None:
    """The end of a parallelogram's coupler moves only on a circle of 100 mm about (200, 0) mm."""
    q = math.radians(30)
    on = f"{200 + 100 * math.cos(q)} 0 {-100 * math.sin(q)} mm"
    answer = rig.test(PARALLELOGRAM.replace("DRIVE", ""), f"  on: {{point: {{mount: middle, at: {on}, within: 10 um}}}}\n"
                      "  off: {point: {mount: middle, at: 330 0 0 mm, within: 10 um}}\n")
    on_it, off = answer["by_name"]["on"], answer["by_name"]["off"]
    crank, rocker = (on_it["measured"]["joints"][name] for name in ("crank", "rocker"))
    assert on_it["passed"] and rocker == pytest.approx(q, abs=1e-3)
    ends = [0.1 * math.cos(crank), 0.1 * math.sin(crank)], [0.2 + 0.1 * math.cos(rocker), 0.1 * math.sin(rocker)]
    assert math.dist(*ends) == pytest.approx(0.2, abs=1e-5)
    assert not off["passed"] and off["measured"]["distance"] == pytest.approx(0.03, abs=1e-4)


@pytest.mark.parametrize(("direction", "passes"), [("[1, 0, 0]", True), ("[0, 0, 2]", False)])
def test_direction_at_a_point(rig: Workspace, direction: str, passes: bool) -> None:
    """If fully stretched along x, the tip can only point along x."""
    keys = f"mount: tip, at: 159.99 0 0 mm, within: 1 mm, direction: {direction}, angle: 5 deg"
    answer = rig.test(two_links(), f"  aim: {{point: {{{keys}}}}}\n")
    assert answer["by_name"]["aim"]["passed"] is passes


def test_static_torques_of_two_level_bars(rig: Workspace) -> None:
    answer = rig.test(two_links(), "  hold: {torque_margin: {drive: '*', min: 2}}\n  much: {torque_margin: {drive: shoulder, min: 50}}\n")
    elbow = 0.024 * G * 0.03
    shoulder = 0.04 * G * 0.05 + 0.024 * G * 0.13
    efforts = answer["by_name"]["hold"]["measured"]["efforts"]
    assert {name: abs(value) for name, value in efforts.items()} == pytest.approx({"shoulder": shoulder, "elbow": elbow}, rel=1e-12)
    assert answer["by_name"]["hold"]["measured"]["margin"] == pytest.approx(1 / shoulder, rel=1e-12)
    assert answer["diagnostics"][0]["message"].endswith(
        f"the margin of drive `shoulder` ({1 / shoulder:.3g}) is below the minimum (50)"
    )


@pytest.mark.parametrize(("drive", "expected"), [
    ("", {"crank": 1.0}),
    (", drive: {kind: position, kp: 5 N*m/rad, effort: 1 N*m}", {"crank": 0.5, "rocker": 0.5}),
    (", drive: {kind: position, kp: 5 N*m/rad, effort: 3 N*m}", {"crank": 0.1, "rocker": 0.9}),
])
def test_static_torques_of_a_parallelogram(rig: Workspace, drive: str, expected: dict[str, float]) -> None:
    """Virtual work: both bars turn by the same angle, the coupler moves with their ends, so the total is (0.04 g 50 mm * 2 + 0.08 g 100
    mm) cos q. Two drives share it in proportion to the squares of their limits: this minimizes the sum of squares of effort by limit
    with a given sum."""
    text = PARALLELOGRAM.replace("DRIVE", drive)
    whole = (2 * 0.04 * 0.05 + 0.08 * 0.1) * G * math.cos(math.radians(30))
    answer = rig.test(text, "  hold: {torque_margin: {drive: '*', min: 0.1, pose: lowered}}\n")
    efforts = answer["by_name"]["hold"]["measured"]["efforts"]
    assert {name: abs(value) for name, value in efforts.items()} == pytest.approx(
        {name: share * whole for name, share in expected.items()}, rel=1e-6,
    )
    # of two margins that differ by rounding at most, the first
    assert answer["by_name"]["hold"]["measured"]["drive"] == ("rocker" if expected.get("rocker") == 0.9 else "crank")


def test_undriven_joint_that_would_move_is_an_error(rig: Workspace) -> None:
    text = two_links().replace(",\n    drive: {kind: position, kp: 5 N*m/rad, effort: 0.5 N*m}}", "}")
    answer = rig.test(text, "  hold: {torque_margin: {drive: shoulder, min: 1}}\n")
    found = answer["diagnostics"][0]
    assert "no drive prevents the motion of joint `elbow`" in found["message"] and found["code"] == "TC656"
    hanging = text.replace("level: {elbow: 0}", "level: {shoulder: 90 deg}")
    assert rig.test(hanging, "  hold: {torque_margin: {drive: shoulder, min: 1}}\n")["code"] == 0


def test_spring_reduces_the_torque(rig: Workspace) -> None:
    """A spring with its rest position at 0, deflected by 20 deg, contributes k q."""
    sprung = "dynamics: {stiffness: 0.1 N*m/rad}, drive: {kind: motor, effort: 1 N*m}"
    text = two_links().replace("drive: {kind: position, kp: 5 N*m/rad, effort: 1 N*m}", sprung)
    text = text.replace("level: {elbow: 0}", "level: {shoulder: 20 deg}")
    q = math.radians(20)
    gravity = (0.04 * 0.05 + 0.024 * 0.13) * G * math.cos(q)
    found = rig.test(text, "  hold: {torque_margin: {drive: shoulder, min: 1}}\n")["by_name"]["hold"]
    assert abs(found["measured"]["effort"]) == pytest.approx(gravity - 0.1 * q, rel=1e-9)


def test_drive_force_of_a_vertical_slide(rig: Workspace) -> None:
    """A block of 8 g on a vertical rail, and half the weight of a second block that follows the first at half its speed."""
    text = SLIDERS.replace("slide: {rpy: 0 90 0 deg}", "slide: {rpy: 0 0 0 deg}")
    text = text.replace("upper: 200 mm}}\n  two", "upper: 200 mm}, drive: {kind: motor, effort: 1 N}}\n  two")
    text = text.replace("upper: 200 mm}}\nposes", "upper: 200 mm}, mimic: {joint: one, multiplier: 0.5}}\nposes")
    text = re.sub("  (apart|close|touching|overlapping): {.*\n", "", text).replace("poses:\n", "poses:\n  apart: {}\n")
    found = rig.test(text, "  hold: {torque_margin: {drive: one, min: 1}}\n")["by_name"]["hold"]
    assert abs(found["measured"]["effort"]) == pytest.approx(1.5 * 0.008 * G, rel=1e-9)
    assert found["said"].startswith("margin 8.49 at one: 0.1177 N of 1 N")


# --- the arm against MuJoCo -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def arm(root: Path, shared_store: str) -> tuple[dict[str, mujoco.MjModel], dict[str, Robot]]:
    document = str(root / "assemblies" / "arm.yaml")
    compiled = compile(document, store=shared_store)
    with Environment(document, Options(store=shared_store)) as environment:
        compilation = pipeline.compile(environment)
        return {name: mode.model() for name, mode in compiled.modes.items()}, {r.mode.name: r for r in compilation.robots}


@pytest.mark.parametrize("mode", ["bench", "drawing"])
def test_static_torques_of_the_arm_match_mujoco(arm: tuple[dict[str, mujoco.MjModel], dict[str, Robot]], mode: str) -> None:
    """The oracle is the bias force at zero velocity, which contains only gravity, in 20 random poses."""
    model, robot = arm[0][mode], arm[1][mode]
    data = mujoco.MjData(model)
    source = np.random.default_rng(5)
    for _ in range(20):
        q = {name: float(source.uniform(*model.joint(name).range)) for name in ("yaw", "shoulder", "elbow", "wrist")}
        pose = NamedPose(name="tried", values=q, origins={}, origin=())
        placed = pose_robot(robot.assembly, robot.mode, [pose])
        assert placed is not None
        frame = keyframe(placed, pose)
        assert frame is not None
        for name, value in q.items():
            data.joint(name).qpos[0] = value
        mujoco.mj_forward(model, data)
        found = static_efforts(placed, frame.q, body_poses(placed, frame.q))
        assert found.unheld < 1e-9 and found.choices == 0
        assert found.by_joint == pytest.approx({name: data.joint(name).qfrc_bias[0] for name in q}, abs=1e-9)


def test_mass_and_centre_of_the_arm_match_mujoco(
    arm: tuple[dict[str, mujoco.MjModel], dict[str, Robot]], root: Path, rig: Workspace, tmp_path: Path,
) -> None:
    shutil.copytree(root / "assemblies", rig.folder / "assemblies")
    shutil.copytree(root / "parts", rig.folder / "parts", dirs_exist_ok=True)
    document = rig.folder / "assemblies" / "arm.yaml"
    text = document.read_text().partition("\ntests:")[0]
    tests = (
        "  weight: {mass: {min: 1 g}}\n"
        "  centre: {centre: {mode: all, pose: all, within: {x: [-1 m, 1 m]}}}\n"
    )
    document.write_text(f"{text}\ntests:\n{tests}")
    code, out, _ = rig.run(str(document), "--format", "json")
    results = json.loads(out)["tests"]
    assert code == 0 and len(results) == 1 + 3 * 4
    for mode, model in arm[0].items():
        data = mujoco.MjData(model)
        for result in results:
            if result["kind"] == "mass":
                assert result["measured"]["mass"] == pytest.approx(model.body_subtreemass[0], rel=1e-9)
            elif result["mode"] == mode:
                mujoco.mj_resetDataKeyframe(model, data, model.key(result["pose"]).id)
                mujoco.mj_forward(model, data)
                assert result["measured"]["centre"] == pytest.approx(data.subtree_com[0], abs=1e-9)


def test_lowest_corner_of_a_hanging_bar(rig: Workspace) -> None:
    """The lower bar (60 x 20 mm) hangs down at 30 deg: its lowest corner is 60 sin + 10 cos below the hinges; the edge of the other bar
    is 10 mm below."""
    corner = 0.06 * math.sin(math.radians(30)) + 0.01 * math.cos(math.radians(30))
    answer = rig.test(two_links(at="30 deg"), (
        "  over: {ground_clearance: {plane: -100 mm, at_least: 50 mm}}\n"
        "  under: {ground_clearance: {at_least: 1 mm}}\n"
        "  spared: {ground_clearance: {plane: -20 mm, at_least: 10 mm, except: [low*]}}\n"
        "  nothing: {ground_clearance: {at_least: 0, except: [lower, upper]}}\n"
    ))
    found = answer["by_name"]
    assert found["over"]["passed"] and found["over"]["measured"]["clearance"] == pytest.approx(0.1 - corner, abs=1e-7)
    assert found["under"]["measured"] == {"clearance": pytest.approx(-corner, abs=1e-7), "part": "lower"}
    assert found["spared"]["passed"] and found["spared"]["measured"] == {"clearance": pytest.approx(0.01, abs=1e-7), "part": "upper"}
    under, nothing = answer["diagnostics"]
    assert under["code"] == nothing["code"] == "TC662"
    assert f"the ground clearance of `lower` (-{1000 * corner:.4g} mm) is below the minimum (1 mm)" in under["message"]
    assert [note["message"] for note in under["notes"]] == ["`upper` is 10 mm below the plane"]
    assert under["help"] == "if this is intended, add `except: [lower]`"
    assert "no part in the test has a shape" in nothing["message"]
