"""`pytest --jobs` reports the results of all tests, also if a test ends its process."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

FILES = {
    "test_one.py": """
        import os, pytest
        @pytest.fixture(scope="session", autouse=True)
        def kept(tmp_path_factory):
            yield
            (tmp_path_factory.getbasetemp().parent / f"ended-{os.getpid()}").touch()
        def test_passes(tmp_path): assert tmp_path.parent.name.startswith("popen-gw")
        def test_ends_its_process(): os._exit(3)
        @pytest.mark.parametrize("number", range(3))
        def test_number(number): print("printed"); assert number < 2
    """,
    "test_two.py": """
        import pytest
        def test_skips(): pytest.skip("why not")
        def test_fails_in_a_fixture(nothing): pass
    """,
}


def ran(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run pytest in a folder with the tests above, with the plugin of this repository only."""
    for name, text in FILES.items():
        (folder / name).write_text(re.sub("^        ", "", text, flags=re.MULTILINE))
    program = "import sys, pytest, forked; sys.exit(pytest.main(sys.argv[1:], [forked]))"
    return subprocess.run(
        [sys.executable, "-c", program, "-p", "no:cacheprovider", "-rA", "--basetemp", "temp", "-c", "/dev/null", "--rootdir", ".", *words],
        cwd=folder, capture_output=True, text=True, timeout=120,
        env={"PYTHONPATH": str(Path(__file__).parents[1]), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
    )


def test_results_equal_those_of_one_process(tmp_path: Path) -> None:
    done = ran(tmp_path, "--jobs", "2")
    assert done.returncode == 1, done.stdout + done.stderr
    found = set(re.findall(r"^(PASSED|FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE))
    assert found == {
        ("PASSED", "test_one.py::test_passes"), ("FAILED", "test_one.py::test_ends_its_process"), ("PASSED", "test_one.py::test_number[0]"),
        ("PASSED", "test_one.py::test_number[1]"), ("FAILED", "test_one.py::test_number[2]"),
        ("ERROR", "test_two.py::test_fails_in_a_fixture"),
    }
    assert "the process of this test has ended" in done.stdout and "printed" in done.stdout and "1 skipped" in done.stdout
    assert "2 failed, 3 passed, 1 skipped, 1 error" in done.stdout
    assert 1 <= len([*tmp_path.glob("temp/ended-*")]) <= 2, "fixtures of processes that did not end early are taken down"


def test_first_failure_ends_the_run(tmp_path: Path) -> None:
    done = ran(tmp_path, "--jobs", "1", "-x", "-k", "number")
    assert done.returncode == 1 and "1 failed, 2 passed" in done.stdout and "stopping after 1 failures" in done.stdout, done.stdout
