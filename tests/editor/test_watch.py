"""`thingc schema --watch`: from a save to the schema on disk, what only workers can tell, and its end."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from editor.language_server import wait_until
from editor.running import ROOT, thingc

SOON = 3.0
"""How much processor time [s] a save may take, whatever else the machine does; it is well below one second."""

PATIENCE = 300.0
"""How long [s] is waited for what comes in a second where the machine does nothing else."""


class Watched:
    """A workspace that is watched, and what the watcher prints."""

    def __init__(self, folder: Path, store: str) -> None:
        self.folder = folder
        self.printed = folder / "printed.txt"
        with open(self.printed, "w") as stream:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "thingc", "schema", "--watch"], cwd=folder, stdout=stream, stderr=stream,
                env={**os.environ, "THINGC_STORE": store},
            )
        assert wait_until(lambda: "watching" in self.text() or self.process.poll() is not None, PATIENCE), self.text()
        assert self.process.poll() is None, self.text()

    def text(self) -> str:
        return self.printed.read_text()

    def schema(self, name: str) -> Any:
        return json.loads((self.folder / ".thingc/schema" / f"{name}.json").read_text())

    def spent(self) -> float:
        """The processor time [s] that the watcher has taken."""
        return sum(psutil.Process(self.process.pid).cpu_times()[:2])

    def after(self, path: Path, text: str, seen: Any) -> float:
        """Save a file, at once, as most editors do; how much processor time [s] the watcher takes until `seen()` is true."""
        before, aside = self.spent(), self.folder / "saved.tmp"
        aside.write_text(text)
        aside.replace(path)
        assert wait_until(seen, PATIENCE), self.text()
        return self.spent() - before


@pytest.fixture
def watched(tmp_path: Path, shared_store: str) -> Iterator[Watched]:
    for name in ("assemblies", "parts"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "thingc.toml", tmp_path)
    thingc(tmp_path, shared_store, "schema")
    found = Watched(tmp_path, shared_store)
    yield found
    found.process.kill()
    found.process.wait()


def test_a_save_is_fresh_soon(watched: Watched) -> None:
    minchw = watched.folder / "assemblies/minchw/minchw.yaml"
    name = "assemblies/minchw/minchw.yaml"
    text = minchw.read_text()

    def has(word: str) -> bool:
        return word in watched.schema(name)["properties"]["components"]["properties"]

    fresh = text.replace("components:\n", "components:\n  marker_plate: {part: arm:BasePlate, attach: {bottom: body.origin}}\n", 1)
    assert watched.after(minchw, fresh, lambda: has("marker_plate")) < SOON
    assert watched.after(minchw, text, lambda: not has("marker_plate")) < SOON
    assert "refreshed in " in watched.text()
    # what did not change was not written again
    assert "assemblies/arm.yaml" not in watched.text().partition("watching")[2]


def test_a_broken_save_keeps_the_last_schema_and_the_next_one_mends_it(watched: Watched) -> None:
    arm = watched.folder / "assemblies/arm.yaml"
    text, before = arm.read_text(), watched.schema("assemblies/arm.yaml")
    kept = "assemblies/arm.yaml: not well-formed just now; it keeps its last schema"
    arm.write_text("")  # by an editor that has not written it yet
    assert wait_until(lambda: kept in watched.text(), PATIENCE)
    assert watched.schema("assemblies/arm.yaml") == before
    watched.after(arm, text + "x: [\n", lambda: watched.text().count(kept) == 2)
    assert watched.schema("assemblies/arm.yaml") == before
    fresh = text.replace("  home: {", "  away: {}\n  home: {")
    watched.after(arm, fresh, lambda: "away" in json.dumps(watched.schema("assemblies/arm.yaml")["$defs"]["ModeSpec"]))


def test_new_documents_and_parts_are_found(watched: Watched) -> None:
    extra = watched.folder / "assemblies/extra.yaml"
    there = watched.folder / ".thingc/schema/assemblies/extra.yaml.json"
    text = "thingc: assembly/1\nname: extra\ncomponents:\n  plate: {part: arm:BasePlate}\n"
    assert watched.after(extra, text, there.exists) < SOON
    assert wait_until(lambda: "assemblies/extra.yaml" in (watched.folder / ".vscode/settings.json").read_text(), PATIENCE)
    # a parameter that is new in a part file: the kernel is loaded for it, meanwhile what was known stays
    part = watched.folder / "parts/arm.py"
    before = part.read_text()
    for word in ("square", "squarer"):  # twice: the same part is missing from the store again
        watched.after(
            part, before.replace("size: edge of the plate", f"size: edge of the {word} plate"),
            lambda word=word: f"Edge of the {word} plate" in json.dumps(watched.schema("assemblies/extra.yaml")),
        )
    extra.unlink()
    assert wait_until(lambda: not there.exists(), PATIENCE)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_cleanly_and_leaves_nobody_behind(watched: Watched, number: signal.Signals) -> None:
    part = watched.folder / "parts/arm.py"
    part.write_text(f"{part.read_text()}\nimport time\ntime.sleep({PATIENCE})\n")  # whoever looks at it is still at it when we look
    own = psutil.Process(watched.process.pid)
    workers = wait_until(lambda: own.children(recursive=True), PATIENCE)
    assert workers, "a worker looks at the part that was edited"
    watched.process.send_signal(number)
    assert watched.process.wait(PATIENCE) == 0, watched.text()
    assert "Traceback" not in watched.text()
    assert not psutil.wait_procs(workers, timeout=PATIENCE)[1]
