"""Whole processes, and what they cost."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

THINGC = str(Path(sys.executable).with_name("thingc"))

_MEASURE = """\
import json, resource, subprocess, sys
done = subprocess.run(sys.argv[1:], capture_output=True, text=True, errors="replace")
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([done.returncode, done.stdout[:2_000_000], done.stderr[:20_000], used.ru_utime + used.ru_stime, used.ru_maxrss / 1024]))
"""


@dataclass(frozen=True)
class Ran:
    """A process that ended: its exit code, what it printed, CPU seconds and peak memory [MB] of it and its children."""

    code: int
    out: str
    err: str
    seconds: float
    memory: float


def environment(**more: str) -> dict[str, str]:
    """An environment in which nothing of the caller's decides where Python looks for modules."""
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "THINGC_STORE", "PYTHONSTARTUP")}
    return {**kept, "COLUMNS": "100", **more}


def ran(words: Sequence[str], folder: Path, more: Mapping[str, str] | None = None, program: Sequence[str] = (THINGC,)) -> Ran:
    """Run `thingc` with these words in a folder, to its end."""
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", _MEASURE, *program, *words], cwd=folder, env=environment(**(more or {})),
        capture_output=True, text=True, check=True, timeout=600,
    )
    return Ran(*json.loads(done.stdout))
