"""Calibrations are checked against the robot, and written so that other programs compute the same encoder values."""

from __future__ import annotations

import json
import math
import random
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from thingc.tools.cli.main import main

BODY = "frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}"
ROBOT = f"""\
thingc: assembly/1
name: arm
components: {{a: {{{BODY}}}, b: {{{BODY}}}, c: {{{BODY}}}, d: {{{BODY}}}, e: {{{BODY}}}, f: {{{BODY}}}}}
joints:
  pan:
    type: revolute
    parent: a.origin
    child: b.origin
    limit: {{lower: -90 deg, upper: 120 deg}}
    drive: {{kind: position, kp: 1 N*m/rad}}
  lift: {{type: revolute, parent: b.origin, child: c.origin, limit: {{lower: 10 deg, upper: 100 deg}}}}
  slide: {{type: prismatic, parent: c.origin, child: d.origin, limit: {{lower: -5 mm, upper: 80 mm}}}}
  geared: {{type: revolute, parent: d.origin, child: e.origin, mimic: {{joint: lift}}}}
  wheel: {{type: continuous, parent: a.origin, child: f.origin}}
"""
GOOD = """\
thingc: calibration/1
joints:
  pan: {id: 1, model: sts3215, offset: 2100, sign: -1, ticks_per_turn: 4096}
  lift: {id: 2, model: sts3215, offset: 3900, ticks_per_turn: 4096}
  wheel: {id: 7, model: xl330, offset: 12, ticks_per_turn: 4096}
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "arm.yaml").write_text(ROBOT)
    return tmp_path


def emitted(here: Path, form: str, text: str = GOOD) -> str:
    (here / "left.calibration.yaml").write_text(text)
    assert main(["calibration", "arm.yaml", "left.calibration.yaml", "--emit", form, "-o", "out"]) == 0
    return (here / "out").read_text()


def test_the_motor_of_lerobot_reports_the_ticks_of_each_angle(here: Path) -> None:
    """Feetech motors report the encoder value minus `Homing_Offset`, modulo one turn; LeRobot measures from the middle of the range."""
    motors = json.loads(emitted(here, "lerobot"))
    assert list(motors) == ["pan", "lift", "wheel"]
    assert {name: (one["id"], one["drive_mode"]) for name, one in motors.items()} == {"pan": (1, 1), "lift": (2, 0), "wheel": (7, 0)}
    limits = {"pan": (-90.0, 120.0, 2100, -1), "lift": (10.0, 100.0, 3900, 1)}
    for name, (lower, upper, offset, sign) in limits.items():
        one = motors[name]
        assert 0 <= one["range_min"] < one["range_max"] <= 4095 and -2048 <= one["homing_offset"] <= 2047
        draw = random.Random(1)
        for q in (lower, upper, *(draw.uniform(lower, upper) for _ in range(20))):
            actual = round(offset + sign * q * 4096 / 360) % 4096
            present = (actual - one["homing_offset"]) % 4096
            assert one["range_min"] - 1 <= present <= one["range_max"] + 1
            degrees = (present - (one["range_min"] + one["range_max"]) / 2) * 360 / 4095
            assert degrees == pytest.approx(sign * (q - (lower + upper) / 2), abs=0.25)
    assert (motors["wheel"]["range_min"], motors["wheel"]["range_max"], motors["wheel"]["homing_offset"]) == (0, 4095, 0)


def test_the_motors_of_lerobot(here: Path) -> None:
    assert json.loads(emitted(here, "lerobot_motors")) == {
        "pan": {"id": 1, "model": "sts3215", "norm_mode": "degrees"}, "lift": {"id": 2, "model": "sts3215", "norm_mode": "degrees"},
        "wheel": {"id": 7, "model": "xl330", "norm_mode": "degrees"},
    }


def test_reversed_motors_of_lerobot_are_reported(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """LeRobot computes degrees as `(value - middle) * 360 / most`, without `drive_mode`, so the angle increases with the encoder value."""
    for form in ("lerobot", "lerobot_motors"):
        emitted(here, form)
        found = capsys.readouterr().err
        assert found.count("warning[TC801]") == 1 and "moves joint `pan` in the wrong direction" in found
        assert "--> left.calibration.yaml:3:" in found
        command = re.search("`thingc (rezero .*)`", found)
    emitted(here, "python")
    assert capsys.readouterr().err == ""
    assert main(["calibration", "arm.yaml", "left.calibration.yaml", "--emit", "lerobot", "-o", "strict", "--strict"]) == 2
    assert not (here / "strict").exists()
    assert command is not None and main(command[1].split()) == 0
    capsys.readouterr()
    emitted(here, "lerobot", (here / "left.calibration.yaml").read_text())
    assert capsys.readouterr().err == ""


def test_python(here: Path) -> None:
    text = GOOD + "  slide: {id: 9, offset: 500, resolution: 0.01 mm, range: [0, 8500]}\n"
    read: dict[str, Any] = {}
    exec(emitted(here, "python", text), read)
    joints = read["JOINTS"]
    assert list(joints) == ["pan", "lift", "wheel", "slide"]
    assert joints["slide"] == {
        "id": 9, "model": None, "sign": 1, "offset": 500, "ticks_per_unit": pytest.approx(1e5), "range": (0, 8500),
        "limits": (-0.005, 0.08),
    }
    pan = joints["pan"]
    for q in pan["limits"]:
        assert min(abs(pan["offset"] + pan["sign"] * q * pan["ticks_per_unit"] - end) for end in pan["range"]) <= 0.5


def test_a_resolution_can_be_an_expression(here: Path) -> None:
    read: dict[str, Any] = {}
    exec(emitted(here, "python", GOOD.replace("ticks_per_turn: 4096}\n  wheel", "resolution: =360 deg / 4096 / 50}\n  wheel")), read)
    assert read["JOINTS"]["lift"]["ticks_per_unit"] == pytest.approx(4096 * 50 / (2 * math.pi))


def test_joint_without_limits_has_no_range_if_its_encoder_counts_turns(here: Path) -> None:
    read: dict[str, Any] = {}
    exec(emitted(here, "python", GOOD.replace("offset: 12, ticks_per_turn: 4096", "offset: 12, resolution: 0.1 deg")), read)
    assert read["JOINTS"]["wheel"]["range"] is None and read["JOINTS"]["pan"]["range"] == (735, 3124)


def test_no_input_is_overwritten(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "left.calibration.yaml").write_text(GOOD)
    for name, text in (("arm.yaml", ROBOT), ("left.calibration.yaml", GOOD)):
        assert main(["calibration", "arm.yaml", "left.calibration.yaml", "--emit", "python", "-o", f"./{name}"]) == 2
        assert f"`./{name}` is an input file" in capsys.readouterr().err
        assert (here / name).read_text() == text
    assert main(["calibration", "arm.yaml", "left.calibration.yaml", "-o", "out"]) == 2
    assert "-o requires --emit" in capsys.readouterr().err
    assert main(["calibration", "arm.yaml", "lft.calibration.yaml"]) == 2
    assert "did you mean `left.calibration.yaml`?" in capsys.readouterr().err


def test_ros2_control(here: Path) -> None:
    block = ET.fromstring(emitted(here, "ros2_control"))
    names = [one.get("name") for one in block.findall("joint")]
    assert (block.tag, names) == ("ros2_control", ["pan", "lift", "slide", "geared", "wheel"])
    pan = next(one for one in block.findall("joint") if one.get("name") == "pan")
    params = {one.get("name"): float(one.text or "") for one in pan.findall("param")}
    assert params["id"] == 1 and params["offset"] == 2100 and params["sign"] == -1
    assert params["ticks_per_unit"] == pytest.approx(4096 / (2 * math.pi))
    assert {one.get("name"): float(one.text or "") for one in pan.findall("command_interface/param")} == {
        "min": pytest.approx(-math.pi / 2), "max": pytest.approx(2 * math.pi / 3),
    }
    assert block.findall("joint[@name='slide']/param") == []


ONE_TURN = "id: 3, offset: 0, ticks_per_turn: 4096"


@pytest.mark.parametrize(("entry", "code", "said"), [
    ("elbow: {id: 3, offset: 0, ticks_per_turn: 4096}", "TC304", "the robot has no joint `elbow`"),
    ("geared: {id: 3, offset: 0, ticks_per_turn: 4096}", "TC338", "joint `geared` cannot have a motor (mimics `lift`)"),
    ("lift: {id: 1, offset: 0, ticks_per_turn: 4096}", "TC212", "joints `pan` and `lift` have the same motor `id: 1`"),
    ("lift: {id: 254, offset: 0, ticks_per_turn: 4096}", "TC208", "from 0 to 253, found 254"),
    ("lift: {id: -1, offset: 0, ticks_per_turn: 4096}", "TC208", "from 0 to 253, found -1"),
    ("lift: {id: 3, offset: 4096, ticks_per_turn: 4096}", "TC212", "an encoder value from 0 to 4095, found 4096"),
    ("lift: {id: 3, offset: -1, ticks_per_turn: 4096}", "TC212", "an encoder value from 0 to 4095, found -1"),
    ("lift: {id: 3, offset: 0, ticks_per_turn: 1}", "TC208", "from 2 to 4294967296, found 1"),
    (f"lift: {{{ONE_TURN}, range: [100, 1100]}}", "TC315", "beyond the lower limit of joint `lift` (10 deg)"),
    (f"lift: {{{ONE_TURN}, range: [120, 1200]}}", "TC315", "the position at 1200 ticks (105.469 deg) is beyond the upper limit"),
    (f"lift: {{{ONE_TURN}, sign: -1, range: [120, 1100]}}", "TC315", "the position at 120 ticks (-10.5469 deg) is beyond the lower"),
    (f"lift: {{{ONE_TURN}, range: [1100, 120]}}", "TC212", "must increase, found 1100 and 120"),
    (f"lift: {{{ONE_TURN}, range: [120, 5000]}}", "TC212", "an encoder value from 0 to 4095, found 5000"),
    ("slide: {id: 3, offset: 0, ticks_per_turn: 4096}", "TC314", "requires a rotating joint, found `slide`"),
    ("slide: {id: 3, offset: 0, resolution: 1 deg}", "TC314", "of joint `slide` must be a length, found `1 deg`"),
    ("slide: {id: 3, offset: 0, resolution: -1 mm}", "TC208", "expected an angle or a length of at least 1e-12 in SI units, found `-1 mm`"),
    ("slide: {id: 3, offset: 0, resolution: 1e-320 mm}", "TC208", "expected an angle or a length of at least 1e-12 in SI units"),
    ("slide: {id: 3, offset: 0, resolution: =lead / 4096}", "TC209", "lead"),
    ("lift: {id: 3, offset: 0}", "TC212", "requires exactly one of `ticks_per_turn` and `resolution`, found none"),
    (f"lift: {{{ONE_TURN}, resolution: 1 deg}}", "TC212", "found both"),
    ("lift: {id: 3, offset: 0.5, ticks_per_turn: 4096}", "TC203", "expected a whole number, found the number `0.5`"),
    ("lift: {id: 3, offset: 0, sign: 2, ticks_per_turn: 4096}", "TC204", "expected `1` or `-1`, found the number `2`"),
    ("lift: {id: 3, offset: 0, sign: 1.0, ticks_per_turn: 4096}", "TC204", "expected `1` or `-1`, found the number `1.0`"),
    ("lift: {id: 3, offset: 0, sign: true, ticks_per_turn: 4096}", "TC204", "expected `1` or `-1`, found `true`"),
    ("lift: {id: 3, offset: 0, tick_per_turn: 4096}", "TC201", "`tick_per_turn`"),
    ("lift: {offset: 0, ticks_per_turn: 4096}", "TC202", "`id`"),
])
def test_errors_are_at_their_lines(here: Path, entry: str, code: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "left.calibration.yaml").write_text("\n".join(GOOD.splitlines()[:3]) + f"\n  {entry}\n")
    assert main(["calibration", "arm.yaml", "left.calibration.yaml", "--emit", "lerobot", "-o", "out", "--format", "json"]) == 1
    found, *_ = (one for one in json.loads(capsys.readouterr().out)["diagnostics"] if one["severity"] == "error")
    assert (found["code"], found["file"], found["line"]) == (code, "left.calibration.yaml", 4) and said in found["message"], found
    assert not (here / "out").exists()


def test_check_reports_errors_that_do_not_depend_on_the_robot(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "left.calibration.yaml").write_text("""\
thingc: calibration/1
joints:
  pan: {id: 1, offset: 9, ticks_per_turn: 0}
  lift: {id: 3, sign: true, offset: 4, ticks_per_turn: 8}
  wheel: {id: 3, offset: 9, ticks_per_turn: 8, range: [3, 2]}
