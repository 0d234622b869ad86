"""Create environments for readers and checkers, with pinned packages. Each has its own environment, because their dependencies conflict."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
import venv
from collections.abc import Sequence
from pathlib import Path


def environment(
    place: Path, packages: Sequence[str], needs: Sequence[str] = (), *, alone: bool = False, version: str = "",
) -> Path | None:
    """Return the path of the Python interpreter in the environment at `place`. Create the environment if it does not exist, or if it has
    other packages. Return None if packages are not available or a command in `needs` fails.

    If `packages` is empty, the current environment is used. If `alone` is True, only `packages` are installed, without their dependencies.
    `version` is the version of Python, such as `3.12`. By default, it is the current version.
    """
    if not all(succeeds(command) for command in needs):
        return None
    if not packages:
        return Path(sys.executable)
    python, complete, pinned = place / "bin" / "python", place / "complete", "\n".join((*packages, version))
    if complete.exists() and complete.read_text() == pinned:
        return python
    folder = shlex.quote(str(place))
    if not version:
        venv.create(place, with_pip=False, clear=True)
    elif not succeeds(f"python{version} -m venv --without-pip --clear {folder}") and not succeeds(f"uv venv -c -p {version} {folder}"):
        return None
    words = ["--quiet", "--disable-pip-version-check", "--no-compile", "--retries=1", *(["--no-deps"] if alone else []), *packages]
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install"]
    if subprocess.run([*pip, *words], check=False, stdout=subprocess.DEVNULL).returncode:
        return None
    complete.write_text(pinned)
    return python


def succeeds(command: str) -> bool:
    """Return whether a command exists and exits with status 0."""
    words = shlex.split(command)
    return shutil.which(words[0]) is not None and not subprocess.run(words, check=False, capture_output=True).returncode
