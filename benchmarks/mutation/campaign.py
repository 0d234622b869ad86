"""Change one expression of the compiler at a time (a mutant), and report the mutants that no test notices.

    make mutation MUTANTS=300 SEED=1

The tests run in a copy of the working tree. First, each test file runs once to create a map. The map contains the CPU time of each file,
and the statements of the compiler that the file executes. Then, for each mutant, test files that execute the changed line run until one
fails. Test files of the same room run first, then the fastest files. The option `--seconds` limits the total time of these test files.
Tests that are marked `slow` do not run. A test that did not run may still notice a surviving mutant. Before you write a new test, make the
change by hand and run `tests/cases` and other related tests.

Tests run in forks of a process that has already imported the compiler. Each fork replaces the code of the changed functions. If a mutant
changes code that runs during an import, its tests run in a new Python process.

The map and each result are written as soon as they are available, so an interrupted campaign can continue. An entry of the map is updated
if the test file, a `conftest.py` or the compiler has changed. With `--keep-map`, changes of the compiler are ignored, and line numbers may
be wrong. To start again, delete the results. To judge surviving mutants again after you have added tests, use `--again`.
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
from itertools import accumulate, count
from pathlib import Path
from types import FunctionType
from typing import Any

from coverage_map import IMPORT, IMPORTED, PACKAGE, ROOMS, TestFile, read_map
from forks import patched, run, warmed

from mutants import Mutant, mutants

ROOT = Path(__file__).resolve().parents[2]
PLUGINS = Path(__file__).resolve().parent / "plugins"
LIMIT = 4.0
"""A mutant counts as killed if its tests take this many times their usual CPU time."""
PATIENCE = 15.0
"""Additional time [s] that is always allowed."""
CLOCK = count(int(time.time()), 2)


def copied(target: Path) -> Path:
    """Copy all files of the working tree that git does not ignore to the folder `target`, and return the folder."""
    names = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout
    for name in filter(None, names.split("\0")):
        if (ROOT / name).exists() or (ROOT / name).is_symlink():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name, follow_symlinks=False)
    return target


def write(path: Path, text: str) -> None:
    """Write a module. The modification time of the module is always new, so that Python does not use bytecode of the previous text."""
    path.write_text(text)
    now = next(CLOCK)
    os.utime(path, (now, now))


def judged(tree: Path, mutant: Mutant, tests: list[TestFile], functions: list[FunctionType], seconds: float) -> str | None:
    """Return the path of the test file that kills a mutant, or None if the mutant survives."""
    own = tuple(f"tests/{name}/" for room, names in ROOMS.items() if mutant.file.startswith(f"{room}/") for name in names)
    covering = sorted(
        (one for one in tests if one.path != IMPORT and one.covers(mutant)), key=lambda one: (not one.path.startswith(own), one.seconds),
    )
    before = accumulate((one.seconds for one in covering), initial=0.0)
    most = [one for one, begin in zip(covering, before) if begin < seconds]
    if not most:
        return None
    imported = any(one.path == IMPORT and one.covers(mutant) for one in tests)
    path = tree / PACKAGE / mutant.file
    original = path.read_text()
    write(path, mutant.text)
    try:
        limit = LIMIT * sum(one.seconds for one in most) + PATIENCE
        return run(tree, [one.path for one in most], limit, lambda: patched(functions, path, mutant.text, imported))[0]
    finally:
        write(path, original)


def chosen(tree: Path, rooms: list[str], number: int, seed: int) -> list[Mutant]:
    """Return mutants of random lines, at most one per line. A larger number only appends mutants."""
    by_line: dict[tuple[str, int], list[Mutant]] = {}
    for room in rooms:
        for path in sorted((tree / PACKAGE / room).rglob("*.py")):
            for one in mutants(str(path.relative_to(tree / PACKAGE)), path.read_text()):
                by_line.setdefault((one.file, one.line), []).append(one)
    chance = random.Random(seed)
    lines = sorted(by_line)
    chance.shuffle(lines)
    return [chance.choice(by_line[line]) for line in lines[:number]]


def report(results: list[dict[str, Any]], rooms: list[str]) -> None:
    print()
    for room in (*rooms, ""):
        of = [one for one in results if one["file"].startswith(f"{room}/" if room else "")]
        killed = sum(one["killed_by"] is not None for one in of)
        share = f"{100 * killed / len(of):.0f} %" if of else "-"
        print(f"{room or 'all':16} {killed:4} killed {len(of) - killed:4} survived {share:>6}")
    print("\nsurvivors:")
    for one in sorted(results, key=lambda one: (one["file"], one["line"])):
        if one["killed_by"] is None:
            print(f"{PACKAGE}/{one['file']}:{one['line']}: {one['old']} -> {one['new']}{'' if one['covered'] else '  (not executed)'}")


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--number", type=int, default=300, help="number of mutants (default: 300)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS), help="folders of compiler/thingc to change")
    parser.add_argument("--minutes", type=float, default=240.0, help="start no mutants after this time [min] (default: 240)")
    parser.add_argument("--seconds", type=float, default=8.0, help="processor time of the tests that a mutant must survive (default: 8)")
    parser.add_argument("--longest", type=float, default=8.0, help="skip test files that take more processor time [s] (default: 8)")
    parser.add_argument("--map-minutes", type=float, default=60.0, help="time limit for building the map [min] (default: 60)")
    parser.add_argument("--keep-map", action="store_true", help="use the existing map even if the compiler has changed")
    parser.add_argument("--again", action="store_true", help="test mutants again that survived before")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "mutation", help="folder for the map and the results")
    return parser.parse_args()


def main() -> None:
    arguments = parsed()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    path, written = arguments.folder / "map.json", arguments.folder / f"results_{arguments.seed}.jsonl"
    before = [json.loads(line) for line in written.read_text().splitlines()] if written.exists() else []
    results = {(one["file"], one["line"], one["new"]): one for one in before}
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        tree = copied(Path(folder) / "tree")
        paths = [tree / "compiler", tree / "parts", PLUGINS]
        os.environ.update(PYTHONPATH=os.pathsep.join(map(str, paths)), THINGC_STORE=f"{folder}/store", OMP_NUM_THREADS="1")
        sys.path[:0] = map(str, paths)
        tests = read_map(tree, path, arguments.rooms, arguments.keep_map, arguments.map_minutes, arguments.longest)
        if all(test.path == IMPORT for test in tests):
            raise SystemExit("the map has no test files, so every mutant would survive: use a larger --map-minutes")
        functions = warmed(tree / PACKAGE, IMPORTED)
        end = time.monotonic() + 60.0 * arguments.minutes
        judgements = []
        for mutant in chosen(tree, arguments.rooms, arguments.number, arguments.seed):
            one = results.get((mutant.file, mutant.line, mutant.new))
            if (one is None or arguments.again and one["killed_by"] is None) and time.monotonic() < end:
                killer = judged(tree, mutant, tests, functions, arguments.seconds)
                covered = any(test.covers(mutant) for test in tests)
                one = {name: getattr(mutant, name) for name in ("file", "line", "old", "new")} | {"killed_by": killer, "covered": covered}
                with written.open("a") as out:
                    out.write(json.dumps(one) + "\n")
                verdict = f"killed by {killer}" if killer else "SURVIVED" if covered else "SURVIVED, not executed by any test"
                print(f"{mutant.file}:{mutant.line}: {mutant.old} -> {mutant.new}: {verdict}", flush=True)
            judgements += [one] if one else []
    report(judgements, arguments.rooms)


if __name__ == "__main__":
    main()