""")
    assert main(["check", "left.calibration.yaml", "--format", "json"]) == 1
    found = [(one["code"], one["line"]) for one in json.loads(capsys.readouterr().out)["diagnostics"]]
    assert found == [("TC208", 3), ("TC204", 4), ("TC212", 5), ("TC212", 5)], found
    twice = GOOD.replace("id: 7", "id: 2")
    (here / "left.calibration.yaml").write_text(twice)
    assert main(["check", "left.calibration.yaml"]) == 1
    assert "joints `lift` and `wheel` have the same motor `id: 2`" in "".join(capsys.readouterr())


def test_too_small_encoder(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "arm.yaml").write_text(ROBOT.replace("lower: -90 deg, upper: 120 deg", "lower: -200 deg, upper: 200 deg"))
    (here / "left.calibration.yaml").write_text(GOOD)
    assert main(["calibration", "arm.yaml", "left.calibration.yaml"]) == 1
    assert "the range of joint `pan` (4552 ticks) exceeds the range of the encoder (4096 ticks)" in capsys.readouterr().err


def test_format_limitations(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = GOOD + "  slide: {id: 9, offset: 500, resolution: 0.01 mm}\n"
    (here / "left.calibration.yaml").write_text(text)
    refused = (("lerobot", "does not support the `resolution`"), ("lerobot_motors", "requires the motor model of joint `slide`"))
    for form, words in refused:
        assert main(["calibration", "arm.yaml", "left.calibration.yaml", "--emit", form]) == 2
        assert words in capsys.readouterr().err


def test_other_commands_know_the_document(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "left.calibration.yaml").write_text(GOOD)
    assert main(["check", "left.calibration.yaml"]) == 0
    assert main(["check", "."]) == 0 and main(["fmt", "--check", "left.calibration.yaml"]) == 0
    assert main(["calibration", "arm.yaml", "left.calibration.yaml"]) == 0
    assert "left.calibration.yaml: ok, 3 motors\n" in capsys.readouterr().out
    assert main(["build", "left.calibration.yaml"]) == 1
    assert "found `calibration`" in "".join(capsys.readouterr())
    assert main(["calibration", "arm.yaml", "arm.yaml"]) == 1
    said = "".join(capsys.readouterr())
    assert "expected a document of kind `calibration`, found `assembly`" in said and "use `thingc calibration ROBOT FILE`" in said


def test_rezero_keeps_the_encoder_values_of_all_positions(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The encoder value at a physical position does not change. `q` of the old robot is `zero + q` or `zero - q` of the new robot."""
    text = GOOD + "  slide: {id: 4, offset: 500, sign: -1, resolution: 0.02 mm}\n"
    (here / "left.calibration.yaml").write_text(text)
    (here / "other.yaml").write_text("thingc: calibration/1\njoints: {pan: {id: 1, offset: 7, ticks_per_turn: 100}}\n")
    (here / "duo.yaml").write_text("thingc: calibration/1\njoints: {left.lift: {id: 1, offset: 7, ticks_per_turn: 100}}\n")
    (here / "unrelated.yaml").write_text("thingc: calibration/1\njoints: {thumb: {id: 1, offset: 7, ticks_per_turn: 100}}\n")
    old = table(here)
    words = ["pan=-90 deg", "lift=30 deg", "slide=-7 mm", "--flip", "lift", "--flip", "slide", "--calibration", "left.calibration.yaml"]
    assert main(["rezero", "arm.yaml", *words, "--diff"]) == 0
    assert "+++ left.calibration.yaml" in capsys.readouterr().out and (here / "left.calibration.yaml").read_text() == text
    assert main(["rezero", "arm.yaml", *words]) == 0
    out = capsys.readouterr().out
    assert "left.calibration.yaml: joints.slide.offset: 500 -> 850" in out, out
    assert "the calibration `other.yaml` of the same joints was not changed" in out and "--calibration other.yaml" in out, out
    assert "the calibration `duo.yaml` of the same joints was not changed" in out  # the calibration of a robot that nests the arm
    assert "unrelated" not in out
    new = table(here)
    assert new["wheel"] == old["wheel"]
    moves = {"pan": (1, math.radians(-90)), "lift": (-1, math.radians(30)), "slide": (-1, -0.007)}
    for name, (sign, zero) in moves.items():
        for q in (-0.003, 0.0, 0.05):
            before, after = (one["offset"] + one["sign"] * at * one["ticks_per_unit"] for one, at in (
                (old[name], q), (new[name], sign * q + zero),
            ))
            assert abs(apart(name, before, after)) <= 0.5, (name, q, before, after)
        assert all(abs(apart(name, *ends)) <= 1 for ends in zip(old[name]["range"], new[name]["range"], strict=True))


