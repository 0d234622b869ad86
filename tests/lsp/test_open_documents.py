"""The order in which open documents are analysed, and which diagnostics are published."""

from __future__ import annotations

import gc
import random
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from live.documents import DOCUMENTS, write
from thingc.driver.environment import Options
from thingc.model.resolve import assembly
from thingc.tools.cli.console import of_exception
from thingc.tools.lsp import open_documents
from thingc.tools.lsp.analysis import Analysis, OpenText, analyse
from thingc.tools.lsp.open_documents import OpenDocuments, Superseded


class Desk:
    """Open documents and their published diagnostics."""

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
        """Return everything published until no work is left."""
        self.published.clear()
        while self.opened.next():
            pass
        return list(self.published)


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    desk = Desk(tmp_path)
    yield desk
    desk.opened.close()


def test_edited_document_is_first_then_its_parents(desk: Desk) -> None:
    for name in ("robot.yaml", "palm.yaml", "finger.yaml", "materials.yaml"):
        desk.put(name, 1)
    assert {(name, version, *found) for name, version, found in desk.said()} == {(name, 1) for name in DOCUMENTS}
    desk.put("finger.yaml", 2, DOCUMENTS["finger.yaml"].replace("{seat: bone", "{seet: bone"))
    assert desk.said() == [("finger.yaml", 2, []), ("robot.yaml", 1, ["TC303", "TC303"])]
    desk.put("finger.yaml", 3)
    assert desk.said() == [("finger.yaml", 3, []), ("robot.yaml", 1, [])]
    desk.put("robot.yaml", 2)
    assert desk.said() == [("robot.yaml", 2, [])], "nobody depends on it"


def test_edited_document_does_not_wait_for_older_requests(desk: Desk) -> None:
    for name in ("robot.yaml", "palm.yaml", "finger.yaml"):
        desk.put(name, 1)
    desk.said()
    for version in (2, 3):
        desk.put("finger.yaml", version)
        assert desk.opened.next()
        assert desk.published[-1] == ("finger.yaml", version, []), "robot.yaml still waits"


def test_long_lived_objects_are_frozen_once_for_gc(desk: Desk) -> None:
    frozen = [gc.get_freeze_count()]
    for version in (1, 2):
        desk.put("robot.yaml", version)
        desk.said()
        frozen.append(gc.get_freeze_count())
    gc.unfreeze()
    assert frozen[0] < frozen[1] >= frozen[2], "once, lest what is replaced is kept"


def test_errors_in_closed_documents_are_published_there(desk: Desk) -> None:
    (desk.folder / "palm.yaml").write_text(DOCUMENTS["palm.yaml"].replace("frame: true", "frame: tru"))
    desk.put("robot.yaml", 1)
    assert sorted(desk.said(), key=str) == [("palm.yaml", None, ["TC204"]), ("robot.yaml", 1, [])]
    desk.put("palm.yaml", 1)
    assert desk.said() == [("palm.yaml", 1, []), ("robot.yaml", 1, [])]
    desk.opened.close_text(str(desk.folder / "palm.yaml"))
    assert ("palm.yaml", None, ["TC204"]) in desk.said(), "it is wrong on the disk"


