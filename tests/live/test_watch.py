"""`thingc watch` as a process: its output after saves, and how it ends."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from editor.language_server import wait_until
from live.documents import ROBOT, write

BLOCKS = """
    from pathlib import Path
    from build123d import Box, Pos
    from thingc import Length, MountPoint, Thing

    class Block(Thing):
        def __init__(self, width: Length = 30):
            super().__init__(material="oak")
            self.body = Box(width, 20, float(Path(__file__).with_name("height.txt").read_text()))
            self.body += Pos(0, 0, 100) * Box(1, 1, 1)  # apart
            self.top = MountPoint(Pos(0, 0, 5))

        def result(self):
            return self.body
"""
RIG = """\
thingc: assembly/1
name: rig
materials: {oak: {density: 700 kg/m^3}}
components:
  block: {part: "blocks:Block", params: {width: 31 mm}, allow: {TC414: two of them are meant}}
"""


class Watching:
    """A `thingc watch` process and its output."""

    def __init__(self, document: Path, store: str, *words: str) -> None:
        self.folder, self.printed = document.parent, document.parent.with_suffix(".txt")
        with open(self.printed, "w") as stream:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "thingc", "watch", document.name, *words], cwd=self.folder, stdout=stream, stderr=stream,
                env={**os.environ, "THINGC_STORE": store},
            )
        assert self.says("press Ctrl-C to stop"), self.text()

    def text(self) -> str:
        return self.printed.read_text()

    def says(self, word: str) -> str:
        """Wait for a line that contains a word, and return it."""
        assert wait_until(lambda: word in self.text() or self.process.poll() is not None, 300.0), self.text()
        return next((line for line in self.text().splitlines() if word in line), "")


@pytest.fixture
def watching(tmp_path: Path, shared_store: str) -> Iterator[Watching]:
    found = Watching(write(tmp_path), shared_store, "--emit", "mjcf")
    yield found
    found.process.kill()
    found.process.wait()


def test_output_lines(watching: Watching) -> None:
    """A build, a save, a save with an error, its fix, and a save without a change of meaning; then Ctrl-C."""
    assert watching.text() == "Built build/robot: 7 files; 0 parts modelled, 0 reused\nwatching; press Ctrl-C to stop\n"
    robot = watching.folder / "robot.yaml"
    robot.write_text(ROBOT.replace("120 deg", "125 deg"))
    watching.says(" s\n")
    robot.write_text(ROBOT.replace("yaw_0: 30 deg", "yaw_0: 300 deg"))
    watching.says("the last successful build remains")
    robot.write_text(ROBOT.replace("yaw_0: 30 deg", "yaw_0: 31 deg"))
    watching.says("errors fixed")
    robot.write_text(f"# words\n{ROBOT.replace('yaw_0: 30 deg', 'yaw_0: 31 deg')}")
    watching.says("no file changed")
    watching.process.send_signal(signal.SIGINT)
    assert watching.process.wait(60.0) == 0
    said = re.sub(r"\d\.\d\d s", "T s", re.sub(r"(?m)^\d\d:\d\d:\d\d", "NOW", watching.text()))
    assert [line for line in said.splitlines() if line.startswith("NOW")] == [
        "NOW robot.yaml: 2 files changed (mjcf/robot_bench.xml, mjcf/robot_held.xml) in T s",
        "NOW robot.yaml: not built (T s); the last successful build remains",
        "NOW robot.yaml: errors fixed; 3 files changed (mjcf/robot_bench.xml, mjcf/robot_held.xml, modes.json) in T s",
        "NOW robot.yaml: no file changed in T s",
    ]
    failed = (
        "error[TC601]: the value of `yaw_0` in pose `out` (300 deg) is outside its limits (-90 deg to 120 deg)\n"
        "    --> robot.yaml:23:16\n"
    )
    assert said.count(failed) == 1 and said.count("\n1 error\n") == 1 and "Traceback" not in said


INTERRUPTED = """\
import signal, sys, weakref
from thingc.__main__ import entry
from thingc.tools.cli.watch import Lines

class Dies: pass

def say(lines, made):
    one = Dies()
    say.watching = weakref.ref(one, lambda _: signal.raise_signal(signal.SIGINT))

