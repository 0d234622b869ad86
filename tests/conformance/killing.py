"""Builds that are killed at a given moment, and what must hold of all that they leave."""

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
"""How long the system may take to end processes whose parent was killed [s], however busy it is."""

Tree = dict[str, bytes]


@dataclass(frozen=True)
class Scene:
    """The workspace of the rig, a store with all of its parts, what builds of it must be, and how long a cold and a warm one take [s]."""

    root: Path
    store: Path
    expected: dict[int, Tree]
    cold: float
    warm: float

    def start(self, span: int, output: Path, store: Path, *words: str) -> subprocess.Popen[bytes]:
        """A build in a process of its own."""
        return self.run(["build", "rig.yaml", "-p", f"span={span} mm", "-o", str(output), *words], output, store)

    def run(self, words: list[str], output: Path, store: Path) -> subprocess.Popen[bytes]:
        """A command in a process of its own. The folder for temporary files marks all of its processes."""
        return subprocess.Popen(
            [*COMMAND, *words], cwd=self.root, env=environment(store, TMPDIR=self.mark(output)), stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )

    def mark(self, output: Path) -> str:
        """The folder for temporary files of what writes to `output`."""
        folder = output.parent / f"tmp-{output.name}"
        folder.mkdir(parents=True, exist_ok=True)
        return str(folder)


def made_scene(base: Path) -> Scene:
    """The rig in a folder, with each of its two sizes built to the end."""
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
    """Every finished file of a store, each checked against its place: a blob's name is the hash of its bytes, and the first line of a
    document that of its kind, its name and the rest."""
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
    """Kills builds at a given part of their time. How long they take is nine tenths of what the last one took that got away: the machine
    may have less and less to do beside them."""

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
        self.seconds = 0.9 * min(self.seconds, time.monotonic() - began)
        return False
