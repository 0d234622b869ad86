"""Rebuild rounds of an edited document: each gives the result of a separate build, and every save is noticed, however an editor saves."""

from __future__ import annotations

import json
import os
import re
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest
from msgspec.structs import replace

from live.documents import DOCUMENTS, FINGER, ROBOT, write
from thingc.driver import build_document
from thingc.driver.build_document import BuildRequest
from thingc.driver.environment import Options, with_environment
from thingc.geometry.build_reasons import BuildReason
from thingc.geometry.client import Workers
from thingc.tools.cli.console import of_exception
from thingc.tools.live.rebuild_loop import Rebuild, RebuildLoop

WISH = BuildRequest(targets=("mjcf", "bom"))
PATIENCE = 300.0


class Working:
    """A document that is being edited, and its rebuild rounds."""

    def __init__(self, folder: Path, store: str, wish: Callable[[], BuildRequest] = lambda: WISH) -> None:
        self.folder = folder
        self.options = Options(store=store)
        self.document = str(write(folder))
        self.stop = threading.Event()
        self.live = RebuildLoop(self.document, self.options, wish, of_exception)
        self._rounds = self.live.rounds(self.stop)

    def round(self) -> Rebuild:
        """Return the next round; fail if there is none."""
        timer = threading.Timer(PATIENCE, self.stop.set)
        timer.start()
        try:
            return next(self._rounds)
        finally:
            timer.cancel()

    def save(self, name: str, text: str) -> Rebuild:
        """Save a file and return the resulting round."""
        (self.folder / name).write_text(text)
        return self.round()

    def silent(self) -> bool:
        """Return whether the last action caused no round."""
        timer = threading.Timer(0.5, self.stop.set)
        timer.start()
        made = next(self._rounds, None)
        timer.cancel()
        return made is None

    def digests(self) -> dict[str, str]:
        """Return the files and digests in the manifest."""
        found: dict[str, str] = json.loads((self.folder / "build/robot/manifest.json").read_text())["files"]
        return found

    def alone(self) -> build_document.BuildResult:
        """Return the result of a separate build."""
        return with_environment(self.document, self.options, partial(build_document.build, request=WISH))


