"""`thingc diff` at the command line: arguments, output formats, exit codes and usage errors."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

from diff.cranes import CRANE, write
from thingc.tools.cli.main import main


def git(folder: Path, *words: str) -> str:
    return subprocess.run(
        ["git", "-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false", *words], cwd=folder, check=True,
        capture_output=True, text=True,
    ).stdout


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared_store: str) -> Path:
    """A repository with the crane in a folder, and a branch with a longer boom."""
    folder = tmp_path / "repository"
    write(folder / "robots")
    git(folder, "init", "-q", "-b", "main")
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", "a crane")
    git(folder, "checkout", "-qb", "longer")
    write(folder / "robots", ("value: 400 mm", "value: 450 mm"))
    (folder / "robots" / "lone.yaml").write_text("thingc: assembly/1\nname: lone\ncomponents: {a: {frame: true}}\n")
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", "a longer boom")
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.chdir(folder / "robots")
    return folder


def said(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> str:
    assert main(["diff", *words]) == code
    captured = capsys.readouterr()
    return captured.out if code != 2 else captured.err


def run_diff_json(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(said(capsys, "--format", "json", *words, code=code))
    return found


def test_revisions_are_compared(repository: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No revision is checked out. Without document arguments, the documents affected by the change are compared."""
    before = git(repository, "status", "--porcelain=v2", "--branch")
    found = run_diff_json(capsys, "main..longer")
    assert (found["old"], found["new"]) == ("main", "longer")
    changes = {(c["what"], c["change"], c["path"], c["field"]): c for c in found["changes"]}
    reach = changes["parameter", "changed", "reach", "value"]
    assert reach == {
        "what": "parameter", "change": "changed", "path": "reach", "new_path": None, "field": "value", "old": 0.4, "new": 0.45,
        "because": [], "file": "crane.yaml", "line": CRANE[: CRANE.index("  reach:")].count("\n") + 1,
    }
    assert changes["file", "added", "lone.yaml", None]["because"] == []
    assert all(c["because"] for key, c in changes.items() if key[0] not in ("parameter", "file"))
    assert git(repository, "status", "--porcelain=v2", "--branch") == before


def test_working_tree_and_single_document(repository: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, "HEAD", "--", "crane.yaml") == "crane.yaml: no changes in meaning\n"
    assert said(capsys, "HEAD") == "HEAD -> working tree: no changes in meaning\n"
    write(repository / "robots", ("value: 120 g", "value: 150 g"), ("value: 400 mm", "value: 450 mm"))
    assert said(capsys, "--", "crane.yaml").splitlines()[:2] == [
        "crane.yaml: HEAD -> working tree", "    component hook: mass.value 120 g -> 150 g (+25 %)",
    ]
    assert "parameter reach: value 400 mm -> 450 mm (+12.5 %)" in said(capsys, "main", "--", "crane.yaml")
    assert said(capsys, "main", "--no-tests", "--", "crane.yaml").splitlines()[0] == "crane.yaml: main -> working tree"
    assert {c["path"] for c in run_diff_json(capsys, "HEAD", "crane.yaml")["changes"] if not c["because"]} == {"hook"}


