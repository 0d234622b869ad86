"""Fixtures for the tests of STEP assemblies and of proposed joints."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from thingc.geometry.worker.lazy_build123d import import_cheaply
from thingc.tools.cli.main import main

import_cheaply("build123d")  # modules of tests use it; of all tests, those in this folder import it first


@pytest.fixture
def run(
    tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> Callable[..., tuple[int, str]]:
    """Run a command in the folder of the test, and return its exit code and its output."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("THINGC_STORE", shared_store)

    def command(*words: str) -> tuple[int, str]:
        code = main([*words])
        out = capsys.readouterr()
        return code, out.out + out.err

    return command
