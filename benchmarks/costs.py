"""Measure the costs of a process."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Cost:
    """The costs of one process: wall time [s], the largest peak resident memory [MB] of it and its children, and its standard output."""

    wall: float
    memory: float
    out: str


def cost(command: list[str], folder: Path, environment: dict[str, str]) -> Cost:
    """Run a command. Raises if it fails: a failing command is not fast."""
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
