"""Packages built from the repository, and environments in which they are installed."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import venv
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def build(source: Path, folder: Path) -> None:
    """Build the sdist, and then the wheel from the sdist, with the build backend of this environment."""
    run_module("build", "--no-isolation", "--outdir", str(folder), str(source))


def run_module(*words: str) -> None:
    """Run a module of this environment that builds packages. The date is set to 2023-11-14."""
    environment = {**os.environ, "SOURCE_DATE_EPOCH": "1700000000"}
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr


@dataclass(frozen=True)
class Installed:
    """A virtual environment with thingc. The attributes are its folder of programs, its folder of packages, and the store for its
    commands."""

    programs: Path
    packages: Path
    store: str

    def run(self, folder: Path, *words: str) -> str:
        """Run a program of the environment in a folder, and return its standard output. Other processes delete temporary folders without
        a lock, so this folder is locked."""
        clean = {name: text for name, text in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
        command = [str(self.programs / words[0]), *words[1:]]
        own = {"THINGC_STORE": self.store, "TMPDIR": str(self.packages)}
        done = subprocess.run(command, cwd=folder, env=clean | own, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout


def install(folder: Path, wheel: Path) -> None:
    """Install a wheel in a new environment without its dependencies."""
    programs, packages = _create(folder, [])
    command = [sys.executable, "-m", "pip", "--python", str(programs / "python"), "install", "--no-deps", "--no-index"]
    subprocess.run([*command, "--no-compile", "--quiet", str(wheel)], check=True)


def installed_in(folder: Path, store: str) -> Installed:
    """Return the environment that `install` has created in a folder."""
    return Installed(*_places(folder), store)


def derive(folder: Path, store: str, other: Installed) -> Installed:
    """Create an environment that reads thingc from another one, where it is already compiled."""
    programs, packages = _create(folder, [other.packages])
    script = programs / "thingc"
    script.write_text((other.programs / script.name).read_text().replace(str(other.programs), str(programs)))
    script.chmod(0o755)
    return Installed(programs, packages, store)


def _create(folder: Path, others: list[Path]) -> tuple[Path, Path]:
    """Create an environment without packages. A `.pth` file adds the dependencies of this environment and other folders to `sys.path`.
    The `.pth` files of this environment are not read, so the checkout is not on `sys.path`."""
    venv.create(folder, with_pip=False, symlinks=True)
    programs, packages = _places(folder)
    (packages / "dependencies.pth").write_text("".join(f"{path}\n" for path in (*others, sysconfig.get_path("purelib"))))
    return programs, packages


def _places(folder: Path) -> tuple[Path, Path]:
    """Return the folder of programs and the folder of packages of the environment in a folder."""
    names = {"base": str(folder), "platbase": str(folder)}
    programs, packages = (Path(sysconfig.get_path(one, "venv", names)) for one in ("scripts", "purelib"))
    return programs, packages
