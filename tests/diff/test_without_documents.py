"""Build folders and lock files as arguments of `thingc diff`, and comparisons without running code of the workspace."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from code_pages import read_page, unpack

from diff.cranes import write
from thingc.base.diagnostics import Code
from thingc.tools.cli.main import main

LOCKED = read_page(Code.NOT_LOOKED_AT)


@pytest.fixture(autouse=True)
def store(monkeypatch: pytest.MonkeyPatch, shared_store: str) -> None:
    monkeypatch.setenv("THINGC_STORE", shared_store)


@pytest.fixture
def locked(tmp_path: Path) -> tuple[Path, Path]:
    """A workspace with a lock file, and an edited copy in which a part has twice the length, which the lock file also contains."""
    old, new = tmp_path / "old", tmp_path / "new"
    for folder in (old, new):
        unpack(LOCKED, "right", folder)
    document = new / "robot.yaml"
    document.write_text(document.read_text().replace("block: {part: blocks:Block}", "block: {part: blocks:Block, params: {edge: 20 mm}}"))
    return old, new


def run_diff_json(capsys: pytest.CaptureFixture[str], *words: str | Path, code: int = 0) -> dict[tuple[str, str, str, str | None], Any]:
    assert main(["diff", *map(str, words), "--format", "json"]) == code
    changes = json.loads(capsys.readouterr().out)["changes"]
    return {(c["what"], c["change"], c["path"], c["field"]): c for c in changes}


def test_no_code_uses_the_lock_file(locked: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    """Numbers come from the lock file. Part code, which would fail, is not run."""
    old, new = locked
    found = run_diff_json(capsys, old / "robot.yaml", new / "robot.yaml", "--no-code")
    assert [key for key, c in found.items() if not c["because"]] == [("parameter", "changed", "block", "params.edge")]
    volume = found["geometry", "changed", "block", "volume"]
    assert (volume["old"], volume["new"], volume["because"]) == (1e-6, 8e-6, ["block"])
    mass = found["mass", "changed", "block", "mass"]
    assert mass["new"] == pytest.approx(7850 * 8e-6) and mass["because"] == ["block"]
    assert found["mount", "moved", "block/top", "pose"]["new"][0] == [0.0, 0.0, 0.01]


def test_no_code_works_in_a_new_process(locked: tuple[Path, Path]) -> None:
    """The sandbox cannot load libraries, so they are loaded before it starts."""
    sides = [str(side / "robot.yaml") for side in locked]
    done = subprocess.run([sys.executable, "-I", "-m", "thingc", "diff", *sides, "--no-code"], capture_output=True, text=True)
    assert done.returncode == 0 and "parameter block: params.edge 10 mm -> 20 mm" in done.stdout, done


def test_no_code_without_lock_file_is_an_error(locked: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    old, new = locked
    (new / "parts.lock.json").unlink()
    assert main(["diff", str(old / "robot.yaml"), str(new / "robot.yaml"), "--no-code"]) == 1
    assert "error[TC340]" in capsys.readouterr().out


def test_lock_files_are_compared(locked: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    old, new = locked
    lock = new / "parts.lock.json"
    values = json.loads(lock.read_text())
    thing = values["things"]["blocks:Block"]
    thing["parameters"]["edge"]["maximum"] = 0.06
    thing["records"]["blocks:Block"] |= {"volume": 2e-6}
    del thing["records"]["blocks:Block(edge=0.02)"]
    lock.write_text(json.dumps(values))
    found = run_diff_json(capsys, old / "parts.lock.json", lock)
    assert set(found) == {
        ("component", "removed", "blocks:Block(edge=0.02)", None), ("parameter", "changed", "blocks:Block", "params.edge.max"),
        ("geometry", "changed", "blocks:Block", "volume"),
    }
    assert main(["diff", str(lock), str(lock)]) == 0
    assert "no changes in meaning" in capsys.readouterr().out
    thing["records"]["blocks:Block"]["mounts"]["origin"] = {"pose": []}
    for text, where in ("{", ""), (json.dumps(values), " at `things.blocks:Block.records.blocks:Block.mounts.origin.pose`"):
        lock.write_text(text)
        assert main(["diff", str(old / "parts.lock.json"), str(lock)]) == 1
        assert f"error[TC342]: `parts.lock.json` is invalid{where}: " in capsys.readouterr().out


def test_given_lock_file_is_read_in_any_workspace(locked: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    lock = locked[0] / "parts.lock.json"
    values = json.loads(lock.read_text())
    values["things"]["blocks:Block"]["parameters"]["edge"]["maximum"] = 0.06
    copy = locked[0] / "before" / "parts.lock.json"
    copy.parent.mkdir()
    copy.write_text(json.dumps(values))
    assert set(run_diff_json(capsys, copy, lock)) == {("parameter", "changed", "blocks:Block", "params.edge.max")}


def test_changed_gear_ratio_in_lock_files_is_reported(locked: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    old, new = (folder / "parts.lock.json" for folder in locked)
    values = json.loads(old.read_text())
    for lock, ratio in ((old, 4.0), (new, 5.0)):
        values["things"]["blocks:Block"]["records"]["blocks:Block"]["actuator"] = {"kind": "motor", "gear_ratio": ratio, "sources": {}}
        lock.write_text(json.dumps(values))
    found = run_diff_json(capsys, old, new)
    changed = {key: (change["old"], change["new"]) for key, change in found.items()}
    assert changed == {("component", "changed", "blocks:Block", "drive.gear_ratio"): (4.0, 5.0)}


def test_build_folders_are_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    old = write(tmp_path / "old")
    new = write(tmp_path / "new", ("value: 120 g", "value: 300 g"), ("base: fixed, pose: up", "base: held, pose: up"))
    assert main(["build", str(old)]) == 0
    capsys.readouterr()
    build = tmp_path / "old" / "build" / "crane"
    expected = {
        ("mass", "changed", "hook", "mass"), ("mode", "changed", "stand", "base"),
    }
    found = run_diff_json(capsys, build, new)
    assert set(found) == expected and found["mass", "changed", "hook", "mass"]["new"] == 0.3
    assert run_diff_json(capsys, build, old) == {}
    assert main(["diff", str(build), str(new)]) == 0
    assert "not compared: parameters, mates, limits" in capsys.readouterr().out
    monkeypatch.chdir(tmp_path / "old")
    assert main(["diff", "build", "crane.yaml"]) == 2
    assert "the folder `build` is not a build folder (no manifest.json)" in (said := capsys.readouterr().err)
    assert "did you mean `build/crane`?" in said
    (build / "manifest.json").write_text("[]")
    assert main(["diff", str(build), str(new)]) == 2
    assert "manifest.json` was not built by this version of thingc" in capsys.readouterr().err
    unpack(LOCKED, "right", tmp_path / "locked")
    assert main(["diff", str(build), str(tmp_path / "locked" / "parts.lock.json")]) == 2
    assert "cannot be compared with a lock (`" in capsys.readouterr().err
