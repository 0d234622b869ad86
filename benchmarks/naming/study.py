"""`make bench-naming`: check that named mounts keep their meaning when parameters of a part change, in contrast to plain selectors.

The command prints the tables and writes them to `docs/studies/naming.md`. The results depend only on the parts and on the CAD kernel, so
two runs print the same numbers.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(Path(__file__).resolve().parent), str(ROOT / "parts"), str(ROOT / "compiler")]

from picks import EDGES, FACES  # noqa: E402
from sweep import PARTS, Result, sweep  # noqa: E402

PAGE = ROOT / "docs" / "studies" / "naming.md"
STEPS = 7
OUTCOMES = ("same", "another", "fails")
GROUPS = ("outermost plane", "inner plane", "hole", "other surface")


def main() -> int:
    """Vary all parameters and write the page. Return 1 if a name was wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=STEPS, help="number of values per parameter, including both ends of its range")
    parser.add_argument("--print", action="store_true", help="print the results without updating the page")
    arguments = parser.parse_args()
    if arguments.steps < 2:
        parser.error("a sweep has at least 2 steps")
    robots: dict[str, list[Result]] = {}
    for robot, parts in PARTS.items():
        for part, table in parts:
            print(f"{robot}: {part.__name__}", file=sys.stderr)
            robots.setdefault(robot, []).append(sweep(part, table, arguments.steps))
    page = written(robots, arguments.steps)
    print(page)
    if not arguments.print:
        PAGE.write_text(page, encoding="utf-8")
    return 1 if any(result.wrong for results in robots.values() for result in results) else 0


def written(robots: dict[str, list[Result]], steps: int) -> str:
    """Format the page, which describes the method and contains the tables."""
    every = [result for results in robots.values() for result in results]
    lines = [
        "# Stability of names", "", "```sh", command(steps), "```", "", *_wrapped(MEASURED.format(steps=steps)), "",
        "## Names", "",
        f"The study made {sum(r.checks for r in every)} checks of {sum(r.names for r in every)} names in "
        f"{sum(r.members for r in every)} members. The number of wrong results is {sum(len(r.wrong) for r in every)}.", "",
        *names_table(robots), "", *[f"- wrong: {text}" for r in every for text in r.wrong],
        "## Faces selected by plain selectors", "", SHARES, "", *picks_table(robots, FACES), "",
        "## Edges selected by plain selectors", "",
        "For a hole, the study selects the circular edge at the opening.", "", *picks_table(robots, EDGES), "",
        "## Results by kind of feature", "",
        "The table adds up the checks of all parts. An *outermost plane* is a plane beyond which the solid does not extend.", "",
        *groups_table(every), "",
        "## Selectors that work for all values", "",
        "The table counts the selectors that select the same feature in all members of a part.", "",
        *lasting_table(every), "",
        *reading(every), "",
        "## Missing features", "",
        "Some parameter values remove a feature. For example, a servo without an idler has no idler holes, and a tray for two cells has no "
        "third bay. For a removed feature, the lookup must fail.", "",
        *gone_table(every), "",
    ]
    return "\n".join(lines)


def command(steps: int) -> str:
    return "python benchmarks/naming/study.py" + (f" --steps {steps}" if steps != STEPS else "   # or: make bench-naming")


def names_table(robots: dict[str, list[Result]]) -> list[str]:
    rows = []
    for robot, results in robots.items():
        for r in results:
            rows.append([robot, r.part, r.members, len(r.refused), r.names, r.checks, r.checks - len(r.wrong), len(r.wrong)])
    return table(["robot", "part", "members", "refused", "names", "checks", "right", "wrong"], rows)


def picks_table(robots: dict[str, list[Result]], selectors: tuple[str, ...]) -> list[str]:
    rows: list[list[object]] = []
    total: Counter[tuple[str, str, str]] = Counter()
    for robot, results in robots.items():
        together: Counter[tuple[str, str, str]] = Counter()
        for result in results:
            together += result.picks
            if count := _count(result.picks, selectors[0]):
                rows.append([robot, result.part, count, *(shares(result.picks, selector) for selector in selectors)])
        rows.append([robot, "**all**", _count(together, selectors[0]), *(shares(together, selector) for selector in selectors)])
        total += together
    rows.append(["**all**", "", _count(total, selectors[0]), *(shares(total, selector) for selector in selectors)])
    return table(["robot", "part", "picks", *(f"`{selector}`" for selector in selectors)], rows)


def groups_table(results: list[Result]) -> list[str]:
    total: Counter[tuple[str, str, str]] = Counter()
    for result in results:
        total += result.picks
    rows = []
    for selector in (*FACES, *EDGES):
        rows.append([f"`{selector}`", *(shares(total, selector, group) for group in GROUPS)])
    return table(["selector", *GROUPS], rows)


