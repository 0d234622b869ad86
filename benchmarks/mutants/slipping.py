"""`make slips`: count the user mistakes (slips) that thingc reports. The command writes `docs/studies/slips.md`.

For each slip, `thingc build` runs on the robot whose document contains the slip. If the build reports nothing, `thingc test` also runs.

    python benchmarks/mutants/slipping.py                   # about ten minutes on two cores
    python benchmarks/mutants/slipping.py --before          # the same with the version for which the study was first made
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from reasons import REASONS  # noqa: E402
from slips import ARM, MEANING, MINCHW, SIZES, WALKER, Slip  # noqa: E402

from thingc.base.diagnostics import Report  # noqa: E402
from thingc.base.source import Document, MappingNode, node_at  # noqa: E402
from thingc.documents.load.documents import load  # noqa: E402
from thingc.documents.workspace import Workspace  # noqa: E402
from thingc.tools.cli.main import main as thingc  # noqa: E402

ROOT = HERE.parents[1]
PAGE = ROOT / "docs" / "studies" / "slips.md"
HEAD = HERE / "slips_page.md"
COMMIT = "c3d9b01"
"""The version of thingc for which the lists were written. None of the diagnostics that the study found missing existed in this version."""
BEFORE = HERE / "before.json"
"""The results of this version, which `--before` writes."""
PATIENCE = 120.0
"""Time limit [s] for the tests of a document. All documents need less than a tenth of this time."""

DOCUMENTS = {
    ARM: {name: f"assemblies/{name}.yaml" for name in ("arm", "end_effector", "materials")},
    MINCHW: {name: f"assemblies/minchw/{name}.yaml" for name in ("minchw", "leg", "materials")},
    WALKER: {name: f"walker/{name}.yaml" for name in ("walker", "leg", "materials")},
}
"""The documents of each robot, by the name that edits use. The first document of each robot is built."""


@dataclass(frozen=True)
class Verdict:
    """The result for a slip. `outcome` is `refused` (an error), `warned`, `tests`, `silent` or `gone`. `tests` means that only the tests of
    the document found the slip. `gone` means that the document no longer contains the place of the slip. `near` is True if a diagnostic
    refers to a changed line or the line before or after it. `said` contains the code and the message of the first diagnostic.
    """

    outcome: str
    near: bool = False
    said: str = ""


def workspace(root: Path, folder: Path) -> None:
    """Copy the three robots of the checkout at `root` to temporary workspaces. Two robots are in the folder `assemblies/`, and the third
    robot is in `walker/`.
    """
    for name in ("assemblies", "parts"):
        shutil.copytree(root / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(root / "thingc.toml", folder)
    walker = folder / "walker"
    docs = root / "docs"
    pages = sorted(docs.glob("language/*.md")) or [docs / "language.md"]  # the version of `COMMIT` has one page
    text = "\n".join(page.read_text() for page in pages)
    blocks = re.findall(r"^```\w+\n# ([\w/]+\.(?:yaml|py))\n(.*?)^```$", text, re.M | re.S)
    for name, text in blocks:
        if name in ("walker.yaml", "leg.yaml", "materials.yaml", "parts/toy.py"):
            (walker / name).parent.mkdir(parents=True, exist_ok=True)
            (walker / name).write_text(text)
    shutil.copy(root / "thingc.toml", walker)


def edited(path: Path, edit: str) -> range:
    """Make one edit in a file. Return the range of lines that are near the edit. Raises `LookupError` if the document does not contain the
    path of the edit.
    """
    report = Report()
    home = Workspace.find(str(path), report)
    documents = load(str(path), home, report, kinds=("assembly", "materials")) if home is not None else None
    assert documents is not None, (path, report.diagnostics)
    document, text = documents.root, path.read_text()
    begin, end, new = _cut(document, text, edit[1:]) if edit.startswith("-") else _put(document, text, *edit.split(": ", 1))
    path.write_text(text[:begin] + new + text[end:])
    first = text.count("\n", 0, begin) + 1
    return range(first - 1, first + new.rstrip("\n").count("\n") + 2)


def _put(document: Document, text: str, where: str, value: str) -> tuple[int, int, str]:
    *around, last = steps = _steps(where)
    node = node_at(document.tree, steps)
    if node is not None:
        begin, end = _indices(text, node.span)
        return begin, end, value
    mapping = node_at(document.tree, tuple(around))
    if not isinstance(mapping, MappingNode):
        raise LookupError(where)
    begin = _indices(text, mapping.span)[0]
    if text[begin] == "{":
        return begin + 1, begin + 1, f"{last}: {value}, "
    first = next(iter(mapping.keys.values()))
    at = _indices(text, first)[0]
    return at, at, f"{last}: {value}\n{' ' * (first.column - 1)}"


def _cut(document: Document, text: str, where: str) -> tuple[int, int, str]:
    steps = _steps(where)
    node = node_at(document.tree, steps)
    if node is None:
        raise LookupError(where)
    begin, end = _indices(text, document.span(steps, key=True))[0], _indices(text, node.span)[1]
    rest = re.compile(r"[ \t]*(?:,[ \t]*|(?:#.*)?\n)?").match(text, end)
    assert rest is not None
    line = text.rfind("\n", 0, begin) + 1
    alone = not text[line:begin].strip() and rest.group().endswith("\n")
    return (line, rest.end(), "") if alone else (begin, rest.end() - rest.group().endswith("\n"), "")


def _steps(where: str) -> tuple[str | int, ...]:
    return tuple(int(step) if step.isdigit() else step for step in where.split("/"))


def _indices(text: str, span: Any) -> tuple[int, int]:
    starts = [0, *(found.end() for found in re.finditer("\n", text))]
    return starts[span.line - 1] + span.column - 1, starts[span.end_line - 1] + span.end_column - 1


def judge(slip: Slip, folder: Path, rewrite: Callable[[str], str]) -> Verdict:
    """Build a robot with a slip in its documents below `folder`, and restore the documents afterwards. If the build reports nothing, also
    run the tests of the document.
    """
    names = DOCUMENTS[slip.robot]
    before = {name: (folder / path).read_text() for name, path in names.items()}
    touched: dict[str, list[range]] = {}
    try:
        for edit in slip.edits:
            name, _, rest = edit.removeprefix("-").partition(" ")
            lines = edited(folder / names[name], f"{'-' * edit.startswith('-')}{rewrite(rest)}")
            touched.setdefault(names[name], []).append(lines)
        robot = str(folder / next(iter(names.values())))
        answer = _json("build", robot, "-o", str(folder / "out"))
        said = answer["diagnostics"]
        if said:
            places = [(found["file"], found["line"]) for one in said for found in (one, *one["notes"]) if found["file"]]
            near = any(
                line in lines for file, line in places for lines in touched.get(os.path.relpath(os.path.abspath(file), folder), ())
            )
            errors = [one for one in said if one["severity"] == "error"]
            first = (errors or said)[0]
            return Verdict("refused" if errors else "warned", near, f"{first['code']}: {first['message']}")
        failed = [one for one in _tested(robot) if one["severity"] == "error"]
        return Verdict("tests", False, f"{failed[0]['code']}: {failed[0]['message']}") if failed else Verdict("silent")
    except LookupError:
        return Verdict("gone")
    finally:
        for name, text in before.items():
            (folder / names[name]).write_text(text)


def _json(*words: str) -> Any:
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()):
        thingc([*words, "--format", "json"])
    return json.loads(out.getvalue())


def _tested(robot: str) -> list[Any]:
    """Run the tests of a document, and return their diagnostics. Return an empty list if the tests take too long."""
    command = [sys.executable, "-m", "thingc", "test", robot, "--format", "json"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        return []
    found: list[Any] = json.loads(done.stdout)["diagnostics"]
    return found


def run(task: tuple[int, int, str, str | None, bool]) -> list[tuple[int, Verdict]]:
    """Judge every `jobs`-th slip of both lists in a temporary workspace of this process. Return the results with the numbers of the
    slips.
    """
    part, jobs, root, store, bare_gains = task
    slips = [*MEANING, *SIZES]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(os.path.realpath(scratch))
        os.environ["THINGC_STORE"] = store or str(folder / "store")
        workspace(Path(root), folder)
        os.chdir(folder)
        for names in DOCUMENTS.values():
            said = _json("build", str(folder / next(iter(names.values()))), "-o", str(folder / "out"))["diagnostics"]
            assert not said, said
        rewrite = (lambda edit: re.sub(r"(k[pv]: [\d.e]+) N\*m\*?s?/rad", r"\1", edit)) if bare_gains else str
        found: list[tuple[int, Verdict]] = []
        for number, slip in enumerate(slips):
            if number % jobs == part:
                found.append((number, judge(slip, folder, rewrite)))
                print(f"{number}: {found[-1][1].outcome}: {slip.edits[0]}", file=sys.stderr, flush=True)
        return found


def verdicts(root: Path, jobs: int, store: str | None, *, bare_gains: bool = False) -> list[Verdict]:
    """Judge all slips of both lists, using the robots of the checkout at `root`. Return the results in the order of the lists.
    Set `bare_gains` for a version of thingc in which `kp` has no unit.
    """
    with ProcessPoolExecutor(jobs) as pool:
        parts = pool.map(run, [(part, jobs, str(root), store, bare_gains) for part in range(jobs)])
    return [verdict for _, verdict in sorted((pair for part in parts for pair in part), key=lambda pair: pair[0])]


def before(jobs: int, store: str | None) -> None:
    """Judge all slips with the version `COMMIT` of thingc and its documents, and store the results."""
    with tempfile.TemporaryDirectory() as scratch:
        old = Path(scratch) / "old"
        subprocess.run(["git", "-C", ROOT, "worktree", "add", "--detach", old, COMMIT], check=True)
        try:
            command = [sys.executable, __file__, "--root", old, "--bare-gains", "--verdicts", "--jobs", str(jobs)]
            command += ["--store", store] if store else []
            environment = {**os.environ, "PYTHONPATH": str(old / "compiler")}
            done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
        finally:
            subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", old], check=True)
    BEFORE.write_text("[\n" + ",\n".join(f" {json.dumps(verdict)}" for verdict in json.loads(done.stdout)) + "\n]\n")


def main() -> int:
    """Judge all slips and write the page. Return 1 if a slip is not reported and has no reason."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--store", help="cache of built parts (default: an empty one)")
    parser.add_argument("--before", action="store_true", help=f"judge with the version of {COMMIT} instead, and keep that")
    parser.add_argument("--root", type=Path, default=ROOT, help="checkout with the robots to use")
    parser.add_argument("--bare-gains", action="store_true", help="`kp` is written without a unit there")
    parser.add_argument("--verdicts", action="store_true", help="print only the verdicts, as JSON")
    arguments = parser.parse_args()
    if arguments.before:
        before(arguments.jobs, arguments.store)
        return 0
    found = verdicts(arguments.root, arguments.jobs, arguments.store, bare_gains=arguments.bare_gains)
    if arguments.verdicts:
        print(json.dumps([[one.outcome, one.near, one.said] for one in found]))
        return 0
    page = written(found, [Verdict(*verdict) for verdict in json.loads(BEFORE.read_text())])
    print(page)
    PAGE.write_text(HEAD.read_text() + page)
    return 0 if good(found) else 1


