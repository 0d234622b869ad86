"""Runs the tests of JAX in a separate process, because JAX starts threads, and the processes of other tests fork."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from xla_flags import XLA_FLAGS

MODULES = ("families/jax_functions.py", "families/mjx_models.py", "families/mjx_env.py", "modes/jax_switches.py")


@pytest.mark.slow
def test_jax(tmp_path: Path) -> None:
    tests = [str(Path(__file__).parents[1] / name) for name in MODULES]
    words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--basetemp", str(tmp_path / "own"), *tests]
    done = subprocess.run(words, capture_output=True, text=True, env={**os.environ, "XLA_FLAGS": XLA_FLAGS})
    assert done.returncode == 0, done.stdout + done.stderr