def test_rezero_writes_nothing_if_the_new_calibration_has_errors(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The measured range of an encoder with one turn does not fit a zero at the other side of the turn."""
    text = "thingc: calibration/1\njoints:\n  pan: {id: 1, offset: 1000, ticks_per_turn: 4096, range: [10, 2300]}\n"
    (here / "left.calibration.yaml").write_text(text)
    assert main(["rezero", "arm.yaml", "pan=120 deg", "--calibration", "left.calibration.yaml"]) != 0
    assert "--> left.calibration.yaml:3:" in capsys.readouterr().out
    assert ((here / "arm.yaml").read_text(), (here / "left.calibration.yaml").read_text()) == (ROBOT, text)


def apart(name: str, one: float, other: float) -> float:
    """Return the difference of two encoder values. The encoders of rotations have one turn."""
    return other - one if name == "slide" else (other - one + 2048) % 4096 - 2048


def table(here: Path) -> dict[str, dict[str, Any]]:
    """Return the motors of the calibration, as thingc exports them to Python."""
    assert main(["calibration", "arm.yaml", "left.calibration.yaml", "--emit", "python", "-o", "out.py"]) == 0
    names: dict[str, Any] = {}
    exec((here / "out.py").read_text(), names)
    joints: dict[str, dict[str, Any]] = names["JOINTS"]
    return joints
