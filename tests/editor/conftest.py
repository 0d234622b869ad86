"""The language servers, installed once from the committed lock file, and a workspace with schemas."""

from __future__ import annotations

import fcntl
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from editor.language_server import LanguageServer
from editor.running import ROOT, schemas_of, thingc

HERE = Path(__file__).resolve().parent
MODULES = HERE / "node_modules"


@pytest.fixture(scope="session")
def node_modules() -> Path:
    """Return `node_modules` as specified by `package-lock.json`. Skips on a machine without Node.js."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("Node.js (node and npm) is not on this machine: the language servers cannot be driven")
    wanted = (HERE / "package-lock.json").read_text()
    mark = MODULES / ".installed-from"
    with open(HERE / ".gitignore") as lock:  # several test processes install once
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not mark.exists() or mark.read_text() != wanted:
            done = subprocess.run(["npm", "ci", "--no-audit", "--no-fund"], cwd=HERE, capture_output=True, text=True)
            assert done.returncode == 0, f"npm ci in {HERE}:\n{done.stdout}{done.stderr}"
            mark.write_text(wanted)
    return MODULES


@pytest.fixture(scope="session")
def workspace(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Path:
    """Return a copy of the repository's robots with their schemas, as written by `thingc schema`."""
    folder = tmp_path_factory.mktemp("robots")
    for name in ("assemblies", "parts"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "thingc.toml", folder)
    thingc(folder, shared_store, "schema")
    return folder


@pytest.fixture(scope="session")
def server(node_modules: Path, workspace: Path) -> Iterator[LanguageServer]:
    """Yield a server that was started in the workspace as VS Code does."""
    program = node_modules / "yaml-language-server" / "bin" / "yaml-language-server"
    server = LanguageServer(program, workspace, schemas_of(workspace))
    yield server
    server.close()
