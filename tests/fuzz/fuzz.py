"""`make fuzz MINUTES=30`: check generated workspaces in this process, like `thingc check --no-code`, and record the results. The results
are the number of inputs, crashes (an exception, or TC899), control characters in the output, the slowest input, and the peak of
memory. Python's audit hook also records every file that is opened outside of the workspace, every import of a module in the
workspace, and every process, connection and write. Each failure is stored as a workspace in the folder of `--keep`, and the exit code
is 1. The same `--seed` gives the same inputs."""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from thingc.base.diagnostic_output import as_json, as_text
from thingc.base.diagnostics import Diagnostic
from thingc.base.safe_text import json_text
from thingc.driver.environment import Options
from thingc.tools.cli.check import without_code
from thingc.tools.reporting.ci_formats import as_github, as_sarif

sys.path.insert(0, str(Path(__file__).resolve().parent))
from mutations import NAMES, ROOT, Grammar, mutated, mutated_code, mutated_lock, seeds

sys.dont_write_bytecode = True  # a module of ours that is imported late is no write of an input

HANG = 5.0
"""The largest computing time [s] for an input."""
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_PROCESSES = ("os.exec", "os.fork", "os.posix_spawn", "os.system", "subprocess.", "socket.", "ctypes.", "os.remove", "os.rename",
    "os.mkdir", "shutil.")


class Hang(Exception):
    """Raised if an input takes too long."""


