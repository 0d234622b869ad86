"""Run thingc like a user, in a separate process, and read the files that it writes."""

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
    """The result of a command."""

    code: int
    out: str
    err: str

    @property
    def answer(self) -> dict[str, Any]:
        """The standard output, parsed as JSON."""
        found: dict[str, Any] = json.loads(self.out)
        return found


def environment(store: str | Path, **more: str) -> dict[str, str]:
    """Return the environment of this process with the store of the test."""
    return {**os.environ, "THINGC_STORE": str(store), **more}


def thingc(*words: str | Path, store: str | Path, cwd: str | Path = ROOT, more: Mapping[str, str] | None = None) -> Ran:
    """Run a command, and wait for its end."""
    done = subprocess.run(
        [*COMMAND, *map(str, words)], cwd=cwd, env=environment(store, **(more or {})), capture_output=True, text=True,
        timeout=TIMEOUT, check=False,
    )
    return Ran(code=done.returncode, out=done.stdout, err=done.stderr)


MEANT = ("TC517", "TC518", "TC519", "TC610")
"""Expected warnings of small robots in tests: far offsets, magnets and servos that only add weight, links in the floor."""


def build(document: str | Path, *words: str | Path, store: str | Path, cwd: str | Path = ROOT, **options: Any) -> dict[str, Any]:
    """Run `thingc build`, which must succeed without diagnostics, and return its JSON output."""
    return _silent(thingc("build", document, "--format", "json", *words, store=store, cwd=cwd, **options))


def thingc_here(*words: str | Path, cwd: str | Path, store: str | Path | None = None) -> Ran:
    """Run `thingc` in this process, for tests of messages and files that do not depend on processes."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.chdir(cwd), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([*map(str, words), *([] if store is None else ["--store", str(store)])])
    return Ran(code=code, out=out.getvalue(), err=err.getvalue())


def build_here(document: str | Path, *words: str | Path, store: str | Path, cwd: str | Path) -> dict[str, Any]:
    """Run `build` with the CAD kernel of this process."""
    return _silent(thingc_here("build", document, "--format", "json", *words, store=store, cwd=cwd))


def once(folder: Path, make: Callable[[], object]) -> Path:
    """Fill a folder once per run: one of several test processes fills it, and the others wait."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "made").exists():
            make()
            (folder / "made").touch()
    return folder


def built(document: str, store: str, *targets: str) -> Path:
    """Return the folder of a build with these targets (by default those of a build without `--emit`), which all tests read."""
    name = Path(document).stem
    folder = Path(store).parent / "-".join(("built", name, *targets))
    emit = [word for target in targets for word in ("--emit", target)]
    return once(folder, lambda: build_here(document, *emit, "-o", folder, store=store, cwd=ROOT)) / name


def with_all_formats(document: str, store: str) -> Path:
    """Return the folder of one build of a large robot for the tests of the viewer and of readers of other formats."""
    return built(document, store, "html", "mjcf", "urdf", "usd")


def _silent(ran: Ran) -> dict[str, Any]:
    assert ran.code == 0, ran.out + ran.err
    assert [found for found in ran.answer["diagnostics"] if found["code"] not in MEANT] == []
    return ran.answer


def tree(folder: str | Path) -> dict[str, bytes]:
    """Return all files below a folder, by path with `/`."""
    base = Path(folder)
    return {path.relative_to(base).as_posix(): path.read_bytes() for path in sorted(base.rglob("*")) if path.is_file()}


def write(folder: str | Path, files: Mapping[str, str | bytes]) -> Path:
    """Write a workspace to `folder`. The common indentation of texts is removed, and a `thingc.toml` is added if there is none."""
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
    """Edit a file, in which `old` must occur once."""
    text = path.read_text()
    assert text.count(old) == 1, (path, old, text.count(old))
    path.write_text(text.replace(old, new))


def processes(mark: str) -> list[str]:
    """Return the command lines of other running processes with `mark` in their command line or environment."""
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
