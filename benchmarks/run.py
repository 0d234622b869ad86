"""`make bench`: measure the costs of thingc as ratios to a reference time I.

I is the time of `python -c "import build123d"` in the same run. I represents the speed of the machine, so the ratios of different machines
can be compared. Each command is measured as a whole process, from start to exit. The memory of a command is the largest resident set of any
process that it starts. The documents and parts of both robots are copied to a temporary workspace, where the benchmark edits them. If a
scenario counts parts, the build must model exactly the definitions whose parameters have changed.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import eighty
import typing_in_editor
from costs import Cost, cost
from forty import write_forty
from wide import write_wide

ROOT = Path(__file__).resolve().parent.parent
MODELS = "mjcf,mjz,glb,urdf,ros,sdf,usd,html,stl,step,bom,hag"
"""All targets but those of the workshop (plates, drawings and the assembly book) and of learning frameworks."""


class Workspace:
    """A temporary copy of the workspace with its own store. Each edit writes a value that was not used before."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.store = folder / "store"
        self.count = 0
        for name in ("assemblies", "parts"):
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "thingc.toml", folder)
        (folder / "wide").mkdir()
        tools = folder / "tools"  # without Chromium, whose start for the PDF file of drawings takes longer than the drawings
        tools.mkdir()
        tools.joinpath("git").symlink_to(shutil.which("git") or sys.exit("install git"))
        self.environment = {**os.environ, "PATH": str(tools), "THINGC_STORE": str(self.store), "PYTHONDONTWRITEBYTECODE": ""}

    def edit(self, file: str, pattern: str, values: Callable[[int], str]) -> None:
        """Replace the value after the only match of a pattern in a file by a new value."""
        self.count += 1
        path = self.folder / file
        text, times = re.subn(pattern, lambda match: match.group(1) + values(self.count), path.read_text())
        if times != 1:
            raise SystemExit(f"expected one match of {pattern!r} in {file}, found {times}")
        path.write_text(text)

    def write_thousand(self, file: str) -> None:
        """Write a document with 1 000 components, with comments and with keys that are not in the canonical order."""
        lines = ["thingc: assembly/1", "components:", "  base: {frame: true}", "name: thousand"]
        components = []
        for n in range(1, 1000):
            components += [
                f"  screw_{n}:   # number {n}", f"    attach: {{ seat: base.screw_{n} }}", "    collision: none",
                "    part: thingc_stock.fasteners:Screw", "    params: {size: M3,length: 8mm}",
                f"    bom: {{number: ISO 4762 M3 x 8}}  # {n}",
            ]
        (self.folder / file).write_text("\n".join([*lines[:3], *components, lines[3], ""]))

    def known(self, document: str) -> None:
        """Check a document, so that the store contains its parts."""
        cost([str(Path(sys.executable).parent / "thingc"), "check", document], self.folder, self.environment)

    def lock_once(self) -> None:
        """Write the lock file if it does not exist. Delete the store, so that `--no-code` uses only the lock file."""
        if not (self.folder / "parts.lock.json").exists():
            cost([str(Path(sys.executable).parent / "thingc"), "lock"], self.folder, self.environment)
        self.empty()

    def unbuilt(self) -> None:
        """Delete the build folder, but not the cached parts."""
        shutil.rmtree(self.folder / "build", ignore_errors=True)

    def empty(self) -> None:
        """Delete the build folder and the cached parts."""
        shutil.rmtree(self.store, ignore_errors=True)
        shutil.rmtree(self.folder / "build", ignore_errors=True)

    def two_revisions(self) -> None:
        """Create a git repository with two revisions that differ in a joint limit. The store then contains the parts of both revisions."""
        if (self.folder / ".git").exists():
            return
        arm = "assemblies/arm.yaml"
        git = ["git", "-c", "user.name=bench", "-c", "user.email=bench@example.org", "-c", "commit.gpgsign=false"]
        cost([*git, "init", "-q"], self.folder, self.environment)
        for number in range(2):
            self.edit(arm, r"(yaw:(?:.|\n)*?upper: )[\d.]+", lambda n: f"{150 - n / 1000.0:.3f}")
            cost([*git, "add", "assemblies", "parts", "thingc.toml"], self.folder, self.environment)
            cost([*git, "commit", "-qm", f"revision {number}"], self.folder, self.environment)
        cost([str(Path(sys.executable).parent / "thingc"), "diff", "HEAD~1..HEAD", "--", arm], self.folder, self.environment)


