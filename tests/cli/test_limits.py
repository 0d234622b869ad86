"""`thingc limits`: intervals with ends known from the geometry of two boxes, written to the document and confirmed by its tests."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from testing.rig import HEAD, SLIDERS, Workspace
from thingc.tools.cli.main import main

VANE = HEAD + """\
components:
  ground: {frame: true, mounts: {hinge: {}}}
  pin: {part: rig_parts:Block, params: {x: 0.5 mm, y: 0.5 mm, z: 10 mm}, at: {in: ground.origin, xyz: 31.234 17.1 0 mm}}
  hub: {part: rig_parts:Block, params: {x: 4 mm, y: 4 mm, z: 2 mm}}
  vane: {part: rig_parts:Block, params: {x: 40 mm, y: 0.2 mm, z: 2 mm}, at: {in: hub.origin, xyz: 20 0 0 mm}}
joints:
  turn: {type: revolute, parent: ground.hinge, child: hub.origin, limit: {lower: -90 deg, upper: 150 deg}}   # as far as it goes
modes: {bench: {root: ground}}
allow: {TC610: "they lie in the floor"}
tests: {clear: {no_collision: {joints: all, certify: true}}}
"""


@pytest.fixture
def rig(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path)


def run(*words: str) -> tuple[int, str, str]:
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = main(list(words))
    return code, out.getvalue(), err.getvalue()


def contact() -> tuple[float, float]:
    """Return the angles [deg] between which the vane touches the pin, from the corners of the pin in the frame of the vane, which is
    along -y at 0."""
    angles = np.radians(np.arange(20.0, 40.0, 1e-4))
    corners = np.array([[31.234 + x, 17.1 + y] for x in (-0.25, 0.25) for y in (-0.25, 0.25)])
    y = np.cos(angles)[:, None] * corners[:, 1] - np.sin(angles)[:, None] * corners[:, 0]
    touching = np.degrees(angles[(y.min(axis=1) <= 0.1) & (y.max(axis=1) >= -0.1)])
    return 90.0 + float(touching[0]), 90.0 + float(touching[-1])


@pytest.mark.parametrize("resolution", ["0.25 deg", "0.01 deg"])
def test_interval_ends_match_the_geometry(rig: Workspace, resolution: str) -> None:
    code, out, err = run("limits", str(rig.write(VANE)), "--resolution", resolution, "--format", "json")
    assert code == 0, out + err
    found: dict[str, Any] = json.loads(out)["joints"][0]
    ((low, high),) = np.degrees(found["intervals"])
    begin, end = contact()
    width = float(resolution.split()[0])
    assert begin - width <= high <= begin and end <= low + 360.0 <= end + width
    assert found["free"] == found["intervals"][0] and found["contacts"] == ["pin and vane"] * 2
    assert found["proved"] is True and found["resolution"] == pytest.approx(np.radians(width))


def searched(rig: Workspace, text: str) -> dict[str, Any]:
    code, out, err = run("limits", str(rig.write(text)), "turn", "--format", "json")
    assert code == 0, out + err
    found: dict[str, Any] = json.loads(out)["joints"][0]
    return found


def posed(text: str, angle: float) -> str:
    return text.replace("{root: ground}", "{root: ground, pose: home}").replace("modes:", f"poses: {{home: {{turn: {angle} deg}}}}\nmodes:")


@pytest.mark.parametrize("home", [-85.0, -61.0, -60.0, -59.0, -58.0, -55.0, 30.0, 117.0, 124.0, 145.0])
def test_one_interval_is_found_from_every_pose(rig: Workspace, home: float) -> None:
    """The searched turn ends 180 deg from the pose: far from the pin, just before it (-61 deg), in contact with it, and just after it."""
    found, (begin, end) = searched(rig, posed(VANE, home)), contact()
    ((low, high),) = np.degrees(found["intervals"])
    turn = 360.0 if home < begin else 0.0
    assert end - 1e-6 <= low + turn <= end + 0.25 and begin - 0.25 <= high - 360.0 + turn <= begin + 1e-6
    assert low <= home <= high and found["free"] == found["intervals"][0] and found["contacts"] == ["pin and vane"] * 2


def test_interval_ends_at_a_contact_that_is_approached_slowly(rig: Workspace) -> None:
    """A ball on a circle grazes a wall: the gap is only 0.02 mm 1.1 deg before the contact, and proofs of longer steps fail."""
    body = "frame: true, mass: 1 kg, inertia: {ixx: 1 g*m^2, iyy: 1 g*m^2, izz: 1 g*m^2}"
    text = HEAD + f"""\
components:
  wall: {{link: true, mass: 1 kg, shapes: [{{box: 10 300 50 mm, at: {{xyz: 114.98 0 0 mm}}}}]}}
  carrier: {{{body}}}
  arm: {{link: true, mass: 1 kg, shapes: [{{sphere: {{radius: 10 mm}}, at: {{xyz: 100 0 0 mm}}}}]}}
