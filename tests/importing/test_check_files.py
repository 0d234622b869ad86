"""`thingc check` of robot files: wrong values are reported at the element of the file that contains them, and nothing is written."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from thingc.base.diagnostics import Report
from thingc.tools.cli.main import main
from thingc.tools.importing.importing import import_robot

HERE = Path(__file__).parent
ROBOTS = HERE / "robots"
# a file, the text to replace, a wrong value, the code, and the start of the element at which the value must be reported
SLIPS = {
    "degrees": ("constructs.urdf", 'upper="1.5707963267948966"', 'upper="90"', "TC515", '<joint name="shoulder"'),
    "friction": ("constructs.urdf", 'friction="0.2"', 'friction="200"', "TC521", '<joint name="shoulder"'),
    "damping": ("constructs.urdf", 'damping="0.01"', 'damping="10"', "TC521", '<joint name="spin"'),
    "mass": ("shapes.urdf", '<mass value="2"/>', '<mass value="2000"/>', "TC792", '<inertial><mass value="2000"'),
    "negative mass": ("shapes.urdf", '<mass value="2"/>', '<mass value="-2"/>', "TC952", '-2"'),
    "fixed joint": ("shapes.urdf", 'xyz="0 0 0.6"', 'xyz="0 0 600"', "TC517", '<joint name="stuck"'),
    "moving joint": ("shapes.urdf", 'xyz="0 0 0.2"', 'xyz="0 0 200"', "TC517", '<joint name="turn"'),
    "point mass": ("shapes.urdf", 'xyz="0.01 0.02 0"', 'xyz="10 20 0"', "TC522", '<inertial><origin xyz="10 20 0"'),
    "size": ("shapes.urdf", 'radius="0.05"', 'radius="50"', "TC416", 'lead">'),
    "sdf limit": ("constructs.sdf", "<upper>1.5</upper>", "<upper>90</upper>", "TC515", '<joint name="shoulder"'),
    "sdf friction": ("constructs.sdf", "<friction>0.2<", "<friction>200<", "TC521", '<joint name="shoulder"'),
    "mjcf limit": ("constructs.xml", 'range="0 120"', 'range="0 2000"', "TC515", '<joint name="elbow"'),
    "mjcf travel": ("constructs.xml", 'range="-0.01 0.02"', 'range="-10 20"', "TC517", '<joint name="left"'),
    "mjcf step": ("constructs.xml", 'timestep="0.004"', 'timestep="0.04"', "TC523", 'constructs">'),
    "mjcf pose": ("floating.xml", '<key qpos="1 0 0.1', '<key name="low" qpos="1 0 0.1', "TC618", '<key name="low"'),
}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Yield a folder with the robots, in which a command must neither write nor leave temporary files."""
    shutil.copytree(ROBOTS, tmp_path / "robots")
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    monkeypatch.chdir(tmp_path / "robots")
    yield tmp_path / "robots"
    assert not [*(tmp_path / "temporary").iterdir()]


def spoil(file: Path, old: str, new: str) -> str:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    return file.read_text()


@pytest.mark.parametrize("slip", SLIPS)
def test_wrong_value_is_reported_at_its_element(here: Path, slip: str, capsys: pytest.CaptureFixture[str]) -> None:
    name, old, new, code, start = SLIPS[slip]
    text = spoil(here / name, old, new)
    before = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
    main(["check", name, "--format", "json"])
    found = json.loads(capsys.readouterr().out)["diagnostics"]
    at = text.index(start)
    place = (name, text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at))
    assert (code, *place) in [(one["code"], one["file"], one["line"], one["column"]) for one in found]
    assert all(one["file"] == name and "allow:" not in (one["help"] or "") for one in found)
    assert before == {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}


