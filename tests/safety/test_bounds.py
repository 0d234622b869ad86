"""`thingc check --no-code` of documents designed to exhaust it: a diagnostic within five seconds and a gigabyte for every input. Each
check is a process, measured by the kernel."""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from bombs import BOMBS
from harness import Ran, forked

from thingc.base.diagnostics import Diagnostic
from thingc.tools.cli import sandboxed_check as bounds

pytestmark = pytest.mark.slow

LONGER = ["--time-limit", "20 s"]
"""A limit for inputs that are rejected before they reach it, even on a slow machine."""
SECONDS = 22.0
"""The time limit of the check, plus the time to start and to print."""
MEMORY = 1000.0

SHORTER = ["--time-limit", "0.2 s"]
"""A limit for inputs that may reach it, to keep the test short."""

SAID = {
    "doubling": "TC331", "doubling_with_parameters": "TC331", "repeats_of_repeats": "TC331", "repeats_beside": "TC331",
    "laughs": "TC108", "many_aliases": "TC108", "deep_flow": "TC108", "deep_flow_braces": "TC108", "deep_block": "TC108",
    "deep_sequence": "TC108", "complex_keys": "TC108", "many_keys": "TC108", "one_line": "TC108", "long_expression": "TC209",
    "deep_expression": "TC209", "chained_parameters": "TC315", "parameters_in_a_circle": "TC316", "digits": "TC109",
    "globs_match_all": "TC331", "mode_chain": "TC331", "mode_circle": "TC333", "large_documents": "TC108", "materials_chain": "TC306",
    "bad_bytes": "TC102", "zeros": "TC103", "too_large": "TC108", "large_lock": "TC342", "deep_lock": "TC342", "digits_lock": "TC342",
    "large_python": "TC343", "settings": "TC108", "deep_settings": "TC108", "toml_deep": "TC108", "toml_deep_table": "TC108",
    "toml_deep_header": "TC108", "toml_digits": "TC103",
}
"""The code reported for inputs that are rejected far below the limit on any machine; it is not the code of a reached limit."""


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[Sequence[str], Path], Ran]]:
    with forked(tmp_path_factory.mktemp("forks")) as run:
        yield run


@pytest.mark.parametrize("name", BOMBS)
def test_bombs_end_within_time_and_memory_limits(name: str, tmp_path: Path, ran: Callable[[Sequence[str], Path], Ran]) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "blocks.py").write_text("class Block: pass\n")
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "parts.lock.json").write_text('{"thingc": "lock/1"}')
    document = BOMBS[name](tmp_path)
    done = ran(["check", "--no-code", *(LONGER if name in SAID else SHORTER), document], tmp_path)
    assert done.code in (0, 1), done.err
    assert "Traceback" not in done.out + done.err and "TC899" not in done.out
    assert done.err == ""
    assert done.seconds < SECONDS and done.memory < MEMORY, (done.seconds, done.memory)
    if name in SAID:
        assert f"error[{SAID[name]}]" in done.out and "TC346" not in done.out


def test_reached_time_limit_is_one_diagnostic(tmp_path: Path, ran: Callable[[Sequence[str], Path], Ran]) -> None:
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "parts.lock.json").write_text('{"thingc": "lock/1"}')
    document = BOMBS["as_many_as_allowed"](tmp_path)
    done = ran(["check", "--no-code", "--time-limit", "0.3 s", document], tmp_path)
    assert done.code == 1
    assert done.out.startswith("error[TC346]: the check exceeded the CPU time limit (0.3 s)")
    assert done.seconds < 4.0


def test_time_limit_below_one_second() -> None:
    def endlessly() -> None:
        while True:
            pass

    before = os.times()
    ended = bounds.run_confined(endlessly, 0.1)
    after = os.times()
    assert isinstance(ended, Diagnostic) and ended.message == "the check exceeded the CPU time limit (0.1 s)"
    used = after.children_user + after.children_system - before.children_user - before.children_system
    assert 0.05 < used < 0.5


def test_hanging_check_is_stopped_but_slow_one_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounds, "PATIENCE", 0.3)

    def slowly() -> str:
        for _ in range(3):
            time.sleep(0.7)
            until = time.process_time() + 0.05
            while time.process_time() < until:
                pass
        return "done"

    assert bounds.run_confined(slowly, 5.0) == "done"
    hung = bounds.run_confined(lambda: select.select([], [], []), 1.0)
    assert isinstance(hung, Diagnostic) and hung.message == "the check was stopped after 0.3 s without progress"
