"""The program that the VS Code extension starts, as determined by its own module in Node.js."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

SOURCE = Path(__file__).resolve().parents[2] / "editors/vscode/src/program.mjs"
SCRIPT = """
const { findProgram } = await import(process.argv[1]);
console.log(JSON.stringify(JSON.parse(process.argv[2]).map((state) => findProgram(state) ?? null)));
"""


def found(*states: dict[str, Any]) -> list[dict[str, Any] | None]:
    """Return the program that the extension would start in each state."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("Node.js is not on this machine")
    done = subprocess.run(
        [node, "--input-type=module", "-e", SCRIPT, SOURCE.as_uri(), json.dumps(states)], capture_output=True, text=True, check=True,
    )
    answer: list[dict[str, Any] | None] = json.loads(done.stdout)
    return answer


def executable(path: Path) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("#!/bin/sh\n")
    path.chmod(0o755)
    return str(path)


def state(folder: Path, path: str, *, trusted: bool = False, words: tuple[str, ...] = (), windows: bool = False) -> dict[str, Any]:
    return {"words": words, "trusted": trusted, "folders": [str(folder)], "path": path, "windows": windows}


def test_untrusted_workspace_programs_are_not_started(tmp_path: Path) -> None:
    workspace, outside = tmp_path / "robots", tmp_path / "tools"
    executable(workspace / "thingc")
    executable(workspace / "thingc.exe")
    own = executable(workspace / ".venv/bin/thingc")
    good, windows = executable(outside / "thingc"), executable(outside / "thingc.exe")
    linked = tmp_path / "linked"
    linked.symlink_to(workspace, target_is_directory=True)
    hidden = tmp_path / "hidden"
    hidden.mkdir()
    (hidden / "thingc").symlink_to(workspace / "thingc")
    inside = os.pathsep.join(["", ".", "robots", str(workspace), str(workspace / ".venv/bin"), str(linked), str(hidden)])
    answers = found(
        state(workspace, inside),
        state(workspace, os.pathsep.join([inside, str(outside)])),
        state(workspace, inside, windows=True),
        state(workspace, os.pathsep.join([inside, str(outside)]), windows=True),
        state(workspace, str(outside), words=("./thingc",)),
        state(workspace, str(outside), words=(own, "x")),
        state(workspace, "", words=(good, "--quiet")),
        state(workspace, str(outside), words=("thingc", "--quiet")),
    )
    home = str(Path.home())
    assert answers == [
        None,
        {"program": good, "words": [], "cwd": home},
        None,
        {"program": windows, "words": [], "cwd": home},
        None,
        None,
        {"program": good, "words": ["--quiet"], "cwd": home},
        {"program": good, "words": ["--quiet"], "cwd": home},
    ]


def test_deleted_workspace_folder(tmp_path: Path) -> None:
    program = executable(tmp_path / "tools/thingc")
    (answer,) = found(state(tmp_path / "gone", str(tmp_path / "tools")))
    assert answer is not None and answer["program"] == program


def test_trusted_workspace_uses_its_own_environment(tmp_path: Path) -> None:
    workspace = tmp_path / "robots"
    workspace.mkdir()
    assert found(state(workspace, "/usr/bin", trusted=True)) == [{"program": "thingc", "words": [], "cwd": str(workspace)}]
    own = executable(workspace / ".venv/bin/thingc")
    assert found(
        state(workspace, "/usr/bin", trusted=True), state(workspace, "/usr/bin", trusted=True, words=("uv", "run", "thingc")),
    ) == [{"program": own, "words": [], "cwd": str(workspace)}, {"program": "uv", "words": ["run", "thingc"], "cwd": str(workspace)}]
