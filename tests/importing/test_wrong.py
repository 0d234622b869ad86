"""Invalid robot files and the exact error output for each: all errors with their lines, and nothing is written."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

import thingc
from importing.imports import write_import
from thingc.base.diagnostics import Code, Report
from thingc.tools.cli.main import main
from thingc.tools.importing.importing import import_robot

HERE = Path(__file__).parent
WRONG = sorted(path for path in (HERE / "wrong").iterdir() if path.suffix in (".urdf", ".xml", ".sdf"))


@pytest.mark.parametrize("path", WRONG, ids=lambda path: path.stem)
def test_error_output(path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(path.parent)
    code = main(["import", path.name, "-o", str(tmp_path / "robot")])
    said = f"{capsys.readouterr().err}exit {code}\n"
    told = path.with_suffix(".txt")
    if os.environ.get("REGENERATE"):
        told.write_text(said)
    assert said == told.read_text()
    assert code == 1 and not (tmp_path / "robot").exists()


@pytest.mark.parametrize(("text", "words"), [
    ("<robot>" + "<a>" * 200 + "</a>" * 200 + "</robot>", "elements nest more than 100 levels deep"),
    ("<robot>" + "<a/>" * 500_001 + "</robot>", "the file has more than 500,000 elements"),
    ("<robot>" + " " * 50_000_000 + "</robot>", "the file has more than 50,000,000 bytes"),
    ("<robot name='many'>" + "".join(f"<link name='l{k}'/>" for k in range(10_001)) + "</robot>",
     "the number of links (10,001) exceeds the maximum (10,000)"),
])
def test_file_size_is_limited(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "large.urdf"
    path.write_text(text)
    report = Report()
    assert import_robot(str(path), report) is None
    assert len(report.diagnostics) == 1 and words in report.diagnostics[0].message


@pytest.mark.parametrize(("words", "said"), [
    (["robots/constructs.urdf", "--root", "uper"], "--root: there is no link `uper`\n  help: did you mean `upper`?"),
    (["robots/blcks.urdf"], "no such file or directory\n  help: did you mean `robots/blocks.urdf`?"),
    (["none.step"], "cannot read `none.step`: no such file or directory\n  help: no robot files are available"),
    (["test_wrong.py"], "`test_wrong.py` is not of a supported format: `.urdf`, `.xml`, `.sdf`, `.xacro`"),
    (["robots"], "`robots` is a folder, not a file: `.urdf`, `.xml`, `.sdf`, `.xacro`"),
    (["xacro/bot/urdf/bot.urdf.xacro", "--arg", "armss=3"], "--arg: the file has no argument `armss`\n  help: did you mean `arms`?"),
    (["arm.urdf.xacro"], "cannot read `arm.urdf.xacro`: no such file or directory"),
])
def test_invalid_command_lines(words: list[str], said: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(HERE)
    assert main(["import", *words]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("text", [
    '<robot name="r"><link name="a" zeta="1" beta="2" alpha="3" gamma="4"/></robot>',
    '<sdf version="1.9"><model name="m"><link name="a" zeta="1" beta="2" alpha="3" gamma="4"><inertial/></link></model></sdf>',
])
def test_unread_attributes_are_listed_in_file_order(text: str, tmp_path: Path) -> None:
    path = tmp_path / f"robot.{'urdf' if '<robot' in text else 'sdf'}"
    path.write_text(text)
    imported = import_robot(str(path), Report())
    assert imported is not None
    assert [one.what for one in imported.losses] == [f"`{name}` of `<link>`" for name in ("zeta", "beta", "alpha", "gamma")]


def test_summary_after_an_import(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["import", str(HERE / "robots" / "constructs.urdf")]) == 0
    told = capsys.readouterr().out
    assert told.startswith("constructs: 12 links and 6 joints of constructs.urdf\nrenamed: 5 elements, listed in constructs/import.json\n")
    for command in re.findall(r"^  thingc (check \S+)", told, re.MULTILINE):
        assert main(command.split()) == 0
    assert "thingc build constructs/constructs.yaml" in told
    assert main(["import", str(HERE / "robots" / "constructs.urdf")]) == 0, "what is there already is the same"
    (tmp_path / "constructs" / "constructs.yaml").write_text("edited")
    assert main(["import", str(HERE / "robots" / "constructs.urdf")]) == 2
    assert (tmp_path / "constructs" / "constructs.yaml").read_text() == "edited"


def test_check_writes_nothing_and_lists_losses(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["import", str(HERE / "robots" / "shapes.urdf"), "--check"]) == 0
    assert capsys.readouterr().out == (
        "would import 3 links and 1 joint of shapes.urdf\nshapes.urdf:9: lost: a `<sphere>`: the shape has no volume\n"
    )
    assert main(["import", str(HERE / "wrong" / "inertias.urdf"), "--check", "--repair", "inertia=nearest"]) == 0
    assert "inertias.urdf:3: repaired: mass and inertia of `arm` (nearest)\n" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("word", ["arm", "=.", "arm=nowhere"])
def test_package_option_requires_a_folder(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(HERE / "robots" / "shapes.urdf"), "--package", word]) == 2
    assert f"--package: expected NAME=DIR with a folder, found `{word}`" in capsys.readouterr().err


@pytest.mark.parametrize("count", [496, 497])
def test_chain_too_long_for_mujoco_is_a_warning(count: int, tmp_path: Path) -> None:
    """The warning is at the joint of the first link beyond the limit."""
    weight = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    links = [f'<link name="l{k}">{weight}</link>' for k in range(count)]
    joints = [f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/></joint>' for k in range(count - 1)]
    path, report = tmp_path / "chain.urdf", Report()
    path.write_text("\n".join(["<robot name='chain'>", *links, *joints, "</robot>"]))
    imported = import_robot(str(path), report)
    assert imported is not None
    said = [(fault.code, fault.span and fault.span.line, fault.message) for fault in report.diagnostics]
    message = "the chain of links to `l496` (497 links) exceeds the maximum of MuJoCo (496)"
    assert said == ([] if count == 496 else [(Code.SOURCE_DOUBT, 1 + 497 + 496, message)])
    refused = [fault.code for fault in thingc.family(write_import(imported, tmp_path)).write({}, tmp_path / "out", emit=["mjcf"])]
    assert refused == ([] if count == 496 else [Code.MJCF_REFUSED])


@pytest.mark.parametrize("text", ['<robot name="r"><link name="a"/>', '<robot name="r"><link name="a"/>\n<!-- '])
def test_truncated_xml_is_reported(tmp_path: Path, text: str) -> None:
    (tmp_path / "cut.urdf").write_text(text)
    report = Report()
    assert import_robot(str(tmp_path / "cut.urdf"), report) is None
    (found,) = report.diagnostics
    assert found.message.startswith("invalid XML")
    assert [note.message for note in found.notes] == ["`<robot>` is opened here"]