joints:
  lift: {{type: prismatic, parent: wall.origin, child: carrier.origin, axis: [0, 0, 1], limit: {{lower: 0, upper: 1 mm}}}}
  turn: {{type: continuous, parent: carrier.origin, child: arm.origin, axis: [0, 0, 1]}}
poses: {{home: {{turn: 90 deg}}}}
modes: {{bench: {{root: wall, pose: home}}}}
"""
    ((low, high),) = np.degrees(searched(rig, text)["intervals"])
    contact = np.degrees(np.arccos(0.9998))
    assert contact <= low <= contact + 0.25 and contact <= 360.0 - high <= contact + 0.25


def test_second_pin_splits_the_range(rig: Workspace) -> None:
    """A second pin, opposite to the first, leaves two intervals. One of them crosses the end of the searched turn."""
    text = VANE.replace("  hub:", "  post: {part: rig_parts:Block, params: {x: 0.5 mm, y: 0.5 mm, z: 10 mm}, "
                        "at: {in: ground.origin, xyz: -31.234 -17.1 0 mm}}\n  hub:", 1)
    begin, end = contact()
    found = searched(rig, posed(text, 60.0))
    assert np.degrees(found["intervals"]) == pytest.approx(np.array([(end - 360.0, begin - 180.0), (end - 180.0, begin)]), abs=0.25)
    assert found["contacts"] == ["post and vane", "pin and vane"]
    assert "(1 more)" in run("limits", str(rig.write(posed(text, 60.0))))[1]


def test_pose_in_contact_has_no_free_interval(rig: Workspace) -> None:
    thick = VANE.replace("x: 0.5 mm, y: 0.5 mm", "x: 4 mm, y: 4 mm").replace("y: 0.2 mm", "y: 4 mm")
    found = searched(rig, posed(thick, 118.7))
    assert found["free"] is None and len(found["intervals"]) == 1
    assert "touches in the pose (1 more)" in run("limits", str(rig.write(posed(thick, 118.7))))[1]


def test_joint_without_compared_parts_is_not_proved(rig: Workspace) -> None:
    body = "frame: true, mass: 1 kg, inertia: {ixx: 1 g*m^2, iyy: 1 g*m^2, izz: 1 g*m^2}"
    text = HEAD + f"components: {{a: {{frame: true}}, b: {{{body}}}, c: {{{body}}}}}\njoints:\n" + "".join(
        f"  {name}: {{type: revolute, parent: {parent}.origin, child: {child}.origin, limit: {{lower: -90 deg, upper: 90 deg}}}}\n"
        for name, parent, child in (("turn", "a", "b"), ("bend", "b", "c"))
    )
    found = searched(rig, text)
    assert found["proved"] is False and found["compared"] == 0
    out = run("limits", str(rig.write(text)), "--pairs")[1]
    assert out.count("no parts compared") == 3 and "proved" not in out and "sampled" not in out


def test_joint_without_contacts_is_free_for_one_turn(rig: Workspace) -> None:
    found = searched(rig, posed(VANE.replace("31.234 17.1 0 mm", "31.234 57.1 0 mm"), 100.0))
    assert np.degrees(found["intervals"]) == pytest.approx(np.array([(-80.0, 280.0)])) and found["contacts"] == [None, None]


@pytest.mark.parametrize(("polynomial", "intervals"), [("[0 deg, 0.75]", 2), ("[0 deg, -1]", 1), ("[0 deg, 0, 0.3 rad^-1]", 3)])
def test_gear_intervals_join_only_for_integer_ratios(rig: Workspace, polynomial: str, intervals: int) -> None:
    """The vane follows a wheel. After one turn of the wheel, the vane is elsewhere unless the ratio is an integer."""
    text = VANE.replace("mounts: {hinge: {}}", "mounts: {hinge: {}, far: {xyz: 0 0 50 mm}}").replace(
        "joints:\n  turn:",
        "  wheel: {part: rig_parts:Block}\njoints:\n  turn: {type: continuous, parent: ground.far, child: wheel.origin}\n"
        f"  follow: {{type: continuous, parent: ground.hinge, child: hub.origin, mimic: {{joint: turn, polynomial: {polynomial}}}}}\n  #",
    )
    found = searched(rig, text)
    assert len(found["intervals"]) == intervals, found
    if intervals > 1:
        assert np.degrees([found["intervals"][0][0], found["intervals"][-1][1]]) == pytest.approx([-180.0, 180.0])


def test_written_limits_pass_the_test(rig: Workspace) -> None:
    document = rig.write(VANE)
    assert run("test", str(document))[0] == 1
    code, out, err = run("limits", str(document), "turn", "--write")
    assert code == 0, out + err
    written = document.read_text()
    upper = float(written.partition("upper: ")[2].partition(" deg")[0])
    assert contact()[0] - 0.26 <= upper <= contact()[0]
    assert written == VANE.replace("upper: 150 deg", f"upper: {upper:g} deg, source: geometry")
    assert run("test", str(document))[0] == 0


def test_limits_are_not_widened(rig: Workspace) -> None:
    document = rig.write(VANE.replace("upper: 150 deg", "upper: 30 deg"))
    code, out, err = run("limits", str(document), "turn", "--write")
    assert code == 0 and "proved to 0.25 deg" in out, out + err
    assert "upper: 30 deg" in document.read_text() and "source" not in document.read_text()
    document.write_text(VANE.replace("limit: {lower: -90 deg, upper: 150 deg}", "dynamics: {damping: 0}").replace("revolute", "continuous"))
    code, out, err = run("limits", str(document), "turn", "--write")
    assert code == 2 and "help: use `type: revolute`" in out + err


LINKS = HEAD + """\
components:
  ground: {link: true, mass: 1 kg, shapes: [{box: 100 20 10 mm}], mounts: {slide: {}}}
  stop: {link: true, mass: 1 kg, shapes: [{box: 10 10 10 mm, at: {xyz: 50 0 20 mm}}], at: {in: ground.origin}}
  other: {link: true, mass: 1 kg, shapes: [{box: 10 10 10 mm, at: {xyz: -50 0 20 mm}}]}
  cart: {link: true, mass: 1 kg, shapes: [{box: 10 10 10 mm, at: {xyz: 0 0 20 mm}}]}