@pytest.fixture
def without_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Prevent the preparation of a worker: no document in `DOCUMENTS` needs the kernel."""
    monkeypatch.setattr(Workers, "warm", lambda _: None)


@pytest.fixture
def working(tmp_path: Path, shared_store: str, without_kernel: None) -> Iterator[Working]:
    made = Working(tmp_path, shared_store)
    with made.live:
        assert made.round().good
        yield made


def test_round_equals_a_build(working: Working) -> None:
    """Edits of every kind, one after the other. Edits that only move lines would reveal stale source locations."""
    texts = dict(DOCUMENTS)
    edits: list[tuple[str, str, str]] = [
        ("robot.yaml", r"upper: [\d.]+ deg", "upper: {n} deg"),  # a number
        ("robot.yaml", r"\A", "# {n}\n"),  # every line moves
        ("finger.yaml", r"\A", "# {n}\n"),
        ("robot.yaml", r"yaw_0: [\d.-]+ deg", "yaw_0: 300 deg"),  # beyond its limit: an error, shown at its line
        ("robot.yaml", r"\A", "# {n}\n"),
        ("robot.yaml", r"yaw_0: [\d.-]+ deg", "yaw_0: 30 deg"),
        ("robot.yaml", r"upper: [\d.]+ deg", "upper: 20 deg"),  # a pose that was not touched is wrong now
        ("robot.yaml", r"upper: [\d.]+ deg", "upper: 120 deg"),
        ("finger.yaml", r"10 g", "-10 g"),
        ("materials.yaml", r"\A", "\n"),
        ("finger.yaml", r"-10 g", "10 g"),
        ("robot.yaml", r"count: 2", "count: 3"),
        ("robot.yaml", r"poses:", "poses: ["),  # no YAML
        ("robot.yaml", r"poses: \[", "poses:"),
        ("materials.yaml", r"700", "9e9"),
        ("materials.yaml", r"9e9", "700"),
        # what was not touched in the nested document moves now, and weighs nothing
        ("robot.yaml", r"type: fixed", "type: continuous"),
    ]
    found: set[str] = set()
    for number, (name, pattern, text) in enumerate(edits):
        texts[name], times = re.subn(pattern, text.format(n=number + 40), texts[name], count=1)
        assert times == 1, pattern
        made, alone = working.save(name, texts[name]), working.alone()
        assert list(made.diagnostics) == list(alone.diagnostics), (name, pattern)
        assert made.good == (alone.files is not None)
        if alone.files is not None:
            files = json.loads(bytes(alone.files["manifest.json"]))  # type: ignore[arg-type]
            assert working.digests() == files["files"]
        found |= {d.code.code for d in made.diagnostics}
    assert len(found) > 3, "errors and warnings are among them"


def test_failing_save_keeps_the_last_good_build(working: Working) -> None:
    before = working.digests()
    wrong = working.save("robot.yaml", ROBOT.replace("yaw_0: 30 deg", "yaw_0: 300 deg"))
    assert (wrong.good, wrong.kept, wrong.changed) == (False, True, ())
    assert [(d.code.code, d.span and d.span.line) for d in wrong.diagnostics] == [("TC601", 23)]
    assert working.digests() == before
    right = working.save("robot.yaml", ROBOT.replace("yaw_0: 30 deg", "yaw_0: 31 deg"))
    assert right.good and right.recovered and right.saved == (str(working.folder / "robot.yaml"),)
    assert {path for path, digest in working.digests().items() if before[path] != digest} == set(right.changed)


def test_save_without_a_change_of_meaning(working: Working) -> None:
    """Saving the same bytes causes no round. Different bytes with the same meaning change no file."""
    os.utime(working.document)
    commented = working.save("robot.yaml", f"# words\n{ROBOT}")
    assert (commented.good, commented.changed, commented.number) == (True, (), 2)
    (working.folder / "robot.yaml").write_text(f"# words\n{ROBOT}")
    assert working.silent()


def test_saves_by_rename_and_in_pieces(working: Working) -> None:
    aside = working.folder / ".robot.yaml.swp"
    aside.write_text(ROBOT.replace("120 deg", "121 deg"))
    aside.replace(working.document)
    assert working.round().good
    # half of a document is YAML, too; nobody hears of it
    text = ROBOT.replace("120 deg", "122 deg")

    def in_pieces() -> None:
        with open(working.document, "w") as stream:
            for start in range(0, len(text), 200):
                stream.write(text[start : start + 200])
                stream.flush()
                time.sleep(0.004)

    writer = threading.Thread(target=in_pieces)
    writer.start()
    made = working.round()
    writer.join()
    assert made.good and b"122 deg" in (working.folder / "robot.yaml").read_bytes()
    # gone for a moment
    os.unlink(working.document)
    threading.Timer(0.1, lambda: write(working.folder)).start()
    made = working.round()
    assert made.good and made.diagnostics == ()
    # all at once: one round
    for name, text in DOCUMENTS.items():
        (working.folder / name).write_text(f"# anew\n{text}")
    assert {os.path.basename(path) for path in working.round().saved} == set(DOCUMENTS)


def test_deleted_document_that_is_restored(working: Working) -> None:
    os.unlink(working.document)
    gone = working.round()
    assert [d.code.code for d in gone.diagnostics] == ["TC101"] and gone.kept
    assert working.save("robot.yaml", ROBOT).recovered


def test_pipe_instead_of_a_document_does_not_block(working: Working) -> None:
    os.unlink(working.document)
    os.mkfifo(working.document)
    piped = working.round()
    assert [d.message for d in piped.diagnostics] == ["cannot read `robot.yaml`: it is not a regular file"] and piped.kept
    os.unlink(working.document)
    assert working.save("robot.yaml", ROBOT).recovered


def test_missing_referenced_files_are_watched(working: Working) -> None:
    missing = working.save("robot.yaml", ROBOT.replace("finger.yaml", "other/thumb.yaml"))
    assert [d.code.title for d in missing.diagnostics] == ["a missing file"]
    (working.folder / "other").mkdir()
    found = working.save("other/thumb.yaml", FINGER)
    assert found.good and found.recovered and found.saved[-1].endswith("other/thumb.yaml")
    shutil.rmtree(working.folder / "other")
    assert not working.round().good


def test_workspace_file_is_watched(tmp_path: Path, shared_store: str, without_kernel: None) -> None:
    """Its settings take effect at once, an error in it can be fixed, and a new workspace file is noticed."""
    from thingc.documents.workspace import Workspace

    def wish() -> BuildRequest:
        from thingc.base.diagnostics import Report

        workspace = Workspace.find(str(tmp_path / "robot.yaml"), Report())
        return BuildRequest(targets=(workspace.emit if workspace is not None else ()) or ("bom",))

    working = Working(tmp_path, shared_store, wish)
    with working.live:
        assert working.round().good and set(working.digests()) == {"bom.csv", "bom.json"}
        head = 'thingc = "workspace/1"\n'
        assert "hag.svg" in working.save("thingc.toml", f'{head}emit = ["hag"]\n').changed
        broken = working.save("thingc.toml", f"{head}emit = [\n")
        assert not broken.good and broken.diagnostics[0].span is not None
        assert working.save("thingc.toml", f'{head}build = "made"\nemit = ["bom"]\n').recovered
        assert (tmp_path / "made/robot/bom.csv").exists()
        (tmp_path / "thingc.toml").unlink()
        assert working.round().good
        assert working.save("thingc.toml", head).good


def test_failed_write_is_reported_and_retried(working: Working) -> None:
    strange = working.folder / "build/robot/notes.txt"
    strange.write_text("mine")
    refused = working.save("robot.yaml", f"# 1\n{ROBOT}")
    assert [d.code.code for d in refused.diagnostics] == ["TC804"] and "notes.txt" in refused.diagnostics[0].message
    strange.unlink()
    assert working.save("robot.yaml", f"# 2\n{ROBOT}").recovered


def test_exception_ends_one_round_only(working: Working, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("a defect")

    said: list[Exception] = []
    monkeypatch.setattr(working.live, "_refused", lambda fault: (said.append(fault), of_exception(OSError(2, "no", "file")))[1])
    with monkeypatch.context() as patched:
        patched.setattr(build_document, "build", broken)
        made = working.save("robot.yaml", f"# 1\n{ROBOT}")
    assert not made.good and [str(fault) for fault in said] == ["a defect"]
    assert working.save("robot.yaml", f"# 2\n{ROBOT}").recovered


def test_save_during_a_round_is_not_lost(working: Working, monkeypatch: pytest.MonkeyPatch) -> None:
    """A result that mixes both versions is not written."""
    build, texts = build_document.build, iter([ROBOT.replace("120 deg", "124 deg")])

    def slow(*arguments: object) -> build_document.BuildResult:
        built = build(*arguments)  # type: ignore[arg-type]
        for text in texts:
            (working.folder / "robot.yaml").write_text(text)
        return built

    monkeypatch.setattr(build_document, "build", slow)
    made = working.save("robot.yaml", ROBOT.replace("120 deg", "123 deg"))
    assert made.number == 2 and "2.164" in (working.folder / "build/robot/mjcf/robot_bench.xml").read_text()  # 124 deg
    assert working.silent()


def test_modelled_parts_of_an_abandoned_round_are_reported(working: Working, monkeypatch: pytest.MonkeyPatch) -> None:
    build, texts = build_document.build, iter([ROBOT.replace("120 deg", "124 deg")])
    modelled = BuildReason(reused=False, reason="first time")

    def slow(*arguments: object) -> build_document.BuildResult:
        built = build(*arguments)  # type: ignore[arg-type]
        for text in texts:
            (working.folder / "robot.yaml").write_text(text)
            built = replace(built, compilation=replace(built.compilation, decisions={"things:Weight": modelled}))
        return built

    monkeypatch.setattr(build_document, "build", slow)
    made = working.save("robot.yaml", ROBOT.replace("120 deg", "123 deg"))
    assert made.number == 2 and made.modelled == {"things:Weight": "things:Weight"}
    assert working.save("robot.yaml", ROBOT).modelled == {}


def test_single_file_is_processed_without_delay(working: Working, monkeypatch: pytest.MonkeyPatch) -> None:
    """Several files are processed once no more saves arrive."""
    part, document, empty = working.folder / "things.py", working.document, working.folder / "empty.py"
    part.write_text("pass")
    empty.write_text("")
    monkeypatch.setattr(working.live, "_geometry", SimpleNamespace(inputs={str(part), str(empty)}))
    assert [working.live._small(saved) for saved in [(str(part),), (document,), (str(empty),), (str(part), document), ()]] == [
        True, True, False, False, False,
    ]


def test_parts_start_early_and_hanging_parts_are_abandoned(tmp_path: Path) -> None:
    """The part is modelled while its class is described. The next save does not wait for its timeout of two minutes."""
    part = "\n".join([
        "from build123d import Box", "from thingc import Thing", "", "class Weight(Thing):", "    def __init__(self) -> None:",
        "        super().__init__()", "", "    def result(self):", "        return Box(10, 10, 10)", "",
    ])
    document = "\n".join([
        "thingc: assembly/1", "name: robot", "components:", "  base: {frame: true, mass: 1 kg}",
        "  weight: {part: things:Weight, mass: 100 g, at: {in: base.origin}}", "",
    ])
    for name, text in {
        "parts/things.py": part, "thingc.toml": 'thingc = "workspace/1"\nparts = ["parts"]\n', "robot.yaml": document,
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    options = Options(store=str(tmp_path / "store"), jobs=1)
    stop = threading.Event()
    with RebuildLoop(str(tmp_path / "robot.yaml"), options, lambda: BuildRequest(targets=("bom",)), of_exception, writes=False) as live:
        rounds = live.rounds(stop)
        first = next(rounds)
        assert first.good, first.diagnostics
        asked: list[str] = []
        send = live._workers._send
        live._workers._send = lambda worker, request: (asked.append(request["op"]), send(worker, request))[1]  # type: ignore[method-assign]
        (tmp_path / "parts" / "things.py").write_text(part.replace("Box(10", "Box(12"))
        longer = next(rounds)
        assert longer.good and longer.modelled == {"things:Weight": "things:Weight"} and asked[:2] == ["model", "describe"]
        assert longer.built is not None and longer.built.compilation.assembly is not None
        assert [one.record.volume for one in longer.built.compilation.assembly.occurrences if one.record] == [pytest.approx(1.2e-6)]
        (tmp_path / "robot.yaml").write_text(document.replace("100 g", "100 gg"))
        assert not next(rounds).good
        (tmp_path / "parts" / "things.py").write_text(part.replace("Box(10", "Box(13"))
        assert not next(rounds).good and live._workers._begun == {}
        (tmp_path / "robot.yaml").write_text(document)
        assert next(rounds).good
        hanging = part.replace("        return", "        import time\n        time.sleep(600)\n        return")
        (tmp_path / "parts" / "things.py").write_text(hanging)
        mending = threading.Timer(3.0, (tmp_path / "parts" / "things.py").write_text, [part.replace("10)", "20)")])
        mending.start()
        began = time.monotonic()
        mended = next(rounds)
        assert mended.good and mended.built is not None and mended.built.compilation.modelled == ["things:Weight"]
        assert time.monotonic() - began < 60.0