def test_change_supersedes_a_slow_analysis(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """The analysis of the edited document continues for a while; that of another document is dropped at once."""
    begun: list[str] = []

    def endless(path: str, texts: Any, options: Any, lend: Any, memo: Any, known: Any) -> Analysis:
        begun.append(path)
        if len(begun) < 3:  # while it is at work
            threading.Thread(target=desk.put, args=[("robot.yaml", 2), ("palm.yaml", 1)][len(begun) - 1]).start()
        while len(begun) < 3:
            memo.make_empty().last("place", ())
            time.sleep(0.005)
        return Analysis(path=path, open=texts)

    monkeypatch.setattr(open_documents, "analyse", endless)
    desk.put("robot.yaml", 1)
    started = time.monotonic()
    assert desk.opened.next() and desk.published == [] and time.monotonic() - started >= open_documents.IMPATIENT
    desk.put("palm.yaml", 1)
    with pytest.raises(Superseded):
        desk.opened.analysis(str(desk.folder / "robot.yaml"))
    assert desk.published == [] and begun == [str(desk.folder / "robot.yaml")] * 2
    assert desk.said() == [("palm.yaml", 1, []), ("robot.yaml", 2, [])]


def test_internal_failure_is_a_diagnostic(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> Analysis:
        raise OSError(28, "No space left on device", "/store/x")

    with monkeypatch.context() as patch:
        patch.setattr(open_documents, "analyse", broken)
        desk.put("robot.yaml", 1)
        assert desk.said() == [("robot.yaml", 1, ["TC805"])]
    desk.put("robot.yaml", 2)
    assert desk.said() == [("robot.yaml", 2, [])]


def test_broken_text_keeps_the_last_valid_analysis(desk: Desk) -> None:
    path = str(desk.folder / "robot.yaml")
    desk.put("robot.yaml", 1)
    desk.put("robot.yaml", 2, DOCUMENTS["robot.yaml"].replace("joints:", "joints: {"))
    now = desk.opened.analysis(path)
    assert not now.well_formed and now.known is now, "it was never whole before"
    desk.put("robot.yaml", 3)
    whole = desk.opened.analysis(path)
    for version in (4, 5):
        desk.put("robot.yaml", version, DOCUMENTS["robot.yaml"].replace("joints:", "joints: {"))
        now = desk.opened.analysis(path)
        assert now.known is whole and now.text != whole.text and {joint.name for joint in now.known.model.joints} >= {"lift", "yaw_0"}


def test_cached_nested_documents_do_not_change_results(desk: Desk) -> None:
    """Mistakes are added and removed in all documents. After each change the analysis equals one without a cache."""
    path = str(desk.folder / "robot.yaml")
    slips = [
        ("robot.yaml", "base.top", "base.tip"), ("finger.yaml", "{seat: bone.seat}", "{seet: bone.seat}"), ("robot.yaml", "50 g", "-50 g"),
        ("finger.yaml", "mass: 50 g", "mass: {value: 50 g, max: 60 g}"), ("robot.yaml", "name: robot", "description: d\nname: robot"),
        ("finger.yaml", "40 mm", "40 deg"), ("palm.yaml", "frame: true", 'part: "nowhere:Palm"'), ("robot.yaml", "palm.seat", "palm.saet"),
        ("robot.yaml", "  palm:", '  spare: {part: "nowhere:Palm"}\n  palm:'), ("materials.yaml", "700 kg/m^3", "7 kg/m^3"),
    ]
    chance = random.Random(3)
    slipped: set[int] = set()
    for version in range(24):
        slipped ^= {chance.randrange(len(slips))}
        texts = dict(DOCUMENTS)
        for slip in slipped:
            name, right, wrong = slips[slip]
            texts[name] = texts[name].replace(right, wrong, 1)
        for name, text in texts.items():
            desk.put(name, version, text)
        now = desk.opened.analysis(path)
        fresh = analyse(path, now.open, desk.opened.options)
        assert now.findings == fresh.findings, slipped
        assert (now.model is None) == (fresh.model is None) and (now.robots == fresh.robots)


def test_unchanged_nested_documents_are_not_resolved_again(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    filled: list[str] = []
    fill = assembly._fill
    monkeypatch.setattr(assembly, "_fill", lambda *given, **more: (filled.append(given[1].document.relative), fill(*given, **more)))
    resolved = []
    for version, name in enumerate(["robot.yaml", "robot.yaml", "robot.yaml", "finger.yaml", "robot.yaml"]):
        filled.clear()
        desk.put(name, version, f"# {version}\n" + DOCUMENTS[name])
        desk.opened.analysis(str(desk.folder / "robot.yaml"))
        resolved.append(sorted(set(filled)))
    nested = ["finger.yaml", "palm.yaml", "robot.yaml"]
    assert resolved == [nested, ["robot.yaml"], ["robot.yaml"], nested, ["robot.yaml"]]
