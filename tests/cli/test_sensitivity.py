"""`thingc sensitivity`: derivatives that match finite differences of `thingc info` and `thingc test`, in the units of the document."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import thingc
from thingc.base.units import parse_quantity
from thingc.tools.cli.main import main

INERTIA = "inertia: {ixx: 0.01 kg*m^2, iyy: 0.02 kg*m^2, izz: 0.015 kg*m^2}"
ROBOT = f"""\
thingc: assembly/1
name: crane
parameters:
  reach: {{value: 300 mm, min: 100 mm, max: 600 mm}}
  left: {{value: 20 mm}}
  load: 0.5 kg
  tilt: 10 deg
  pull: 8 N*m
  half: =reach / 2
  spare: false
components:
  post: {{frame: true, mass: 2 kg, {INERTIA}}}
  jib:
    link: true
    mass: =300 g/m * reach
    com: [=half, 0, 1 mm]
    {INERTIA}
    shapes: [{{box: ["=max(left, 20 mm)", 20 mm, 20 mm]}}]
    mounts: {{end: {{xyz: [=reach, 0, 0]}}}}
  weight: {{frame: true, mass: =load, at: {{in: jib.end}}}}
joints:
  lift:
    type: revolute
    parent: post.origin
    child: jib.origin
    axis: [0, 1, 0]
    turn: =tilt
    limit: {{lower: -90 deg, upper: 90 deg, effort: =pull}}
    drive: {{kind: motor, effort: =pull}}
mounts: {{hook: weight.origin}}
poses: {{level: {{lift: 0 deg}}, low: {{lift: 20 deg}}}}
modes: {{standing: {{root: post, base: fixed, pose: level}}, held: {{root: jib, base: held}}}}
tests:
  light: {{mass: {{max: 1 kg}}}}
  balance: {{centre: {{within: {{x: [-1 m, 1 m]}}}}}}
  holds: {{torque_margin: {{drive: lift, pose: [level, low], min: 2}}}}
  clear: {{no_collision: {{pose: all}}}}
"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("sensitivity")
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (folder / "crane.yaml").write_text(ROBOT)
    return str(folder / "crane.yaml")