def good(found: Sequence[Verdict]) -> bool:
    """Return whether every slip that the build does not report has a reason."""
    slips = [*MEANING, *SIZES]
    return all(slips[number].edits[0] in REASONS for number in _silent(found))


def _silent(found: Sequence[Verdict]) -> list[int]:
    return [number for number, one in enumerate(found) if one.outcome in ("silent", "tests")]


def written(found: Sequence[Verdict], earlier: Sequence[Verdict]) -> str:
    """Format the tables of the page."""
    lines = ["```sh", "make slips", "```", ""]
    lines += ["| | mistakes | refused | warnings | at the right line | not reported | not reported, but found by the document's tests |"]
    lines += ["|---|---:|---:|---:|---:|---:|---:|"]
    size = len(MEANING)
    for name, part in (("meaning", slice(0, size)), ("magnitudes, units, positions", slice(size, None))):
        lines += [_row(f"{name}, before", earlier[part]), _row(f"{name}, now", found[part])]
    slips = [*MEANING, *SIZES]
    lines += ["", "| mistake | count | not reported before | not reported now |", "|---|---:|---:|---:|"]
    for kind in dict.fromkeys(slip.kind for slip in slips):
        mine = [number for number, slip in enumerate(slips) if slip.kind == kind]
        lines.append(
            f"| {kind} | {len(mine)} | {len(_silent([earlier[k] for k in mine]))} | {len(_silent([found[k] for k in mine]))} |"
        )
    codes = Counter(one.said[:5] for one in found if one.outcome in ("refused", "warned"))
    lines += ["", "## Reported codes", "", "| code | mistakes |", "|---|---:|"]
    lines += [*(f"| {code} | {times} |" for code, times in codes.most_common()), ""]
    lines += ["## Mistakes that are not reported", "", "| robot | mistake | reason |", "|---|---|---|"]
    for number in _silent(found):
        message = _cell(found[number].said[:100])
        by_tests = f" The tests of the document find the mistake: {message}" if found[number].outcome == "tests" else ""
        edits = "; ".join(slips[number].edits)
        lines.append(f"| {slips[number].robot} | {_cell(edits[:150])} | {REASONS.get(slips[number].edits[0], '')}{by_tests} |")
    return "\n".join([*lines, ""])


def _row(name: str, found: Sequence[Verdict]) -> str:
    """Format a row of the table. Percentages refer to the slips whose place still exists in the documents."""
    tally = Counter(one.outcome for one in found)
    size, near, silent = len(found) - tally["gone"], sum(one.near for one in found), tally["silent"] + tally["tests"]
    share = f"{silent} ({silent / size:.0%})"
    return f"| {name} | {size} | {tally['refused']} | {tally['warned']} | {near} | {share} | {tally['tests']} |"


def _cell(text: str) -> str:
    return "`" + text.replace("|", "\\|").replace("`", "'").replace("\n", " ") + "`"


if __name__ == "__main__":
    sys.exit(main())