def urdf(mass: str) -> str:
    inertia = "".join(f' {key}="{1e-3 if key[1] == key[2] else 0}"' for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
    return f'<robot name="r"><link name="a"><inertial><mass value="{mass}"/><inertia{inertia}/></inertial></link></robot>\n'


@pytest.fixture
def robot_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository whose last commit changes, adds and removes robot files, and changes an XML file of another kind."""
    folder = tmp_path / "urdf"
    folder.mkdir()
    git(folder, "init", "-q")
    (folder / "unchanged.urdf").write_text("neither read nor compared")
    for mass, project, name in (("0.2", "old", "removed"), ("0.3", "new", "added")):
        (folder / "arm.urdf").write_text(urdf(mass))
        (folder / "pom.xml").write_text(f"<project>{project}</project>")
        (folder / "removed.urdf").unlink(missing_ok=True)
        (folder / f"{name}.urdf").write_text(urdf("7"))
        git(folder, "add", "-A")
        git(folder, "commit", "-qm", project)
    monkeypatch.setenv("THINGC_STORE", str(tmp_path / "store"))
    monkeypatch.chdir(folder)
    return folder


def test_changed_robot_files_are_compared(robot_files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = run_diff_json(capsys, "HEAD~1..HEAD", "--fail-on", "mass", code=1)["changes"]
    assert [(c["change"], c["path"]) for c in found if c["what"] == "file"] == [("added", "added.urdf"), ("removed", "removed.urdf")]
    assert [(c["old"], c["new"]) for c in found if c["field"] == "robot.mass"] == [(0.2, 0.3)]
    assert said(capsys, "HEAD") == "HEAD -> working tree: no changes in meaning\n"
    (robot_files / "arm.urdf").write_text(urdf("0.45"))
    (robot_files / "pom.xml").write_text("<project/>")
    assert "component a: mass.value 300 g -> 450 g (+50 %)" in said(capsys, "HEAD")
    skipped = "arm.urdf: changed, but not compared because of --no-code"
    assert said(capsys, "HEAD", "--no-code") == f"  {skipped}\n"
    assert said(capsys, "HEAD", "--no-code", "--format", "markdown").splitlines()[1] == f"- `arm.urdf` is {skipped.partition(': ')[2]}"
    said(capsys, "HEAD", "--no-code", "--fail-on", "file", code=1)


def test_changed_robot_files_are_compared_as_mechanisms(robot_files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["same", "HEAD"]) == 0
    assert capsys.readouterr().out == "HEAD -> working tree: nothing to compare: no document and no robot file changed\n"
    (robot_files / "arm.urdf").write_text(urdf("0.45"))
    assert main(["same", "HEAD"]) == 1
    assert "mass of a: 0.3 kg -> 0.45 kg" in capsys.readouterr().out


def test_three_dots_compare_with_the_merge_base(repository: Path, capsys: pytest.CaptureFixture[str]) -> None:
    git(repository, "checkout", "-q", "main")
    write(repository / "robots", ("max: 2.6 kg", "max: 2.7 kg"))
    git(repository, "commit", "-qam", "a test")
    made = [c["path"] for c in run_diff_json(capsys, "main...longer", "--", "crane.yaml")["changes"] if not c["because"]]
    assert made == ["reach"]
    made = [c["path"] for c in run_diff_json(capsys, "main..longer", "--", "crane.yaml")["changes"] if not c["because"]]
    assert set(made) == {"reach", "light"}


def test_fail_on_selects_kinds_of_changes(tmp_path: Path, capsys: pytest.CaptureFixture[str], shared_store: str) -> None:
    old, new = str(write(tmp_path / "old")), str(write(tmp_path / "new", ("value: 120 g", "value: 320 g")))
    said(capsys, old, new, "--store", shared_store, "--fail-on", "joints,poses")
    out = said(capsys, old, new, "--store", shared_store, "--fail-on", "joints", "--fail-on", "tests", code=1)
    assert "test light: FAILS now (because of hook)" in out
    said(capsys, old, new, "--store", shared_store, "--fail-on", "mass", code=1)
    assert "test light" not in said(capsys, old, new, "--store", shared_store, "--no-tests", "--fail-on", "tests")
    err = said(capsys, old, new, "--fail-on", "jionts", code=2)
    assert "--fail-on: expected a kind of change, found `jionts`" in err and "did you mean `joints`?" in err


def test_markdown_output_for_a_comment(tmp_path: Path, capsys: pytest.CaptureFixture[str], shared_store: str) -> None:
    old, new = str(write(tmp_path / "old")), str(write(tmp_path / "new", ("value: 120 g", "value: 320 g")))
    text = said(capsys, old, new, "--store", shared_store, "--format", "markdown")
    assert "- component `hook` `mass.value 120 g -> 320 g (+167 %)`\n" in text
    assert text.index("- test `light` `FAILS now` — because of `hook`\n") < text.index("<details>")  # not folded away
    assert re.search(r"<details><summary>tests \(\d\)</summary>\n\n- test `light` `measured", text)
    assert text.count("<details>") == text.count("</details>") >= 2


def test_errors_of_a_revision_are_reported(repository: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Diagnostics point to the file in the revision."""
    write(repository / "robots", ("parent: mast.head", "parent: mats.head"))
    out = said(capsys, "main", "--", "crane.yaml", code=1)
    assert "this document has no component `mats`" in out and "--> crane.yaml:" in out
    git(repository, "commit", "-qam", "a slip")
    out = said(capsys, "HEAD..main", "--", "crane.yaml", code=1)
    assert "this document has no component `mats`" in out and "--> HEAD:robots/crane.yaml:" in out and "parent: mats.head" in out
    diagnostics = run_diff_json(capsys, "HEAD..main", "--", "crane.yaml", code=1)["diagnostics"]
    assert [d["code"] for d in diagnostics] == ["TC302"] and diagnostics[0]["line"] == CRANE[: CRANE.index("    parent:")].count("\n") + 1


@pytest.mark.parametrize(("words", "message", "hint"), [
    (["mian"], "there is no revision, document or build folder `mian`", "did you mean `main`?"),
    (["main..longr"], "there is no revision, document or build folder `longr`", "did you mean `longer`?"),
    (["crane.yaml", "cran.yaml"], "there is no document `cran.yaml`", "did you mean `crane.yaml`?"),
    (["main", "--", "crain.yaml"], "there is no document `crain.yaml` in main or working tree", "did you mean `robots/crane.yaml`?"),
    (["main", "longer", "HEAD"], "expected two sides, found 3 arguments", "write the documents to compare after `--`"),
    (["main", "--", "crane.yaml", "--format"], "there is no document `--format` in main or working tree", "known documents:"),
    ([".", "crane.yaml"], "the folder `.` is not a build folder (no manifest.json)", "use a build folder or a document"),
    (
        ["crane.yaml", "cabin.yaml", "--", "crane.yaml"], "documents after `--` can only be used with two revisions",
        "thingc diff OLD.yaml NEW.yaml",
    ),
])
def test_invalid_arguments_are_usage_errors(
    repository: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str, hint: str,
) -> None:
    err = said(capsys, *words, code=2)
    assert f"error[TC801]: {message}" in err and hint in err


def test_missing_repository_is_a_usage_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    err = said(capsys, "main", code=2)
    assert "`main` is not a file, a folder or a revision: fatal: not a git repository" in err
    assert "use two documents, or run the command in a Git repository" in err
