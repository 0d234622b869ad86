"""Run test files in forks of a process that has imported the compiler. This saves the imports and allows a fork to replace the code of
functions.
"""

from __future__ import annotations

import gc
import math
import os
import re
import resource
import select
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import CodeType, FunctionType

import pytest

WAITING = 20.0
"""Ratio of the limit of wall time to the limit of CPU time. The ratio is large because other programs use the machine, too."""


def warmed(package: Path, rooms: Iterable[str]) -> list[FunctionType]:
    """Import rooms of the compiler, so that forks of this process do not have to import them. Return all functions of the compiler."""
    for room in rooms:
        for path in sorted((package / room).rglob("*.py")):
            import_module(".".join(path.relative_to(package.parent).with_suffix("").parts).removesuffix(".__init__"))
    functions = [one for one in gc.get_objects() if isinstance(one, FunctionType) and one.__code__.co_filename.startswith(str(package))]
    gc.freeze()
    return functions


def patched(functions: list[FunctionType], path: Path, text: str, imported: bool) -> None:
    """Replace the code of the functions of a module by the code in a changed source text.

    Raises `ValueError` if the changed code runs during an import (`imported`). Raises `KeyError` or `ValueError` if a function cannot be
    replaced.
    """
    if imported:
        raise ValueError

    def codes(code: CodeType) -> Iterator[CodeType]:
        yield code
        for one in code.co_consts:
            if isinstance(one, CodeType):
                yield from codes(one)

    changed: dict[tuple[str, int], list[CodeType]] = {}
    for code in codes(compile(text, path, "exec", dont_inherit=True)):
        changed.setdefault((code.co_qualname, code.co_firstlineno), []).append(code)
    for one in functions:
        if one.__code__.co_filename == str(path):
            [one.__code__] = changed[one.__code__.co_qualname, one.__code__.co_firstlineno]


def run(tree: Path, tests: list[str], most: float, prepare: Callable[[], None]) -> tuple[str | None, float]:
    """Run tests. Return the first test file that fails and the CPU time [s]. The file is `"time"` if the tests take more than `most`
    seconds.

    The tests run in a fork of this process, after a call of `prepare`. If `prepare` raises `KeyError` or `ValueError`, the tests run in a
    new Python process.
    """
    said = tree.parent / "said"
    options = ["-x", "-p", "no:cacheprovider", "-p", "unshrunk", "--hypothesis-profile=unshrunk", f"--basetemp={tree.parent / 'tmp'}"]
    options += ["-m", "not slow", *tests]
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        try:
            os.setsid()
            os.chdir(tree)
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 1)
            os.dup2(1, 2)
            resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(most), resource.RLIM_INFINITY))
            try:
                prepare()
            except (KeyError, ValueError):
                os.execv(sys.executable, [sys.executable, "-m", "pytest", *options])
            code = int(pytest.main(options))
            if "TRACED_LINES" in os.environ:
                import_module("sitecustomize").write()
        except BaseException:
            traceback.print_exc()
            code = 1
        sys.stdout.flush()
        os._exit(code)
    ended = os.pidfd_open(child)
    late = not select.select([ended], [], [], WAITING * most)[0]
    os.close(ended)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    _, status, usage = os.wait4(child, 0)
    seconds = usage.ru_utime + usage.ru_stime
    if late or os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU:
        return "time", seconds
    if os.WIFEXITED(status) and os.WEXITSTATUS(status) in (0, 5):  # status 5: pytest ran no tests, because all are slow
        return None, seconds
    return next(iter(re.findall(r"^(?:FAILED|ERROR) ([^:\s]+)", said.read_text(errors="replace"), re.MULTILINE)), tests[0]), seconds
