"""`loop: true`: joints that close loops, compared with closed formulas of the four-bar linkage and the slider-crank."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import mujoco
import numpy as np
import pytest

from loops.robots import BALL, Built, at_key, compiled, equality_residual, pose_of
from thingc.base.diagnostics import Report
from thingc.base.memo import Memo
from thingc.model.robot.kinematic_tree import root
from thingc.model.robot.loop_solver import Loops
from thingc.tools.cli.info import as_text, mode_data

A, B, C, D = 0.06, 0.18, 0.12, 0.2
"""Crank, coupler, rocker and ground [m]. By Grashof's rule, the crank can rotate fully."""

FACING = "rpy: 180 0 -90 deg"
"""A mount that, mated to one with z up, aligns the axes of its link with those of the mount, so joint angles are plane angles."""

ANGLES = (20.0, 75.0, 130.0, 200.0, 290.0)

FOURBAR = f"""\
thingc: assembly/1
name: fourbar
components:
  ground: {{frame: true, mass: 1 kg, {BALL}, mounts: {{a: {{xyz: 0 0 0 mm}}, d: {{xyz: 200 0 0 mm}}}}}}
  crank: {{frame: true, mass: 0.1 kg, {BALL}, mounts: {{low: {{{FACING}}}, high: {{xyz: 60 0 0 mm}}}}}}
  coupler: {{frame: true, mass: 0.2 kg, {BALL}, com: [90 mm, 0, 0], mounts: {{low: {{{FACING}}}, high: {{xyz: 180 0 0 mm}}}}}}
  rocker: {{frame: true, mass: 0.15 kg, {BALL}, mounts: {{low: {{{FACING}}}, high: {{xyz: 120 0 0 mm, {FACING}}}}}}}
joints:
  drive: {{type: continuous, parent: ground.a, child: crank.low, drive: {{kind: position, kp: 5 N*m/rad, kv: 0.05 N*m*s/rad}}}}
  elbow: {{type: continuous, parent: crank.high, child: coupler.low, dynamics: {{damping: 0.001 N*m*s/rad}}}}
  pivot: {{type: revolute, parent: ground.d, child: rocker.low, limit: {{lower: 5 deg, upper: 175 deg}}}}
  wrist: {{type: continuous, parent: coupler.high, child: rocker.high, loop: true, dynamics: {{damping: 0.001 N*m*s/rad}}}}
poses:
""" + "".join(f"  at_{angle:.0f}: {{drive: {angle} deg}}\n" for angle in ANGLES) + """\
modes:
  bench: {root: ground}
  by_coupler: {root: coupler, base: free}
  other: {root: ground, cut: [pivot]}
  third: {root: rocker.high, base: held, cut: [elbow]}
"""


def rocker_angle(crank: float) -> float:
    """Angle of the rocker [rad] on the branch above the ground, by the law of cosines in the two triangles at the diagonal from the end
    of the crank to the pivot of the rocker."""
    x, y = A * np.cos(crank) - D, A * np.sin(crank)
    diagonal = np.hypot(x, y)
    inner = np.arccos((C**2 + diagonal**2 - B**2) / (2 * C * diagonal))
    return float((np.arctan2(y, x) - inner) % (2 * np.pi))


@pytest.fixture(scope="module")
def fourbar(tmp_path_factory: pytest.TempPathFactory) -> Built:
    found = compiled(tmp_path_factory.mktemp("fourbar"), FOURBAR)
    assert found.said == []
    return found


MODES = ("bench", "by_coupler", "other", "third")


def test_loop_closes_at_the_analytic_angles(fourbar: Built) -> None:
    """Limits select the branch, and the crank keeps the angle from the pose."""
    for frame, angle in zip(fourbar.robot("bench").keyframes, np.radians(ANGLES), strict=True):
        assert frame.q["drive"] == pytest.approx(angle, abs=1e-15)
        assert frame.q["pivot"] == pytest.approx(rocker_angle(angle), abs=1e-9)
        coupler = frame.q["drive"] + frame.q["elbow"]
        tip = [A * np.cos(angle) + B * np.cos(coupler), A * np.sin(angle) + B * np.sin(coupler)]
        rocker = frame.q["pivot"]
        assert tip == pytest.approx([D + C * np.cos(rocker), C * np.sin(rocker)], abs=1e-10)
        assert np.exp(1j * (coupler + frame.q["wrist"])) == pytest.approx(np.exp(1j * rocker), abs=1e-9)
        assert frame.moved == {}
    assert not [loss for loss in fourbar.losses("bench") if loss.how == "approximated"]