@dataclass(frozen=True)
class Scenario:
    """A command, a function that prepares each run, and two bounds. `reach` is the bound of the ratio to I (None: only printed), and
    `memory` is the bound of the memory [MB].

    If `counted` is True, the command must model exactly the definitions that the previous run did not have. If `beyond` is the name of
    another scenario, the time of that scenario is subtracted, and the rest is divided by `pieces`, for example by the number of drawings.
    """

    name: str
    command: tuple[str, ...]
    before: Callable[[], None]
    reach: float | None
    memory: float = float("inf")
    counted: bool = False
    beyond: str = ""
    pieces: int = 1


def scenarios(workspace: Workspace) -> list[Scenario]:
    """Return the scenarios for the arm and MInchW: a cold build, an unchanged build, and builds after an edit of each kind."""
    arm, minchw = "assemblies/arm.yaml", "assemblies/minchw/minchw.yaml"

    def edited(file: str, pattern: str, value: Callable[[int], str]) -> Callable[[], None]:
        return lambda: workspace.edit(file, pattern, value)

    limit = edited(arm, r"(yaw:(?:.|\n)*?lower: -)[\d.]+", lambda n: f"{150 - n / 1000.0:.3f}")
    value = edited(arm, r"(yaw:(?:.|\n)*?upper: )[\d.]+", lambda n: f"{150 - n / 1000.0:.3f}")
    color = edited("assemblies/materials.yaml", r"(petg:(?:.|\n)*?color: )(?:[a-z]+|\"[^\"]*\")", lambda n: f'"#{n:02x}aa{n:02x}"')
    dimension = edited("parts/arm.py", r"(class BasePlate(?:.|\n)*?thickness: Annotated.* = )[\d.]+", lambda n: f"{5 + n / 1000.0:.3f}")
    bracket = edited("parts/minchw/leg.py", r"(class HipBracket(?:.|\n)*?boss_diameter__add=)[\d.]+", lambda n: f"{6 + n / 1000.0:.3f}")
    forty = write_forty(workspace.folder)
    one_of_forty = edited(
        "parts/forty.py", r"(class Plate7(?:.|\n)*?thickness: Annotated.* = )[\d.]+", lambda n: f"{3 + n / 1000.0:.3f}",
    )
    knee = edited("assemblies/minchw/leg.yaml", r"(knee:(?:.|\n)*?upper: )[\d.]+", lambda n: f"{115 - n / 1000.0:.3f}")
    wide = f"wide/{write_wide(workspace.folder / 'wide')}"
    value_of_wide = edited("wide/level7.yaml", r"(reach: \{value: )[\d.]+", lambda n: f"{40 + n / 1000.0:.3f}")
    leg = edited("assemblies/minchw/minchw.yaml", r"(  leg_length: \{value: )[\d.]+", lambda n: f"{64 + n / 100.0:.2f}")
    (text, _, _), tests = (workspace.folder / arm).read_text().partition("\ntests:"), "assemblies/arm_{}.yaml"
    for name, test in (("mass", "mass: {min: 1 g}"), ("certified", "no_collision: {mode: bench, joints: {elbow: all}, certify: true}")):
        (workspace.folder / tests.format(name)).write_text(f"{text}\ntests: {{only: {{{test}}}}}\n")

    def from_full_store() -> None:
        workspace.known(arm)
        workspace.unbuilt()

    return [
        Scenario("arm: cold build, empty store", ("build", arm), workspace.empty, 1.0, 480.0),
        Scenario("arm: cold build, all models", ("build", "--emit", MODELS, arm), workspace.empty, 0.95, 480.0),
        Scenario("arm: all targets, from a full store", ("build", "--emit", "all", arm), workspace.unbuilt, None),
        Scenario("arm: build, nothing changed", ("build", arm), lambda: None, 0.05, 60.0),
        Scenario("arm: build, a limit edited", ("build", arm), limit, 0.20),
        Scenario("arm: a limit edited, text targets", ("build", "--emit", "mjcf,bom,hag,urdf,ros,sdf,usd", arm), limit, 0.35),
        Scenario("arm: the page, from a full store", ("build", "--emit", "html", arm), workspace.unbuilt, 0.10),
        Scenario("arm: build, a colour edited", ("build", arm), color, 0.65),
        Scenario("arm: build, one part's dimension", ("build", arm), dimension, 0.7),
        Scenario("arm: check, one value edited", ("check", arm), value, 0.11),
        Scenario("arm: check, nothing changed", ("check", arm), lambda: None, 0.04),
        Scenario("arm: test, without geometry", ("test", tests.format("mass")), from_full_store, None),
        Scenario(
            "arm: test, one joint certified", ("test", tests.format("certified")), from_full_store, 0.1,
            beyond="arm: test, without geometry",
        ),
        Scenario("arm: cold build, bill only", ("build", "--emit", "bom", arm), workspace.empty, None),
        Scenario(
            "arm: cold build, each drawing", ("build", "--emit", "bom,drawing", arm), workspace.empty, 0.1,
            beyond="arm: cold build, bill only", pieces=6,
        ),
        Scenario("arm: plates, from a full store", ("build", "--emit", "3mf", arm), from_full_store, None),
        Scenario("arm: STEP, from a full store", ("build", "--emit", "step", arm), from_full_store, None),
        Scenario("minchw: cold build, empty store", ("build", minchw), workspace.empty, 1.2, 500.0),
        Scenario("minchw: build, nothing changed", ("build", minchw), lambda: None, 0.05),
        Scenario("minchw: build, a limit edited", ("build", minchw), knee, 0.20),
        Scenario("minchw: build, one part's dimension", ("build", minchw), bracket, 0.7),
        Scenario("40 parts in a module, one edited", ("build", forty), one_of_forty, 2.0),
        Scenario("minchw: check, one value edited", ("check", minchw), lambda: (workspace.known(minchw), knee())[1], 0.11),
        Scenario("check: 1 000 in 20 documents", ("check", wide), lambda: (workspace.known(wide), value_of_wide())[1], 0.6),
        Scenario("minchw: check --no-code", ("check", "--no-code", minchw), workspace.lock_once, 0.15),
        Scenario("check --no-code: the same", ("check", "--no-code", wide), workspace.lock_once, 0.6),
        Scenario("arm: diff of two revisions", ("diff", "HEAD~1..HEAD", "--", arm), workspace.two_revisions, 0.5),
        Scenario("fmt: 1 000 components", ("fmt", "thousand.yaml"), lambda: workspace.write_thousand("thousand.yaml"), 0.4),
        Scenario("minchw: build, one leg parameter", ("build", minchw), leg, None, counted=True),
    ]


