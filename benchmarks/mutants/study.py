"""`make mutants`: change one value in a valid document at a time, and check that thingc rejects the document. The command prints the tables
and writes `docs/studies/mutants.md`.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(Path(__file__).resolve().parent), str(ROOT / "compiler")]

from judging import Verdict, field_of, judge, scalars_in, subjects  # noqa: E402
from mutations import KINDS, Mutant, mutants  # noqa: E402

PAGE = ROOT / "docs" / "studies" / "mutants.md"
HEAD = Path(__file__).resolve().parent / "page.md"
COUNT = 2400
REFUSED, RIGHT = 0.80, 0.95


def main() -> int:
    """Judge the mutants and write the page. Return 1 if thingc rejects too few mutants, or reports too few errors at the right line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=COUNT, help="total number of mutants, distributed over the documents by size")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--store", default=None, help="cache of built parts")
    parser.add_argument("--print", action="store_true", help="print the results without updating the page")
    parser.add_argument("--list", action="store_true", help="also print every mutant that is accepted or reported at another place")
    arguments = parser.parse_args()
    begun = time.monotonic()
    with ProcessPoolExecutor(arguments.jobs) as pool:
        parts = list(pool.map(run, [
            (part, arguments.jobs, arguments.count, arguments.seed, arguments.store) for part in range(arguments.jobs)
        ]))
    results = [result for part in parts for result in part]
    page = written(results, arguments.count, arguments.seed)
    print(page)
    print(f"{time.monotonic() - begun:.0f} s", file=sys.stderr)
    if arguments.list:
        for name, field, mutant, verdict in results:
            if verdict.outcome != "right":
                print(f"{verdict.outcome}: {name}:{mutant.first}: {mutant.kind} {field}: {mutant.what}  => {verdict.said}", file=sys.stderr)
    if not arguments.print:
        PAGE.write_text(HEAD.read_text() + page)
    tally = Counter(verdict.outcome for *_, verdict in results)
    refused = tally["right"] + tally["elsewhere"]
    return 0 if refused >= REFUSED * len(results) and tally["right"] >= RIGHT * refused else 1


Result = tuple[str, str, Mutant, Verdict]


def run(task: tuple[int, int, int, int, str | None]) -> list[Result]:
    """Judge every `jobs`-th mutant in a temporary workspace of this process."""
    part, jobs, count, seed, store = task
    found: list[Result] = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(os.path.realpath(scratch)) / "workspace"
        folder.mkdir()
        kept = store or str(folder.parent / "store")
        good = subjects(folder, kept)
        sizes = [scalars_in(subject.document) for subject in good]
        for subject, size in zip(good, sizes, strict=True):
            name = os.path.relpath(subject.document.path, folder)
            source = mutants(subject.document, seed)
            for number in range(-(-count * size // sum(sizes))):
                mutant = next(source)
                if number % jobs == part:
                    found.append((name, field_of(subject.document, mutant), mutant, judge(subject, mutant, kept)))
    return found


def written(results: list[Result], count: int, seed: int) -> str:
    """Format the tables of the page."""
    tally = Counter(verdict.outcome for *_, verdict in results)
    refused = tally["right"] + tally["elsewhere"]
    command = "make mutants" if (count, seed) == (COUNT, 1) else f"python benchmarks/mutants/study.py --count {count} --seed {seed}"
    lines = [
        "```sh", command, "```", "",
        f"{len(results)} mutants: {refused} refused ({refused / len(results):.1%}), {tally['built']} accepted. MuJoCo compiles all "
        f"accepted mutants. {tally['right']} refused mutants ({tally['right'] / max(refused, 1):.1%}) are reported at the right line.", "",
        "| mutation | mutants | refused | at the right line | accepted |", "|---|---:|---:|---:|---:|",
    ]
    for kind in KINDS:
        mine = Counter(verdict.outcome for _, _, mutant, verdict in results if mutant.kind == kind)
        lines.append(_row(kind, mine))
    lines += ["", "| document | mutants | refused | at the right line | accepted |", "|---|---:|---:|---:|---:|"]
    for name in sorted({name for name, *_ in results}):
        lines.append(_row(f"`{name}`", Counter(verdict.outcome for one, _, _, verdict in results if one == name)))
    codes = Counter(code for *_, verdict in results for code in verdict.codes)
    lines += ["", "## Reported codes", "", "| code | mutants |", "|---|---:|"]
    lines += [*(f"| {code} | {times} |" for code, times in codes.most_common()), ""]
    lines += ["## Accepted mutants by kind", "", "| mutation | field | count | example |", "|---|---|---:|---|"]
    lines += _groups(results, "built")
    lines += ["", "## Mutants reported at another line, by kind", "", "| mutation | field | count | example |", "|---|---|---:|---|"]
    lines += _groups(results, "elsewhere")
    return "\n".join([*lines, ""])


def _row(name: str, tally: Counter[str]) -> str:
    total, refused = sum(tally.values()), tally["right"] + tally["elsewhere"]
    return f"| {name} | {total} | {refused} | {tally['right']} | {tally['built']} |"


def _groups(results: list[Result], outcome: str) -> list[str]:
    grouped: dict[tuple[str, str], list[tuple[Mutant, Verdict]]] = {}
    for _, field, mutant, verdict in results:
        if verdict.outcome == outcome:
            grouped.setdefault((mutant.kind, field), []).append((mutant, verdict))
    rows = sorted(grouped.items(), key=lambda item: (KINDS.index(item[0][0]), -len(item[1]), item[0][1]))
    shown = []
    for (kind, field), found in rows:
        mutant, verdict = found[0]
        said = f": {_cell(verdict.said[:90])}" if verdict.said else ""
        shown.append(f"| {kind} | `{field}` | {len(found)} | {_cell(mutant.what)}{said} |")
    return shown


def _cell(text: str) -> str:
    return "`" + text.replace("|", "\\|").replace("`", "'").replace("\n", " ") + "`"


if __name__ == "__main__":
    sys.exit(main())
