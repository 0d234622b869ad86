"""Behaviour on systems without `fork`, file locks and other features of POSIX, and with the line ends and paths of Windows."""

from __future__ import annotations

import ast
import ntpath
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path, PureWindowsPath

import pytest

import thingc.documents.workspace
from package.installed import ROOT, Installed, derive
from thingc.base.diagnostics import Report
from thingc.documents.load import paths
from thingc.documents.workspace import Workspace
from thingc.tools.cli.main import main

HIDDEN = ROOT / "tests" / "package" / "without_posix.py"


def modules() -> Iterator[str]:
    """Return all modules of thingc except templates and modules for JAX, whose import takes long."""
    for path in sorted((ROOT / "compiler" / "thingc").rglob("*.py")):
        words = path.relative_to(ROOT / "compiler").with_suffix("").parts
        if "templates" not in words[:-1] and not any("jax" in word or "mjx" in word for word in words):
            yield ".".join(words[:-1] if words[-1] == "__init__" else words)


def test_every_module_can_be_imported_without_posix() -> None:
    """Third-party packages are imported first, because they have separate packages for Windows."""
    program = f"""
import importlib, runpy, sys
from thingc.geometry.worker.lazy_build123d import import_cheaply
import_cheaply("build123d")
names = []
for name in {list(modules())!r}:
    try:
        importlib.import_module(name)
        names.append(name)
    except ModuleNotFoundError as fault:  # an extra that is not installed
        assert not fault.name.startswith("thingc"), fault
for name in [name for name in sys.modules if name.partition(".")[0] == "thingc"]:
    del sys.modules[name]
runpy.run_path({str(HIDDEN)!r})
for name in names:
    importlib.import_module(name)
print(len(names))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 300


def test_posix_modules_are_imported_lazily() -> None:
    """At the top of a module, they can only be imported in a `try` statement."""
    found, lazy = [], 0
    for path in sorted((ROOT / "compiler" / "thingc").rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if not re.search(r"^\s*(import|from)\b.*\b(fcntl|grp|pty|pwd|resource|termios)\b", text, re.MULTILINE):
            continue
        lazy += 1
        for node in ast.parse(text).body:
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else [getattr(node, "module", None)]
            found += [f"{path}: {name}" for name in names if name in ("fcntl", "grp", "pty", "pwd", "resource", "termios")]
    assert found == [] and lazy > 5


@pytest.fixture
def elsewhere(installed: Installed, tmp_path: Path) -> Installed:
    """thingc in an environment without features of POSIX in all processes, including workers, and with a separate store."""
    derived = derive(tmp_path / "venv", str(tmp_path / "store"), installed)
    (derived.packages / HIDDEN.name).write_bytes(HIDDEN.read_bytes())
    (derived.packages / "without_posix.pth").write_text("import without_posix\n")
    return derived


@pytest.mark.slow
def test_commands_work_without_posix_and_write_the_same_files(
    elsewhere: Installed, tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Parts are built by workers that cannot fork."""
    code = "import os, sys; print(hasattr(os, 'fork'), 'fcntl' in sys.modules and sys.modules['fcntl'])"
    assert elsewhere.run(tmp_path, "python", "-c", code) == "False None\n"
    elsewhere.run(tmp_path, "thingc", "new", "rover", "--template", "empty")
    rover = tmp_path / "rover"
    (rover / "two.yaml").write_text("thingc: variants/1\nname: two\nassembly: rover.yaml\nparameters: {length: [100 mm, 140 mm]}\n")
    elsewhere.run(rover, "thingc", "build", "rover.yaml", "--jobs", "1", "-o", str(tmp_path / "here"))
    elsewhere.run(rover, "thingc", "lock", "--jobs", "1")
    assert elsewhere.run(rover, "thingc", "check", "--no-code", "rover.yaml") == "rover.yaml: ok\n"
    elsewhere.run(rover, "thingc", "batch", "two.yaml", "--jobs", "1")
    before = (rover / "rover.yaml").read_text()
    elsewhere.run(rover, "thingc", "set", "rover.yaml", "joints.swing.limit.upper=85 deg")
    assert "upper: 85 deg" in (rover / "rover.yaml").read_text()
    (rover / "rover.yaml").write_text(before)

    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.chdir(rover)
    assert main(["build", "rover.yaml", "-o", str(tmp_path / "there")]) == 0
    found, expected = (
        {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        for folder in (tmp_path / "here", tmp_path / "there")
    )
    assert len(found) > 10 and found == expected


@pytest.mark.slow
@pytest.mark.parametrize("begun", ["legged"], indirect=True)
def test_workspace_with_windows_line_ends(begun: Path, tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Git for Windows checks out text files with these line ends."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    for path in begun.parent.rglob("*"):
        if path.suffix in (".yaml", ".toml", ".py") and "build" not in path.parts:
            copy = tmp_path / path.relative_to(begun.parent)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    monkeypatch.chdir(tmp_path)
    assert main(["check", "--strict", "rover.yaml"]) == 0
    assert main(["fmt", "--check", "."]) == 0
    assert main(["build", "rover.yaml", "--emit", "mjcf"]) == 0
    for model in (begun.parent / "build/rover/mjcf").glob("*.xml"):
        assert (tmp_path / "build/rover/mjcf" / model.name).read_bytes() == model.read_bytes()


@pytest.fixture
def on_windows(monkeypatch: pytest.MonkeyPatch) -> Workspace:
    """Let the modules that resolve paths use the path syntax of Windows. Links are not resolved, because the files do not exist."""

    class Windows:
        path = ntpath
        sep = "\\"

    monkeypatch.setattr(ntpath, "realpath", ntpath.normpath)
    monkeypatch.setattr(ntpath, "isfile", lambda path: path == "C:\\robots\\rover\\legs\\leg.yaml")
    monkeypatch.setattr(paths, "os", Windows)
    monkeypatch.setattr(thingc.documents.workspace, "os", Windows)
    return Workspace(
        root="C:\\robots\\rover", parts=("C:\\robots\\rover\\parts",), packages=(), build="C:\\robots\\rover\\build", part_timeout=1.0,
        mesh=thingc.documents.workspace.DEFAULT_MESH, simulation=thingc.documents.workspace.DEFAULT_SIMULATION,
    )


def test_windows_paths_are_written_with_slashes(on_windows: Workspace) -> None:
    document = "C:\\robots\\rover\\arms\\arm.yaml"
    found = paths.resolve_path("../legs/leg.yaml", document)
    assert found is not None and PureWindowsPath(found) == PureWindowsPath("C:/robots/rover/legs/leg.yaml")
    assert on_windows.contains(found) and on_windows.relative(found) == "legs/leg.yaml"
    assert not on_windows.contains("C:\\robots\\rover2\\leg.yaml") and not on_windows.contains("D:\\robots\\rover\\leg.yaml")
    assert paths.find_assembly("../legs/leg.yaml", relative_to=document, where=None, workspace=on_windows, report=Report()) == found


@pytest.mark.parametrize("text", ["C:\\x.yaml", "C:/x.yaml", "C:x.yaml", "\\\\server\\x.yaml", "/x.yaml", "..\\..\\x.yaml", "../../x.yaml"])
def test_paths_outside_the_workspace_are_errors_on_windows(text: str, on_windows: Workspace) -> None:
    report = Report()
    beside = "C:\\robots\\rover\\rover.yaml"
    assert paths.find_assembly(text, relative_to=beside, where=None, workspace=on_windows, report=report) is None
    assert [one.code.code for one in report.diagnostics] == ["TC114"]
