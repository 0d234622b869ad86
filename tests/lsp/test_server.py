"""`thingc lsp` as an editor meets it: what is typed, and what is published."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from live.documents import ROBOT, write
from lsp.editor import Editor, lines


@pytest.fixture(scope="module")
def editor(shared_store: str) -> Iterator[Editor]:
    editor = Editor(shared_store)
    yield editor
    assert editor.leave() == 0


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    return write(tmp_path)


def test_what_is_wrong_is_published_with_the_version(editor: Editor, robot: Path) -> None:
    assert editor.open(robot) == []
    found = editor.type(robot, ROBOT.replace("parent: base.top\n    child", "parent: bass.top\n    child"))
    assert lines(found) == ["19:13 TC302 this document has no component `bass`"]
    assert editor.type(robot, ROBOT) == []
    assert editor.type(robot, ROBOT + "\n") == []
