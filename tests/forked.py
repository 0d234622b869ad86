"""A plugin of pytest that runs tests in several processes (`--jobs`), which are forked after one process has imported and collected all
tests. The processes of pytest-xdist would each import and collect them again, which takes a quarter of a minute of processor time each.

A process runs all tests of a file, then those of the next file that no process has begun. If a process ends during a test, this test fails,
and a new process runs the other tests of the file.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import traceback
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe, wait
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

LOOK = 1.0
"""Time [s] after which the parent looks whether a silent process has ended. Processes that a test has left keep its pipe open."""
CANCEL = getattr(signal, "SIGUSR2", signal.SIGINT)
"""The signal that cancels a process. A shell that starts pytest in the background makes it ignore SIGINT."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--jobs`."""
    parser.addoption("--jobs", type=int, default=0, help="number of processes that are forked after the collection, and run the tests")


def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Run the tests in several processes with `--jobs`."""
    options = session.config.option
    if options.jobs == 0 or options.collectonly or session.testsfailed or not session.items:
        return None
    run(session, options.jobs)
    return True


class Files:
    """All tests by file, and a pipe with the indices of the first tests of all files, from which each process takes the next one."""

    def __init__(self, items: Sequence[pytest.Item]) -> None:
        order = {path: number for number, path in enumerate(dict.fromkeys(item.path for item in items))}
        self.items = sorted(items, key=lambda item: order[item.path])  # pytest puts tests of one parameter of a session together
        self.source, target = os.pipe()
        starts = [0, *(index + 1 for index in range(len(items) - 1) if self.is_last(index))]
        os.write(target, b"".join(index.to_bytes(4, "big") for index in starts))
        os.close(target)

    def is_last(self, index: int) -> bool:
        """Return whether a test is the last one of its file."""
        return index + 1 == len(self.items) or self.items[index + 1].path != self.items[index].path

    def rest(self, index: int) -> Iterator[int]:
        """Yield the indices of the tests of a file from this test on."""
        yield index
        while not self.is_last(index):
            index += 1
            yield index

    def indices(self, begun: Iterable[int]) -> Iterator[int]:
        """Yield the tests that are left of a file, and then those of files that no process has begun."""
        yield from begun
        while start := os.read(self.source, 4):
            yield from self.rest(int.from_bytes(start, "big"))


@dataclass(slots=True)
class Child:
    """A process that runs tests. `running` is the index of the test that it has begun last, until it has ended all."""

    number: int
    pid: int
    pipe: Connection
    running: int | None = None


class Sender:
    """A plugin of a forked process that sends the reports of its tests to the parent."""

    def __init__(self, config: pytest.Config, pipe: Connection) -> None:
        self.config, self.pipe = config, pipe

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Send a report."""
        self.pipe.send(self.config.hook.pytest_report_to_serializable(config=self.config, report=report))


def run(session: pytest.Session, jobs: int) -> None:
    """Run all tests of a session in `jobs` processes. Raises `session.Failed` and `session.Interrupted` as pytest does (`-x`)."""
    files, config = Files(session.items), session.config
    basetemp = config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]
    config.pluginmanager.getplugin("capturemanager").stop_global_capturing()  # forked processes would share its files
    sys.stdout.flush()
    children = [_fork(session, files, basetemp, number, ()) for number in range(jobs)]
    try:
        while children:
            for child in _speaking(children):
                if not _listen(config, child):
                    _wait_for(child)
                    children.remove(child)
                    if child.running is not None:
                        _report_lost(files.items[child.running], config)
                        left = [*files.rest(child.running)][1:]
                        children.append(_fork(session, files, basetemp, child.number, left))
                if session.shouldfail:
                    raise session.Failed(session.shouldfail)
                if session.shouldstop:
                    raise session.Interrupted(session.shouldstop)
    finally:
        os.close(files.source)
        for child in children:
            with contextlib.suppress(ProcessLookupError):
                os.kill(child.pid, CANCEL)
            _wait_for(child)


def _speaking(children: Sequence[Child]) -> list[Child]:
    """Return the processes that have sent something or have ended."""
    ready = wait([child.pipe for child in children], LOOK)
    if ready:
        return [child for child in children if child.pipe in ready]
    return [child for child in children if os.waitpid(child.pid, os.WNOHANG)[0]]


def _wait_for(child: Child) -> None:
    """Wait until a process has ended."""
    with contextlib.suppress(ChildProcessError):  # `_speaking` has seen its end
        os.waitpid(child.pid, 0)


def _listen(config: pytest.Config, child: Child) -> bool:
    """Pass the next report of a process to pytest. Return False if there is none, because the process has ended."""
    try:
        message = child.pipe.recv() if child.pipe.poll() else None
    except EOFError:
        message = None
    if message is None:
        return False
    if isinstance(message, dict):
        report = config.hook.pytest_report_from_serializable(config=config, data=message)
        config.hook.pytest_runtest_logreport(report=report)
        if report.when == "teardown":
            config.hook.pytest_runtest_logfinish(nodeid=report.nodeid, location=report.location)
    else:
        (child.running,) = message
    return True


def _report_lost(item: pytest.Item, config: pytest.Config) -> None:
    """Report that the process of a test has ended."""
    report = pytest.TestReport(item.nodeid, item.location, {}, "failed", "the process of this test has ended", "call")
    config.hook.pytest_runtest_logreport(report=report)


def _fork(session: pytest.Session, files: Files, basetemp: Path, number: int, begun: Iterable[int]) -> Child:
    """Start a process that runs the tests that are left of a file, and then further files."""
    here, there = Pipe(duplex=False)
    pid = os.fork()
    if pid:
        there.close()
        return Child(number, pid, here)
    try:
        signal.signal(CANCEL, signal.default_int_handler)
        os.environ["PYTEST_XDIST_WORKER"] = f"gw{number}"
        _run_tests(session, files, begun, there, basetemp / f"popen-gw{number}")
    except BaseException as fault:
        signal.signal(CANCEL, signal.SIG_IGN)
        session.config.pluginmanager.getplugin("capturemanager").stop_global_capturing()
        if not isinstance(fault, KeyboardInterrupt):
            traceback.print_exc()
        session._setupstate.teardown_exact(None)  # type: ignore[attr-defined]
    finally:
        os._exit(0)  # without the time to take down what the parent has collected


def _run_tests(session: pytest.Session, files: Files, begun: Iterable[int], pipe: Connection, basetemp: Path) -> None:
    """Run tests, and send their reports. A tuple announces the test with this index, or with None the end of all tests."""
    config: Any = session.config
    basetemp.mkdir(exist_ok=True)
    config._tmp_path_factory._basetemp = basetemp
    config.pluginmanager.unregister(name="terminalreporter")
    config.pluginmanager.register(Sender(config, pipe))
    capture = config.pluginmanager.getplugin("capturemanager")
    capture.start_global_capturing()
    capture.suspend_global_capture()
    other_file: Any = SimpleNamespace(listchain=lambda: [session])  # pytest then takes down all fixtures except those of the session
    for index in files.indices(begun):
        pipe.send((index,))
        following = other_file if files.is_last(index) else files.items[index + 1]
        config.hook.pytest_runtest_protocol(item=files.items[index], nextitem=following)
    session._setupstate.teardown_exact(None)  # type: ignore[attr-defined]
    pipe.send((None,))