def test_cut_joint_selection(fourbar: Built) -> None:
    """The joint that closes the loop in the document is cut, unless the mode names another or it has limits. A driven joint is never
    cut."""
    assert {mode: [closure.path for closure in fourbar.robot(mode).closures] for mode in MODES} == {
        "bench": ["wrist"], "by_coupler": ["wrist"], "other": ["pivot"], "third": ["elbow"],
    }


def test_joints_with_limits_are_not_cut(fourbar: Built, tmp_path: Path) -> None:
    """This includes the joint that closes the loop in the document. `info` gives the reason for the cut."""
    limited = FOURBAR.replace("wrist: {type: continuous", "wrist: {type: revolute, limit: {lower: -3 rad, upper: 3 rad}")
    found = compiled(tmp_path, limited)
    assert found.said == []
    assert {mode: [closure.path for closure in found.robot(mode).closures] for mode in MODES} == {
        "bench": ["elbow"], "by_coupler": ["elbow"], "other": ["pivot"], "third": ["elbow"],
    }
    assert [(loss.path, loss.what) for loss in found.losses("bench")] == [("elbow", "the dynamics: the loop is cut at the joint")]
    frame = next(frame for frame in found.robot("bench").keyframes if frame.name == "at_75")
    assert equality_residual(at_key(found.model("bench"), "at_75")) < 1e-9
    assert frame.q["pivot"] == pytest.approx(rocker_angle(np.radians(75.0)), abs=1e-9)

    def told(built: Built, mode: str) -> list[str]:
        assert built.compilation.assembly is not None
        lines = as_text(built.compilation.assembly, (built.robot(mode),))
        start = next(number for number, line in enumerate(lines) if "closes a loop" in line)
        return lines[start : next(number for number, line in enumerate(lines) if "pose " in line)]

    assert told(found, "bench") == [
        "  elbow (hinge) closes a loop between crank and coupler",
        "    through drive, which is driven",
        "    through pivot, which has limits",
        "    through wrist, which has limits",
    ]
    assert told(fourbar, "bench") == [
        "  wrist (hinge) closes a loop between coupler and rocker",
        "    through elbow, which places its child",
        "    through drive, which is driven",
        "    through pivot, which has limits",
    ]
    assert told(fourbar, "other")[1:] == ["    through drive, elbow, wrist: cut at the joint that the mode lists under `cut`"]
    assert mode_data(fourbar.robot("bench"))["loops"] == [
        {"cut": "wrist", "through": {"elbow": "places its child", "drive": "is driven", "pivot": "has limits"}},
    ]


def test_poses_have_equal_q_in_every_mode(fourbar: Built) -> None:
    expected = [(frame.name, frame.q) for frame in fourbar.robot("bench").keyframes]
    for mode in MODES:
        assert [(frame.name, frame.q) for frame in fourbar.robot(mode).keyframes] == expected
        assert fourbar.modes[mode]["poses"] == dict(expected)


