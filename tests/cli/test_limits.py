"""`thingc limits`: intervals whose ends are known from the geometry of two boxes, written to the document and proved by its tests."""

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
    """The angles [deg] between which the vane touches the pin: corners of the pin in the frame of the vane, which is along -y at 0."""
    angles = np.radians(np.arange(20.0, 40.0, 1e-4))
    corners = np.array([[31.234 + x, 17.1 + y] for x in (-0.25, 0.25) for y in (-0.25, 0.25)])
    y = np.cos(angles)[:, None] * corners[:, 1] - np.sin(angles)[:, None] * corners[:, 0]
    touching = np.degrees(angles[(y.min(axis=1) <= 0.1) & (y.max(axis=1) >= -0.1)])
    return 90.0 + float(touching[0]), 90.0 + float(touching[-1])


@pytest.mark.parametrize("resolution", ["0.25 deg", "0.01 deg"])
def test_the_ends_of_the_intervals_are_known(rig: Workspace, resolution: str) -> None:
    code, out, err = run("limits", str(rig.write(VANE)), "--resolution", resolution, "--format", "json")
    assert code == 0, out + err
    found: dict[str, Any] = json.loads(out)["joints"][0]
    (first, low), (high, last) = np.degrees(found["intervals"])
    begin, end = contact()
    width = float(resolution.split()[0])
    assert begin - width <= low <= begin and end <= high <= end + width and (first, last) == pytest.approx((-180.0, 180.0))
    assert np.degrees(found["free"]) == pytest.approx([first, low]) and found["contacts"] == [None, "pin and vane"]
    assert found["proved"] is True and found["resolution"] == pytest.approx(np.radians(width))


def test_limits_are_written_and_pass_the_test(rig: Workspace) -> None:
    document = rig.write(VANE)
    assert run("test", str(document))[0] == 1
    code, out, err = run("limits", str(document), "turn", "--write")
    assert code == 0, out + err
    written = document.read_text()
    upper = float(written.partition("upper: ")[2].partition(" deg")[0])
    assert contact()[0] - 0.26 <= upper <= contact()[0]
    assert written == VANE.replace("upper: 150 deg", f"upper: {upper:g} deg")
    assert run("test", str(document))[0] == 0


def test_pairs_of_joints(rig: Workspace) -> None:
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
    (["trun"], "there is no joint `trun` that can be moved"), (["--pose", "up"], "there is no pose `up`"),
    (["--resolution", "3 kg"], "--resolution"), (["--resolution", "fine"], "--resolution"), (["--resolution", "0 deg"], "--resolution"),
    (["--mode", "bnch"], "bnch"),
])
def test_wrong_command_lines(rig: Workspace, words: list[str], said: str) -> None:
    code, out, err = run("limits", str(rig.write(VANE)), *words)
    assert code in (1, 2) and said in out + err and (out + err).count("error[") == 1, out + err


def test_a_slide_without_limits(rig: Workspace) -> None:
    text = SLIDERS.replace("type: prismatic, parent: ground.slide, child: left.left, limit: {lower: -200 mm, upper: 200 mm}",
                           "type: cylindrical, parent: ground.slide, child: left.left")
    code, out, err = run("limits", str(rig.write(text.partition("poses:")[0] + "modes: {bench: {root: ground}}\n")))
    assert code in (1, 2) and "joint `one[1]` slides without limits" in out + err