@dataclass(frozen=True)
class Save:
    """A save of a file while `thingc watch DOC --emit mjcf` runs. `reach` is the bound of the time from the save to the new build folder,
    as a ratio to I. This time does not include the modelling of parts.

    Workers report how long they modelled each part, after its class was loaded.
    """

    name: str
    document: str
    save: Callable[[], None]
    reach: float


def saves(workspace: Workspace) -> list[Save]:
    """Return two saves for each robot: a changed number, and a changed part."""
    arm, minchw = "assemblies/arm.yaml", "assemblies/minchw/minchw.yaml"

    def edited(file: str, pattern: str, value: Callable[[int], str]) -> Callable[[], None]:
        return lambda: workspace.edit(file, pattern, value)

    yaw = edited(arm, r"(yaw:(?:.|\n)*?lower: -)[\d.]+", lambda n: f"{140 - n / 1000.0:.3f}")
    knee = edited("assemblies/minchw/leg.yaml", r"(knee:(?:.|\n)*?upper: )[\d.]+", lambda n: f"{113 - n / 1000.0:.3f}")
    plate = edited("parts/arm.py", r"(class BasePlate(?:.|\n)*?thickness: Annotated.* = )[\d.]+", lambda n: f"{5.2 + n / 1000.0:.3f}")
    # The documents set the thickness of the bracket, so the default of another parameter is edited.
    bracket = edited("parts/minchw/leg.py", r"(class HipBracket(?:.|\n)*?boss_diameter__add=)[\d.]+", lambda n: f"{6.2 + n / 100.0:.2f}")
    return [
        Save("arm: watch, a limit saved", arm, yaw, 0.065),
        Save("minchw: watch, a limit saved", minchw, knee, 0.065),
        Save("arm: watch, a part saved", arm, plate, 0.065),
        Save("minchw: watch, a part saved", minchw, bracket, 0.065),
    ]