@dataclass
class Watch:
    """The audit hook, which records forbidden events between `begin` and `end`."""

    allowed: tuple[str, ...]
    workspace: str = ""
    on: bool = False
    seen: Counter[str] = field(default_factory=Counter)
    said: list[str] = field(default_factory=list)

    def hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Called by Python for every audited event."""
        if not self.on:
            return
        if event == "open":
            path, mode, flags = arguments
            if not isinstance(path, (str, bytes, os.PathLike)):
                return
            real = os.path.realpath(os.fsdecode(path))
            inside = real == self.workspace or real.startswith(self.workspace + os.sep)
            if isinstance(flags, int) and flags & _WRITING or isinstance(mode, str) and set(mode) & set("wax+"):
                self._note(f"write {real}")
            elif not inside and not real.startswith(self.allowed):
                self._note(f"open {real}")
        elif event == "import":
            file = arguments[1]
            if isinstance(file, str) and os.path.realpath(file).startswith(self.workspace + os.sep):
                self._note(f"import {arguments[0]}")
        elif event in ("exec", "compile"):
            code = arguments[0] if event == "exec" else None
            file = getattr(code, "co_filename", arguments[1] if event == "compile" else "")
            if event == "exec" and os.path.isabs(file) and os.path.realpath(file).startswith(self.workspace + os.sep):  # not "<string>"
                self._note(f"exec {file}")
        elif event.startswith(_PROCESSES):
            self._note(event)

    def _note(self, what: str) -> None:
        self.seen[what.partition(" ")[0]] += 1
        self.said.append(what)


@dataclass
class Result:
    """The results of all inputs."""

    inputs: int = 0
    accepted: int = 0
    codes: Counter[str] = field(default_factory=Counter)
    failures: list[dict[str, Any]] = field(default_factory=list)
    slowest: tuple[float, str] = (0.0, "")


class Fuzzer:
    """Generates and checks inputs. The first failure of each kind is stored in the folder `keep`."""

    def __init__(self, seed: int, keep: Path, lock: str) -> None:
        self.random = random.Random(seed)
        self.seeds = seeds()
        self.robots = [one for one in self.seeds if "minchw.yaml" in one.files or "arm.yaml" in one.files]
        self.donors = [text for one in self.seeds for text in one.files.values()]
        self.grammar = Grammar(self.random)
        self.keep = keep
        self.lock = lock
        self.result = Result()
        self.kinds: set[str] = set()
        self.home = os.getcwd()
        self.folder = Path(tempfile.mkdtemp(prefix="thingc-fuzz-"))
        own = {os.path.realpath(path) + os.sep for path in (sys.prefix, sys.base_prefix, *sys.path) if path}
        self.watch = Watch(allowed=(*own, os.devnull))
        self.watch.workspace = os.path.realpath(self.folder)
        (self.folder / "parts").mkdir()
        shutil.copytree(ROOT / "parts" / "minchw", self.folder / "parts" / "minchw", ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "parts" / "arm.py", self.folder / "parts")
        self.code = (self.folder / "parts" / "arm.py").read_text()
        marker = f"open({str(self.folder / 'EXECUTED')!r}, 'w')\n"
        for name in ("json", "yaml", "conftest", "sitecustomize", "evil"):
            (self.folder / f"{name}.py").write_text(marker)
            (self.folder / "parts" / f"{name}.py").write_text(marker + "class Evil: pass\n")
        sys.addaudithook(self.watch.hook)

    def one(self) -> None:
        """Check one input."""
        files, document = self._made()
        for path in self.folder.iterdir():
            if path.suffix in (".yaml", ".yml", ".toml", ".step") or path.name == "parts.lock.json":
                shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
        if self.random.random() < 0.05:
            files = {**files, "parts/arm.py": mutated_code(self.code, self.random)}
        for name, text in {"parts/arm.py": self.code, **files}.items():
            (self.folder / name).write_bytes(text.encode("utf-8", "surrogatepass"))
        if self.random.random() < 0.05:
            name = self.random.choice(NAMES)
            (self.folder / document).rename(self.folder / name)
            document = name
        (self.folder / "z_link.yaml").symlink_to("/etc/hostname")
        (self.folder / "z_folder.yaml").mkdir()
        os.mkfifo(self.folder / "z_pipe.yaml")
        self._judge(document)
        self.result.inputs += 1

    def _made(self) -> tuple[dict[str, str], str]:
        choose = self.random
        files = {"thingc.toml": 'thingc = "workspace/1"\npackages = ["thingc_stock", "bd_warehouse", "os", "evil"]\n',
            "parts.lock.json": self.lock}
        if choose.random() < 0.4:
            toml = choose.random() < 0.3
            document = "document.toml" if toml else "document.yaml"
            files |= {"materials.yaml": self.grammar.document("materials", toml=False), document: self.grammar.document("assembly",
                toml=toml)}
            if choose.random() < 0.3:
                files[document] = mutated(files[document], choose, self.donors)
        else:
            seed = choose.choice(self.robots if choose.random() < 0.6 else self.seeds)
            document = seed.name
            files |= seed.files
            files["thingc.toml"] = seed.files.get("thingc.toml", files["thingc.toml"])
            victim = document if choose.random() < 0.8 else choose.choice(list(seed.files))
            files[victim] = mutated(files[victim], choose, self.donors)
        if choose.random() < 0.15:
            files["parts.lock.json"] = mutated_lock(self.lock, choose)
        if choose.random() < 0.05:
            files["thingc.toml"] = mutated(files["thingc.toml"], choose, self.donors)
        return files, document

    def _judge(self, document: str) -> None:
        self.watch.said.clear()
        fault = ""
        found: list[Diagnostic] = []
        start = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, HANG)
        gone = self.random.random() < 0.02  # a working folder that somebody has deleted
        if gone:
            os.chdir(tempfile.mkdtemp())
            os.rmdir(os.getcwd())
        self.watch.on = True
        try:
            found = without_code(str(self.folder / document), Options(), strict=False)
            printed = [
                as_text(found, debug=True), as_github(found, base="/"), as_sarif(found, base="/", version="1"),
                json_text(json.dumps(as_json(found), ensure_ascii=False)),
            ]
            if not all(line.replace("\t", " ").isprintable() for text in printed for line in text.split("\n")):
                fault = "hidden characters printed"
        except Hang:
            fault = "hang"
        except Exception as raised:
            frames = traceback.extract_tb(raised.__traceback__)
            fault = f"{type(raised).__name__} at {os.path.basename(frames[-1].filename)}:{frames[-1].lineno}"
        finally:
            self.watch.on = False
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        spent = time.process_time() - start
        if gone:
            os.chdir(self.home)
        if any(one.code.code == "TC899" for one in found):
            fault = "TC899"
        if self.watch.said:
            fault = self.watch.said[0]
        if (self.folder / "EXECUTED").exists():
            (self.folder / "EXECUTED").unlink()
            fault = "code was executed"
        self.result.codes.update(one.code.code for one in found)
        self.result.accepted += not any(one.severity.value == "error" for one in found)
        if spent > self.result.slowest[0]:
            self.result.slowest = (spent, self._kept("slowest"))
        if fault:
            self.result.failures.append({"input": self.result.inputs, "document": document, "fault": fault})
            if fault not in self.kinds and len(self.kinds) < 100:
                self.kinds.add(fault)
                self._kept(f"fault-{len(self.kinds)}", f"{document}\n{fault}\n")

    def _kept(self, name: str, words: str = "") -> str:
        place = self.keep / name
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        for path in self.folder.iterdir():
            if path.is_file() and not path.is_symlink() and path.suffix in (".yaml", ".yml", ".toml", ".json"):
                shutil.copy(path, place)
        shutil.copy(self.folder / "parts" / "arm.py", place)
        (place / "FAULT.txt").write_text(words, errors="backslashreplace")
        return str(place)

    def close(self) -> None:
        """Remove the workspace."""
        shutil.rmtree(self.folder, ignore_errors=True)


def run(seconds: float, seed: int, keep: Path, lock: str, most: int | None = None, tell: Callable[[str], None] | None = None) -> Result:
    """Check inputs for a number of seconds, or at most `most` inputs."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise Hang

    signal.signal(signal.SIGPROF, stop)
    fuzzer = Fuzzer(seed, keep, lock)
    until = time.monotonic() + seconds
    told = time.monotonic()
    try:
        while time.monotonic() < until and (most is None or fuzzer.result.inputs < most):
            fuzzer.one()
            if tell is not None and time.monotonic() > told + 60.0:
                told = time.monotonic()
                tell(words(fuzzer))
    finally:
        fuzzer.close()
    if tell is not None:
        tell(words(fuzzer))
    return fuzzer.result


