"""The study of differences: its edits fit the documents, and a short run of it."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "benchmarks" / "differences"


@pytest.fixture(scope="module", autouse=True)
def on_path():
    folders = [str(FOLDER), str(ROOT / "benchmarks" / "designs")]
    sys.path[:0] = folders
    yield
    for folder in folders:
        sys.path.remove(folder)


def test_edits_fit_the_documents(tmp_path: Path):
    from known_changes import ROBOTS, cases

    texts = {}
    assert len(cases()) >= 60 and len({(one.robot, one.name) for one in cases()}) == len(cases())
    for one in cases():
        for file, old, new in one.edits:
            path = ROOT / ROBOTS[one.robot].folder / Path(ROBOTS[one.robot].document).parent / file
            text = texts.setdefault(path, path.read_text())
            assert text.count(old) == 1 and old != new, (one.name, file)


def test_short_run(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch):
    from known_changes import ROBOTS, cases, rewritten

    study = runpy.run_path(str(FOLDER / "study.py"))
    drawn, faults = study["drawn"], study["faults"]
    monkeypatch.setenv("THINGC_STORE", shared_store)
    old = drawn(ROBOTS["arm"].copy(tmp_path / "arm"))
    assert old is not None
    for one in cases():
        if one.robot == "arm" and one.name in ("a pose of another name", "a new part", "a mount elsewhere"):
            document = ROBOTS["arm"].copy(tmp_path / one.name)
            one.write(document)
            new = drawn(document)
            assert new is not None and list(faults(old, new, one.made)) == []
            assert list(faults(old, new, frozenset())) == [f"named: {change}" for change in one.made]
    document = ROBOTS["arm"].copy(tmp_path / "rewritten")
    for number in (2, 4):
        document.write_text(rewritten((ROOT / ROBOTS["arm"].document).read_text(), number))
        new = drawn(document)
        assert new is not None and list(faults(old, new, frozenset())) == []
