"""Measure the time and the memory of a process."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Cost:
    """The costs of a process: wall time [s], largest peak resident memory [MB] of the process and its children, and standard output."""

    wall: float
    memory: float
    out: str


def cost(command: list[str], folder: Path, environment: dict[str, str]) -> Cost:
    """Run a command, and measure its costs. Raises `SystemExit` if the command fails."""
    program = (
        "import json, os, resource, subprocess, sys, time\n"
        "start = time.perf_counter()\n"
        "code = subprocess.run(sys.argv[1:], stdout=subprocess.PIPE, stderr=subprocess.PIPE)\n"
        "wall = time.perf_counter() - start\n"
        "peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss\n"
        "sys.stderr.buffer.write(code.stderr) if code.returncode else None\n"
        "print(json.dumps([wall, peak / 1024.0, code.returncode, code.stdout.decode()]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-S", "-E", "-c", program, *command], cwd=folder, env=environment, capture_output=True, text=True, check=True,
    )
    wall, memory, code, out = json.loads(done.stdout)
    if code != 0:
        raise SystemExit(f"{' '.join(command)} failed:\n{done.stderr}")
    return Cost(wall, memory, out)