def test_loop_solutions_are_shared_and_cached(fourbar: Built, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each pose is solved once for all modes, and not again if nothing changes."""
    assembly, memo, asked = fourbar.compilation.assembly, Memo(), []
    assert assembly is not None
    close = Loops.close
    monkeypatch.setattr(Loops, "close", lambda *given, **more: (asked.append(given[1]), close(*given, **more))[1])
    for _ in range(2):
        assert tuple(root(assembly, mode, Report(), memo) for mode in assembly.modes) == fourbar.compilation.robots
        assert len(asked) == len(ANGLES)


@pytest.mark.parametrize("mode", MODES)
def test_loop_is_closed_at_every_keyframe(fourbar: Built, mode: str) -> None:
    model, robot = fourbar.model(mode), fourbar.robot(mode)
    for frame in robot.keyframes:
        data = at_key(model, frame.name)
        assert equality_residual(data) < 1e-9
        assert (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY).sum() == 6
        assert all(model.eq_solref[:, 0] == 2.0 * model.opt.timestep)
        assert frame.residual is not None and max(frame.residual) < 1e-9


def test_relative_poses_are_equal_in_every_mode(fourbar: Built) -> None:
    def pairs(mode: str, key: str) -> np.ndarray:
        data = at_key(fourbar.model(mode), key)
        at = [pose_of(data.body(name)) for name in ("ground", "crank", "coupler", "rocker")]
        return np.array([np.linalg.inv(one) @ other for one, other in combinations(at, 2)])

    for angle in ANGLES:
        expected = pairs("bench", f"at_{angle:.0f}")
        for mode in MODES[1:]:
            assert pairs(mode, f"at_{angle:.0f}") == pytest.approx(expected, abs=1e-9)


def test_loop_neighbours_are_excluded_in_every_mode(fourbar: Built) -> None:
    pairs = (("ground", "crank"), ("crank", "coupler"), ("ground", "rocker"), ("coupler", "rocker"))
    expected = {frozenset(pair) for pair in pairs}
    for mode in MODES:
        model = fourbar.model(mode)
        found = {
            frozenset(model.body(int(signature) >> bits & 0xFFFF).name for bits in (16, 0))
            for signature in model.exclude_signature
        }
        assert found == expected


@pytest.mark.parametrize("mode", ["bench", "other", "third"])
def test_simulated_rocker_follows_the_formula(fourbar: Built, mode: str) -> None:
    """The crank is driven once around. The rocker follows the formula, and the loop stays closed, whichever joint is cut."""
    model = fourbar.model(mode)
    data = at_key(model, "at_20")
    ids = {name: model.joint(name).qposadr[0] for name in ("drive", "pivot") if name != "pivot" or mode != "other"}
    worst = 0.0
    for step in range(1500):
        data.ctrl[0] = np.radians(20.0) + 2 * np.pi * step / 1500
        mujoco.mj_step(model, data)
        worst = max(worst, equality_residual(data))
        if "pivot" in ids and step % 100 == 0:
            assert data.qpos[ids["pivot"]] == pytest.approx(rocker_angle(data.qpos[ids["drive"]]), abs=2e-3)
    assert data.qpos[ids["drive"]] == pytest.approx(np.radians(380.0), abs=0.1)
    assert worst < 1e-4


def test_dynamics_and_limits_of_cut_joints_are_losses(fourbar: Built) -> None:
    assert [(loss.path, loss.what, loss.how) for loss in fourbar.losses("bench")] == [
        ("wrist", "the dynamics: the loop is cut at the joint", "omitted")
    ]
    assert [(loss.path, loss.what, loss.how) for loss in fourbar.losses("other")] == [
        ("pivot", "the limits: the loop is cut at the joint", "omitted")
    ]


def test_modes_json_contains_cuts(fourbar: Built) -> None:
    described = fourbar.modes["bench"]
    (cut,) = described["cuts"]
    assert [joint["name"] for joint in described["joints"]] == ["drive", "elbow", "pivot"]
    assert (cut["name"], cut["kind"], cut["parent"], cut["child"]) == ("wrist", "continuous", "coupler", "rocker")
    data = at_key(fourbar.model("bench"), "at_75")
    q = described["poses"]["at_75"]["wrist"]
    turned = np.eye(4)
    turned[:2, :2] = [[np.cos(q), -np.sin(q)], [np.sin(q), np.cos(q)]]
    meets = pose_of(data.body("coupler")) @ np.array(cut["X_PA"]) @ turned
    assert meets == pytest.approx(pose_of(data.body("rocker")) @ np.array(cut["X_CB"]), abs=1e-9)
    assert set(described["residuals"]) == set(described["poses"])


def test_hold_and_loop_close_together(tmp_path: Path) -> None:
    """The end of the coupler is held 5 mm and a small rotation from its pose in the loop. With a free crank the base follows and both
    loops close. With a fixed ground, the loop has one degree of freedom, so a hold `here` blocks it."""
    text = FOURBAR.partition("modes:")[0] + (
        "modes:\n"
        "  stopped: {root: ground, pose: at_75, poses: [at_130], hold: {rocker.high: here}}\n"
        "  towed: {root: crank, base: free, pose: at_75, poses: [], hold: {coupler.high: {xyz: 5 0 3 mm, rpy: 2 1 0 deg}}}\n"
    )
    found = compiled(tmp_path, text)
    assert found.said == []
    stopped, towed = found.robot("stopped"), found.robot("towed")
    assert [(closure.path, closure.hold) for closure in stopped.closures] == [("rocker/high", True), ("wrist", False)]
    assert [frame.name for frame in stopped.keyframes] == ["at_75"] and [one.name for one in stopped.unclosed] == ["at_130"]
    assert stopped.keyframes[0].q["pivot"] == pytest.approx(rocker_angle(np.radians(75.0)), abs=1e-9)
    assert [loss.how for loss in found.losses("stopped") if loss.path == "at_75"] == []
    (frame,) = towed.keyframes
    assert frame.q["drive"] == pytest.approx(np.radians(75.0), abs=1e-15)
    assert frame.q["pivot"] == pytest.approx(rocker_angle(np.radians(75.0)), abs=1e-9)
    for robot in (stopped, towed):
        data = at_key(found.model(robot.mode.name), "at_75")
        assert (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY).sum() == 12
        assert equality_residual(data) < 1e-9


# --- the slider-crank: a slide in the loop -------------------------------------------------------------------------------

R, L = 0.05, 0.15
SLIDER = f"""\
thingc: assembly/1
name: engine
components:
  block: {{frame: true, mass: 1 kg, {BALL}, mounts: {{main: {{}}, bore: {{rpy: 0 90 0 deg}}}}}}
  crank: {{frame: true, mass: 0.1 kg, {BALL}, mounts: {{low: {{{FACING}}}, pin: {{xyz: 50 0 0 mm}}}}}}
  rod: {{frame: true, mass: 0.1 kg, {BALL}, mounts: {{big: {{{FACING}}}, small: {{xyz: 150 0 0 mm}}}}}}
  piston: {{frame: true, mass: 0.1 kg, {BALL}, mounts: {{wall: {{rpy: 90 0 -90 deg}}, pin: {{}}}}}}
joints:
  main: {{type: continuous, parent: block.main, child: crank.low, MAIN}}
  crankpin: {{type: continuous, parent: crank.pin, child: rod.big, PIN}}
  wristpin: {{type: continuous, parent: rod.small, child: piston.pin, WRIST}}
  bore: {{type: prismatic, parent: block.bore, child: piston.wall, limit: {{lower: 50 mm, upper: 250 mm}}, BORE}}
poses:
  top: {{main: 0}}
  down: {{main: 100 deg}}
"""
DRIVEN = "drive: {kind: position, kp: 5 N*m/rad}"


def slider(folder: Path, **more: str) -> Built:
    text = SLIDER + "modes:\n  run: {root: block}\n"
    for mark in ("MAIN", "PIN", "WRIST", "BORE"):
        text = text.replace(f", {mark}", f", {more[mark]}" if mark in more else "")
    # A pin that faces the rod's, so that the piston's axes are parallel to it.
    return compiled(folder, text.replace("pin: {}", f"pin: {{{FACING}}}"))


@pytest.mark.parametrize(
    ("more", "cut"),
    [
        ({"WRIST": "loop: true", "MAIN": DRIVEN}, "wristpin"),
        ({"BORE": "loop: true", "MAIN": DRIVEN}, "wristpin"),  # MuJoCo has no equality that slides
        ({"WRIST": f"loop: true, {DRIVEN}"}, "crankpin"),  # a passive one will do
        ({"WRIST": "loop: true, dynamics: {damping: 0.001 N*m*s/rad}", "MAIN": DRIVEN}, "crankpin"),  # which no cut joint can have
        ({"BORE": "loop: true", "MAIN": DRIVEN, "WRIST": DRIVEN}, "crankpin"),
        ({"WRIST": f"loop: true, {DRIVEN}", "MAIN": DRIVEN, "PIN": DRIVEN}, "bore"),  # the only passive one
    ],
)
def test_least_useful_joint_is_cut(tmp_path: Path, more: dict[str, str], cut: str) -> None:
    """The order of preference is tested with a slider-crank. A cut slide has no equality in MuJoCo and is a loss."""
    found = slider(tmp_path, **more)
    assert found.said == []
    (closure,) = found.robot("run").closures
    assert closure.path == cut
    for frame, angle in zip(found.robot("run").keyframes, np.radians([0.0, 100.0]), strict=True):
        assert frame.q["main"] == pytest.approx(angle, abs=1e-15)
        travel = R * np.cos(angle) + np.sqrt(L**2 - (R * np.sin(angle)) ** 2)
        assert frame.q["bore"] == pytest.approx(travel, abs=1e-9)
        if cut != "bore":
            assert equality_residual(at_key(found.model("run"), frame.name)) < 1e-9
    losses = [(loss.path, loss.what, loss.how) for loss in found.losses("run")]
    lost = ("bore", "the loop through the joint: MuJoCo has no equality for slides", "omitted")
    assert losses == ([lost] if cut == "bore" else [])


def test_fixed_loop_joint_becomes_a_weld(tmp_path: Path) -> None:
    """A `fixed` joint that closes a loop keeps both links separate."""
    text = FOURBAR.replace(
        "wrist: {type: continuous, parent: coupler.high, child: rocker.high, loop: true, dynamics: {damping: 0.001 N*m*s/rad}}",
        "wrist: {type: fixed, parent: coupler.high, child: rocker.high, loop: true}",
    ).replace("xyz: 200 0 0 mm", "xyz: 100 0 0 mm")
    text = text.partition("poses:")[0] + "poses:\n  up: {pivot: 40 deg}\nmodes:\n  bench: {root: ground}\n"
    found = compiled(tmp_path, text)
    assert [code for code, *_ in found.said] == ["TC618"]  # 40 deg become 33.6 deg
    robot = found.robot("bench")
    assert [(closure.path, closure.kind) for closure in robot.closures] == [("wrist", "weld")]
    assert len(robot.bodies) == 4
    (frame,) = robot.keyframes
    # The rocker lies back along the coupler: with 180 - 120 mm between them, crank and ground (100 mm) make a triangle.
    angle = np.arccos((A**2 + 0.1**2 - (B - C) ** 2) / (2 * A * 0.1))
    assert [frame.q[name] for name in ("drive", "pivot", "elbow")] == pytest.approx([-angle, angle, 2 * angle], abs=1e-9)
    assert equality_residual(at_key(found.model("bench"), "up")) < 1e-9


def test_impossible_loop_is_reported_once(tmp_path: Path) -> None:
    """With a coupler of 20 mm, 60 + 20 + 100 mm cannot span 200 mm of ground; 20 mm are missing."""
    text = FOURBAR.replace("upper: 175 deg", "upper: 200 deg").replace("xyz: 180 0 0 mm", "xyz: 20 0 0 mm")
    text = text.replace("xyz: 120 0 0 mm", "xyz: 100 0 0 mm")
    found = compiled(tmp_path, text)
    line = next(number for number, words in enumerate(text.splitlines(), 1) if words.startswith("  wrist:"))
    assert [(code, where) for code, _, _, where in found.said] == [("TC604", line)]
    assert found.said[0][1] == "the loop through joint `wrist` does not close (smallest error: 20 mm and 0 deg)"
    assert found.said[0][2] == "change the lengths in the loop, or the limits of its joints"


@pytest.mark.parametrize(("off", "said"), [
    ("0.00004 mm", []), ("0.002 mm", ["the loop through joint `wrist` does not close (smallest error: 0.002 mm and 0 deg)"]),
])
def test_tiny_gap_across_the_plane_is_tolerated(off: str, said: list[str], tmp_path: Path) -> None:
    """All joints turn about z, and one end is slightly higher, which no joint can correct. In the plane the loop closes to the last
    digit."""
    text = FOURBAR.replace("high: {xyz: 180 0 0 mm}", f"high: {{xyz: 180 0 {off.removesuffix(' mm')} mm}}")
    found = compiled(tmp_path, text)
    assert [message for _, message, _, _ in found.said] == said
    for frame in found.robot("bench").keyframes if not said else ():
        assert frame.q["pivot"] == pytest.approx(rocker_angle(frame.q["drive"]), abs=1e-12)
        assert frame.residual is not None and frame.residual[0] == pytest.approx(4e-8, abs=1e-12)


def test_hinges_with_another_axis_turn_in_closed_loops(tmp_path: Path) -> None:
    """The second `connect` of a hinge is on its axis: it moves 30 mm sideways in a quarter turn about another axis."""
    links = "".join(f"  {name}: {{frame: true, mass: 100 g, {BALL}, mounts: {{end: {{xyz: {end} mm}}}}}}\n" for name, end in (
        ("ground", "50 0 0"), ("left", "0 0 60"), ("bar", "50 0 0"), ("right", "0 0 60"),
    ))
    joints = "".join(
        f"  {name}: {{type: continuous, parent: {parent}, child: {child}, axis: [0, 1, 0], loop: {str(name == 'loop').lower()}}}\n"
        for name, parent, child in (
            ("a", "ground.origin", "left.origin"), ("b", "left.end", "bar.origin"), ("c", "ground.end", "right.origin"),
            ("loop", "bar.end", "right.end"),
        )
    )
    text = f"thingc: assembly/1\nname: parallel\ncomponents:\n{links}joints:\n{joints}poses: {{tilted: {{a: 70 deg}}}}\n"
    made = compiled(tmp_path, text + "modes: {bench: {root: ground, pose: tilted}}\n")
    model = made.model("bench")
    data = at_key(model, "tilted")
    assert data.joint("c").qpos[0] == pytest.approx(np.radians(70.0), abs=1e-9)
    assert equality_residual(data) < 1e-9
