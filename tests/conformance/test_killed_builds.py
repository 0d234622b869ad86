"""Builds that are killed, interrupted, or run at the same time: what stands is whole, and the next build makes it right."""

from __future__ import annotations

import hashlib
import json
import select
import signal
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from conformance import rig
from conformance.harness import COMMAND, TIMEOUT, build, environment, processes, tree, write

pytestmark = pytest.mark.slow

SPANS = (60, 95)
FAREWELL = 10.0
"""How long the system may take to end processes whose parent was killed [s]."""

Tree = dict[str, bytes]


@dataclass(frozen=True)
class Scene:
    """The workspace of the rig, what builds of it must be, and how long a cold and a warm one take [s]."""

    root: Path
    expected: dict[int, Tree]
    cold: float
    warm: float

    def start(self, span: int, output: Path, store: Path, *words: str) -> subprocess.Popen[bytes]:
        """A build in a process of its own. The folder for temporary files marks all of its processes."""
        marked = self.mark(output)
        return subprocess.Popen(
            [*COMMAND, "build", "rig.yaml", "-p", f"span={span} mm", "-o", str(output), *words], cwd=self.root,
            env=environment(store, TMPDIR=marked), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        )

    def mark(self, output: Path) -> str:
        folder = output.parent / f"tmp-{output.name}"
        folder.mkdir(parents=True, exist_ok=True)
        return str(folder)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    base = tmp_path_factory.mktemp("killed")
    root = write(base / "ws", rig.DOCUMENTS)
    expected, seconds = {}, []
    for span in (*SPANS, SPANS[0]):
        began = time.monotonic()
        build("rig.yaml", "-p", f"span={span} mm", "-o", base / "out", store=base / "store", cwd=root)
        seconds.append(time.monotonic() - began)
        expected[span] = tree(base / "out" / "rig")
    assert expected[60] != expected[95]
    return Scene(root=root, expected=expected, cold=seconds[0], warm=seconds[2])


def ended(process: subprocess.Popen[bytes], mark: str) -> None:
    """Waits until nothing of a build is alive; fails when something stays."""
    process.wait(timeout=FAREWELL)
    last = time.monotonic() + FAREWELL
    while (alive := processes(mark)) and time.monotonic() < last:
        select.select([], [], [], 0.02)
    assert alive == []


def whole(folder: Path) -> Tree | None:
    """The files of a build folder, None where there is none. What the manifest lists is there to the byte, and nothing else."""
    if not folder.exists():
        return None
    files = tree(folder)
    listed = json.loads(files["manifest.json"])["files"]
    assert {path: hashlib.sha256(data).hexdigest() for path, data in files.items() if path != "manifest.json"} == listed
    return files


def sound(store: Path) -> Iterator[str]:
    """Every finished file of a store, each checked against its name or its first line."""
    for path in store.rglob("*"):
        if not path.is_file() or "." in path.name or path.name == "claims":
            continue  # being written when it was killed: a name nobody looks for; or the file whose bytes are locked, which is empty
        data = path.read_bytes()
        kind, start = path.relative_to(store).parts[0], path.parent.name
        if kind == "blobs":
            assert hashlib.sha256(data).hexdigest() == start + path.name
        else:
            checksum, _, payload = data.partition(b"\n")
            assert len(checksum) == 64 and json.loads(payload) is not None, path  # the checksum covers a key that the name hides
        yield str(path)


@dataclass
class Killer:
    """Kills builds at a given part of their time. How long they take is what the last one that was quicker took: the machine
    may have other things to do."""

    seconds: float

    def kill(self, moment: float, process: subprocess.Popen[bytes]) -> bool:
        """Kill with SIGKILL; whether the build was still running."""
        began = time.monotonic()
        try:
            process.wait(timeout=moment * self.seconds)
        except subprocess.TimeoutExpired:
            process.kill()
        if process.wait() == -signal.SIGKILL:
            return True
        assert process.returncode == 0
        self.seconds = min(self.seconds, time.monotonic() - began)
        return False


