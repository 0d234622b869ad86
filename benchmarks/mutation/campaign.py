"""Change one expression of the compiler at a time and report which changes no test notices.

    make mutation MUTANTS=300 SEED=1

The tests run in copies of the working tree. First each test file runs once with a tracer, which records its duration and the lines that it
executes. A mutant then runs the test files that execute its line, those of its own room first, then the fastest, until one fails. A test
file that takes `LIMIT` times as long as before counts as failed.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from queue import SimpleQueue

from mutants import Mutant, mutants

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "compiler/thingc"
ROOMS = ("tools/importing", "targets", "model/resolve", "model/assembly", "model/robot", "batch/plans")
TESTS = (*ROOMS, "cases", "families", "links", "loops", "mjcf", "modes", "statics", "testing", "variants")
PLUGINS = Path(__file__).resolve().parent / "plugins"
LIMIT = 4.0
PATIENCE = 30.0
"""Seconds that a test file may always take longer than before."""


@dataclass
class TestFile:
    """A test file: how long it takes [s], and the lines that it executes, by file of the compiler."""

    path: str
    seconds: float
    lines: dict[str, set[int]]

    def covers(self, mutant: Mutant) -> bool:
        lines = self.lines.get(mutant.file, set())
        return mutant.line in lines or mutant.statement in lines


@dataclass
class Copies:
    """Copies of the working tree, each used by one thread at a time; temporary files and the store of parts lie beside `tree`."""

    free: SimpleQueue[Path] = field(default_factory=SimpleQueue)
    clock: Iterator[int] = field(default_factory=lambda: count(int(time.time()), 2))

    @contextmanager
    def one(self) -> Iterator[Path]:
        copy = self.free.get()
        try:
            yield copy
        finally:
            self.free.put(copy)

    def write(self, path: Path, text: str) -> None:
        """Write a module with a new time stamp, without which Python would use the compiled module of the one before."""
        path.write_text(text)
        now = next(self.clock)
        os.utime(path, (now, now))


def copied(target: Path) -> Path:
    """Copy the files of the working tree that git does not ignore."""
    names = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout
    for name in filter(None, names.split("\0")):
        if (ROOT / name).exists() or (ROOT / name).is_symlink():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name, follow_symlinks=False)
    return target


def run(copy: Path, test: str, slow: bool, timeout: float, traced: Path | None = None) -> bool:
    """Whether the tests of a file pass in a copy."""
    paths = [copy / "compiler", copy / "parts", PLUGINS]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths)), "THINGC_STORE": str(copy.parent / "store")}
    if traced is not None:
        environment |= {"TRACED_FOLDER": str(copy / PACKAGE), "TRACED_LINES": str(traced)}
    options = ["-x", "-p", "no:cacheprovider", "-p", "unshrunk", "--hypothesis-profile=unshrunk", f"--basetemp={copy.parent / 'tmp'}"]
    command = [sys.executable, "-m", "pytest", *options, *([] if slow else ["-m", "not slow"]), test]
    process = subprocess.Popen(
        command, cwd=copy, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return process.wait(timeout) in (0, 5)  # 5: all tests of the file are slow
    except subprocess.TimeoutExpired:
        return False
    finally:
        if process.poll() is None:
            os.killpg(process.pid, 9)
            process.wait()


def traced(copies: Copies, test: str, slow: bool) -> TestFile | None:
    """Run a test file with the tracer; None if it fails without any mutant."""
    with copies.one() as copy, tempfile.TemporaryDirectory() as folder:
        begin = time.monotonic()
        if not run(copy, test, slow, 900.0, Path(folder)):
            print(f"not used: {test} fails", flush=True)
            return None
        lines: dict[str, set[int]] = {}
        for path in Path(folder).iterdir():
            for file, found in json.loads(path.read_text() or "{}").items():
                lines.setdefault(file, set()).update(found)
        return TestFile(test, time.monotonic() - begin, lines)


def judged(copies: Copies, mutant: Mutant, tests: list[TestFile], most: int, slow: bool) -> str | None:
    """The test file that kills a mutant, or None."""
    room = mutant.file.split("/")[0]
    covering = sorted((one for one in tests if one.covers(mutant)), key=lambda one: (f"tests/{room}/" not in one.path, one.seconds))
    with copies.one() as copy:
        path = copy / PACKAGE / mutant.file
        original = path.read_text()
        copies.write(path, mutant.text)
        try:
            slowest = (one for one in covering[:most] if not run(copy, one.path, slow, LIMIT * one.seconds + PATIENCE))
            killer = next(slowest, None)
        finally:
            copies.write(path, original)
    return None if killer is None else killer.path


def chosen(rooms: list[str], number: int, seed: int) -> list[Mutant]:
    """Mutants of random lines, at most one of each line."""
    by_line: dict[tuple[str, int], list[Mutant]] = {}
    for room in rooms:
        for path in sorted((ROOT / PACKAGE / room).rglob("*.py")):
            for one in mutants(str(path.relative_to(ROOT / PACKAGE)), path.read_text()):
                by_line.setdefault((one.file, one.line), []).append(one)
    chance = random.Random(seed)
    return [chance.choice(by_line[line]) for line in chance.sample(sorted(by_line), min(number, len(by_line)))]


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--number", type=int, default=300, help="how many mutants (default: 300)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rooms", nargs="+", default=list(ROOMS), help="folders of compiler/thingc to change")
    parser.add_argument("--minutes", type=float, default=240.0, help="start no further mutant after this time (default: 240)")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--most", type=int, default=6, help="how many test files a mutant must survive (default: 6)")
    parser.add_argument("--slow", action="store_true", help="run tests that are marked `slow`, too")
    parser.add_argument("--json", type=Path, default=ROOT / "build" / "mutation.json", help="where the results are written")
    return parser.parse_args()


def main() -> None:
    arguments = parsed()
    end = time.monotonic() + 60.0 * arguments.minutes
    results: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder, ThreadPoolExecutor(arguments.jobs) as pool:
        copies = Copies()
        for number in range(arguments.jobs):
            copies.free.put(copied(Path(folder) / str(number) / "tree"))
        files = sorted(str(path.relative_to(ROOT)) for name in TESTS for path in (ROOT / "tests" / name).glob("test_*.py"))
        tests = [one for one in pool.map(lambda test: traced(copies, test, arguments.slow), files) if one is not None]
        print(f"{len(tests)} test files take {sum(one.seconds for one in tests):.0f} s with the tracer", flush=True)

        def judge(mutant: Mutant) -> None:
            if time.monotonic() < end:
                killer = judged(copies, mutant, tests, arguments.most, arguments.slow)
                covered = any(one.covers(mutant) for one in tests)
                results.append({
                    "file": mutant.file, "line": mutant.line, "old": mutant.old, "new": mutant.new, "killed_by": killer, "covered": covered,
                })
                verdict = f"killed by {killer}" if killer else "SURVIVED" if covered else "SURVIVED, not executed by any test"
                print(f"{mutant.file}:{mutant.line}: {mutant.old} -> {mutant.new}: {verdict}", flush=True)

        list(pool.map(judge, chosen(arguments.rooms, arguments.number, arguments.seed)))
    results.sort(key=lambda one: (one["file"], one["line"]))
    print()
    for room in (*arguments.rooms, ""):
        of = [one for one in results if str(one["file"]).startswith(f"{room}/" if room else "")]
        killed = sum(one["killed_by"] is not None for one in of)
        share = f"{100 * killed / len(of):.0f} %" if of else "-"
        print(f"{room or 'all':10} {killed:4} killed {len(of) - killed:4} survived {share:>6}")
    print("\nsurvivors:")
    for one in results:
        if one["killed_by"] is None:
            print(f"{PACKAGE}/{one['file']}:{one['line']}: {one['old']} -> {one['new']}{'' if one['covered'] else '  (not executed)'}")
    arguments.json.parent.mkdir(parents=True, exist_ok=True)
    arguments.json.write_text(json.dumps({"seed": arguments.seed, "mutants": results}, indent=1) + "\n")


if __name__ == "__main__":
    main()
