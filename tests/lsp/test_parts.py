"""Editing parts: diagnostics do not wait for part descriptions, saving a part describes it again, and untrusted code is never run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from lsp.editor import Editor, lines

BLOCKS = """\
from pathlib import Path
from build123d import Box, Pos
from thingc import Length, MountPoint, Thing

Path(__file__).with_name("ran.txt").write_text("x")


class Block(Thing):
    def __init__(self, width: Length = 30):
        super().__init__(material="oak")
        self.width = width
        self.top = MountPoint(Pos(0, 0, 5))

    def result(self):
        return Box(self.width, 20, 10)
"""
RIG = """\
thingc: assembly/1
name: rig
materials: {oak: {density: 700 kg/m^3}}
components:
  block: {part: "blocks:Block", params: {width: 31 mm}}
  lid: {part: "blocks:Block", at: {in: block.top}}
"""
POSE = "poses: {out: {turn: 1 deg}}\n"


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/blocks.py").write_text(BLOCKS.replace('Path(__file__).with_name("ran.txt").write_text("x")\n', ""))
    (tmp_path / "rig.yaml").write_text(RIG)
    return tmp_path / "rig.yaml"


@pytest.fixture
def editor(shared_store: str) -> Iterator[Editor]:
    editor = Editor(shared_store)
    yield editor
    if editor.process.returncode is None:
        editor.process.kill()


def until(editor: Editor, path: Path, wanted: list[str], since: int = 0) -> None:
    """Wait until these diagnostics are published for a file."""
    editor.wait(lambda one: one.uri == path.as_uri() and lines(list(one.diagnostics)) == wanted, since)


def test_parts_are_described_in_the_background(editor: Editor, rig: Path) -> None:
    wrong = RIG.replace("block.top", "block.tip") + POSE
    pose, mount = "7:15 TC304 there is no joint `turn`", "6:40 TC303 `block` (`blocks:Block(width={} mm)`) has no mount `tip`"
    assert lines(editor.open(rig, wrong)) == [pose], "of the parts nothing is known yet"
    until(editor, rig, [mount.format(31), pose])
    assert lines(editor.type(rig, wrong.replace("31 mm", "33 mm"))) == [pose], "a part of 33 mm is new; those that need it wait"
    until(editor, rig, [mount.format(33), pose], len(editor.published))
    part = rig.parent / "parts/blocks.py"
    seen = len(editor.published)
    part.write_text(part.read_text().replace("self.top", "self.tip"))  # in another program
    until(editor, rig, [pose], seen)
    part.write_text(part.read_text().replace("width: Length", "wide: Length"))
    editor.wait(lambda one: any("has no parameter `width`" in found.message for found in one.diagnostics), seen)
    worker = psutil.Process(editor.process.pid).children(recursive=True)
    assert worker, "it is warm"
    editor.process.stdin.close()  # the editor has died
    assert psutil.wait_procs([psutil.Process(editor.process.pid), *worker], timeout=60.0)[1] == []


def test_untrusted_workspace_code_is_not_run(shared_store: str, rig: Path) -> None:
    (rig.parent / "parts/blocks.py").write_text(BLOCKS)
    editor = Editor(shared_store, trusted=False)
    assert lines(editor.open(rig, RIG + POSE)) == ["7:15 TC304 there is no joint `turn`"]
    settings = (rig.parent / "thingc.toml").as_uri()
    assert [one.code for one in editor.wait(lambda one: one.uri == settings and one.version is None)] == ["TC340"]
    assert psutil.Process(editor.process.pid).children() == []
    assert editor.leave() == 0
    assert not (rig.parent / "parts/ran.txt").exists()