def moments(count: int, seed: int) -> list[float]:
    """Random moments, one in each part of the whole time."""
    source = np.random.default_rng(seed)
    return [float((k + source.random()) / count) for k in range(count)]


def test_cold_builds_killed_at_random_moments(scene: Scene, tmp_path: Path) -> None:
    """From an empty store. Nothing is there afterwards, or all; the next build, from what is left of the store, is as good
    as any."""
    killer = Killer(scene.cold)
    for moment in moments(5, seed=1):
        for attempt in range(5):
            output, store = tmp_path / f"out-{moment}-{attempt}", tmp_path / f"store-{moment}-{attempt}"
            process = scene.start(60, output, store)
            killed = killer.kill(moment, process)
            ended(process, scene.mark(output))
            assert whole(output / "rig") in (None, scene.expected[60])
            list(sound(store))
            if killed:
                break
        assert killed
        build("rig.yaml", "-p", "span=60 mm", "-o", output, store=store, cwd=scene.root)
        assert whole(output / "rig") == scene.expected[60], moment
        assert sorted(path.name for path in output.iterdir()) == ["rig"], "swept"
        assert len(list(sound(store))) > 20


def test_warm_builds_killed_at_random_moments(scene: Scene, tmp_path: Path) -> None:
    """Over a standing build, to and fro between two sizes: the folder holds the one or the other, whole."""
    output, store, killer = tmp_path / "out", tmp_path / "store", Killer(scene.warm)
    for span in SPANS:
        build("rig.yaml", "-p", f"span={span} mm", "-o", output, store=store, cwd=scene.root)
    standing = SPANS[1]
    for moment in moments(8, seed=2):
        for _ in range(5):
            span = SPANS[1 - SPANS.index(standing)]
            process = scene.start(span, output, store)
            killed = killer.kill(moment, process)
            ended(process, scene.mark(output))
            found = whole(output / "rig")
            assert found in (scene.expected[standing], scene.expected[span])
            standing = span if found == scene.expected[span] else standing
            if killed:
                break
        assert killed
    list(sound(store))
    for span in SPANS:
        build("rig.yaml", "-p", f"span={span} mm", "-o", output, store=store, cwd=scene.root)
        assert whole(output / "rig") == scene.expected[span]
    assert sorted(path.name for path in output.iterdir()) == ["rig"]


def test_an_interrupted_build_leaves_nothing(scene: Scene, tmp_path: Path) -> None:
    """Ctrl-C while parts are modelled: no folder, no process, no traceback."""
    process = scene.start(60, tmp_path / "out", tmp_path / "store")
    assert process.stderr is not None
    readable, _, _ = select.select([process.stderr], [], [], TIMEOUT)
    assert readable, "modelling has begun"
    assert any("thingc.realize.worker" in command for command in processes(scene.mark(tmp_path / "out"))), "they would be seen"
    process.send_signal(signal.SIGINT)
    said = process.stderr.read().decode()
    ended(process, scene.mark(tmp_path / "out"))
    assert process.returncode == 130 and "interrupted; what was written is whole" in said and "Traceback" not in said
    assert not (tmp_path / "out" / "rig").exists()


def test_two_builds_at_once(scene: Scene, tmp_path: Path) -> None:
    """From an empty store that they share, each into its own folder; then both into one folder; nothing of them stays."""
    store, mine, yours = tmp_path / "store", tmp_path / "mine", tmp_path / "yours"
    for outputs in ((mine, yours), (mine, mine), (yours, yours)):
        spans = SPANS if outputs[0] is not outputs[1] else (SPANS[1], SPANS[1])
        started = [scene.start(span, output, store) for span, output in zip(spans, outputs, strict=True)]
        for process, output in zip(started, outputs, strict=True):
            _, said = process.communicate(timeout=TIMEOUT)
            assert process.returncode == 0, said.decode()
            ended(process, scene.mark(output))
        for span, output in zip(spans, outputs, strict=True):
            assert whole(output / "rig") == scene.expected[span]
            assert [path.name for path in output.iterdir()] == ["rig"]
    assert len(list(sound(store))) > 20
