"""Output of parts is reported when they are modelled, whether or not they succeed, and not when they come from the cache."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

import thingc
from realize.conftest import modelled_parts
from thingc.geometry.client import Workers
from thingc.geometry.record import PartFailure, PartRecord
from thingc.geometry.worker.captured_output import MOST, NAME, SHOWN, WIDTH, keep, lines_of
from thingc.tools.cli.console import show_printed
from thingc.tools.cli.main import main

TALKING = """\
import subprocess
import sys, time
from build123d import *
from thingc import Length, Thing

class Talks(Thing):
    def __init__(self, width: Length = 3):
        super().__init__()
        self.width = width
        print("width", width)
        print("on standard error", file=sys.stderr)

    def result(self):
        sys.stdout.buffer.write(b"bytes \\xff\\n")
        subprocess.run(["true"], stdout=sys.stdout)
        print("never ended", end="")
        return Box(self.width, 2, 3)

class Quiet(Thing):
    def result(self):
        return Box(1, 2, 3)

class Raises(Thing):
    def result(self):
        print("before it raises")
        raise ValueError("no")

class Hangs(Thing):
    def result(self):
        print("before it hangs")
        time.sleep(600)

class Floods(Thing):
    def result(self):
        for number in range(100_000):
            print(number)
        return Box(1, 2, 3)

class Puts(Thing):
    def result(self):
        import os, tempfile
        os.mkfifo(os.path.join(tempfile.gettempdir(), "printed"))
        return Box(1, 2, 3)
"""


@pytest.fixture
def heard() -> list[tuple[str, Sequence[str]]]:
    return []


def test_part_output_is_reported_once(place: Any, define: Callable[..., Any], heard: list[Any]) -> None:
    place.write("parts/talking.py", TALKING)
    definitions = [define("talking:Talks", width=0.004), define("talking:Quiet")]
    for again in (False, True):
        with place.service(on_printed=lambda *said: heard.append(said)) as service:
            service.describe(["talking:Talks", "talking:Quiet"])
            found = service.realize(definitions)
        assert all(isinstance(record, PartRecord) for record in found.values())
        assert sorted(modelled_parts(service)) == ([] if again else sorted(one.text for one in definitions))
    assert heard == [("talking:Talks", ["width 4.0", "on standard error", "bytes \ufffd", "never ended"])]


def test_output_of_failing_parts_is_reported(place: Any, define: Callable[..., Any], heard: list[Any]) -> None:
    place.write("parts/talking.py", TALKING)
    with place.service(timeout=3.0, on_printed=lambda *said: heard.append(said)) as service:
        found = service.realize([define("talking:Raises"), define("talking:Hangs"), define("talking:Puts")])
    kinds = [one.kind if isinstance(one, PartFailure) else "made" for one in found.values()]
    assert kinds == ["raised", "hung", "made"]
    assert sorted(heard) == [("talking:Hangs", ["before it hangs"]), ("talking:Raises", ["before it raises"])]


def test_output_of_a_module_that_fails_to_load_is_reported(place: Any, heard: list[Any]) -> None:
    place.write("parts/broken.py", "from thingc import Thing\nprint('this far')\nclass A(Thing): ...\nnothing\n")
    with place.service(on_printed=lambda *said: heard.append(said)) as service:
        found = service.describe(["broken:A"])
    assert isinstance(found["broken:A"], PartFailure)
    assert heard == [("broken:A", ["this far"])]


def test_python_api_reports_part_output(place: Any, heard: list[Any]) -> None:
    place.write("parts/talking.py", TALKING)
    place.write("robot.yaml", "thingc: assembly/1\nname: one\ncomponents:\n  it: {part: talking:Talks, mass: 1 kg}\n")
    thingc.compile(str(place.root / "robot.yaml"), store=str(place.root / "store"), printed=lambda *said: heard.append(said))
    assert heard == [("talking:Talks", ["width 3.0", "on standard error", "bytes \ufffd", "never ended"])]


def test_long_output_is_truncated(place: Any, define: Callable[..., Any], heard: list[Any]) -> None:
    place.write("parts/talking.py", TALKING)
    with place.service(on_printed=lambda *said: heard.append(said)) as service:
        service.realize([define("talking:Floods")])
    ((_, lines),) = heard
    assert len(lines) == SHOWN + 1 and lines[:2] == ["0", "1"] and lines[-1] == "..."
    kept = len("".join(f"{number}\n" for number in range(100_000))[:MOST].splitlines()) + 1
    assert lines[SHOWN // 2] == f"... ({kept - SHOWN} lines)"


def test_long_lines_are_truncated_and_links_ignored(tmp_path: Path) -> None:
    with keep(str(tmp_path)):
        print("x" * (WIDTH + 1))
    assert lines_of(str(tmp_path)) == ["x" * WIDTH]
    (tmp_path / NAME).unlink()
    assert lines_of(str(tmp_path)) == []
    (tmp_path / NAME).symlink_to("/etc/passwd")
    assert lines_of(str(tmp_path)) == []


def test_output_is_reported_without_fork(place: Any, define: Callable[..., Any], heard: list[Any]) -> None:
    place.write("parts/talking.py", TALKING)
    workers = Workers(1, forking=False)
    try:
        with place.service(on_printed=lambda *said: heard.append(said), workers=workers) as service:
            service.realize([define("talking:Talks", width=0.004), define("talking:Quiet")])
    finally:
        workers.close()
    assert [part for part, _ in heard] == ["talking:Talks"] and heard[0][1][0] == "width 4.0"


@pytest.mark.parametrize("form", ["text", "json"])
def test_command_line_shows_output_in_text_format_only(
    place: Any, form: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    place.write("parts/talking.py", TALKING)
    place.write("thingc.toml", 'thingc = "workspace/1"\n')
    place.write("robot.yaml", """
        thingc: assembly/1
        name: robot
        materials: {petg: {density: 1270 kg/m^3}}
        components: {box: {part: talking:Talks, params: {width: 40 mm}, material: petg}}
        """)
    monkeypatch.chdir(place.root)
    command = ["check", "robot.yaml", "--store", place.store.root, "--format", form]
    assert main(command) == 0
    printed = capsys.readouterr()
    if form == "json":
        assert "talking" not in printed.err and "width 40.0" not in printed.out and json.loads(printed.out)
    else:
        lines = [line for line in printed.err.splitlines() if " | " in line]
        assert lines[0] == "talking:Talks(width=40 mm) | width 40.0" and len(lines) == 4
        assert "width 40.0" not in printed.out
    main(command)
    assert " | " not in capsys.readouterr().err, "it was modelled already"


def test_control_characters_of_output_are_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    show_printed("arm:\x1b[2JPen", ["\x1b]0;title\x07", "a\rb"])
    assert sys.stderr.getvalue() == "arm:\\x1b[2JPen | \\x1b]0;title\\x07\narm:\\x1b[2JPen | a\\rb\n"  # type: ignore[attr-defined]
