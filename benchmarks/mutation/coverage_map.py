"""Create the map of the tests: the CPU time of each test file, and the statements of the compiler that it executes."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from itertools import chain, zip_longest
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from forks import run, warmed

from mutants import Mutant

PACKAGE = "compiler/thingc"
ROOMS = {
    "tools/importing": ("importing",), "targets": ("emit", "mjcf"), "model/resolve": ("resolve", "cases"),
    "model/assembly": ("graph", "links"), "model/robot": ("robot", "loops"), "batch/plans": ("plans", "families"),
}
"""Folders of `compiler/thingc` in which mutants are created, each with the folders of its tests in `tests/`."""
OTHERS = ("units", "spec", "statics", "testing", "modes", "variants")
"""Folders of `tests/` whose tests execute code of several rooms."""
IMPORTED = (*ROOMS, "driver", "tools/cli")
"""Folders of `compiler/thingc` that most tests import."""
IMPORT = "import"
"""Key of the map entry with the lines that run while the compiler is imported."""


@dataclass
class TestFile:
    """A test file with its CPU time [s], and the lines of the compiler that it executes, by source file."""

    path: str
    seconds: float
    lines: dict[str, set[int]]

    def covers(self, mutant: Mutant) -> bool:
        lines = self.lines.get(mutant.file, set())
        return mutant.line in lines or mutant.statement in lines


def digest(paths: Iterable[Path]) -> str:
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths if path.exists())).hexdigest()


def missing(tree: Path, known: dict[str, Any], rooms: Iterable[str], keep: bool) -> dict[str, dict[str, Any]]:
    """Return new entries for all test files that have no valid entry in the map. The files alternate between the folders."""
    compiler = digest(sorted((tree / PACKAGE).rglob("*.py")))
    own, others = (
        zip_longest(*(sorted((tree / "tests" / name).glob("test_*.py")) for name in names))
        for names in ([name for room in rooms for name in ROOMS[room]], OTHERS)
    )
    entries = {}
    for file in filter(None, chain(*own, *others)):
        text = digest([file, file.parent / "conftest.py", tree / "tests" / "conftest.py"])
        entries[str(file.relative_to(tree))] = {"test": text, "compiler": compiler}
    compared = ["test"] if keep else ["test", "compiler"]
    return {name: one for name, one in entries.items() if name not in known or any(known[name][key] != one[key] for key in compared)}


def add_to_map(tree: Path, known: dict[str, Any], entries: dict[str, dict[str, Any]], path: Path, minutes: float, most: float) -> None:
    """Run test files with recording, and write their map entries. A file that fails or takes more than `most` seconds gets an entry without
    lines.
    """
    folder = tree.parent / "lines"
    sys.pycache_prefix = str(tree.parent / "marked")
    os.environ.update(TRACED_FOLDER=str(tree / PACKAGE), TRACED_LINES=str(folder), TRACED_ROOMS=os.pathsep.join(ROOMS))
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix
    found = import_module("sitecustomize").found
    warmed(tree / PACKAGE, IMPORTED)
    known[IMPORT] = {"test": "", "compiler": "", "seconds": 0.0, "lines": found()}
    end = time.monotonic() + 60.0 * minutes
    for test, entry in entries.items():
        if time.monotonic() < end:
            folder.mkdir()
            fault, seconds = run(tree, [test], most, lambda: None)
            lines: dict[str, set[int]] = {}
            for one in [] if fault else folder.iterdir():
                for file, executed in json.loads(one.read_text() or "{}").items():
                    lines.setdefault(file, set()).update(executed)
            shutil.rmtree(folder)
            known[test] = {**entry, "seconds": seconds, "lines": {file: sorted(of) for file, of in lines.items()}}
            path.with_suffix(".new").write_text(json.dumps(known))
            path.with_suffix(".new").replace(path)
            verdict = "" if not fault else ", not used: it takes too long" if fault == "time" else ", not used: it fails"
            print(f"{test}: {seconds:.1f} s{verdict}", flush=True)


def read_map(tree: Path, path: Path, rooms: Iterable[str], keep: bool, minutes: float, longest: float) -> list[TestFile]:
    """Return all test files with the lines that they execute. Valid entries of an earlier run are reused."""
    known = json.loads(path.read_text()) if path.exists() else {}
    entries = missing(tree, known, rooms, keep)
    if entries and minutes:
        # Run in a separate process, in which all modules are compiled with marks.
        process = get_context("fork").Process(target=add_to_map, args=(tree, known, entries, path, minutes, longest))
        process.start()
        process.join()
        known = json.loads(path.read_text())
        entries = missing(tree, known, rooms, keep)
    compiler = digest(sorted((tree / PACKAGE).rglob("*.py")))
    used = {test: one for test, one in known.items() if test == IMPORT or test not in entries and (tree / test).exists() and one["lines"]}
    stale = sum(one["compiler"] != compiler for test, one in used.items() if test != IMPORT)
    print(f"map: {len(used) - 1} test files, {stale} of them with the lines of another compiler; {len(entries)} are missing", flush=True)
    return [TestFile(test, one["seconds"], {file: set(of) for file, of in one["lines"].items()}) for test, one in used.items()]
