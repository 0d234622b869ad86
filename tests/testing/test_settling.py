"""Settling in simulation, against falls and springs with a closed form."""

from __future__ import annotations

import math

import pytest

from testing.rig import HEAD, Workspace, two_links

DROP = HEAD + """\
components:
  block: {part: rig_parts:Block}
modes:
  falling: {root: block, base: free, at: {xyz: 0 0 60 mm}}
  lying: {root: block, base: free, at: {xyz: 0 0 10 mm}}
simulation: {timestep: 1 ms}
"""


def test_block_falls_and_comes_to_rest(rig: Workspace) -> None:
    """It falls by 50 mm in sqrt(2 h / g) = 0.101 s, so it cannot be at rest earlier."""
    answer = rig.test(DROP, "  falls: {settles: {mode: falling, within: 1 s, drift: 1 mm}}\n"
                            "  stays: {settles: {mode: [falling, lying], within: 1 s, drift: 1 mm, moved: 2 mm, penetration: 1 mm}}\n")
    found = answer["by_name"]["falls"]
    assert found["passed"] and found["measured"]["moved"] == pytest.approx(0.05, abs=0.001)
    assert math.sqrt(2 * 0.05 / 9.81) - 0.005 < found["measured"]["rest"] < 0.5
    assert [(r["name"], r["mode"], r["passed"]) for r in answer["tests"]] == [
        ("falls", "falling", True), ("stays", "falling", False), ("stays", "lying", True),
    ]
    assert len(answer["diagnostics"]) == 1 and answer["diagnostics"][0]["code"] == "TC657"
    message = answer["diagnostics"][0]["message"]
    assert "the distance between the start and the rest position (50" in message and "exceeds the maximum (2 mm)" in message


SUNK = HEAD + """\
components:
  post: {frame: true, mass: 10 g, inertia: {ixx: 1 g*m^2, iyy: 1 g*m^2, izz: 1 g*m^2}}
  block: {part: rig_parts:Block}
joints:
  lift:
    type: prismatic
    parent: post.origin
    child: block.origin
    limit: {lower: -20 mm, upper: 20 mm, effort: 50 N}
    dynamics: {damping: 10 N*s/m}
    drive: {kind: position, kp: 5000 N/m, effort: 50 N}
modes:
  sunk: {root: post, base: fixed}
simulation: {timestep: 1 ms}
"""


def test_resting_deep_inside_the_floor_fails(rig: Workspace) -> None:
    """A drive holds a block of 20 mm half in the floor: it is 10 mm deep, less the deflection of the drive. The document must explicitly
    allow such a depth."""
    answer = rig.test(SUNK, "  rests: {settles: {within: 1 s, drift: 1 mm}}\n"
                            "  soft: {settles: {within: 1 s, drift: 1 mm, penetration: 11 mm}}\n")
    rests, soft = answer["by_name"]["rests"], answer["by_name"]["soft"]
    assert (rests["passed"], soft["passed"]) == (False, True) and 0.006 < rests["measured"]["penetration"] < 0.01
    (said,) = answer["diagnostics"]
    assert said["code"] == "TC657" and "exceeds the maximum (5 mm)" in said["message"] and "on: floor" in said["help"]


def test_without_a_floor_the_robot_falls_forever(rig: Workspace) -> None:
    """In the second after the first it falls by g (2^2 - 1^2) / 2."""
    answer = rig.test(DROP, "  falls: {settles: {mode: falling, within: 1 s, drift: 1 mm, floor: false}}\n")
    found = answer["by_name"]["falls"]
    assert not found["passed"] and found["measured"]["rest"] is None
    assert found["measured"]["drift"] == pytest.approx(9.81 * 1.5, rel=0.01)
    assert "the drift of the robot after 1 s (147" in answer["diagnostics"][0]["message"]


def test_frictionless_pendulum_never_settles(rig: Workspace) -> None:
    text = two_links().replace("drive: {kind: position, kp: 5 N*m/rad, effort: 1 N*m}", "drive: {kind: motor, effort: 1 N*m}")
    answer = rig.test(text, "  rests: {settles: {within: 3 s, drift: 1 mm, floor: false}}\n")
    assert not answer["by_name"]["rests"]["passed"]


def test_position_drive_sags_by_torque_over_gain(rig: Workspace) -> None:
    """With kp 5 the elbow deflects by 0.024 g 30 mm / 5, and the shoulder by its torque / 5: the far end moves down by both."""
    text = two_links().replace("joints:\n", "defaults: {joint: {dynamics: {damping: 0.05 N*m*s/rad}}}\njoints:\n", 1)
    found = rig.test(text, "  sags: {settles: {within: 3 s, drift: 0.01 mm, floor: false}}\n")["by_name"]["sags"]
    elbow = 0.024 * 9.81 * 0.03 / 5
    shoulder = (0.04 * 0.05 + 0.024 * 0.13) * 9.81 / 5
    assert found["passed"]
    assert found["measured"]["moved"] == pytest.approx(0.16 * shoulder + 0.06 * elbow, rel=0.1)
