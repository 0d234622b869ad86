"""`thingc touched` lists exactly the documents that depend on a file, without running part code."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from conformance.harness import thingc, thingc_here

ROOT = Path(__file__).resolve().parents[2]
Run = Callable[..., list[str]]

PART = '''
import measures

raise SystemExit("part code was run")


class Block:
    def __init__(self):
        self.size = measures.SIZE
'''
ROBOT = """\
thingc: assembly/1
name: {name}
materials: [materials.yaml]
components:
  body: {{part: blocks:Block}}
  foot: {{assembly: foot.yaml, attach: {{top: body.bottom}}}}
"""
FOOT = "thingc: assembly/1\nname: foot\ncomponents:\n  sole: {file: sole.step}\n"
LONE = "thingc: assembly/1\nname: lone\ncomponents:\n  tag: {frame: true, mass: 1 g}\n"
MATERIALS = "thingc: materials/1\nmaterials:\n  petg: {density: 1270 kg/m^3}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A repository with a robot, its nested document, materials, part code in two modules, and an independent robot."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "robots").mkdir()
    for name, text in {
        "thingc.toml": 'thingc = "workspace/1"\n', "parts/blocks.py": PART, "parts/measures.py": "SIZE = 10\n",
        "parts/unused.py": "", "robots/walker.yaml": ROBOT.format(name="walker"), "robots/foot.yaml": FOOT, "robots/lone.yaml": LONE,
        "robots/materials.yaml": MATERIALS, "robots/notes.yaml": "shopping: [milk]\n",
    }.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.fixture
def touched(folder: Path, shared_store: str) -> Run:
    def run(*words: str) -> list[str]:
        done = thingc_here("touched", *words, store=shared_store, cwd=folder)
        assert done.code == 0, done.out + done.err
        return done.out.splitlines()

    return run


WALKER, FOOT_FILE, LONE_FILE, MATERIALS_FILE = (f"robots/{name}.yaml" for name in ("walker", "foot", "lone", "materials"))


@pytest.mark.parametrize(("changed", "expected"), [
    (WALKER, [WALKER]),
    (FOOT_FILE, [FOOT_FILE, WALKER]),
    (LONE_FILE, [LONE_FILE]),
    (MATERIALS_FILE, [MATERIALS_FILE, WALKER]),
    ("robots/sole.step", [FOOT_FILE, WALKER]),  # named, and not there yet
    ("parts/blocks.py", [WALKER]),
    ("parts/measures.py", [WALKER]),  # through the import
    ("parts/unused.py", []),
    ("parts/motor.step", [WALKER]),  # a part may read it while it is made
    ("parts/blocks/__init__.py", [WALKER]),  # would be found before blocks.py
    ("robots/notes.yaml", []),
    ("README.md", []),
    ("thingc.toml", [FOOT_FILE, LONE_FILE, MATERIALS_FILE, WALKER]),
    ("parts.lock.json", [FOOT_FILE, LONE_FILE, MATERIALS_FILE, WALKER]),
])
def test_documents_that_depend_on_a_file(touched: Run, changed: str, expected: list[str]) -> None:
    assert touched(changed) == expected


def test_roots_have_modes_or_are_not_nested(folder: Path, touched: Run) -> None:
    assert touched("robots/foot.yaml", "--roots") == [WALKER]
    assert touched("robots/materials.yaml", "robots/lone.yaml", "--roots") == [LONE_FILE, WALKER]
    assert touched("--all") == [FOOT_FILE, LONE_FILE, MATERIALS_FILE, WALKER]
    (folder / FOOT_FILE).write_text(FOOT + "modes: {standing: {root: sole}}\n")
    assert touched("robots/foot.yaml", "--roots") == [FOOT_FILE, WALKER]


def test_unreadable_document_is_listed(folder: Path, touched: Run) -> None:
    (folder / "robots" / "torn.yaml").write_text("thingc: assembly/1\ncomponents: {")
    assert touched("robots/torn.yaml") == ["robots/torn.yaml"]
    assert touched("parts/blocks.py") == [WALKER]


def test_virtual_environments_and_hidden_folders_are_ignored(folder: Path, touched: Run) -> None:
    for name in ("venv", ".cache", "node_modules"):
        shutil.copytree(folder / "robots", folder / name)
    (folder / "venv" / "pyvenv.cfg").write_text("")
    assert touched("--all") == [FOOT_FILE, LONE_FILE, MATERIALS_FILE, WALKER]


def test_robots_of_the_repository(shared_store: str) -> None:
    def run(*words: str) -> list[str]:
        return thingc_here("touched", *words, store=shared_store, cwd=ROOT / "assemblies").out.splitlines()

    assert run("../parts/arm.py") == ["arm.yaml", "end_effector.yaml"]
    # the robot is nested in one that carries a probe, and has modes of its own; the leg has none
    assert run("../parts/minchw/leg.py", "--roots") == ["minchw/minchw.yaml", "minchw/probe.yaml"]
    assert run("../parts/thingc_stock/magnets.py") == [
        f"minchw/{name}.yaml" for name in ("bridge_search", "leg", "minchw", "probe", "sizes")
    ]


def git(folder: Path, *words: str) -> str:
    identity = ["-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "init.defaultBranch=main", "-c", "commit.gpgsign=false"]
    return subprocess.run(["git", *identity, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


def test_since_a_revision(folder: Path, touched: Run) -> None:
    git(folder, "init", "-q")
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", "first")
    assert touched("--since", "main") == []
    git(folder, "checkout", "-qb", "branch")
    (folder / FOOT_FILE).write_text(FOOT + "description: a foot\n")
    git(folder, "commit", "-qam", "a foot")
    # what the other branch did meanwhile does not count, nor do ignored files
    git(folder, "checkout", "-q", "main")
    (folder / LONE_FILE).write_text(LONE + "description: alone\n")
    (folder / ".gitignore").write_text("ignored.yaml\n")
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", "alone")
    git(folder, "checkout", "-q", "branch")
    assert touched("--since", "main") == [FOOT_FILE, WALKER]
    (folder / "robots" / "new.yaml").write_text(LONE.replace("lone", "new"))  # untracked
    (folder / "parts" / "measures.py").unlink()  # uncommitted, and gone
    assert touched("--since", "main") == [FOOT_FILE, "robots/new.yaml", WALKER]


@pytest.mark.parametrize(("words", "said"), [
    ([], "expected changed files, or --since"),
    (["--since", "nowhere"], "--since nowhere: fatal: not a git repository"),
])
def test_errors_of_git(folder: Path, shared_store: str, words: list[str], said: str) -> None:
    done = thingc("touched", *words, store=shared_store, cwd=folder)
    assert done.code == 2
    assert said in done.err
    assert "Traceback" not in done.err
    done = thingc("touched", *words, "--format", "json", store=shared_store, cwd=folder)
    (found,) = json.loads(done.out)["diagnostics"]
    assert found["code"] == "TC801"


def test_revision_cannot_be_an_option_of_git(folder: Path, shared_store: str) -> None:
    git(folder, "init", "-q")
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", "first")
    done = thingc("touched", "--since=--output=stolen", store=shared_store, cwd=folder)
    assert done.code == 2
    assert not (folder / "stolen").exists()


def test_check_touched(folder: Path, shared_store: str) -> None:
    done = thingc("check", "--touched", "robots/lone.yaml", "README.md", store=shared_store, cwd=folder)
    assert (done.code, done.out) == (0, "robots/lone.yaml: ok\n")
    done = thingc("check", "--touched", "README.md", store=shared_store, cwd=folder)
    assert (done.code, done.out) == (0, "")
