"""The files that git says have changed."""

from __future__ import annotations

import os
import subprocess


class NotARepository(Exception):
    """git cannot say: there is no repository here, no such revision, or no git. The message is git's own, in one line."""


def changed_since(revision: str, folder: str) -> list[str]:
    """Absolute paths of the files below a folder that differ from where this branch left `revision`, sorted.

    Committed, uncommitted and untracked changes count, deleted files, too; ignored files do not. Raises `NotARepository`.
    """
    base = git(folder, "merge-base", "--end-of-options", revision, "HEAD").strip()
    top = git(folder, "rev-parse", "--show-toplevel").rstrip("\n")
    names = git(folder, "diff", "--name-only", "--no-renames", "-z", base, "--", ".").split("\0")
    untracked = git(folder, "ls-files", "--others", "--exclude-standard", "--full-name", "-z", "--", ".").split("\0")
    return sorted({os.path.join(top, name) for name in (*names, *untracked) if name})


def git(folder: str, *words: str) -> str:
    """What git prints of a command in a folder. Raises `NotARepository`."""
    if any("\0" in word for word in words):
        raise NotARepository("a revision has no NUL in its name")
    try:
        done = subprocess.run(["git", *words], cwd=folder, capture_output=True)
    except FileNotFoundError as fault:
        raise NotARepository("git is not installed here") from fault
    if done.returncode != 0:
        said = os.fsdecode(done.stderr).strip().splitlines()
        raise NotARepository(said[0] if said else f"git {words[0]} found nothing in common with it")
    return os.fsdecode(done.stdout)  # as it is: a name may hold a carriage return