def peak_memory() -> float:
    """Return the peak of memory [MB] of this program. `ru_maxrss` would include the memory of its parent before the exec."""
    with open("/proc/self/status", encoding="ascii") as stream:
        return next(int(line.split()[1]) for line in stream if line.startswith("VmHWM:")) / 1024.0


def words(fuzzer: Fuzzer) -> str:
    """Describe the progress."""
    result = fuzzer.result
    peak = peak_memory()
    return (
        f"{result.inputs} inputs, {result.accepted} without errors, {len(result.codes)} codes said, {len(result.failures)} failures "
        f"({len(fuzzer.kinds)} kinds), slowest {result.slowest[0]:.2f} s, peak {peak:.0f} MB, opened outside {fuzzer.watch.seen['open']}, "
        f"written {fuzzer.watch.seen['write']}, executed {fuzzer.watch.seen['import'] + fuzzer.watch.seen['exec']}"
    )


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--most", type=int, help="maximum number of inputs")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--keep", type=Path, default=Path("fuzz-findings"))
    parser.add_argument("--lock", type=Path, required=True, help="a parts.lock.json of this repository's robots (see `make fuzz`)")
    options = parser.parse_args()
    print(f"seed {options.seed}", flush=True)
    result = run(
        60.0 * options.minutes, options.seed, options.keep, options.lock.read_text(), options.most,
        tell=lambda text: print(text, flush=True),
    )
    for failure in result.failures[:20]:
        print(failure)
    return 1 if result.failures else 0


if __name__ == "__main__":
    sys.exit(main())
