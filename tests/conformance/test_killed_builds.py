"""Builds that are killed, interrupted or run at the same time. The existing files are complete, and the next build is correct. `make
kills` tests many more moments, and batches (`kills.py`)."""

from __future__ import annotations

import select
import shutil
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from conformance import rig
from conformance.harness import TIMEOUT, build_here, processes, write
from conformance.killing import SPANS, Killer, Scene, ended, made_scene, sound, whole

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return made_scene(tmp_path_factory.mktemp("killed"))


def moments(count: int, seed: int) -> list[float]:
    """Return random moments, one in each interval of the total time."""
    source = np.random.default_rng(seed)
    return [float((k + source.random()) / count) for k in range(count)]


def test_cold_builds_killed_at_random_moments(scene: Scene, tmp_path: Path) -> None:
    """With an empty store. Afterwards, the build folder is missing or complete. The next build, with the remaining store, gives the same
    files."""
    killer = Killer(scene.cold)
    for moment in moments(1, seed=1):
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
        build_here("rig.yaml", "-p", "span=60 mm", "-o", output, store=store, cwd=scene.root)
        assert whole(output / "rig") == scene.expected[60], moment
        assert sorted(path.name for path in output.iterdir()) == ["rig"], "swept"
        assert len(list(sound(store))) > 20


def test_warm_builds_killed_at_random_moments(scene: Scene, tmp_path: Path) -> None:
    """Over an existing build, alternating between two sizes. The folder contains one of both builds, complete."""
    output, store, killer = tmp_path / "out", tmp_path / "store", Killer(scene.warm)
    shutil.copytree(scene.store, store)
    for span in SPANS:
        build_here("rig.yaml", "-p", f"span={span} mm", "-o", output, store=store, cwd=scene.root)
    standing = SPANS[1]
    for moment in moments(3, seed=2):
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
        build_here("rig.yaml", "-p", f"span={span} mm", "-o", output, store=store, cwd=scene.root)
        assert whole(output / "rig") == scene.expected[span]
    assert sorted(path.name for path in output.iterdir()) == ["rig"]


def test_remains_of_a_killed_build_are_removed(scene: Scene, tmp_path: Path) -> None:
    """The build was killed after the exchange of the folders, so the existing files equal those of the next build."""
    output = tmp_path / "out"
    words = ("rig.yaml", "-p", "span=60 mm", "-o", output)
    build_here(*words, store=scene.store, cwd=scene.root)
    for left in (".rig.thingc-new/mjcf", ".rig.thingc-old/mjcf"):
        (output / left).mkdir(parents=True)
    (output / ".rig.thingc-lock").touch()
    build_here(*words, store=scene.store, cwd=scene.root)
    assert sorted(path.name for path in output.iterdir()) == ["rig"]
    assert whole(output / "rig") == scene.expected[60]


def test_interrupted_build_leaves_no_files(scene: Scene, tmp_path: Path) -> None:
    """Ctrl-C while parts are built, which would take ten minutes. There is no folder, no process and no traceback."""
    slow = rig.SOLIDS.replace("self.body = Pos(x / 2", "__import__('time').sleep(600)\n            self.body = Pos(x / 2")
    assert slow != rig.SOLIDS
    scene = replace(scene, root=write(tmp_path / "ws", rig.DOCUMENTS | {"parts/solids.py": slow}))
    # What a shell has begun in its background (`make test &`) ignores SIGINT, and so would what that begins.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    process = scene.start(60, tmp_path / "out", tmp_path / "store")
    signal.signal(signal.SIGINT, before)
    assert process.stderr is not None
    readable, _, _ = select.select([process.stderr], [], [], TIMEOUT)
    assert readable, "modelling has begun"
    assert any("thingc.geometry.worker.server" in command for command in processes(scene.mark(tmp_path / "out"))), "they would be seen"
    process.send_signal(signal.SIGINT)
    said = process.stderr.read().decode()
    ended(process, scene.mark(tmp_path / "out"))
    assert (process.returncode, "Traceback" in said) == (130, False) and "interrupted; all written files are complete" in said, said
    assert not (tmp_path / "out" / "rig").exists()


def test_two_builds_at_once(scene: Scene, tmp_path: Path) -> None:
    """With an empty shared store, into one folder. `make kills` also builds two sizes at once. No temporary files remain."""
    store, output = tmp_path / "store", tmp_path / "out"
    started = [scene.start(SPANS[1], output, store) for _ in range(2)]
    for process in started:
        _, said = process.communicate(timeout=TIMEOUT)
        assert process.returncode == 0, said.decode()
    ended(process, scene.mark(output))
    assert whole(output / "rig") == scene.expected[SPANS[1]]
    assert [path.name for path in output.iterdir()] == ["rig"]
    assert len(list(sound(store))) > 20