def printed(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> tuple[str, str]:
    capsys.readouterr()
    assert main(["sensitivity", *words]) == code
    return capsys.readouterr()


def listed(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> dict[tuple[str, str], dict[str, Any]]:
    out, _ = printed(capsys, *words, "--format", "json", code=code)
    return {(one["result"], one["name"]): one for one in json.loads(out)["sensitivities"]}


def compiled(robot: str, name: str, value: float) -> dict[str, float]:
    made = thingc.compile(robot, parameters={name: value})
    whole = made.properties
    return {"mass": whole.mass, "inertia.yy": whole.inertia[1][1], **{f"centre.{x}": one for x, one in zip("xyz", whole.centre)}}


def measured_by_tests(robot: str, capsys: pytest.CaptureFixture[str], name: str, value: str) -> dict[str, float]:
    capsys.readouterr()
    main(["test", robot, "-p", f"{name}={value}", "--format", "json"])
    found: dict[str, float] = {}
    for one in json.loads(capsys.readouterr().out)["tests"]:
        measured = one["measured"]
        if one["name"] == "light":
            found["tests.light"] = measured["mass"]
        elif one["name"] == "balance":
            found.update((f"tests.balance.{axis}", value) for axis, value in zip("xyz", measured["centre"]))
        elif one["name"] == "holds":
            found[f"tests.holds.{one['pose']}"] = measured["margin"]
    return found


def test_derivatives_match_finite_differences(robot: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = listed(capsys, robot, "--of", "mass,com,inertia.yy")
    assert {name for _, name in found} == {"reach", "left", "load", "tilt", "pull"}  # `half` follows `reach`
    assert ("centre.z", "tilt") in found and ("inertia.xx", "load") not in found
    for name, at, step in (("reach", 0.3, 1e-3), ("load", 0.5, 1e-3), ("tilt", parse_quantity("10 deg").value, 1e-3)):
        before, after = compiled(robot, name, at - step), compiled(robot, name, at + step)
        for result, low in before.items():
            one = found[result, name]
            assert one["at"] == at and one["error"] == 0.0
            assert one["derivative"] == pytest.approx((after[result] - low) / (2.0 * step), rel=1e-5, abs=1e-9)


def test_test_measurements_are_results(robot: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = listed(capsys, robot, "--of", "tests.*", "--by", "reach,load,pull")
    names = {"tests.light", *(f"tests.balance.{axis}" for axis in "xyz"), "tests.holds.level", "tests.holds.low"}
    assert {result for result, _ in found} == names
    for name, values in (("reach", ("299 mm", "301 mm")), ("load", ("499 g", "501 g")), ("pull", ("7.99 N*m", "8.01 N*m"))):
        before, after = (measured_by_tests(robot, capsys, name, value) for value in values)
        step = parse_quantity(values[1]).value - parse_quantity(values[0]).value
        for result in names:
            one = found[result, name]
            assert one["error"] == 0.0 and one["value"] == pytest.approx((before[result] + after[result]) / 2.0, rel=1e-4, abs=1e-12)
            assert one["derivative"] == pytest.approx((after[result] - before[result]) / step, rel=1e-4, abs=1e-9)


def test_table_has_document_units_and_is_sorted_by_effect(robot: str, capsys: pytest.CaptureFixture[str]) -> None:
    out, _ = printed(capsys, robot, "--of", "mass,site:hook.z,box.y,tests.holds.low", "-p", "left=19 mm")
    rows = [line.split() for line in out.splitlines()[1:]]
    assert rows[0] == ["mass", "2.59", "kg", "load", "0.5", "kg", "1", "kg/kg", "exact", "+5", "g", "+0.19", "%"]
    assert rows[1] == ["reach", "300", "mm", "0.3", "g/mm", "exact", "+0.9", "g", "+0.035", "%"]
    assert rows[2][:6] == ["site:hook.z", "-52.09", "mm", "reach", "300", "mm"] and rows[2][6:8] == ["-0.1736", "mm/mm"]
    assert rows[3][:5] == ["tilt", "10", "deg", "-5.156", "mm/deg"]
    assert [row[-5:-4] for row in rows if "N*m" in row] == [["1/(N*m)"]] and out.endswith("no parameter changes box.y\n")


def test_settings_change_the_evaluation_point(robot: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = listed(capsys, robot, "--of", "centre.x", "-p", "reach=200 mm", "--set", "components.post.mass=1 kg")
    one = found["centre.x", "reach"]
    before, after = (
        thingc.compile(robot, parameters={"reach": reach}, choices={"components.post.mass": "1 kg"}).properties.centre[0]
        for reach in (0.199, 0.201)
    )
    assert one["at"] == 0.2 and one["derivative"] == pytest.approx((after - before) / 0.002, rel=1e-5)
    held = listed(capsys, robot, "--of", "torque_margin", "--by", "joints.lift.limit.effort", "--mode", "standing")
    assert list(held) == [("torque_margin", "joints.lift.limit.effort")]


def test_missing_derivative_is_an_error_at_the_parameter(robot: str, capsys: pytest.CaptureFixture[str]) -> None:
    out, err = printed(capsys, robot, "--of", "box.x,mass", code=1)
    assert "does not exist" in out and "1 kg/kg" in out
    assert "error[TC906]: `box.x` is not differentiable at left = 0.02 m" in err and "crane.yaml:5:17" in err and "help: choose" in err
    out, _ = printed(capsys, robot, "--of", "box.x", "-p", "left=21 mm")
    assert out.splitlines()[1].split()[3:8] == ["left", "21", "mm", "0.9848", "mm/mm"] and "cos" not in out


@pytest.mark.parametrize(("words", "message"), [
    (["--of", "mas"], "there is no result `mas`\n  help: did you mean `mass`?"),
    (["--of", "tests.clear"],
     "`tests.clear` has no derivatives (kind `no_collision`)\n"
     "  help: remove `tests.clear`"),
    (["--of", "tests.heavy"], "there is no test `heavy`\n  help: known tests: "),
    (["--of", "tests.holds.hig"], "there is no result `tests.holds.hig`\n  help: did you mean"),
    (["--of", "site:hok.z"], "there is no mount `hok`"),
    (["--of", "mass,,box"], "expected names separated by commas, found `mass,,box`"),
    (["--by", "lod"], "the document has no number `lod`\n  help: did you mean `load`?"),
    (["--by", "spare"], "expected a number as the value of `spare`, found `false`\n  help: remove `spare`"),
    (["--mode", "walking"], "`crane` has no mode `walking`"),
    (["-p", "reach=2 m"], "parameter `reach` must be at most 600 mm, found `2000 mm`"),
])
def test_invalid_command_lines_are_explained(robot: str, capsys: pytest.CaptureFixture[str], words: list[str], message: str) -> None:
    out, err = printed(capsys, robot, *words, code=2)
    assert message in err and "Traceback" not in err and not out


def test_document_errors_are_shown(robot: str, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = Path(robot).with_name("wrong.yaml")
    wrong.write_text(ROBOT.replace("child: jib.origin", "child: jb.origin"))
    out, err = printed(capsys, str(wrong), code=1)
    assert "this document has no component `jb`" in err and not out