@pytest.mark.parametrize("name", ["constructs.urdf", "constructs.sdf", "constructs.xml", "cranks.xml", "fixed.urdf"])
def test_valid_robot_file_is_ok(here: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", name, "--strict"]) == 0
    assert capsys.readouterr().out.endswith(f"{name}: ok\n")


def test_losses_are_notes_at_their_lines(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """SOURCE_LOSS: every format contains the losses that an import lists, and strict checks succeed."""
    text = spoil(here / "shapes.urdf", "</robot>", '  <gazebo reference="pole">\n    <selfCollide/></gazebo>\n</robot>')
    assert main(["import", "shapes.urdf", "--check"]) == 0
    lost = re.findall(r"^shapes.urdf:(\d+): (lost: .*)$", capsys.readouterr().out, re.MULTILINE)
    assert str(text[: text.index("<selfCollide")].count("\n") + 1) in dict(lost) and len(lost) == 2
    assert main(["check", "shapes.urdf", "--strict"]) == 0
    said = capsys.readouterr().out
    assert said.endswith("shapes.urdf: ok\n")
    for line, words in lost:
        assert f"note[TC958]: {words}\n   --> shapes.urdf:{line}:" in said.replace("    -->", "   -->")
    main(["check", "shapes.urdf", "--format", "json"])
    found = json.loads(capsys.readouterr().out)["diagnostics"]
    assert [(str(one["line"]), one["message"], one["severity"]) for one in found] == [(*one, "note") for one in lost]
    main(["check", "shapes.urdf", "--format", "github"])
    assert [line.split(",")[1] for line in capsys.readouterr().out.splitlines()] == [f"line={line}" for line, _ in lost]
    main(["check", "shapes.urdf", "--format", "sarif"])
    results = json.loads(capsys.readouterr().out)["runs"][0]["results"]
    assert [(one["ruleId"], one["level"], one["message"]["text"]) for one in results] == [("TC958", "note", words) for _, words in lost]


def test_repairs_are_notes(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    inertial = '<inertial><mass value="1"/><inertia ixx="9" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    spoil(here / "fixed.urdf", '<link name="plate">', f'<link name="plate">\n{inertial}')
    assert main(["check", "fixed.urdf"]) == 1
    capsys.readouterr()
    assert main(["check", "fixed.urdf", "--repair", "inertia=nearest", "--format", "json"]) == 0
    (note,) = [one for one in json.loads(capsys.readouterr().out)["diagnostics"] if one["severity"] == "note"]
    assert (note["code"], note["line"], note["message"]) == ("TC954", 7, "repaired: mass and inertia of `plate` (nearest)")


@pytest.mark.parametrize("name", ["shapes.urdf", "constructs.sdf", "tendons.xml"])
def test_codes_equal_those_of_the_imported_document(here: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = (here / name).read_text()
    for digit in ("0.02", "0.05", "1.5"):
        text = text.replace(digit, f"{digit}e3", 1)
    (here / name).write_text(text)
    main(["check", name, "--format", "json"])
    direct = [one["code"] for one in json.loads(capsys.readouterr().out)["diagnostics"] if one["code"] != "TC958"]
    assert main(["import", name, "-o", "../imported"]) in (0, 1)
    capsys.readouterr()
    if (here.parent / "imported").exists():
        (document,) = (here.parent / "imported").glob("*.yaml")
        main(["check", str(document), "--format", "json"])
        assert sorted(direct) == sorted(one["code"] for one in json.loads(capsys.readouterr().out)["diagnostics"]) != []


def test_messages_use_the_names_of_the_file(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (here / "constructs.urdf").read_text().replace("shoulder", "shoulder-1").replace('upper="1.5707963267948966"', 'upper="90"')
    (here / "constructs.urdf").write_text(text)
    main(["check", "constructs.urdf"])
    assert "joint `shoulder-1` is 14.3 turns" in capsys.readouterr().out


def places_with(file: Path, key: str) -> list[str]:
    """Return the source text at each place of a robot whose path contains a key."""
    imported, lines = import_robot(str(file), Report()), file.read_text().splitlines()
    assert imported is not None
    return [lines[where.line - 1][where.column - 1 :] for path, where in imported.places.items() if key in path]


def test_source_locations_of_shapes_and_mimics(here: Path) -> None:
    starts = {}
    for name in ("shapes.urdf", "constructs.urdf"):
        imported, lines = import_robot(name, Report()), (here / name).read_text().splitlines()
        assert imported is not None
        starts |= {path: lines[where.line - 1][where.column - 1 :] for path, where in imported.places.items()}
    assert starts["components", "base", "shapes", 1].startswith('<sphere radius="0.07"')
    assert starts["components", "pole", "shapes", 0].startswith('<cylinder radius="0.03"')
    assert starts["joints", "grip", "mimic"].startswith('elbow" multiplier="-0.4"')
    magnets, drives = (places_with(here / name, key) for name, key in (("suckers.xml", "mounts"), ("constructs.xml", "drive")))
    assert any(one.startswith("<adhesion") for one in magnets)
    assert drives and all(re.match("<(motor|position|velocity|general)", one) for one in drives)
    assert starts["components", "motor", "mounts", "spin"].startswith('<joint name="spin"')


def test_workspace_around_a_robot_file_is_ignored(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "thingc.toml").write_text("nonsense")
    assert main(["check", "fixed.urdf"]) == 0
    (here / "thingc.toml").unlink()
    (here / "a.yaml").write_text("thingc: materials/1\nmaterials: {a: {density: 1 g/cm^3}}\n")
    assert main(["check", "fixed.urdf", "."]) == 0
    assert capsys.readouterr().out.endswith("fixed.urdf: ok\n2 documents checked, all ok\n")
    assert main(["check", "fixed.urdf", "--fix"]) == 2
    assert "--fix changes only documents, not `fixed.urdf`" in capsys.readouterr().out


def test_info_accepts_a_robot_file(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "constructs.urdf", "--format", "json"]) == 0
    data = json.loads(capsys.readouterr().out)
    text = (here / "constructs.urdf").read_text()
    assert data["mass"] == pytest.approx(sum(map(float, re.findall(r'<mass value="([^"]+)"', text))))
    assert set(data["modes"]["source"]["joints"]) == set(re.findall(r'<joint name="(\w+)" type="(?!fixed)', text))
    (here / "cut.urdf").write_text("<robot")
    assert main(["info", "cut.urdf"]) == 1
    assert "--> cut.urdf:1:" in capsys.readouterr().err


def test_diff_of_two_robot_files(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(here / "constructs.xml", here / "new.xml")
    new = spoil(here / "new.xml", 'mass="0.7"', 'mass="0.8"')
    new = spoil(here / "new.xml", '<joint name="elbow" axis="0 1 0" range="0 120"', '<joint name="elbow" axis="0 1 0" range="0 110"')
    old = spoil(here / "constructs.xml", '<site name="tip"', '<site name="extra"/>\n<site name="tip"')
    assert main(["diff", "constructs.xml", "new.xml", "--fail-on", "mass", "--format", "json"]) == 1
    changes = {(one["path"], one["field"]): one for one in json.loads(capsys.readouterr().out)["changes"]}
    mass, limit = changes["upper_arm", "mass.value"], changes["elbow", "limit.upper"]
    assert (mass["old"], mass["new"], mass["file"]) == (0.7, 0.8, "new.xml")
    assert (limit["file"], limit["line"]) == ("new.xml", new[: new.index('<joint name="elbow"')].count("\n") + 1)
    removed = [one for one in changes.values() if one["change"] == "removed" and one["what"] == "mount" and one["file"] is not None]
    line = old[: old.index('<site name="extra"')].count("\n") + 1
    assert ("constructs.xml", line) in [(one["file"], one["line"]) for one in removed]
    assert main(["diff", "constructs.xml", "cut.xml"]) == 2
    capsys.readouterr()
    (here / "cut.xml").write_text("<mujoco>\n<worldbody")
    assert main(["diff", "constructs.xml", "cut.xml"]) == 1
    assert "--> cut.xml:2:" in capsys.readouterr().out
    assert main(["diff", "fixed.urdf", "fixed.urdf"]) == 0
    assert main(["diff", "fixed.urdf", "fixed.urdf", "--no-code"]) == 2


def test_removed_elements_are_shown_in_the_old_file(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old = (here / "constructs.urdf").read_text().splitlines()
    link = next(number for number, line in enumerate(old) if '<link name="1st_tool"/>' in line)
    joint = next(number for number, line in enumerate(old) if '<child link="1st_tool"/>' in line)
    joint = max(number for number, line in enumerate(old[:joint]) if "<joint" in line)
    end = next(number for number, line in enumerate(old) if number > joint and "</joint>" in line)
    lines = [line for number, line in enumerate(old) if number != link and not joint <= number <= end]
    (here / "new.urdf").write_text("\n".join([*lines[:2], *["<!-- -->"] * 40, *lines[2:]]))
    assert main(["diff", "constructs.urdf", "new.urdf", "--format", "json"]) == 0
    removed = [(one["file"], one["line"]) for one in json.loads(capsys.readouterr().out)["changes"] if one["change"] == "removed"]
    assert sorted(removed) == [("constructs.urdf", link + 1), ("constructs.urdf", joint + 1)]


def test_output_formats_and_exit_codes(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = spoil(here / "constructs.urdf", 'upper="1.5707963267948966"', 'upper="90"')
    line = text[: text.index('<joint name="shoulder"')].count("\n") + 1
    assert main(["check", "constructs.urdf"]) == 0
    assert f"--> constructs.urdf:{line}:3\n" in capsys.readouterr().out
    assert main(["check", "constructs.urdf", "--strict", "--format", "github"]) == 1
    assert f"file=constructs.urdf,line={line},col=3" in capsys.readouterr().out
    assert main(["check", "constructs.urdf", "fixed.urdf", "--format", "sarif"]) == 0
    (result,) = json.loads(capsys.readouterr().out)["runs"][0]["results"]
    region = result["locations"][0]["physicalLocation"]["region"]
    assert (result["ruleId"], region["startLine"], region["startColumn"]) == ("TC515", line, 3)


@pytest.mark.parametrize(("name", "text", "code", "words"), [
    ("missing.urdf", None, 2, "cannot read `missing.urdf`: no such file or directory"),
    ("cut.urdf", '<robot name="r">\n  <link name="a"', 1, "--> cut.urdf:2:3\n"),
    ("page.xml", "<!DOCTYPE html>\n<html><body><br></body></html>", 1, "`<sdf>` (SDF), found `<!DOCTYPE html>`\n   --> page.xml:1:15\n"),
    ("picture.xml", "<!-- -->\n<svg/>", 1, "expected the first element `<mujoco>` (MJCF), `<robot>` (URDF) or `<sdf>` (SDF), found `<svg>`"
     "\n   --> picture.xml:2:1\n  2 | <svg/>\n    | ^^^^\n  help: use a robot file: MJCF, URDF or SDF\n"),
    ("empty.xml", "<mujoco/>", 1, "help: add `<body>` to `<worldbody>`"),
    ("other.urdf", "<mujoco/>", 1, "(URDF), found `<mujoco>`\n   --> other.urdf:1:1\n  1 | <mujoco/>\n    | ^^^^^^^\n"
     "  help: rename the file to `.xml`"),
    ("broken.urdf.xacro", '<robot name="r" xmlns:xacro="http://wiki.ros.org/xacro">\n  <link name="${none}"/></robot>', 1,
     "--> broken.urdf.xacro:2:1\n"),
    ("mesh.urdf", '<robot name="r"><link name="a">\n<visual><geometry><mesh filename="no.stl"/></geometry></visual></link></robot>', 1,
     "--> mesh.urdf:2:"),
])
def test_unreadable_files(here: Path, name: str, text: str | None, code: int, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    if text is not None:
        (here / name).write_text(text)
    assert main(["check", name, "fixed.urdf"]) == code
    said = capsys.readouterr().out
    assert words in said and "fixed.urdf: ok\n" in said and "Traceback" not in said


def test_sdf_file_with_the_suffix_xml(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(here / "constructs.sdf", here / "sdf.xml")
    said = []
    for name in ("constructs.sdf", "sdf.xml"):
        assert main(["check", name]) == 0
        said.append(capsys.readouterr().out.replace(name, "FILE"))
    assert said[0] == said[1] != ""


def test_xacro_errors_have_the_lines_of_the_xacro_file(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(HERE / "xacro", here / "xacro")
    arm = here / "xacro" / "bot" / "urdf" / "arm.xacro"
    bot = "xacro/bot/urdf/bot.urdf.xacro"
    assert main(["check", bot, "--no-meshes"]) == 0
    said = capsys.readouterr().out
    line = arm.read_text()[: arm.read_text().index("<calibration")].count("\n") + 1
    assert f"{bot}: ok\n" in said and f"--> xacro/bot/urdf/arm.xacro:{line}:" in said
    spoil(arm, 'type="continuous"', 'type="revolute"')
    text = spoil(arm, "<calibration", '<limit lower="0" upper="90" effort="1" velocity="1"/><calibration')
    main(["check", bot, "--no-meshes"])
    line = text[: text.index("<joint")].count("\n") + 1
    assert f"--> xacro/bot/urdf/arm.xacro:{line}:5\n" in capsys.readouterr().out


def test_check_without_code_skips_xacro(here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thingc.tools.cli.console.refuse_modules_of_others", lambda: None)
    spoil(here / "constructs.xml", 'range="0 120"', 'range="0 2000"')
    (here / "robot.xacro").write_text('<robot name="r"/>')
    assert main(["check", "--no-code", "constructs.xml", "constructs.sdf", "robot.xacro", "--time-limit", "20 s"]) == 0
    said = capsys.readouterr().out
    assert "warning[TC515]" in said and "--> constructs.xml:" in said and "constructs.sdf: ok\n" in said
    assert "the xacro file was not checked" in said


def test_mjcf_check_without_code_in_a_new_process(here: Path) -> None:
    done = subprocess.run([sys.executable, "-I", "-m", "thingc", "check", "--no-code", "cranks.xml"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "cranks.xml: ok\n"), done.stdout + done.stderr


def test_touched_files_select_complete_robots(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "package.xml").write_text("<package/>")
    (here / "macros.xacro").write_text('<?xml version="1.0"?>\n<!-- <robot name="r"/> -->\n<robot xmlns:xacro="http://wiki.ros.org/xacro"/>')
    (here / "cut.urdf").write_text("<robot")
    (here / "scene.xml").write_text('<mujoco><include file="parts/classes.xml"/></mujoco>')
    (here / "floor.xml").write_text("<mujoco><worldbody><light/></worldbody></mujoco>")
    given = ["package.xml", "macros.xacro", "scene.xml", "floor.xml", "parts/classes.xml", "deleted.urdf"]
    given += ["fixed.urdf", "cranks.xml", "constructs.sdf"]
    assert main(["check", "--touched", "--", *given]) == 0
    assert capsys.readouterr().out == "fixed.urdf: ok\ncranks.xml: ok\nconstructs.sdf: ok\n"
    assert main(["touched", "--robot-files", *given]) == 0
    assert capsys.readouterr().out == "fixed.urdf\ncranks.xml\nconstructs.sdf\n"
    assert main(["touched", "--robot-files", "--all"]) == 2
    capsys.readouterr()
    assert main(["check", "--touched", "--", "cut.urdf"]) == 1
    assert "--> cut.urdf:1:" in capsys.readouterr().out
