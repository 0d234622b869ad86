"""Install the wheel with all its dependencies, build a new robot and run tests, for one or several versions of Python.

    python packaging/pythons.py [--python 3.11 3.12 ...] [--sdist] [--extra dev] [TESTS ...]

The wheel and the sdist are those in `dist/`. uv creates an environment for each version, and downloads missing interpreters. The script
prints one line for each version, and exits with 1 if a version failed. If a dependency has no wheel for a version, the line contains the
name of the dependency.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TESTS = ("tests/graph", "tests/units", "tests/load", "tests/templates", "tests/cli/test_document_meant.py")
"""Tests that run by default: of robots, of documents, and of new workspaces, whose parts are modelled."""
FOR_TESTS = ("pytest", "pytest-xdist", "hypothesis", "jsonschema", "pint")
NO_WHEEL = re.compile(r"([A-Za-z][\w.-]*?)(?:[=<>!~][\w.,=<>!~]*)? has no (?:usable )?wheels\b")
"""Part of a message of uv about a package without a wheel for a version of Python."""


class Failed(Exception):
    """Raised if a command fails. The text is the line to print."""


def uv(*words: str, folder: Path) -> str:
    """Run uv in a folder and return its output. Raises `Failed`."""
    environment = {name: text for name, text in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run(["uv", *words], cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode == 0:
        return done.stdout
    said = " ".join((done.stderr + done.stdout).split())
    if missing := NO_WHEEL.search(said):
        raise Failed(f"`{missing[1]}` has no wheel for this version")
    if "No interpreter found" in said or "python-build-standalone" in said:
        raise Failed("all dependencies have wheels, but uv cannot find or download an interpreter")
    raise Failed(f"`uv {' '.join(words[:2])} ...` failed: {said[-600:]}")


def tried(python: str, package: Path, extra: str, tests: Sequence[str]) -> str:
    """Create and build a robot with `uvx`, then run tests with the installed package. Return the line to print. Raises `Failed`."""
    uv("pip", "compile", "--quiet", "--only-binary", ":all:", "--python-version", python, "pyproject.toml", folder=ROOT)
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        uvx = ("tool", "run", "--python", python, "--from", str(package), "thingc")
        uv(*uvx, "new", "rover", folder=Path(name))
        uv(*uvx, "build", "rover.yaml", folder=Path(name) / "rover")
        model = Path(name) / "rover" / "build" / "rover" / "mjcf" / "scene_bench.xml"
        if not model.exists():
            raise Failed("`thingc build` wrote no model")
    said = f"a new robot builds ({time.monotonic() - start:.0f} s)"
    if tests:
        wanted = f"{package}[{extra}]" if extra else str(package)
        needed = [word for one in (wanted, *FOR_TESTS) for word in ("--with", one)]
        out = uv("run", "--no-project", "--python", python, *needed, "pytest", "-n", "2", *tests, folder=ROOT)
        said += f", {out.strip().splitlines()[-1].strip('= ')}"
    return said


def main() -> int:
    """Try all versions. Return 0 if all of them succeeded."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", nargs="+", default=["{}.{}".format(*sys.version_info)], help="versions (default: this one)")
    parser.add_argument("--sdist", action="store_true", help="also install the sdist")
    parser.add_argument("--extra", default="", help="extra of the package to install for the tests")
    parser.add_argument("--no-tests", action="store_true", help="only create and build a robot")
    parser.add_argument("tests", nargs="*", default=TESTS, help="tests to run (default: %(default)s)")
    options = parser.parse_args()
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    endings = ("-py3-none-any.whl", ".tar.gz")[: 2 if options.sdist else 1]
    packages = [ROOT / "dist" / f"thingc-{version}{ending}" for ending in endings]
    failed = False
    for python in options.python:
        for package in packages:
            try:
                said = f"ok: {tried(python, package, options.extra, () if options.no_tests else options.tests)}"
            except Failed as fault:
                said, failed = f"failed: {fault}", True
            print(f"Python {python}, {package.name}: {said}", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
