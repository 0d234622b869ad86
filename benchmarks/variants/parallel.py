"""Measure how fast a family models parts in parallel, relative to plain scripts: `python benchmarks/variants/parallel.py [--count N]`.

Each setting of the family has another reach of the arm, so one brace is modelled for each setting. The lane `family` is `evaluate` with a
process for each core and an empty cache. It also slices the braces, because the mass of a print depends on its layers, and writes their
meshes, records and cache entries. In the lane `solid`, the infill of the braces is 100 %, so they are not sliced. The lane `pool` has the
same number of processes, and each runs `kernel.py`. Without thingc, this program creates the same braces, computes their volume, centre of
mass and moments of inertia, and writes two meshes of each brace to STL files. The lane `one process` is `evaluate` with one process. The
lanes run in turn, for several rounds.

The program prints the median processor time [ms] of a brace, with the smallest and the largest, and the median rate [1/s]. The processor
time is the user and system time of all processes and their children, without loading the CAD kernel. On a machine that others use, only
the ratio of processor times is meaningful.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from throughput import processor

import thingc

ROOT = Path(__file__).resolve().parents[2]
WARM = 4
SPARSE, SOLID = "infill: 15 %", "infill: 100 %"


def main() -> None:
    """Measure the lanes, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="number of settings (default: %(default)s)")
    parser.add_argument("--rounds", type=int, default=3, help="number of rounds (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="number of processes (default: one for each core)")
    arguments = parser.parse_args()
    count, jobs = arguments.count - arguments.count % arguments.jobs, arguments.jobs
    lanes = {
        "pool": lambda: pool(count, jobs), "family": lambda: family(count, jobs, SPARSE), "solid": lambda: family(count, jobs, SOLID),
        "one process": lambda: family(count, 1, SPARSE),
    }
    found: dict[str, list[tuple[float, float]]] = {lane: [] for lane in lanes}
    for _ in range(arguments.rounds):
        for lane, measure in lanes.items():
            found[lane].append(measure())
    middle = {lane: statistics.median(spent for spent, _ in pairs) for lane, pairs in found.items()}
    for lane, pairs in found.items():
        spent, rate = [1e3 * one for one, _ in pairs], statistics.median(one for _, one in pairs)
        part = middle["pool"] / middle[lane]
        print(f"{lane:12} {1e3 * middle[lane]:6.1f} ms ({min(spent):.1f} to {max(spent):.1f}) {part:6.2f} of the pool {rate:8.2f}/s")


def pool(count: int, jobs: int) -> tuple[float, float]:
    """Create `count` braces in `jobs` processes without thingc. Return the processor time of a brace [s] and the rate [1/s]."""
    command = [sys.executable, str(Path(__file__).with_name("kernel.py")), str(ROOT / "parts")]
    processes = [subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in range(jobs)]
    ask(processes, 1)  # imports the CAD kernel
    begun, before = time.perf_counter(), processor()
    ask(processes, count // jobs)
    took, spent = time.perf_counter() - begun, processor() - before
    for process in processes:
        process.communicate()
    return spent / count, count / took


def ask(processes: list[subprocess.Popen[str]], each: int) -> None:
    """Let each process create `each` braces, and wait for all processes."""
    for process in processes:
        assert process.stdin is not None
        process.stdin.write(f"{each}\n")
        process.stdin.flush()
    for process in processes:
        assert process.stdout is not None
        process.stdout.readline()


def family(count: int, jobs: int, infill: str) -> tuple[float, float]:
    """Evaluate a family at `count` settings, each with a new brace, in `jobs` processes.

    Return the processor time of a setting [s] and the rate [1/s]. `infill` is the text of the infill in the document of the materials.
    """
    settings = [{"reach": f"{70 + 45 * ((number + 1) * 0.6180339887498949 % 1.0)} mm"} for number in range(WARM + count)]
    with tempfile.TemporaryDirectory() as folder:
        for name in ("assemblies", "parts"):
            shutil.copytree(ROOT / name, Path(folder) / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "thingc.toml", folder)
        materials = Path(folder) / "assemblies" / "materials.yaml"
        materials.write_text(materials.read_text().replace(SPARSE, infill))
        with thingc.family(Path(folder) / "assemblies" / "arm.yaml", store=str(Path(folder) / "store"), jobs=jobs) as arms:
            arms.evaluate(settings[:WARM])  # starts the processes and makes the plan
            begun, before = time.perf_counter(), processor()
            assert all(one.sound for one in arms.evaluate(settings[WARM:]))
            took = time.perf_counter() - begun
            return (processor() - before) / count, count / took


if __name__ == "__main__":
    main()
