"""Command lines without a document: the only robot of the workspace is used; otherwise the candidates are listed."""

from __future__ import annotations

from pathlib import Path

import pytest

from live.documents import ROBOT, write
from thingc.tools.cli.main import main

Said = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared_store: str) -> Path:
    write(tmp_path)
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("THINGC_STORE", shared_store)
    return tmp_path


def test_only_robot_is_used(workspace: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said) -> None:
    """A robot is a document that no other document nests. From a folder without documents, the robot of the workspace is used. Nested
    workspaces do not count."""
    other = workspace / "other"
    other.mkdir()
    for name in ("thingc.toml", "robot.yaml"):
        (other / name).write_text((workspace / name).read_text())
    assert main(["hag"]) == 0
    said = capsys.readouterr()
    assert said.err == "using robot.yaml, the only robot in this folder\n" and said.out.startswith("robot\n")
    (workspace / "parts").mkdir()
    monkeypatch.chdir(workspace / "parts")
    assert main(["info", "--format", "json"]) == 0
    assert capsys.readouterr().err == "using ../robot.yaml, the only robot in this folder\n"


def test_several_or_no_robots_are_reported(workspace: Path, capsys: Said) -> None:
    (workspace / "again.yaml").write_text(ROBOT)
    assert main(["build"]) == 2
    assert capsys.readouterr().err == (
        "error[TC801]: the argument DOC is required in a folder with 2 robots\n"
        "  help: known robots: `again.yaml`, `robot.yaml`\n\n1 error\n"
    )
    for path in workspace.glob("*.yaml"):
        path.unlink()
    assert main(["view"]) == 2
    assert capsys.readouterr().err == (
        "error[TC801]: the argument DOC is required in a folder with no robots\n"
        "  help: run `thingc new NAME` to create one\n\n1 error\n"
    )


def test_robots_of_nested_workspaces_are_listed_first(
    workspace: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said,
) -> None:
    for name in ("one", "two"):
        inner = workspace / "robots" / name
        inner.mkdir(parents=True)
        write(inner)
        (inner / "thingc.toml").write_text('thingc = "workspace/1"\n')
    monkeypatch.chdir(workspace / "robots")
    assert main(["info"]) == 2
    assert "a folder with 2 robots\n  help: known robots: `one/robot.yaml`, `two/robot.yaml`\n" in capsys.readouterr().err


def test_document_nested_by_a_broken_one_is_not_a_robot(workspace: Path, capsys: Said) -> None:
    document = workspace / "robot.yaml"
    document.write_text(document.read_text() + "  bad: [\n")
    assert main(["info"]) == 1
    assert capsys.readouterr().err.startswith("using robot.yaml, the only robot in this folder\nerror[TC103]")


def test_check_checks_the_whole_folder(capsys: Said) -> None:
    assert main(["check"]) == 0
    assert capsys.readouterr().out.endswith("robot.yaml: ok\n4 documents checked, all ok\n")
    assert main(["check", "--touched"]) == 2
    assert "--touched requires changed files\n  help: pass the output of `git diff --name-only main...`" in capsys.readouterr().out
