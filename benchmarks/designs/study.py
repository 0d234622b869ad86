"""`make bench-designs`: check random designs of MInchW. Each design must build, or a rule with a diagnostic code must reject it.

The command prints the tables and writes them to `docs/studies/designs.md`. The counts depend only on the seed, and the times depend on the
machine.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from drawing import EDITS, ROOT, design, ranges, workspace, write
from verdicts import Verdict, judged

from thingc.base.diagnostics import Severity

PAGE = ROOT / "docs" / "studies" / "designs.md"
COUNT, SEED = 200, 7


def main() -> int:
    """Create and judge the designs, and write the tables. Return 1 if a design crashed the compiler or has a fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=COUNT, help="number of designs")
    parser.add_argument("--seed", type=int, default=SEED, help="random seed of the designs")
    parser.add_argument("--first", type=int, default=0, metavar="N", help="start with design N, to repeat it")
    parser.add_argument("--store", type=Path, help="cache of built parts, which speeds up a restart (default: an empty one)")
    parser.add_argument("--print", action="store_true", help="print the results without updating the page")
    arguments = parser.parse_args()
    if arguments.count < 1:
        parser.error("there is at least 1 design to draw")
    numbers = range(arguments.first, arguments.first + arguments.count)
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        verdicts = run(numbers, arguments.seed, Path(folder), arguments.store or Path(folder) / "store")
        wall = time.perf_counter() - started
    page = written(verdicts, arguments.seed, wall)
    print(page)
    for verdict in verdicts:
        for fault in verdict.faults:
            print(f"design {verdict.design.number} ({verdict.design}): {fault}", file=sys.stderr)
    if not arguments.print:
        PAGE.write_text(page, encoding="utf-8")
    return 1 if any(v.outcome == "crashed" or v.faults for v in verdicts) else 0


def run(numbers: Sequence[int], seed: int, folder: Path, store: Path) -> list[Verdict]:
    """Judge all designs in this process, and print a line for each design to standard error."""
    workspace(folder)
    verdicts: list[Verdict] = []
    known: set[str] = set()
    for number in numbers:
        one = design(number, seed)
        found = judged(one, write(one, folder), store)
        if again := sorted(known & set(found.modelled)):
            found = replace(found, faults=(*found.faults, f"modelled before: {again}"))
        known.update(found.modelled)
        verdicts.append(found)
        codes = " ".join(sorted(codes_of(verdicts[-1])))
        print(f"{number:4} {verdicts[-1].seconds:6.2f} s  {verdicts[-1].outcome} {codes}  {one}", file=sys.stderr)
    return verdicts


def codes_of(verdict: Verdict) -> set[str]:
    """Return the diagnostic codes of the errors of a design."""
    return {d.code.code for d in verdict.diagnostics if d.severity is Severity.ERROR}


def written(verdicts: list[Verdict], seed: int, wall: float) -> str:
    """Format the page, which describes the method and contains the tables."""
    lines = [
        "# Random designs", "", "```sh", command(len(verdicts), seed), "```", "",
        *MEASURED.format(count=len(verdicts), edits=len(EDITS)).strip().splitlines(), "",
        "## Outcomes", "", *outcome_table(verdicts), "", timing(verdicts, wall), "",
        "## Rules that were broken", "",
        "The last column shows the first message for each rule.", "", *code_table(verdicts), "",
        "## Generated designs", "", *parameter_table(verdicts), "", *edit_table(verdicts), "",
    ]
    return "\n".join(lines)


def command(count: int, seed: int) -> str:
    """Return the command that generates this page."""
    usual = (count, seed) == (COUNT, SEED)
    return f"python benchmarks/designs/study.py --count {count} --seed {seed}" + ("   # or: make bench-designs" if usual else "")


def outcome_table(verdicts: list[Verdict]) -> list[str]:
    built = [v for v in verdicts if v.outcome == "built"]
    refused = [v for v in verdicts if v.outcome == "refused"]
    rows: list[list[object]] = [
        ["built, all modes agree", sum(not v.faults for v in built)],
        ["built, with a fault", sum(bool(v.faults) for v in built)],
        ["refused, with the right rule", sum(not v.faults for v in refused)],
        ["refused, with a fault", sum(bool(v.faults) for v in refused)],
        ["crashed", sum(v.outcome == "crashed" for v in verdicts)],
        ["**all**", len(verdicts)],
    ]
    return table(["outcome", "designs"], rows)


