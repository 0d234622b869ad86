"""The progress line of commands that build parts."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from thingc.tools.cli import console


def test_elapsed_time_counts_from_the_start_of_each_stage(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """A viewer that was opened a minute ago does not report a minute for a part that was built in a second."""
    times = iter([0.0, 10.0, 12.0, 90.0, 91.0])
    monkeypatch.setattr(console, "time", SimpleNamespace(monotonic=lambda: next(times)))
    progress = console.ProgressLine()
    for done, total in ((0, 2), (2, 2), (0, 1), (1, 1)):
        progress("modelling", done, total)
    assert capsys.readouterr().err.splitlines() == [
        "modelling parts: 0 of 2 (0 s)", "modelling parts: 2 of 2 (2 s)", "modelling parts: 0 of 1 (0 s)", "modelling parts: 1 of 1 (1 s)",
    ]
