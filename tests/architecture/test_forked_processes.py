"""`pytest --forks N` reports what pytest reports, runs each test once, also after a process has died, and shares what was imported."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
FIRST = """
import os, warnings
import pytest

@pytest.fixture(scope="session", autouse=True)
def ends():
    yield
    open(f"ended-{os.getpid()}", "w")

def test_prints(): print("printed"); assert os.getcwd() == 1
def test_warns(): warnings.warn("careful")
def test_dies(): os.kill(os.getpid(), 9)
def test_comes_after(tmp_path, capfd): os.system("echo shown"); assert capfd.readouterr().out == "shown\\n"
@pytest.mark.skip(reason="of no use")
def test_is_skipped(): pass
@pytest.mark.xfail
def test_is_expected_to_fail(): raise ValueError
def test_dies_at_the_end(): os._exit(0)
"""
OTHER = """
import os, pytest
open("imported", "a").write("x")
@pytest.mark.parametrize("number", range(3))
def test_runs_once(number): open("ran", "a").write(f"{__name__}{number} {os.getpid()}\\n")
"""


def pytest(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", "-p", "forked_processes", "-p", "no:cacheprovider", "--rootdir", ".", *words]
    return subprocess.run(command, cwd=folder, env={**os.environ, "PYTHONPATH": str(TESTS)}, capture_output=True, text=True)


def test_forks_report_what_pytest_reports(tmp_path: Path) -> None:
    (tmp_path / "test_a.py").write_text(FIRST)
    others = [tmp_path / f"test_{name}.py" for name in "bcdef"]
    for path in others:
        path.write_text(OTHER)
    done = pytest(tmp_path, "--forks", "2")
    assert done.returncode == 1 and "3 failed, 17 passed, 1 skipped, 1 xfailed, 1 warning" in done.stdout, done.stdout + done.stderr
    assert "printed" in done.stdout and "careful" in done.stdout and "the process of the test has ended: -9" in done.stdout
    assert re.findall(r"^FAILED test_a.py::(\w+)", done.stdout, re.MULTILINE) == ["test_prints", "test_dies", "test_dies_at_the_end"]
    ran = [line.split() for line in (tmp_path / "ran").read_text().splitlines()]
    assert sorted(name for name, _ in ran) == sorted(f"{path.stem}{number}" for path in others for number in range(3))
    assert (tmp_path / "imported").read_text() == "x" * len(others)


def test_session_fixtures_end_and_the_first_failure_can_end_the_run(tmp_path: Path) -> None:
    (tmp_path / "test_a.py").write_text(FIRST.replace('os.kill(os.getpid(), 9)', "pass").replace("os._exit(0)", "pass"))
    done = pytest(tmp_path, "--forks", "1", "--deselect", "test_a.py::test_prints")
    assert done.returncode == 0 and len(list(tmp_path.glob("ended-*"))) == 1, done.stdout
    done = pytest(tmp_path, "--forks", "1", "-x")
    assert done.returncode == 1 and "1 failed in" in done.stdout, done.stdout
