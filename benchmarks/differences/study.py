"""Check `thingc diff` with known changes, in both directions: `python benchmarks/differences/study.py`.

For each case in `cases.yaml`, the study checks that `thingc diff` reports each change, and reports nothing else without a cause. Every
cause must be one of the changes, and the reverse comparison must be the mirror image. For random designs of MInchW, exactly the parameters
that were set must be reported. A document that is rewritten without changing the robot must have no changes. The program exits with 1 if a
check fails.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "designs"))

import drawing
from known_changes import ROBOTS, cases, rewritten
from msgspec.structs import replace

from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import compile
from thingc.tools.diff.comparison import compare
from thingc.tools.diff.name_mapping import equal
from thingc.tools.diff.snapshot import Change, How, Snapshot
from thingc.tools.diff.take_snapshot import take_snapshot


def drawn(document: Path) -> Snapshot | None:
    """Compile a document, and return a snapshot of the robot. Return None if the document does not compile."""
    with Environment(str(document), Options()) as environment:
        compilation = compile(environment)
        return None if compilation.report.failed or compilation.assembly is None else take_snapshot(compilation)


def mirrored(change: Change) -> Change:
    """Return the change that a comparison in the opposite direction reports."""
    there, back = (change.path, None) if change.new_path is None else (change.new_path, change.path)
    how: dict[How, How] = {"added": "removed", "removed": "added"}
    return replace(
        change, change=how.get(change.change, change.change), path=there, new_path=back, old=change.new, new=change.old,
    )


def faults(old: Snapshot, new: Snapshot, made: frozenset[tuple[str, str, str, str | None]]) -> Iterator[str]:
    """Yield the errors of `thingc diff` for two robots, given the changes between the robots."""
    there, back = compare(old, new).changes, compare(new, old).changes
    named = {(c.what, c.change, c.path, c.field) for c in there if not c.caused}
    yield from (f"not named: {one}" for one in made - named)
    yield from (f"named: {one}" for one in named - made)
    paths = {c.path for c in there if not c.caused} | {"perhaps"}
    yield from (f"a stray cause: {c}" for c in there if not set(c.because) <= paths)
    if sorted(map(_content, (mirrored(c) for c in there))) != sorted(map(_content, back)):
        yield "the reverse comparison is not the mirror image"


def _content(change: Change) -> tuple[str, ...]:
    return tuple(map(repr, (change.what, change.change, change.path, change.new_path, change.field, change.old, change.new)))


def main() -> int:
    """Run all checks. Return 1 if a check fails."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--designs", type=int, default=10, help="number of random designs (default: %(default)s)")
    parser.add_argument("--rewrites", type=int, default=100, help="number of rewrites (default: %(default)s)")
    arguments = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        snapshots = {name: drawn(robot.copy(Path(folder) / name)) for name, robot in ROBOTS.items()}
        for title, found in (
            ("cases", _cases(Path(folder), snapshots)), ("designs", _designs(Path(folder), snapshots, arguments.designs)),
            ("rewrites", _rewrites(Path(folder), snapshots, arguments.rewrites)),
        ):
            count = bad = 0
            for name, said in found:
                count += 1
                bad += bool(said)
                for line in said:
                    print(f"{name}: {line}")
            print(f"{title}: {count}, wrong: {bad}")
            wrong += bad
    return 1 if wrong else 0


def _cases(folder: Path, snapshots: dict[str, Snapshot | None]) -> Iterator[tuple[str, list[str]]]:
    for number, one in enumerate(cases()):
        document = ROBOTS[one.robot].copy(folder / f"case_{number}")
        one.write(document)
        old, new = snapshots[one.robot], drawn(document)
        yield f"{one.robot}, {one.name}", ["it does not compile"] if old is None or new is None else list(faults(old, new, one.made))


def _designs(folder: Path, snapshots: dict[str, Snapshot | None], count: int) -> Iterator[tuple[str, list[str]]]:
    """Compare designs of MInchW that do not violate a rule with the original. Yield a title and a list of errors for each design.

    The parameters of the design are written into the document, so only these parameters may be reported.
    """
    old, number, taken = snapshots["minchw"], 0, 0
    while taken < count:
        number += 1
        design = drawing.design(number, 7)
        if design.broken or old is None:
            continue
        document = ROBOTS["minchw"].copy(folder / f"design_{number}")
        text, made = document.read_text(), set()
        for name, value in design.parameters.items():
            text = _with(text, name, value)
            before = old.things["parameter", name].facts["value"].value
            if not equal(before, float(value.removesuffix(" mm")) / 1000.0):
                made.add(("parameter", "changed", name, "value"))
        document.write_text(text)
        new = drawn(document)
        if new is not None:  # other designs are rejected, for example because a loop does not close in a pose
            taken += 1
            yield f"design {number}", list(faults(old, new, frozenset(made)))


def _with(text: str, name: str, value: str) -> str:
    """Return the text of the document with another value of a parameter."""
    text = re.sub(rf"(\n  {name}: \{{value: )[^,]+", rf"\g<1>{value}", text)
    return re.sub(rf'(\n  {name}: )"=leg_length"', rf"\g<1>{value}", text)


def _rewrites(folder: Path, snapshots: dict[str, Snapshot | None], count: int) -> Iterator[tuple[str, list[str]]]:
    for number in range(count):
        name = list(ROBOTS)[number // 5 % len(ROBOTS)]
        document = ROBOTS[name].copy(folder / f"rewrite_{number}")
        document.write_text(rewritten(document.read_text(), number))
        old, new = snapshots[name], drawn(document)
        yield f"{name}, rewrite {number}", ["it does not compile"] if old is None or new is None else list(faults(old, new, frozenset()))


if __name__ == "__main__":
    sys.exit(main())
