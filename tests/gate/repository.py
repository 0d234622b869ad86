"""A repository that contains the arm."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
IDENTITY = ("-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "init.defaultBranch=main", "-c", "commit.gpgsign=false")


def git(folder: Path, *words: str) -> str:
    """Run git, and return its standard output."""
    return subprocess.run(["git", *IDENTITY, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


def commit(folder: Path, message: str) -> None:
    """Commit everything."""
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", message)


def fork(folder: Path) -> Path:
    """Create a repository of the arm, with one commit on `main`, and check out `branch`."""
    (folder / "assemblies").mkdir(parents=True)
    (folder / "parts").mkdir()
    for name in ("arm", "end_effector", "materials"):
        shutil.copy(ROOT / "assemblies" / f"{name}.yaml", folder / "assemblies")
    shutil.copy(ROOT / "parts" / "arm.py", folder / "parts")
    shutil.copy(ROOT / "thingc.toml", folder)
    git(folder, "init", "-q")
    commit(folder, "arm")
    git(folder, "checkout", "-qb", "branch")
    return folder
