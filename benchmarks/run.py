"""`make bench`: what thingc costs, as ratios within one run.

I is one `python -c "import build123d"` of the same run: it stands for this machine at this moment, so that the ratios mean
something elsewhere. Every command is a whole process, from start to exit; memory is the largest resident set of any one process
that it started. The arm's documents and parts are copied into a scratch workspace, and the edits are made there.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Cost:
    """Of one process: wall seconds, and the peak resident memory [MB] of the largest process under it."""

    wall: float
    memory: float


def cost(command: list[str], folder: Path, environment: dict[str, str]) -> Cost:
    """Run a command to its end. Raises where it fails: a failing command is not fast."""
    program = (
        "import os, resource, subprocess, sys, time\n"
        "start = time.perf_counter()\n"
        "code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)\n"
        "wall = time.perf_counter() - start\n"
        "peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss\n"
        "sys.stderr.buffer.write(code.stderr) if code.returncode else None\n"
        "print(wall, peak / 1024.0, code.returncode)\n"
    )
    done = subprocess.run(
        [sys.executable, "-S", "-E", "-c", program, *command], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    wall, memory, code = done.stdout.split()
    if code != "0":
        raise SystemExit(f"{' '.join(command)} failed:\n{done.stderr}")
    return Cost(float(wall), float(memory))


class Workspace:
    """A scratch copy of the arm, with a store of its own, and edits that never repeat."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.store = folder / "store"
        self.count = 0
        for name in ("assemblies", "parts"):
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "thingc.toml", folder)
        self.environment = {**os.environ, "THINGC_STORE": str(self.store), "PYTHONDONTWRITEBYTECODE": ""}

    def edit(self, file: str, pattern: str, values: Callable[[int], str]) -> None:
        """Replace the one place that matches by a value never used before."""
        self.count += 1
        path = self.folder / file
        text, times = re.subn(pattern, lambda match: match.group(1) + values(self.count), path.read_text())
        if times != 1:
            raise SystemExit(f"{pattern!r} stands {times} times in {file}; the benchmark expects one place")
        path.write_text(text)

    def empty(self) -> None:
        """Forget every part and every build."""
        shutil.rmtree(self.store, ignore_errors=True)
        shutil.rmtree(self.folder / "build", ignore_errors=True)


def scenarios(workspace: Workspace) -> list[tuple[str, list[str], Callable[[], None], float, float]]:
    """(name, command, what to do before, must reach [I], memory bound [MB])."""
    thingc = [str(Path(sys.executable).parent / "thingc")]
    build = [*thingc, "build", "assemblies/arm.yaml"]
    check = [*thingc, "check", "assemblies/arm.yaml"]
    document = "assemblies/arm.yaml"
    return [
        ("cold build, empty store", build, workspace.empty, 1.6, 480.0),
        ("build, nothing changed", build, lambda: None, 0.10, 60.0),
        ("build, a limit edited", build,
         lambda: workspace.edit(document, r"(yaw:(?:.|\n)*?lower: -)[\d.]+", lambda n: f"{150 - n / 1000.0:.3f}"), 0.30, float("inf")),
        ("build, a colour edited", build,
         lambda: workspace.edit("assemblies/materials.yaml", r"(petg:(?:.|\n)*?color: )(?:[a-z]+|\"[^\"]*\")",
                                lambda n: f'"#{n:02x}aa{n:02x}"'), 0.65, float("inf")),
        ("build, one part's dimension", build,
         lambda: workspace.edit("parts/arm.py", r"(class BasePlate(?:.|\n)*?thickness: Annotated.* = )[\d.]+", lambda n: f"{5 + n / 1000.0:.3f}"),
         1.2, float("inf")),
        ("check, one value edited", check,
         lambda: workspace.edit(document, r"(yaw:(?:.|\n)*?upper: )[\d.]+", lambda n: f"{150 - n / 1000.0:.3f}"), 0.12, float("inf")),
        ("check, nothing changed", check, lambda: None, 0.04, float("inf")),
    ]


def main() -> int:
    """Print the table; exit code 1 when a figure that must be reached is not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=5, help="runs of each scenario; medians are printed")
    parser.add_argument("--only", default="", help="only scenarios whose name contains this")
    arguments = parser.parse_args()
    importing = [sys.executable, "-c", "import build123d"]
    with tempfile.TemporaryDirectory() as folder:
        workspace = Workspace(Path(folder))
        cost(importing, workspace.folder, workspace.environment)
        units: list[float] = []
        rows: list[tuple[str, float, float, float, float]] = []
        cost([str(Path(sys.executable).parent / "thingc"), "build", "assemblies/arm.yaml"], workspace.folder, workspace.environment)
        for name, command, before, bound, limit in scenarios(workspace):
            if arguments.only not in name:
                continue
            costs: list[Cost] = []
            for _ in range(arguments.n):
                units.append(cost(importing, workspace.folder, workspace.environment).wall)
                before()
                costs.append(cost(command, workspace.folder, workspace.environment))
            rows.append((name, statistics.median(c.wall for c in costs), max(c.memory for c in costs), bound, limit))
    unit = statistics.median(units)
    print(f"I = {unit:.2f} s (median of {len(units)}), {os.cpu_count()} cores, Python {sys.version.split()[0]}")
    print(f"{'':32} {'seconds':>8} {'ratio':>8} {'must':>6} {'MB':>6}")
    missed = 0
    for name, wall, memory, bound, limit in rows:
        good = wall / unit <= bound and memory <= limit
        missed += not good
        print(f"{name:32} {wall:8.3f} {wall / unit:6.3f} I {bound:4.2f} I {memory:6.0f}{'' if good else '  MISSED'}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
