"""xacro is expanded by a process of its own; what is said of the result is said at the lines of the files that it was written in."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import pytest

from thingc.cli.main import main
from thingc.diagnostics import Diagnostic, Report
from thingc.importing import Imported, expanding, import_robot

BOT = Path(__file__).parent / "xacro" / "bot"


@pytest.fixture
def bot(tmp_path: Path) -> Path:
    shutil.copytree(BOT, tmp_path / "bot")
    mesh = tmp_path / "bot" / "meshes" / "base.stl"
    mesh.parent.mkdir()
    mesh.write_text("solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n")
    return tmp_path / "bot" / "urdf" / "bot.urdf.xacro"


def read(path: Path, **arguments: str) -> tuple[Imported | None, list[Diagnostic]]:
    report = Report()
    return import_robot(str(path), report, arguments=arguments), report.ordered()


def test_macros_includes_and_packages(bot: Path) -> None:
    imported, said = read(bot)
    assert imported is not None and said == []
    assert [link.name for link in imported.robot.links] == ["base", "left_arm", "right_arm"]
    left, right = imported.robot.hangings
    assert left.pose.translation[1] == pytest.approx(math.pi / 10) and right.pose.translation[1] == -0.1
    assert imported.robot.links[1].weight is not None and imported.robot.links[1].weight.properties.mass == 1.0
    assert [(Path(loss.where.file).name, loss.where.line) for loss in imported.losses] == [("arm.xacro", 12), ("arm.xacro", 12)]
    assert imported.files["meshes/base.stl"] and str(bot.parents[1]) not in imported.files["import.json"].decode()
    imported, _ = read(bot, arms="1")
    assert imported is not None and [link.name for link in imported.robot.links] == ["base", "left_arm"]


def test_an_argument_that_only_yaml_uses(bot: Path) -> None:
    """Which nobody reads but xacro: then any is passed on."""
    (bot.parent / "side.yaml").write_text("left: $(arg side)\n")
    assert [d.message for d in read(bot, side="port")[1]] == ["--arg side: the file has no such argument"]
    text = bot.read_text().replace("0.5 * 2", "1.0 if xacro.load_yaml('side.yaml')['left'] == 'port' else 2.0")
    bot.write_text(text)
    imported, said = read(bot, side="port")
    assert imported is not None and said == []


@pytest.mark.parametrize(("file", "old", "new", "words", "line"), [
    ("arm.xacro", '"${mass}"', '"${mas}"', "name 'mas' is not defined", 5),
    ("arm.xacro", 'link="base"', 'link="bse"', "the parent of joint `left_shoulder` is the link `bse`", 9),
    ("arm.xacro", 'ixx="0.01"', 'ixx="${side}"', "`ixx` of `<inertia>`: expected a number, found `left`", 6),
    ("arm.xacro", "</inertial>", "", "this is no well-formed XML: mismatched tag", 8),
    ("bot.urdf.xacro", "arm.xacro", "leg.xacro", "no such file or directory", 5),
    ("bot.urdf.xacro", "$(find xacro_bot)/urdf", "$(find other)", "there is no package `other`; looked for", 5),
    ("bot.urdf.xacro", "$(arg arms)", "$(arg legs)", "legs", 10),
    ("bot.urdf.xacro", "0.5 * 2", "[].__class__", "Use of invalid name(s)", 4),
    ("bot.urdf.xacro", "0.5 * 2", "[0] * 10**12", "MemoryError when evaluating expression '[0] * 10**12'", 4),
    ("bot.urdf.xacro", "0.5 * 2", "9**9**9**9", "xacro cannot expand this: ", 1),
])
def test_what_is_wrong_is_said_at_its_line(
    bot: Path, file: str, old: str, new: str, words: str, line: int, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(expanding, "SECONDS", 1 if "9**9" in new else 60)
    path = bot.with_name(file)
    path.write_text(path.read_text().replace(old, new))
    imported, said = read(bot)
    assert imported is None
    assert words in said[0].message and said[0].span is not None
    assert (Path(said[0].span.file).name, said[0].span.line) == (file, line)


def test_without_the_extra_it_is_said_what_to_install(
    bot: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(expanding, "find_spec", lambda name: None)
    assert main(["import", str(bot)]) == 2
    assert "pip install 'thingc[import]'" in capsys.readouterr().err
    assert main(["import", str(bot), "--arg", "arms"]) == 2
    assert "--arg: expected NAME=VALUE, found `arms`" in capsys.readouterr().err
