"""Measure how fast a family models parts in parallel, relative to plain scripts: `python benchmarks/variants/parallel.py [--count N]`.

Each setting of the family has another reach of the arm, so one brace is modelled for each setting. The lane `family` is `evaluate` with a
process for each core and an empty cache. It also slices the braces, and writes their meshes, records and cache entries. The lane `pool`
has the same number of processes, and each runs `kernel.py`, which creates the same braces with two meshes each, without thingc. The lane
`one process` is `evaluate` with one process. The lanes run in turn, for several rounds. The program prints the median rates [1/s], and the
rates of the family relative to `pool` and to `one process`.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import thingc

ROOT = Path(__file__).resolve().parents[2]
WARM = 4


def main() -> None:
    """Measure the lanes, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="number of settings (default: %(default)s)")
    parser.add_argument("--rounds", type=int, default=3, help="number of rounds (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="number of processes (default: one for each core)")
    arguments = parser.parse_args()
    count, jobs = arguments.count - arguments.count % arguments.jobs, arguments.jobs
    rates: dict[str, list[float]] = {"pool": [], "family": [], "one process": []}
    for _ in range(arguments.rounds):
        rates["pool"].append(pool(count, jobs))
        rates["family"].append(family(count, jobs))
        rates["one process"].append(family(count, 1))
    middle = {lane: statistics.median(found) for lane, found in rates.items()}
    for lane, rate in middle.items():
        print(f"{lane:12} {rate:6.2f}/s ({min(rates[lane]):.2f} to {max(rates[lane]):.2f})")
    print(f"family with {jobs} processes: {middle['family'] / middle['pool']:.2f} of the pool, "
          f"{middle['family'] / middle['one process']:.2f} times one process")


def pool(count: int, jobs: int) -> float:
    """Create `count` braces in `jobs` processes without thingc. Return the rate [1/s]."""
    command = [sys.executable, str(Path(__file__).with_name("kernel.py")), str(ROOT / "parts")]
    processes = [subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in range(jobs)]
    ask(processes, 1)  # imports the CAD kernel
    begun = time.perf_counter()
    ask(processes, count // jobs)
    took = time.perf_counter() - begun
    for process in processes:
        process.communicate()
    return count / took


def ask(processes: list[subprocess.Popen[str]], each: int) -> None:
    """Let each process create `each` braces, and wait for all processes."""
    for process in processes:
        assert process.stdin is not None
        process.stdin.write(f"{each}\n")
        process.stdin.flush()
    for process in processes:
        assert process.stdout is not None
        process.stdout.readline()


def family(count: int, jobs: int) -> float:
    """Evaluate a family at `count` settings, each with a new brace, in `jobs` processes. Return the rate [1/s]."""
    settings = [{"reach": f"{70 + 45 * ((number + 1) * 0.6180339887498949 % 1.0)} mm"} for number in range(WARM + count)]
    with tempfile.TemporaryDirectory() as store, thingc.family(ROOT / "assemblies" / "arm.yaml", store=store, jobs=jobs) as arms:
        arms.evaluate(settings[:WARM])  # starts the processes and makes the plan
        begun = time.perf_counter()
        arms.evaluate(settings[WARM:])
        return count / (time.perf_counter() - begun)


if __name__ == "__main__":
    main()
