"""The progress line of commands that build parts or prove clearances."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest

from thingc.base import progress
from thingc.tools.cli import console
from thingc.tools.cli.main import main


def test_lines_are_printed_at_the_ends_and_once_per_second(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    times = iter([0.0, 10.0, 10.5, 11.0, 11.5, 12.0])
    monkeypatch.setattr(console, "time", SimpleNamespace(monotonic=lambda: next(times)))
    line = console.ProgressLine()
    for done, seconds in ((0, 0.0), (1, 0.5), (2, 1.0), (3, 1.5), (4, 2.0)):
        line("modelling parts", done, 4, seconds)
    assert capsys.readouterr().err.splitlines() == [
        "modelling parts: 0 of 4 (0 s)", "modelling parts: 2 of 4 (1 s)", "modelling parts: 4 of 4 (2 s)",
    ]


BALL = "link: true, mass: 1 g, shapes: [{sphere: {radius: 10 mm}}]"
SLIDING = f"""thingc: assembly/1
name: sliding
components:
  ground: {{frame: true, mounts: {{rail: {{}}}}}}
  ball: {{{BALL}}}
  one: {{{BALL}, at: {{in: ground.origin, xyz: 50 0 0 mm}}}}
  two: {{{BALL}, at: {{in: ground.origin, xyz: 0 50 0 mm}}}}
joints: {{move: {{type: prismatic, parent: ground.rail, child: ball.origin, limit: {{lower: -100 mm, upper: 40 mm}}}}}}
tests: {{clear: {{no_collision: {{joints: all, certify: true}}}}}}
modes: {{bench: {{root: ground}}}}
"""


@pytest.mark.parametrize("command", ["test", "limits"])
@pytest.mark.parametrize("slow", [True, False])
def test_only_slow_proofs_print_their_progress(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str, slow: bool,
) -> None:
    """Each reading of the clock takes two seconds, or almost no time."""
    times = count(0.0, 2.0 if slow else 0.001)
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: next(times)))
    monkeypatch.setattr(console, "time", SimpleNamespace(monotonic=lambda: 0.0))
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (document := tmp_path / "sliding.yaml").write_text(SLIDING)
    assert main([command, str(document)]) == 0
    printed = [line.partition(" (")[0] for line in capsys.readouterr().err.splitlines() if " of " in line]
    assert printed == (["proving pairs: 2 of 2"] if slow else [])
