"""Runs the tests of `jax_functions.py` in a process of their own: JAX starts threads, and the processes of other tests fork."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def test_functions_of_jax(tmp_path: Path) -> None:
    tests = Path(__file__).with_name("jax_functions.py")
    words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--basetemp", str(tmp_path / "own"), str(tests)]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