def timing(verdicts: list[Verdict], wall: float) -> str:
    """Format the number of parts that were modelled, and the times that the study took."""
    built = [v for v in verdicts if v.outcome == "built"]
    modelled, reused = sum(len(v.modelled) for v in built), sum(len(v.reused) for v in built)
    mean = sum(v.seconds for v in built) / len(built) if built else 0.0
    return (
        f"thingc built {sum(v.modes for v in built)} models of {len(built)} robots. Starting with an empty store, thingc built "
        f"{modelled} parts and reused {reused} parts. The study took {wall:.0f} s on {os.cpu_count()} cores, "
        f"and {mean:.1f} s for each design that builds."
    )


def code_table(verdicts: list[Verdict]) -> list[str]:
    counts: Counter[str] = Counter()
    first: dict[str, tuple[str, str]] = {}
    for verdict in verdicts:
        counts.update(codes_of(verdict))
        for found in verdict.diagnostics:
            if found.severity is Severity.ERROR:
                first.setdefault(found.code.code, (found.code.title, found.message.replace("\n", " ").replace("|", "\\|")))
    return table(["code", "rule", "designs", "example"], [[code, first[code][0], n, first[code][1]] for code, n in sorted(counts.items())])


def parameter_table(verdicts: list[Verdict]) -> list[str]:
    rows: list[list[object]] = []
    for name, (low, high) in ranges().items():
        drawn = [float(v.design.parameters[name].split()[0]) for v in verdicts if name in v.design.parameters]
        outside = sum(not low <= value <= high for value in drawn)
        spread = f"{min(drawn):g} to {max(drawn):g} mm" if drawn else "-"
        rows.append([f"`{name}`", f"{low:g} to {high:g} mm", len(drawn), spread, outside])
    return table(["parameter", "declared", "drawn", "from, to", "outside"], rows)


def edit_table(verdicts: list[Verdict]) -> list[str]:
    counts: dict[str, Counter[str]] = {}
    for verdict in verdicts:
        for edit in verdict.design.edits:
            counts.setdefault(edit.name, Counter())[verdict.outcome] += 1
    rows: list[list[object]] = [[name, sum(found.values()), found["built"], found["refused"]] for name, found in sorted(counts.items())]
    return table(["edit of a document", "designs", "built", "refused"], rows)


def table(heads: list[str], rows: list[list[object]]) -> list[str]:
    lines = [heads, ["---"] * len(heads), *([str(cell) for cell in row] for row in rows)]
    return ["| " + " | ".join(line) + " |" for line in lines]


MEASURED = """
This study generates {count} designs of the robot MInchW at random. thingc must either build a consistent robot from each design, or refuse
the design for the right reason. Every design has random values of `leg_length`, `body_length` and `wall`. In half of the designs, each leg
has its own length. The values cover the ranges in the documents, including both ends. One value in twenty is outside its range, by up to a
tenth of the range. In addition, up to {edits} edits are made to the documents. These edits change dimensions of the legs, materials, print
settings, masses and inertias, limits of the knees, the position of the rear foot, collision shapes, simulation settings and magnets. Some
edits intentionally break a rule.

Each design is compiled by `thingc.compile` in one long-running process. If the design builds, MuJoCo loads the models of all
modes, and the study compares the modes at random joint angles and random poses of the bases. The relative poses of all parts and
sites must be equal within 1e-9 m. Mass, centre of mass and inertia of the whole robot must be equal within 1e-12. Links and
excluded pairs must be identical. The study also computes the mass matrix and gravity torques of each mode from the bodies of
every other mode, with the same link fixed (`tests/conformance/roots.py`). The results must be equal within 1e-9. Each part must
be built only once.

If a design breaks a rule, thingc must report the code of this rule and the value that breaks it. If all values of a design are within their
ranges, thingc must not report a value out of range. If a part rejects its parameters, the error message must come from the code of the
part. Every error must have a location. The following outcomes count as faults of thingc: an unhandled exception, the internal error
`TC899`, a part that crashes or is not a valid solid, and a model that MuJoCo rejects.
"""


if __name__ == "__main__":
    sys.exit(main())
