"""`thingc diff` of robots that are the same mechanism lists only changes that other frames, joint zeros and signs do not explain."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from thingc.tools.cli.main import main

ARM = """\
<robot name="arm">
  <link name="base"><inertial><mass value="2"/><inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="upper">{upper}<mass value="1"/><inertia ixx="0.001" iyy="0.002" izz="0.0025" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="fore">{fore}<mass value="{mass}"/><inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial>
    <visual>{shown}<geometry><box size="0.3 0.02 0.04"/></geometry></visual></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.1" rpy="0 0 {turn}"/><axis xyz="0 0 1"/><limit lower="{low}" upper="{high}" effort="5" velocity="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.3 0 0" rpy="{tilt}"/><axis xyz="{axis}"/><limit {limit} effort="5" velocity="1"/></joint>
</robot>
"""
OLD = {
    "upper": '<inertial><origin xyz="0.1 0.02 0"/>', "fore": '<inertial><origin xyz="0.2 0.03 0.01"/>', "mass": "0.5",
    "inertia": 'ixx="0.001" iyy="0.003" izz="0.0035"', "turn": "0", "low": "-2", "high": "1", "tilt": "0 0 0", "axis": "0 1 0",
    "limit": 'lower="-0.5" upper="1.5"', "shown": '<origin xyz="0.15 0 0"/>',
}
NEW = OLD | {
    "fore": '<inertial><origin xyz="0.03 -0.2 0.01"/>', "inertia": 'ixx="0.003" iyy="0.001" izz="0.0035"', "turn": "-1.5707963267948966",
    "low": "-0.4292036732051034", "high": "2.5707963267948966", "tilt": "0 0 1.5707963267948966", "axis": "-1 0 0",
    "limit": 'lower="-1.5" upper="0.5"', "shown": '<origin xyz="0 -0.15 0" rpy="0 0 -1.5707963267948966"/>',
}
"""The arm with the zero of the shoulder moved by 90 deg, the elbow reversed, and the frame of the forearm turned by 90 deg."""
WORKING = {"mass": "0.6", "limit": 'lower="-1.7" upper="0.5"'}
SAID = "zeros: shoulder +90 deg; reversed: elbow"


def run_diff(folder: Path, old: dict[str, str], new: dict[str, str], capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> str:
    """Return the output of `thingc diff` for two arms."""
    for name, values in (("old", old), ("new", new)):
        (folder / f"{name}.urdf").write_text(ARM.format(**values))
    assert main(["diff", *(str(folder / f"{name}.urdf") for name in ("old", "new")), *words]) == code
    return capsys.readouterr().out


def listed(text: str, key: str = "changes") -> dict[tuple[str, str, str | None], Any]:
    return {(one["what"], one["path"], one["field"]): one for one in json.loads(text)[key]}


@pytest.fixture(autouse=True)
def store(monkeypatch: pytest.MonkeyPatch, shared_store: str) -> None:
    monkeypatch.setenv("THINGC_STORE", shared_store)


def test_only_real_changes_are_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The limit that changed has its old value in the new coordinate: -1.5 rad was the other limit of the joint in the other direction."""
    text = run_diff(tmp_path, OLD, NEW | WORKING, capsys, "--format", "json")
    changes = listed(text)
    edits = {key: (one["old"], one["new"]) for key, one in changes.items() if not one["because"]}
    assert edits == {("joint", "elbow", "limit.lower"): (pytest.approx(-1.5), -1.7), ("component", "fore", "mass.value"): (0.5, 0.6)}
    assert {(what, field) for what, _, field in changes.keys() - edits.keys()} <= {
        ("mass", "mass"), ("mass", "robot.mass"), ("mass", "robot.centre"), ("mass", "robot.inertia"),
    }
    # robot.centre of the old arm in the new zero position: the shoulder is turned back by 90 deg
    centre = changes["mass", "", "robot.centre"]["old"]
    assert centre == pytest.approx([(0.02 + 0.5 * 0.03) / 3.5, -(0.1 + 0.5 * 0.5) / 3.5, (1 * 0.1 + 0.5 * 0.11) / 3.5])
    explained = listed(text, "explained")
    assert {("joint", "shoulder", "limit.lower"), ("joint", "elbow", "limit.upper"), ("component", "fore", "com.value")} <= explained.keys()
    assert not explained.keys() & changes.keys()
    assert json.loads(text)["same_mechanism"] == {str(tmp_path / "new.urdf"): f"the same mechanism except for masses; {SAID}"}
    shown = run_diff(tmp_path, OLD, NEW | WORKING, capsys)
    assert f"  the same mechanism except for masses; {SAID}\n" in shown and "moved by" not in shown and "com." not in shown