def watched(workspace: Workspace, saved: Save, times: int) -> tuple[list[float], list[float]]:
    """Return two lists of times [s], one item per save: the time until the new build folder exists, and the time in which workers modelled
    parts.
    """
    thingc = str(Path(sys.executable).parent / "thingc")
    folder = workspace.folder / "build" / Path(saved.document).stem
    command = [thingc, "watch", saved.document, "--emit", "mjcf", "--format", "json"]
    seconds: list[float] = []
    kernel: list[float] = []
    with subprocess.Popen(command, cwd=workspace.folder, env=workspace.environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        if not json.loads(process.stdout.readline())["good"]:
            raise SystemExit(f"{' '.join(command)} does not build")
        time.sleep(4.0)  # wait until the CAD kernel is loaded
        for turn in range(times + 1):
            before = folder.stat().st_ino
            time.sleep(0.3 + 0.007 * turn)
            saved.save()
            start = time.perf_counter()
            while folder.stat().st_ino == before:
                if process.poll() is not None or time.perf_counter() - start > 60.0:
                    raise SystemExit(f"{saved.name}: nothing was built after the save")
                time.sleep(0.0005)
            seconds.append(time.perf_counter() - start)
            kernel.append(json.loads(process.stdout.readline())["kernel"])
        process.send_signal(signal.SIGINT)
        if process.wait() != 0:
            raise SystemExit(f"{' '.join(command)} did not end as it should")
    return seconds[1:], kernel[1:]


def definitions(out: str) -> tuple[set[str], set[str]]:
    """Return two sets from the JSON output of a build: the definitions that were modelled, and all definitions."""
    answer = json.loads(out)
    return set(answer["modelled"]), {*answer["modelled"], *answer["reused"]}


def main() -> int:
    """Print the table of results. Return 1 if a bound is exceeded."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=5, help="number of runs per scenario; medians are printed")
    parser.add_argument("--only", default="", help="run only scenarios whose name contains this string")
    arguments = parser.parse_args()
    importing = [sys.executable, "-c", "import build123d"]
    with tempfile.TemporaryDirectory() as folder:
        workspace = Workspace(Path(folder))
        cost(importing, workspace.folder, workspace.environment)
        units: list[float] = []
        rows: list[tuple[Scenario, float, float, str]] = []
        thingc = str(Path(sys.executable).parent / "thingc")
        # This first build, which is not measured, also writes the bytecode of thingc.
        cost([thingc, "build", "assemblies/arm.yaml"], workspace.folder, workspace.environment)
        listed = scenarios(workspace)
        bases = {scenario.beyond for scenario in listed if arguments.only in scenario.name}
        for scenario in listed:
            if arguments.only not in scenario.name and scenario.name not in bases:
                continue
            costs: list[Cost] = []
            counts = ""
            command = [thingc, *scenario.command, *(("--format", "json") if scenario.counted else ())]
            for _ in range(arguments.n):
                units.append(cost(importing, workspace.folder, workspace.environment).wall)
                had = definitions(cost(command, workspace.folder, workspace.environment).out)[1] if scenario.counted else set()
                scenario.before()
                costs.append(cost(command, workspace.folder, workspace.environment))
                if scenario.counted:
                    modelled, having = definitions(costs[-1].out)
                    counts = f"  {len(modelled)} of {len(having)} parts modelled, {len(having - had)} changed"
                    if modelled != having - had:
                        counts += "  MISSED"
                        break
            rows.append((scenario, statistics.median(c.wall for c in costs), max(c.memory for c in costs), counts))
        live: list[tuple[Save, list[float], list[float]]] = []
        for saved in saves(workspace):
            if arguments.only in saved.name:
                units.append(cost(importing, workspace.folder, workspace.environment).wall)
                live.append((saved, *watched(workspace, saved, 2 * arguments.n)))
        typed: list[tuple[str, float, str, float | None]] = []
        if arguments.only in "minchw: lsp":  # one server process for all measurements
            units.append(cost(importing, workspace.folder, workspace.environment).wall)
            workspace.known(document := "assemblies/minchw/minchw.yaml")
            workspace.known(f"wide/{write_wide(workspace.folder / 'wide')}")
            wide = sorted((workspace.folder / "wide").glob("level*.yaml"), key=lambda path: int(path.stem.removeprefix("level")))
            typed = typing_in_editor.rows(
                thingc, workspace.folder, workspace.environment, workspace.folder / document, wide, 20 * arguments.n,
            )
        if arguments.only in "80 meshes":
            units.append(cost(importing, workspace.folder, workspace.environment).wall)
            typed += eighty.rows(thingc, workspace.folder, workspace.environment, statistics.median(units))
    if not units:
        raise SystemExit(f"no row is called `{arguments.only}`")
    unit = statistics.median(units)
    print(f"I = {unit:.2f} s (median of {len(units)}), {os.cpu_count()} cores, Python {sys.version.split()[0]}")
    print(f"{'':32} {'seconds':>8} {'ratio':>8} {'must':>6} {'MB':>6}")
    missed = 0
    walls = {"": 0.0} | {scenario.name: wall for scenario, wall, _, _ in rows}
    for scenario, wall, memory, counts in rows:
        ratio = (wall - walls[scenario.beyond]) / scenario.pieces / unit
        good = (scenario.reach is None or ratio <= scenario.reach) and memory <= scenario.memory
        missed += not good or counts.endswith("MISSED")
        must = "     -" if scenario.reach is None else f"{scenario.reach:4.2f} I"
        print(f"{scenario.name:32} {wall:8.3f} {ratio:6.3f} I {must} {memory:6.0f}{counts}{'' if good else '  MISSED'}")
    for saved, seconds, kernel in live:
        wall, modelling = statistics.median(seconds), statistics.median(kernel)
        beyond = statistics.median(one - other for one, other in zip(seconds, kernel, strict=True))
        good = beyond / unit <= saved.reach
        missed += not good
        more = f"  {beyond:.3f} s beyond the kernel's {modelling:.3f}" if modelling else ""
        print(f"{saved.name:32} {wall:8.3f} {beyond / unit:6.3f} I {saved.reach:.3f} I{more}{'' if good else '  MISSED'}")
    for name, figure, measure, must in typed:
        good = must is None or figure <= must
        missed += not good
        digits = 0 if measure == "MB" else 3
        bound = "     -" if must is None else f"{must:6.{digits}f}"
        print(f"{name:35} {figure:8.{digits}f} {measure:>5} {bound}{'' if good else '  MISSED'}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
