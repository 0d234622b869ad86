"""Compare the outputs of two versions of the compiler: run `make freeze` before a refactoring, and `make frozen` after it.

The outputs of many commands form a corpus, which is stored as hashes. The corpus contains the following documents:

- all documents of both robots, with all targets
- every document in `docs/`, every correct example in `docs/codes`, and the random robots of `benchmarks/conformance`, with all targets
- 200 random designs of MInchW (`benchmarks/designs`), and 50 sampled variants of MInchW

Each entry describes one command of `thingc`: its exit code, its output, and the SHA-256 of every file that it wrote. The corpus does not
contain invalid documents, because `tests/cases` and `docs/codes` test their diagnostics.

    python benchmarks/corpus.py freeze build/corpus.json      # about ten minutes on two idle cores
    python benchmarks/corpus.py compare build/corpus.json     # takes as long; prints differences, exits with 1 if there are any

To select entries, use `--only PATTERN...`, for example `--only 'robots/*' 'designs/00?'`, `--only docs/things.md` for a page, or
`make frozen ONLY='trees/*'`. The random designs take most of the time, because no two designs share a part. Each result is written as soon
as it is available, so an interruption does not lose results. Use the same machine and the same installed packages for `freeze` and
`compare`. Another CAD kernel or another version of MuJoCo may write other digits.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import hashlib
import io
import json
import os
import re
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent / "designs"))
sys.path.insert(0, str(Path(__file__).resolve().parent / "conformance"))
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "docs"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "docs"))

import code_pages
import drawing
import pages
import robots as joints

from thingc.base.diagnostics import Code
from thingc.tools.cli.main import main as thingc

ROOT = Path(__file__).resolve().parents[1]
DESIGNS, SEED, RANDOM = 200, 7, 20
ALL = ("--emit", "all")
VARIANTS = """\
thingc: variants/1
assembly: assemblies/minchw/minchw.yaml
name: sampled
sample: {method: sobol, count: 50, seed: 11, ranges: {leg_length: [64 mm, 140 mm], body_length: [92 mm, 220 mm]}}
emit: [mjcf, bom]
"""
ASSEMBLY = re.compile(r"^thingc *[:=] *\"?assembly/1", re.MULTILINE)
PASSING = re.compile(r"^(modelling|decomposing|slicing) parts: .*\n|\d+ parts? modelled.*|\d+\.\d+ s\b", re.MULTILINE)
"""Pattern of the output that depends on the store or on the clock."""
OF_THE_RUN = frozenset({"journal.jsonl", "results.parquet", "shown.json"})
"""Files of a batch that contain durations. These files are not compared, because `results.csv` contains the other columns of the table."""

Entry = dict[str, str]
"""An entry of the corpus: the exit code, the hash of the output, and the SHA-256 of every file by its path in the output folder."""


def main() -> int:
    """Freeze or compare the corpus. Return 1 if an entry differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["freeze", "compare"])
    parser.add_argument("file", type=Path)
    parser.add_argument("--only", nargs="+", default=["*"], metavar="PATTERN", help="only entries whose name matches one of these patterns")
    parser.add_argument("--store", help="cache of built parts (default: an empty one)")
    arguments = parser.parse_args()
    before: dict[str, Entry] = json.loads(arguments.file.read_text()) if arguments.what == "compare" else {}
    now: dict[str, Entry] = {}
    with tempfile.TemporaryDirectory() as scratch:
        os.environ["THINGC_STORE"] = arguments.store or str(Path(scratch) / "store")
        for name, entry in entries(Path(os.path.realpath(scratch)), arguments.only):
            now[name] = entry
            if arguments.what == "freeze":
                freeze(now, arguments.file)
    if arguments.what == "freeze":
        print(f"{len(now)} entries, {sum(len(entry) - 2 for entry in now.values())} files: {arguments.file}")
        return 0
    return compared({name: entry for name, entry in before.items() if fits(name, arguments.only)}, now)