joints:
  apart: {type: prismatic, parent: ground.slide, child: other.origin, axis: [0, 0, 1], limit: {lower: 0, upper: 5 mm}}
  drive: {type: prismatic, parent: ground.slide, child: cart.origin, axis: [1, 0, 0], limit: {lower: -30 mm, upper: 60 mm}}
modes: {bench: {root: ground}}
"""


def test_pairs_that_are_not_compared_are_listed(rig: Workspace) -> None:
    """The cart drives through the stop, but the shapes of links that a joint connects are not compared: the interval is not proved."""
    document = str(rig.write(LINKS))
    found = json.loads(run("limits", document, "drive", "--format", "json")[1])["joints"][0]
    assert found["skipped"] == {"shapes of links are approximate": ["ground and cart", "stop and cart"]}
    assert found["proved"] is False and found["free"] == pytest.approx([-0.03, 0.06])
    out = run("limits", document, "--pairs")[1]
    words = ", 2 pairs skipped (shapes of links are approximate: ground and cart, ...)"
    assert words.removeprefix(", ") in out and "proved" not in out
    assert "4 pairs skipped" in out.splitlines()[-1]


def test_limits_of_nested_documents_are_reported_as_not_written(rig: Workspace) -> None:
    (rig.folder / "inner.yaml").write_text(VANE.partition("modes:")[0])
    text = "thingc: assembly/1\nname: outer\ncomponents: {inner: {assembly: inner.yaml}}\nmodes: {bench: {root: inner.ground}}\n"
    document = rig.folder / "outer.yaml"
    document.write_text(text)
    code, out, err = run("limits", str(document), "--write")
    assert code == 0 and "inner.pin and inner.vane" in out, out + err
    assert "note: the limits of joints in nested documents are not written (`inner.turn`)" in err
    assert document.read_text() == text


def test_pairs_of_joints_are_checked(rig: Workspace) -> None:
    code, out, err = run("limits", str(rig.write(SLIDERS)), "--pairs", "--format", "json")
    assert code == 0, out + err
    pairs = json.loads(out)["pairs"]
    assert [(one["joints"], one["verdict"], one["contact"]) for one in pairs] == [(["one", "two"], "touches", "left and right")]
    text = SLIDERS.replace("two: {type: prismatic, parent: ground.slide, child: right.left, limit: {lower: -200", "two: {type: prismatic, "
                           "parent: ground.slide, child: right.left, limit: {lower: 240")
    code, out, _ = run("limits", str(rig.write(text.replace("upper: 200 mm}}\nposes", "upper: 300 mm}}\nposes").partition("poses:")[0]
                                     + "modes: {bench: {root: ground}}\n")), "--pairs")
    assert code == 0 and "one and two  clear" in out


@pytest.mark.parametrize(("words", "said"), [
    (["trun"], "there is no movable joint `trun`"), (["--pose", "up"], "there is no pose `up`"),
    (["--resolution", "3 kg"], "--resolution"), (["--resolution", "fine"], "--resolution"), (["--resolution", "0 deg"], "--resolution"),
    (["--resolution", "1 m"], "expected an angle, found `1 m`"),
    (["--mode", "bnch"], "bnch"),
])
def test_invalid_command_lines(rig: Workspace, words: list[str], said: str) -> None:
    code, out, err = run("limits", str(rig.write(VANE)), *words)
    assert code in (1, 2) and said in out + err and (out + err).count("error[") == 1, out + err


def test_slide_without_limits_is_an_error(rig: Workspace) -> None:
    text = SLIDERS.replace("type: prismatic, parent: ground.slide, child: left.left, limit: {lower: -200 mm, upper: 200 mm}",
                           "type: cylindrical, parent: ground.slide, child: left.left")
    code, out, err = run("limits", str(rig.write(text.partition("poses:")[0] + "modes: {bench: {root: ground}}\n")))
    assert code in (1, 2) and "the sliding joint `one[1]` has no limits" in out + err
