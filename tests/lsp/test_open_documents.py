"""What is analysed when, and what of that is published."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from live.documents import DOCUMENTS, write
from thingc.cli.common import of_exception
from thingc.environment import Options
from thingc.lsp import open_documents
from thingc.lsp.analysis import Analysis, OpenText
from thingc.lsp.open_documents import OpenDocuments


class Desk:
    """Open documents, and what they publish."""

    def __init__(self, folder: Path) -> None:
        write(folder)
        self.folder = folder
        self.published: list[tuple[str, int | None, list[str]]] = []
        self.opened = OpenDocuments(Options(lock=True), self._note, of_exception, lambda: None)

    def _note(self, uri: str, version: int | None, found: list[dict[str, Any]]) -> None:
        self.published.append((uri.rpartition("/")[2], version, [one["code"] for one in found]))

    def put(self, name: str, version: int, text: str | None = None) -> None:
        path = str(self.folder / name)
        text = DOCUMENTS[name] if text is None else text
        self.opened.put(path, OpenText(uri=f"file:///{name}", version=version, text=text))

    def said(self) -> list[tuple[str, int | None, list[str]]]:
        """What is published until there is nothing more to do."""
        self.published.clear()
        while self.opened.next():
            pass
        return list(self.published)


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    desk = Desk(tmp_path)
    yield desk
    desk.opened.close()


def test_the_document_that_is_typed_in_is_first_and_its_parents_follow(desk: Desk) -> None:
    for name in ("robot.yaml", "palm.yaml", "finger.yaml", "materials.yaml"):
        desk.put(name, 1)
    assert {(name, version, *found) for name, version, found in desk.said()} == {(name, 1) for name in DOCUMENTS}
    desk.put("finger.yaml", 2, DOCUMENTS["finger.yaml"].replace("{seat: bone", "{seet: bone"))
    assert desk.said() == [("finger.yaml", 2, []), ("robot.yaml", 1, ["TC303", "TC303"])]
    desk.put("finger.yaml", 3)
    assert desk.said() == [("finger.yaml", 3, []), ("robot.yaml", 1, [])]
    desk.put("robot.yaml", 2)
    assert desk.said() == [("robot.yaml", 2, [])], "nobody depends on it"


def test_a_document_that_is_not_open_is_shown_where_it_is_wrong(desk: Desk) -> None:
    (desk.folder / "palm.yaml").write_text(DOCUMENTS["palm.yaml"].replace("frame: true", "frame: tru"))
    desk.put("robot.yaml", 1)
    assert sorted(desk.said(), key=str) == [("palm.yaml", None, ["TC204"]), ("robot.yaml", 1, [])]
    desk.put("palm.yaml", 1)
    assert desk.said() == [("palm.yaml", 1, []), ("robot.yaml", 1, [])]
    desk.opened.take_away(str(desk.folder / "palm.yaml"))
    assert ("palm.yaml", None, ["TC204"]) in desk.said(), "it is wrong on the disk"


def test_a_change_supersedes_what_takes_long(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """The document that is typed in has a while; what another one is looked at for is dropped at once."""
    begun: list[str] = []

    def endless(path: str, texts: Any, options: Any, lend: Any, memo: Any, known: Any) -> Analysis:
        begun.append(path)
        while len(begun) < 3:
            memo.apart().last("place", ())
            time.sleep(0.005)
        return Analysis(path=path, open=texts)

    monkeypatch.setattr(open_documents, "analyse", endless)
    desk.put("robot.yaml", 1)
    threading.Timer(0.05, desk.put, ["robot.yaml", 2]).start()
    started = time.monotonic()
    assert desk.opened.next() and desk.published == [] and time.monotonic() - started >= open_documents.IMPATIENT
    desk.put("palm.yaml", 1)
    threading.Timer(0.05, desk.put, ["palm.yaml", 1]).start()
    assert desk.opened.next() and desk.published == [] and begun == [str(desk.folder / "robot.yaml")] * 2
    assert desk.said() == [("palm.yaml", 1, []), ("robot.yaml", 2, [])]


def test_whatever_fails_is_a_diagnostic(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> Analysis:
        raise OSError(28, "No space left on device", "/store/x")

    with monkeypatch.context() as patch:
        patch.setattr(open_documents, "analyse", broken)
        desk.put("robot.yaml", 1)
        assert desk.said() == [("robot.yaml", 1, ["TC805"])]
    desk.put("robot.yaml", 2)
    assert desk.said() == [("robot.yaml", 2, [])]


def test_broken_text_keeps_what_was_known(desk: Desk) -> None:
    path = str(desk.folder / "robot.yaml")
    desk.put("robot.yaml", 1)
    desk.put("robot.yaml", 2, DOCUMENTS["robot.yaml"].replace("joints:", "joints: {"))
    now = desk.opened.analysis(path)
    assert not now.whole and now.known is now, "it was never whole before"
    desk.put("robot.yaml", 3)
    whole = desk.opened.analysis(path)
    for version in (4, 5):
        desk.put("robot.yaml", version, DOCUMENTS["robot.yaml"].replace("joints:", "joints: {"))
        now = desk.opened.analysis(path)
        assert now.known is whole and now.text != whole.text and {joint.name for joint in now.known.model.joints} >= {"lift", "yaw_0"}