def lasting_table(results: list[Result]) -> list[str]:
    lasting: Counter[str] = Counter()
    chosen: Counter[str] = Counter()
    for result in results:
        lasting += result.lasting
        chosen += result.chosen
    rows = [
        [f"`{s}`", chosen[s], lasting[s], f"{100 * lasting[s] / chosen[s]:.1f} %" if chosen[s] else "-"] for s in (*FACES, *EDGES)
    ]
    return table(["selector", "chosen", "works for all values", "share"], rows)


def reading(results: list[Result]) -> list[str]:
    """Return a Markdown list that shows, for each selector, the parts in which the selector always finds the right feature."""
    lines = ["The following list shows, for each kind of selector, the parts in which all selectors work for all parameter values:", ""]
    for selector in (*FACES, *EDGES):
        having = [r for r in results if r.chosen[selector]]
        good = [r.part for r in having if r.lasting[selector] == r.chosen[selector]]
        lines.append(f"- `{selector}`: {len(good)} of {len(having)}{': ' if good else ''}{', '.join(good)}")
    return lines


def gone_table(results: list[Result]) -> list[str]:
    total: Counter[tuple[str, str]] = Counter()
    for result in results:
        total += result.gone
    rows = []
    for selector in ("name", *FACES, *EDGES):
        shown = "names of the part" if selector == "name" else f"`{selector}`"
        rows.append([shown, total[selector, "another"] + total[selector, "fails"], total[selector, "fails"], total[selector, "another"]])
    return table(["looked up by", "lookups", "fails", "returns another feature"], rows)


def shares(picks: Counter[tuple[str, str, str]], selector: str, group: str = "") -> str:
    """Format the fractions of the outcomes `same`, `another` and `fails` in percent."""
    counts = [
        sum(number for (s, g, o), number in picks.items() if s == selector and o == outcome and group in ("", g))
        for outcome in OUTCOMES
    ]
    return " / ".join(f"{100 * count / sum(counts):.1f}" for count in counts) if sum(counts) else "-"


def table(heads: list[str], rows: list[list[object]]) -> list[str]:
    lines = [heads, ["---"] * len(heads), *([str(cell) for cell in row] for row in rows)]
    return ["| " + " | ".join(line) + " |" for line in lines]


def _count(picks: Counter[tuple[str, str, str]], selector: str) -> int:
    return sum(number for (s, _, _), number in picks.items() if s == selector)


def _wrapped(text: str) -> list[str]:
    return text.strip().splitlines()


MEASURED = """
Part code names features such as mounts and screw holes. A name must identify the same feature for all parameter values of the part. This
study compares names with build123d selectors of faces and edges, for all parts of the arm and of MInchW, including bought parts. The
study varies one parameter at a time over its range, in {steps} steps including both ends, with the other parameters at their defaults. For
a parameter that is a count, a choice or a flag, the study uses every value. A *member* of a part is the solid for one set of valid
parameter values. If a part rejects parameter values with an error message, the values count as *refused*.

**Names.** The study uses a table of all mounts and all screw holes for other parts. The table contains the kind of each feature, and
its position as a formula of the parameters. The table was written by hand from the drawings (`benchmarks/naming/intents_*.py`). A name
counts as right if the position and direction of its frame equal those in the table within 1e-6 mm, and the solid has the feature at this
position. For a mount, the feature is a planar face that contains the origin of the frame and is normal to the z axis of the frame. For a
hole, the feature is a cylindrical face around the same axis with the standard diameter and with material outside. The study searches for
features in the faces of the finished solid, not in the code of the part. The study cannot detect a mistake that is in both the part and the
table. The study checks only mounts and screw holes, not sketches, numbers or whole solids.

**Plain selectors.** For each name, the study constructs a selector that selects the named feature in the part with default parameters. For
the name of a screw seat, the selector selects the screw hole. Then the study applies the same selector to the other members of the part.
The study uses the best axis for each selector: the axis X, Y or Z (or the pair of axes, for selectors with two steps) along which the
feature differs most from its neighbours. Indices count from the end of the sorted list that is nearer to the feature. `T` is the geometry
type of the surface. A selector has one of three outcomes: the `same` feature, `another` feature, or `fails` (an `IndexError`). Plain
selectors work if a change only moves faces, but can fail if a change creates, splits or swaps faces. Therefore, the results differ between
parts.
"""
SHARES = "The columns show how often each outcome occurs, in percent: same / another / fails."


if __name__ == "__main__":
    sys.exit(main())