def test_explained_changes_are_not_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--fail-on` and the JSON output contain them."""
    head, *lines = run_diff(tmp_path, OLD, NEW, capsys).splitlines()
    assert lines == [f"  the same mechanism; {SAID}"]
    text = run_diff(tmp_path, OLD, NEW, capsys, "--format", "json", "--fail-on", "joints", code=1)
    assert listed(text) == {} and len(listed(text, "explained")) > 5
    assert f"- `the same mechanism; {SAID}`" in run_diff(tmp_path, OLD, NEW, capsys, "--format", "markdown")


def test_shapes_that_moved_on_their_link_are_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = run_diff(tmp_path, OLD, NEW | {"shown": NEW["shown"].replace("-0.15", "-0.151")}, capsys, "--format", "json")
    assert {what for what, _, _ in listed(text)} == {"bom"} and "same_mechanism" in json.loads(text)


def test_no_mechanism_is_stated_if_it_explains_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = run_diff(tmp_path, OLD, OLD | {"mass": "0.6", "limit": 'lower="-0.5" upper="1.6"'}, capsys, "--format", "json")
    assert "same_mechanism" not in json.loads(text) and "explained" not in json.loads(text)
    assert {("joint", "elbow", "limit.upper"), ("component", "fore", "mass.value")} <= listed(text).keys()


@pytest.mark.parametrize("change", [{"turn": "-1.57"}, {"tilt": "0 0.001 1.5707963267948966"}, {"axis": "-1 0 0.001"}])
def test_other_axes_are_no_explanation(change: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A shoulder with another zero is still the same mechanism, with limits that differ by 0.8 mrad. The other changes turn the axis."""
    text = run_diff(tmp_path, OLD, NEW | change, capsys, "--format", "json")
    edits = {key for key, one in listed(text).items() if not one["because"]}
    if "turn" in change:
        assert edits == {("joint", "shoulder", "limit.lower"), ("joint", "shoulder", "limit.upper")}
    else:
        assert len(edits) > 4 and "same_mechanism" not in json.loads(text)


@pytest.mark.parametrize(("change", "more"), [
    ({}, set()), ({"LAMP": "xyz: 50 0 10 mm, rpy: 0 0 -90 deg"}, {("mate", "lamp", "xyz"), ("mate", "lamp", "rpy")}),
    ({"SENSED": "base.pivot"}, {("mount", "base/pivot", "rpy")}),
])
def test_frames_that_moved_are_listed(
    change: dict[str, str], more: set[tuple[str, str, str]], tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    """`eye` moves with the frame of the forearm, which is turned by 90 deg about z, and `tip` does not. The mount of the joint on the base
    is turned by 30 deg, which only affects a sensor on it. The lamp moves by 10 mm in one case."""
    body = "frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 2e-3 kg*m^2, izz: 2.5e-3 kg*m^2}"
    document = """\
thingc: assembly/1
name: arm
components:
  base: {BODY, mounts: {pivot: {xyz: 0 0 100 mm, rpy: 0 0 PIVOT deg}}}
  fore: {BODY_OF_FORE, mounts: {hole: {rpy: 180 0 HOLE deg}, eye: {EYE}, tip: {xyz: 300 0 0 mm}}}
  lamp: {frame: true, at: {in: fore.origin, LAMP}}
joints: {turn: {type: revolute, parent: base.pivot, child: fore.hole, limit: {lower: LOW, upper: HIGH}}}
sensors: {imu: {type: imu, at: SENSED}}
poses: {home: {turn: HOME}}
modes: {m: {root: base, pose: home}}
"""
    old = {"PIVOT": "0", "SENSED": change.get("SENSED", "fore.eye"), "HOLE": "0"}
    old |= {"EYE": "xyz: 10 20 30 mm", "LAMP": "xyz: 0 50 0 mm", "LOW": "-90 deg", "HIGH": "45 deg", "HOME": "30 deg"}
    new = {"PIVOT": "-30", "EYE": "xyz: 20 -10 30 mm, rpy: 0 0 -90 deg", "LAMP": "xyz: 50 0 0 mm, rpy: 0 0 -90 deg"}
    turned = body.replace("ixx: 1e-3", "ixx: 2e-3").replace("iyy: 2e-3", "iyy: 1e-3")
    bodies = body + ", com: 10 20 0 mm", turned + ", com: 20 -10 0 mm"
    limits = {"LOW": "-150 deg", "HIGH": "-15 deg", "HOME": "-30 deg"}
    for name, values, fore in (("old", old, bodies[0]), ("new", old | new | limits | change, bodies[1])):
        text = document.replace("BODY_OF_FORE", fore).replace("BODY", body)
        for key, value in values.items():
            text = text.replace(key, value)
        (tmp_path / f"{name}.yaml").write_text(text)
    assert main(["diff", str(tmp_path / "old.yaml"), str(tmp_path / "new.yaml"), "--format", "json"]) == 0
    out = capsys.readouterr().out
    assert "zeros: turn -60 deg" in json.loads(out)["same_mechanism"][str(tmp_path / "new.yaml")], out
    assert {key for key, one in listed(out).items() if not one["because"]} == {
        ("mount", "fore/tip", "xyz"), ("mount", "fore/tip", "rpy"), *more,
    }
