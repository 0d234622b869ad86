"""Builds that are killed at a given moment, and the conditions that must hold for the remaining files."""

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

from conformance import rig
from conformance.harness import COMMAND, build, build_here, environment, processes, tree, write

SPANS = (60, 95)
FAREWELL = 60.0
"""The longest time [s] in which the system ends the child processes of a killed process, even if it is busy."""

Tree = dict[str, bytes]


@dataclass(frozen=True)
class Scene:
    """The workspace of the rig, a store with all of its parts, the expected builds, and the times [s] of a cold and a warm build."""

    root: Path
    store: Path
    expected: dict[int, Tree]
    cold: float
    warm: float

    def start(self, span: int, output: Path, store: Path, *words: str) -> subprocess.Popen[bytes]:
        """Start a build in a separate process."""
        return self.run(["build", "rig.yaml", "-p", f"span={span} mm", "-o", str(output), *words], output, store)

    def run(self, words: list[str], output: Path, store: Path) -> subprocess.Popen[bytes]:
        """Start a command in a separate process. Its folder for temporary files identifies all of its processes."""
        return subprocess.Popen(
            [*COMMAND, *words], cwd=self.root, env=environment(store, TMPDIR=self.mark(output)), stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )

    def mark(self, output: Path) -> str:
        """Return the folder for temporary files of the command that writes to `output`."""
        folder = output.parent / f"tmp-{output.name}"
        folder.mkdir(parents=True, exist_ok=True)
        return str(folder)


def made_scene(base: Path) -> Scene:
    """Create the rig in a folder, and build both of its sizes."""
    root = write(base / "ws", rig.DOCUMENTS)
    expected, seconds = {}, []
    for run, span in ((build, SPANS[0]), (build_here, SPANS[1]), (build, SPANS[0])):
        began = time.monotonic()
        run("rig.yaml", "-p", f"span={span} mm", "-o", base / "out", store=base / "store", cwd=root)
        seconds.append(time.monotonic() - began)
        expected[span] = tree(base / "out" / "rig")
    assert expected[SPANS[0]] != expected[SPANS[1]]
    return Scene(root=root, store=base / "store", expected=expected, cold=seconds[0], warm=seconds[2])


def ended(process: subprocess.Popen[bytes], mark: str) -> None:
    """Wait until no process of a build is running. Fail if a process remains."""
    process.wait(timeout=FAREWELL)
    last = time.monotonic() + FAREWELL
    while (alive := processes(mark)) and time.monotonic() < last:
        select.select([], [], [], 0.02)
    assert alive == []


def whole(folder: Path) -> Tree | None:
    """Return the files of a build folder, or None if it does not exist. Check that it contains exactly the files of the manifest."""
    if not folder.exists():
        return None
    files = tree(folder)
    listed = json.loads(files["manifest.json"])["files"]
    assert {path: hashlib.sha256(data).hexdigest() for path, data in files.items() if path != "manifest.json"} == listed
    return files


def sound(store: Path) -> Iterator[str]:
    """Check every finished file of a store. The name of a blob is the hash of its content, and the first line of a document is the hash
    of its kind, its name and the rest."""
    for path in store.rglob("*"):
        if not path.is_file() or "." in path.name or path.name == "build_locks":
            continue  # being written when it was killed: a name nobody looks for; or the file whose bytes are locked, which is empty
        data = path.read_bytes()
        kind, name = path.relative_to(store).parts[0], path.parent.name + path.name
        if kind == "blobs":
            assert hashlib.sha256(data).hexdigest() == name, path
        else:
            checksum, _, payload = data.partition(b"\n")
            assert hashlib.sha256(f"{kind}/{name}\n".encode() + payload).hexdigest().encode() == checksum, path
            json.loads(payload)
        yield str(path)


@dataclass
class Killer:
    """Kills builds at a given fraction of their time. The estimated time is nine tenths of the last build that finished, because the
    load of the machine may decrease."""

    seconds: float

    def kill(self, moment: float, process: subprocess.Popen[bytes]) -> bool:
        """Kill a process with SIGKILL. Return whether the build was still running."""
        began = time.monotonic()
        try:
            process.wait(timeout=moment * self.seconds)
        except subprocess.TimeoutExpired:
            process.kill()
        if process.wait() == -signal.SIGKILL:
            return True
        assert process.returncode == 0
        self.seconds = 0.9 * min(self.seconds, time.monotonic() - began)
        return False
