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
    return sorted(os.path.join(top, name) for name in changed_paths(folder, base))


def changed_paths(folder: str, *commits: str, trusted: bool = False) -> list[str]:
    """Sorted paths in the repository of the files below a folder that differ between two commits, or between one and the checkout.

    In the checkout, uncommitted and untracked changes count, but not those inside a submodule: to find them, git runs what the
    configuration of the submodule names. Raises `NotARepository`.
    """
    options = ("--name-only", "--no-renames", "--ignore-submodules=dirty", "-z")
    names = git(folder, "diff", *options, *commits, "--", ".", trusted=trusted).split("\0")
    if len(commits) == 1:
        names += git(folder, "ls-files", "--others", "--exclude-standard", "--full-name", "-z", "--", ".", trusted=trusted).split("\0")
    return sorted({*names} - {""})


def git(folder: str, *words: str, trusted: bool = False) -> str:
    """The output of a git command, as text. Arguments and errors as for `run_git`."""
    return os.fsdecode(run_git(folder, *words, trusted=trusted))  # as it is: a name may hold a carriage return


def run_git(folder: str, *words: str, given: bytes = b"", trusted: bool = False) -> bytes:
    """Run a git command in a folder and return its output; `given` is its standard input.

    Nothing runs that the configuration of the repository names: no file system monitor, hook, filter or transport. The configuration
    of the user and of the system holds. If the repository is `trusted`, its filters and transports may run. Raises `NotARepository`.
    """
    if any("\0" in word for word in words):
        raise NotARepository("a revision cannot contain NUL")
    options = ["-c", "core.fsmonitor=false", "-c", "core.hooksPath=/dev/null"]
    environment = {**os.environ, "GIT_OPTIONAL_LOCKS": "0"}
    try:
        if not trusted:
            environment |= {"GIT_NO_LAZY_FETCH": "1", "GIT_ALLOW_PROTOCOL": "", "THINGC_EMPTY": ""}
            listed = subprocess.run(["git", "config", "--list", "--show-scope", "--name-only", "-z"], cwd=folder, capture_output=True)
            fields = os.fsdecode(listed.stdout).split("\0")
            own = {key for scope, key in zip(fields[::2], fields[1::2]) if scope in ("local", "worktree") and key.startswith("filter.")}
            options += [f"--config-env={key}=THINGC_EMPTY" for key in sorted(own)]  # `-c` cannot set a name that contains `=`
        done = subprocess.run(["git", *options, *words], cwd=folder, capture_output=True, input=given, env=environment)
    except FileNotFoundError as fault:
        raise NotARepository("git is not installed here") from fault
    if done.returncode != 0:
        said = os.fsdecode(done.stderr).strip().splitlines()
        raise NotARepository(said[0] if said else f"git {words[0]} found nothing in common with it")
    return done.stdout