Lines.say = say
sys.argv = ["thingc", "watch", "robot.yaml", "--emit", "bom"]
entry()
"""


def test_interrupt_where_python_ignores_exceptions(tmp_path: Path, shared_store: str) -> None:
    """Weak references to imported modules have callbacks, and an exception raised in a callback would only be printed."""
    write(tmp_path)
    done = subprocess.run(
        [sys.executable, "-P", "-c", INTERRUPTED], cwd=tmp_path, capture_output=True, text=True, timeout=60.0,
        env={**os.environ, "THINGC_STORE": shared_store},
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize(("words", "said"), [
    (["none.yaml"], "there is no document `none.yaml`"),
    (["robot.yaml", "--mode", "walk"], "`robot.yaml` has no mode `walk`"),
    (["robot.yaml", "-p", "weight=2"], "weight"),
    (["robot.yaml", "--emit", "stl3"], "there is no target `stl3`"),
])
def test_invalid_command_line_does_not_start_watching(tmp_path: Path, shared_store: str, words: list[str], said: str) -> None:
    write(tmp_path)
    done = subprocess.run(
        [sys.executable, "-P", "-m", "thingc", "watch", *words], cwd=tmp_path, capture_output=True, text=True, timeout=60.0,
        env={**os.environ, "THINGC_STORE": shared_store},
    )
    assert done.returncode == 2 and said in done.stderr and "Traceback" not in done.stderr
    assert "Ctrl-C" not in done.stderr, "it says that it watches, and has ended"


def test_json_output_has_one_line_per_round(tmp_path: Path, shared_store: str) -> None:
    document = write(tmp_path)
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "thingc", "watch", "robot.yaml", "--emit", "bom", "--format", "json"], cwd=tmp_path, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, "THINGC_STORE": shared_store},
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        lines = iter(process.stdout.readline, "")
        first = json.loads(next(lines))
        document.write_text(ROBOT.replace("yaw_0: 30 deg", "yaw_0: 300 deg"))
        wrong = json.loads(next(lines))
        document.write_text(ROBOT.replace("mass: 1 kg", "mass: 2 kg"))
        right = json.loads(next(lines))
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 0 and process.stderr.read() == ""
    artifacts = ["build/robot/bom.csv", "build/robot/bom.json", "build/robot/manifest.json"]
    assert {key: first[key] for key in first if key != "seconds"} == {
        "diagnostics": [], "artifacts": artifacts, "modelled": [], "reused": [], "round": 1, "good": True, "saved": [], "changed": [],
        "kernel": 0.0,
    }
    assert [one["code"] for one in wrong["diagnostics"]] == ["TC601"]
    assert (wrong["round"], wrong["good"], wrong["saved"], wrong["artifacts"]) == (2, False, ["robot.yaml"], [])
    assert right["good"] and right["changed"] == ["build/robot/bom.csv", "build/robot/bom.json"]
    assert 0.0 < right["seconds"] < 60.0


def test_invalid_command_line_in_json(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-P", "-m", "thingc", "watch", "none.yaml", "--format", "json"], cwd=tmp_path, capture_output=True, text=True,
        timeout=60.0,
    )
    assert done.returncode == 2 and done.stderr == "" and done.stdout.count("\n") == 1
    assert json.loads(done.stdout)["diagnostics"][0]["message"] == "there is no document `none.yaml`"


def test_watch_starts_with_an_invalid_document(tmp_path: Path, shared_store: str) -> None:
    document = write(tmp_path)
    document.write_text(ROBOT.replace("poses:", "poses: ["))
    watching = Watching(document, shared_store, "--emit", "bom")
    try:
        assert watching.text().endswith("\n1 error\nnothing built yet; watching; press Ctrl-C to stop\n")
        document.write_text(ROBOT)
        assert watching.says("build/robot: 3 files; 0 parts modelled, 0 reused")
        assert " robot.yaml: built in " in watching.text()
        watching.process.send_signal(signal.SIGTERM)
        assert watching.process.wait(60.0) == 0 and "Traceback" not in watching.text()
    finally:
        watching.process.kill()


def test_part_files_and_their_inputs_are_watched(tmp_path: Path, shared_store: str) -> None:
    """The kernel is loaded once, files that a part reads are watched, and no process remains after a kill. An allowed warning stays
    suppressed."""
    (tmp_path / "parts").mkdir()
    blocks, height, rig = tmp_path / "parts/blocks.py", tmp_path / "parts/height.txt", tmp_path / "rig.yaml"
    blocks.write_text(textwrap.dedent(BLOCKS))
    height.write_text("10")
    rig.write_text(RIG)
    watching = Watching(rig, shared_store, "--emit", "mjcf")
    try:
        workers = wait_until(lambda: psutil.Process(watching.process.pid).children(recursive=True), 30.0)
        rig.write_text(f"# words\n{RIG}")
        watching.says("no file changed")
        blocks.write_text(blocks.read_text().replace("20", "21"))
        assert "parts/blocks.py: modelled blocks:Block(width=31 mm); " in watching.says("parts/blocks.py")
        height.write_text("11")
        assert "parts/height.txt: modelled blocks:Block(width=31 mm); " in watching.says("parts/height.txt")
        blocks.write_text(blocks.read_text().replace("return self.body", "return self.bodi"))
        watching.says("the last successful build remains")
        assert "the `result` of `blocks:Block`" in watching.text() or "bodi" in watching.text()
        blocks.write_text(blocks.read_text().replace("self.bodi", "self.body"))
        watching.says("errors fixed")
        assert "warning" not in watching.text()
        rig.write_text(RIG.replace(", allow: {TC414: two of them are meant}", ""))
        watching.says("warning[TC414]")
        shutil.rmtree(tmp_path)  # the working folder of all of them
        watching.says("cannot read `rig.yaml`")
        (tmp_path / "parts").mkdir(parents=True)
        blocks.write_text(textwrap.dedent(BLOCKS))
        height.write_text("10")
        rig.write_text(RIG.replace("31", "32"))
        assert "errors fixed; modelled blocks:Block(width=32 mm); " in watching.says("width=32 mm")
        assert watching.says("width=32 mm").split(" ", 1)[1].startswith(("parts/", "rig.yaml")), "as seen from the folder that is there"
        assert workers and workers[0].is_running(), "the first worker has done all of it"
        watching.process.kill()
        assert not psutil.wait_procs(workers, timeout=60.0)[1]
    finally:
        watching.process.kill()
        watching.process.wait()
