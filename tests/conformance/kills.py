"""`make kills KILLS=60 SEED=1`: kill builds and batches at random moments, and check the remaining files. Five kinds of kills alternate:
a build with an empty store; a build over an existing build of another size; a batch with an empty store; a packed batch; and one of
two simultaneous builds. The killed process is the command itself or, in one of three cases, one of its child processes. Afterwards,
no process is running, the name of every finished file of the store matches its content, and the build folder is missing or equals the
old or the new build. The next build, or the resumed batch (which builds a variant again if its runner was killed), writes the same
bytes as without a kill. The first failure ends the campaign with exit code 1, and its folder is kept. The same seed gives the same
moments on a machine of the same speed."""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from conformance.harness import TIMEOUT, build, thingc, tree, write
from conformance.killing import SPANS, Scene, Tree, ended, made_scene, sound, whole

VARIANTS = """
    thingc: variants/1
    assembly: rig.yaml
    name: spans
    parameters: {span: {from: 60 mm, to: 95 mm, count: 6}}
"""
LAYOUTS = ("folders", "packed")
KINDS = ("cold build", "warm build", "batch", "packed batch", "two builds")


@dataclass
class Campaign:
    """The scene, the expected files and the time [s] of a batch by layout, and the counters."""

    scene: Scene
    base: Path
    source: random.Random
    variants: dict[str, Tree] = field(default_factory=dict)
    batch_seconds: float = 0.0
    counted: Counter[str] = field(default_factory=Counter)

    def prepare(self) -> None:
        """Build the batch of each layout once, the first one with an empty store."""
        write(self.scene.root, {"spans.yaml": VARIANTS})
        for layout in LAYOUTS:
            began = time.monotonic()
            self._batch(self.base / layout, self.base / "reference-store", layout)
            self.batch_seconds = self.batch_seconds or time.monotonic() - began
            self.variants[layout] = self._of_batch(self.base / layout)

    def once(self, number: int) -> None:
        """Kill once, and check the result. Raises `AssertionError` if a file is wrong."""
        kind = KINDS[number % len(KINDS)]
        folder = self.base / str(number)
        folder.mkdir()
        output, store = folder / "out", folder / "store"
        if kind.endswith("batch"):
            self._kill_batch(output, store, "packed" if kind == "packed batch" else "folders")
        else:
            self._kill_build(kind, output, store)
        assert len(list(sound(store))) > 20
        self.counted[kind] += 1
        shutil.rmtree(folder)

    def _kill_build(self, kind: str, output: Path, store: Path) -> None:
        standing: Tree | None = None
        seconds = self.scene.cold
        if kind == "warm build":
            for span in SPANS:
                build("rig.yaml", "-p", f"span={span} mm", "-o", output, store=store, cwd=self.scene.root)
            standing, seconds = self.scene.expected[SPANS[1]], self.scene.warm
        beside = output.parent / "beside"
        other = self.scene.start(SPANS[1], beside, store) if kind == "two builds" else None
        process = self.scene.start(SPANS[0], output, store)
        self._kill(process, seconds)
        ended(process, self.scene.mark(output))
        assert whole(output / "rig") in (standing, self.scene.expected[SPANS[0]])
        if other is not None:
            _, said = other.communicate(timeout=TIMEOUT)
            assert other.returncode == 0, said.decode()
            assert whole(beside / "rig") == self.scene.expected[SPANS[1]]
        list(sound(store))
        build("rig.yaml", "-p", f"span={SPANS[0]} mm", "-o", output, store=store, cwd=self.scene.root)
        assert whole(output / "rig") == self.scene.expected[SPANS[0]]
        assert sorted(path.name for path in output.iterdir()) == ["rig"]

    def _kill_batch(self, output: Path, store: Path, layout: str) -> None:
        process = self.scene.run(["batch", "spans.yaml", "-o", str(output), "--jobs", "2", "--layout", layout], output, store)
        self._kill(process, self.batch_seconds)
        ended(process, self.scene.mark(output))
        for place in (output / "spans" / "variants").glob("*/manifest.json"):
            found = {f"variants/{place.parent.name}/{path}": data for path, data in tree(place.parent).items()}
            assert found.items() <= self.variants[layout].items(), place
        list(sound(store))
        self._batch(output, store, layout)
        assert self._of_batch(output) == self.variants[layout]

    def _batch(self, output: Path, store: Path, layout: str) -> None:
        words = ["--layout", layout, *(["--resume", "--retry"] if (output / "spans" / "batch.json").exists() else [])]
        ran = thingc("batch", "spans.yaml", "-o", output, "--jobs", "2", *words, store=store, cwd=self.scene.root)
        assert ran.code == 0, ran.err

    def _of_batch(self, output: Path) -> Tree:
        """Return the variants of a batch and their shared files. The table and the journal are omitted, because they contain times."""
        found = tree(output / "spans")
        assert not any(path.endswith(".jsonl") and path.startswith("chunks/") for path in found), "a journal is left beside its chunk"
        return {
            path: data for path, data in found.items()
            if path.startswith(("variants/", "chunks/", "assets/")) and not path.endswith(".run.parquet")
        }

    def _kill(self, process: subprocess.Popen[bytes], seconds: float) -> None:
        """Kill the process or one of its child processes with SIGKILL after a random fraction of its time."""
        inner = self.source.random() < 1 / 3
        moment = self.source.random() * seconds
        try:
            process.wait(timeout=moment)
        except subprocess.TimeoutExpired:
            under = psutil.Process(process.pid).children(recursive=True)
            victim = self.source.choice(under).pid if inner and under else process.pid
            try:
                os.kill(victim, signal.SIGKILL)
                self.counted["killed while at work"] += 1
            except ProcessLookupError:
                pass
        process.communicate(timeout=TIMEOUT)
        assert process.returncode in (0, 1, -signal.SIGKILL), process.returncode


def main() -> int:
    """Run the campaign, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--number", type=int, default=60, help="number of kills")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    base = Path(tempfile.mkdtemp(prefix="kills-"))
    began = time.monotonic()
    campaign = Campaign(made_scene(base), base, random.Random(chosen.seed))
    campaign.prepare()
    for number in range(chosen.number):
        try:
            campaign.once(number)
        except AssertionError as fault:
            print(f"kill {number} ({KINDS[number % len(KINDS)]}): {fault}\nits folder is {base / str(number)}", file=sys.stderr)
            raise
        print(f"\r{number + 1} of {chosen.number}", end="", file=sys.stderr, flush=True)
    shutil.rmtree(base)
    seconds = time.monotonic() - began
    told = ", ".join(f"{count} {what}" for what, count in campaign.counted.items())
    print(f"\n{chosen.number} kills with seed {chosen.seed} in {seconds:.0f} s: {told}; nothing but whole entries was left")
    return 0


if __name__ == "__main__":
    sys.exit(main())
