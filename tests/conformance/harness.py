"""thingc as people use it: a process of its own, and the files that it leaves."""

from __future__ import annotations

import contextlib
import fcntl
import io
import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from thingc.tools.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
COMMAND = (sys.executable, "-m", "thingc")
TIMEOUT = 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Ran:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def answer(self) -> dict[str, Any]:
        """Its standard output as JSON."""
        found: dict[str, Any] = json.loads(self.out)
        return found


def environment(store: str | Path, **more: str) -> dict[str, str]:
    """This process's environment with the store of the test."""
    return {**os.environ, "THINGC_STORE": str(store), **more}


def thingc(*words: str | Path, store: str | Path, cwd: str | Path = ROOT, more: Mapping[str, str] | None = None) -> Ran:
    """Run one command to its end."""
    done = subprocess.run(
        [*COMMAND, *map(str, words)], cwd=cwd, env=environment(store, **(more or {})), capture_output=True, text=True,
        timeout=TIMEOUT, check=False,
    )
    return Ran(code=done.returncode, out=done.stdout, err=done.stderr)


MEANT = ("TC517", "TC518", "TC519", "TC610")
"""Warnings that small robots of tests deserve: far offsets, magnets and servos that are there for their weight, links in the floor."""


def build(document: str | Path, *words: str | Path, store: str | Path, cwd: str | Path = ROOT, **options: Any) -> dict[str, Any]:
    """`thingc build`, which must succeed and have nothing to say: its JSON answer."""
    return _silent(thingc("build", document, "--format", "json", *words, store=store, cwd=cwd, **options))


def thingc_here(*words: str | Path, cwd: str | Path, store: str | Path | None = None) -> Ran:
    """`thingc` by the command's function in this process, for tests that ask what is said or made and not what a process does."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.chdir(cwd), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([*map(str, words), *([] if store is None else ["--store", str(store)])])
    return Ran(code=code, out=out.getvalue(), err=err.getvalue())


def build_here(document: str | Path, *words: str | Path, store: str | Path, cwd: str | Path) -> dict[str, Any]:
    """`build`, with the kernel that this process has."""
    return _silent(thingc_here("build", document, "--format", "json", *words, store=store, cwd=cwd))


def once(folder: Path, make: Callable[[], object]) -> Path:
    """Fill a folder once per run: one of several test processes does, and the others wait."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "made").exists():
            make()
            (folder / "made").touch()
    return folder


def built(document: str, store: str, *targets: str) -> Path:
    """The folder of a build of these targets (without any, of what a build writes if none is stated), which all tests read."""
    name = Path(document).stem
    folder = Path(store).parent / "-".join(("built", name, *targets))
    emit = [word for target in targets for word in ("--emit", target)]
    return once(folder, lambda: build_here(document, *emit, "-o", folder, store=store, cwd=ROOT)) / name


def _silent(ran: Ran) -> dict[str, Any]:
    assert ran.code == 0, ran.out + ran.err
    assert [found for found in ran.answer["diagnostics"] if found["code"] not in MEANT] == []
    return ran.answer


def tree(folder: str | Path) -> dict[str, bytes]:
    """Every file below a folder, by its path with `/`."""
    base = Path(folder)
    return {path.relative_to(base).as_posix(): path.read_bytes() for path in sorted(base.rglob("*")) if path.is_file()}


def write(folder: str | Path, files: Mapping[str, str | bytes]) -> Path:
    """A workspace in `folder`: texts have their common indentation taken off; a `thingc.toml` where none is given."""
    base = Path(folder)
    settings = {"thingc.toml": 'thingc = "workspace/1"\nparts = ["parts"]\n'}
    for name, content in {**settings, **files}.items():
        path = base / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            path.write_text(textwrap.dedent(content))
    return base


def replace(path: Path, old: str, new: str) -> None:
    """Edit a file: `old` must be there once."""
    text = path.read_text()
    assert text.count(old) == 1, (path, old, text.count(old))
    path.write_text(text.replace(old, new))


def processes(mark: str) -> list[str]:
    """Command lines of living processes (not this one) with `mark` in their command line or environment."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit() or int(entry.name) == os.getpid():
            continue
        with contextlib.suppress(OSError):
            if (entry / "stat").read_text().rpartition(")")[2].split()[0] == "Z":
                continue
            words = (entry / "cmdline").read_bytes()
            if mark.encode() in words or mark.encode() in (entry / "environ").read_bytes():
                found.append(words.replace(b"\0", b" ").decode("utf-8", "replace"))
    return found