def freeze(entries: dict[str, Entry], file: Path) -> None:
    """Write the entries that have been created so far to a file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    aside = file.with_suffix(".part")
    aside.write_text(json.dumps(entries, indent=1, sort_keys=True) + "\n")
    aside.replace(file)


def fits(name: str, only: Sequence[str]) -> bool:
    """Return whether the name of an entry, or the page that contains the entry, matches one of the patterns."""
    return any(fnmatch(name, pattern) or fnmatch(name, f"{pattern}/*") for pattern in only)


def compared(before: dict[str, Entry], now: dict[str, Entry]) -> int:
    """Print every entry that differs, and the number of differences for each kind of file. Return 1 if any entry differs."""
    kinds: Counter[str] = Counter()
    for name in sorted(before.keys() | now.keys()):
        one, other = before.get(name, {}), now.get(name, {})
        differ = sorted(key for key in one.keys() | other.keys() if one.get(key) != other.get(key))
        if differ:
            print(f"{name}: {', '.join(differ[:6])}{f' and {len(differ) - 6} more' if len(differ) > 6 else ''}")
        kinds.update(key if key in ("exit", "printed") else Path(key).name if key.endswith(".json") else Path(key).suffix for key in differ)
    words = ", ".join(f"{count} x {kind}" for kind, count in kinds.most_common())
    print(f"{len(before.keys() | now.keys())} entries: {f'{words} differ' if kinds else 'all equal'}")
    return 1 if kinds else 0


def entries(folder: Path, only: Sequence[str]) -> Iterator[tuple[str, Entry]]:
    """Yield the name and the content of every entry of the corpus. `folder` is a temporary folder."""
    robots = folder / "robots"
    drawing.workspace(robots)
    for document in sorted((robots / "assemblies").rglob("*.yaml")):
        name = f"robots/{document.relative_to(robots / 'assemblies')}"
        if document.name not in ("materials.yaml", "bridge_search.yaml", "sizes.yaml"):
            for which, words in ((name, ALL), (f"{name} for others", ("--emit", "mjcf", "--compat", "mjx,warp,drake,pymjcf"))):
                if fits(which, only):
                    yield which, build(robots, document, *words)
    for page in pages.PAGES:
        shown = {block.file for block in pages.documents(page)}
        if page.is_relative_to(ROOT / "docs") and any(not pages.meant_to_be_wrong(block) for block in pages.documents(page)):
            name = page.relative_to(ROOT).as_posix()
            yield from documents(name, pages.unpack(page, fresh(folder / name.removesuffix(".md"))), shown, only)
    for code in Code:
        page = code_pages.read_page(code)
        if page.examples and fits(f"codes/{code.code}", only):
            code_pages.unpack(page, "right", folder / code.code)
            document = folder / code.code / page.examples["right"].document
            if ASSEMBLY.search(document.read_text()):
                yield f"codes/{code.code}", build(document.parent, document, *ALL)
    trees = fresh(folder / "trees")
    for number in range(RANDOM):
        for balls in (False, True):
            document = trees / f"{'balls' if balls else 'random'}_{number}.yaml"
            document.write_text(joints.document(number, balls=balls))
            if fits(f"trees/{document.stem}", only):
                yield f"trees/{document.stem}", build(trees, document, *ALL)
    designs = folder / "designs"
    drawing.workspace(designs)
    for number in range(DESIGNS):
        if fits(f"designs/{number:03}", only):
            one = drawing.design(number, SEED)
            words = [word for name, value in one.parameters.items() for word in ("-p", f"{name}={value}")]
            yield f"designs/{number:03}", build(designs, drawing.write(one, designs), "--emit", "mjcf", *words)
    if fits("variants", only):
        variants = fresh(folder / "variants")
        drawing.workspace(variants)
        (variants / "sampled.yaml").write_text(VARIANTS)
        out = fresh(variants / "out")
        yield "variants", run(variants, out, ["batch", "sampled.yaml", "-o", str(out), "--pictures", "none"])


def documents(page: str, folder: Path, shown: Collection[str | None], only: Sequence[str]) -> Iterator[tuple[str, Entry]]:
    """Build every selected assembly that a page shows, and yield its name and its entry. `folder` contains the documents of the page."""
    for document in sorted([*folder.glob("*.yaml"), *folder.glob("*.toml")]):
        name = f"{page}/{document.name}"
        if document.name in shown and fits(name, only) and ASSEMBLY.search(document.read_text()):
            yield name, build(folder, document, *ALL)


def build(folder: Path, document: Path, *words: str) -> Entry:
    """Build a document in a workspace, and return its entry."""
    out = fresh(folder.parent / f"{folder.name}_out")
    return run(folder, out, ["build", os.path.relpath(document, folder), "-o", str(out), *words])


def run(folder: Path, out: Path, words: list[str]) -> Entry:
    """Run one command of `thingc` in `folder`, and return its entry. The command writes to the folder `out`."""
    printed = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        code = thingc(words)
    text = PASSING.sub("", printed.getvalue()).replace(str(out), "OUT").replace(str(folder), "HERE")
    print(f"{code}  {' '.join(words)}", file=sys.stderr)
    files = {
        str(path.relative_to(out)): hashlib.sha256(content(path)).hexdigest() for path in sorted(out.rglob("*"))
        if path.is_file() and path.name not in OF_THE_RUN
    }
    return {"exit": str(code), "printed": hashlib.sha256(text.encode()).hexdigest(), **files}


def content(path: Path) -> bytes:
    """Return the content of a file for hashing. For `results.csv`, omit the columns that describe the run."""
    if path.name != "results.csv":
        return path.read_bytes()
    with path.open(newline="") as stream:
        rows = list(csv.reader(stream))
    kept = [at for at, name in enumerate(rows[0]) if name not in ("parts_modelled", "parts_reused", "seconds")]
    return json.dumps([[row[at] for at in kept] for row in rows]).encode()


def fresh(folder: Path) -> Path:
    """Create an empty folder with this path, and return the path."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


if __name__ == "__main__":
    sys.exit(main())
