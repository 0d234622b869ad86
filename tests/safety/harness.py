"""Run complete processes and measure their CPU time and memory."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
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
    """A finished process: exit code, output, and CPU seconds and peak memory [MB] of it and its children."""

    code: int
    out: str
    err: str
    seconds: float
    memory: float


def environment(**more: str) -> dict[str, str]:
    """Return an environment without variables that change where Python looks for modules."""
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "THINGC_STORE", "PYTHONSTARTUP")}
    return {**kept, "COLUMNS": "100", **more}


def ran(words: Sequence[str], folder: Path, more: Mapping[str, str] | None = None, program: Sequence[str] = (THINGC,)) -> Ran:
    """Run `thingc` with these arguments in a folder until it ends."""
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", _MEASURE, *program, *words], cwd=folder, env=environment(**(more or {})),
        capture_output=True, text=True, check=True, timeout=600,
    )
    return Ran(*json.loads(done.stdout))


_FORKS = """\
import json, os, sys
from thingc.__main__ import entry
from thingc.driver.environment import Options
from thingc.tools.cli.check import without_code
without_code(sys.argv[1], Options(), strict=False)
for line in sys.stdin:
    folder, words, out, err = json.loads(line)
    child = os.fork()
    if child == 0:
        os.chdir(folder)
        for number, name in enumerate((os.devnull, out, err)):
            os.dup2(os.open(name, os.O_RDWR), number)
        sys.argv = ["thingc", *words]
        entry()
    _, status, used = os.wait4(child, 0)
    print(json.dumps([os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, used.ru_maxrss / 1024]), flush=True)
"""


@contextlib.contextmanager
def forked(folder: Path) -> Iterator[Callable[[Sequence[str], Path], Ran]]:
    """Yield a function like `ran` that forks its processes from one that has imported the modules of `thingc check --no-code`."""
    example, streams = folder / "example.yaml", (folder / "out", folder / "err")
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    example.write_text("thingc: assembly/1\nname: example\ncomponents: {body: {frame: true}}\n")
    with subprocess.Popen(
        [sys.executable, "-I", "-c", _FORKS, str(example)], env=environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as server:
        assert server.stdin is not None and server.stdout is not None

        def run(words: Sequence[str], where: Path) -> Ran:
            for stream in streams:
                stream.write_text("")
            print(json.dumps([str(where), [*words], *map(str, streams)]), file=server.stdin, flush=True)
            code, seconds, memory = json.loads(server.stdout.readline())
            out, err = (stream.read_text(errors="replace") for stream in streams)
            return Ran(code, out, err, seconds, memory)

        yield run
