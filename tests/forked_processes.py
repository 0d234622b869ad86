"""`pytest --forks N`: collect the tests once, and run them in N processes that are forked afterwards and share all imported modules.

With `-n N` of pytest-xdist, N processes import all modules and collect all tests. Here, too, a process runs whole files, one after the
other, and takes the next file when it begins the last test of its file. Files are taken in the order of collection.
"""

from __future__ import annotations

import os
import signal
import struct
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, groupby, pairwise
from multiprocessing.connection import Connection, Pipe, wait
from pathlib import Path
from typing import Any

import pytest

NUMBER = struct.Struct("i")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--forks", type=int, default=0, metavar="N", help="collect the tests once, and run them in N forked processes")


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Run the tests, unless pytest itself does (no forks), or there is nothing to run."""
    count = session.config.getoption("--forks")
    if not count or session.testsfailed or session.config.option.collectonly:
        return None
    _Run(session).to_the_end(count)
    return True


@dataclass
class _Process:
    """A forked process, as its parent sees it: the test that it has begun, and the tests that it runs after this one."""

    pid: int
    number: int
    left: list[int]
    test: int | None = None


class _Run:
    def __init__(self, session: pytest.Session) -> None:
        self.session, self.config = session, session.config
        self.base: Path = session.config._tmp_path_factory.getbasetemp()
        self.files = [list(tests) for _, tests in groupby(range(len(session.items)), lambda number: session.items[number].path)]
        self.todo, end = os.pipe()  # numbers of files; a number is read as a whole
        os.write(end, b"".join(map(NUMBER.pack, range(len(self.files)))))
        os.close(end)
        self.processes: dict[Connection, _Process] = {}

    def to_the_end(self, count: int) -> None:
        """Run all tests. Raises what pytest raises if it stops after failures."""
        for number in range(count):
            self.start(number, [])
        try:
            while self.processes:
                for messages in wait(list(self.processes)):
                    try:
                        self.hear(self.processes[messages], messages.recv())
                    except EOFError:
                        self.ended(messages)
                if self.session.shouldfail:
                    raise self.session.Failed(self.session.shouldfail)
                if self.session.shouldstop:
                    raise self.session.Interrupted(self.session.shouldstop)
        finally:
            for process in self.processes.values():
                os.kill(process.pid, signal.SIGTERM)

    def start(self, number: int, tests: list[int]) -> None:
        """Fork a process, which runs `tests` first."""
        messages, end = Pipe(duplex=False)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of threads: those of OpenBLAS end before a fork
            pid = os.fork()
        if pid == 0:
            status = 1
            try:
                _Worker(self, number, end).run(tests)
                status = 0
            except Exception:
                traceback.print_exc()
            finally:
                os._exit(status)
        end.close()
        self.processes[messages] = _Process(pid, number, tests)

    def hear(self, process: _Process, said: dict[str, Any]) -> None:
        """A process takes a file, begins a test (None at the end), or has a warning or a report."""
        if "file" in said:
            process.left = process.left + self.files[said["file"]]
        elif "test" in said:
            process.test = said["test"]
            process.left = process.left[1:]
        elif "warning" in said:
            text, file, line = said.pop("warning")
            said["warning_message"] = warnings.WarningMessage(text, UserWarning, file, line)
            self.config.pluginmanager.getplugin("terminalreporter").pytest_warning_recorded(**said)
        else:
            report = self.config.hook.pytest_report_from_serializable(config=self.config, data=said)
            self.config.hook.pytest_runtest_logreport(report=report)

    def ended(self, messages: Connection) -> None:
        """If a process ends during a test, the test fails, and another process runs the tests that are left."""
        process = self.processes.pop(messages)
        status = os.waitstatus_to_exitcode(os.waitpid(process.pid, 0)[1])
        if process.test is not None:
            test = self.session.items[process.test]
            report = pytest.TestReport(test.nodeid, test.location, {}, "failed", f"the process of the test has ended: {status}", "call")
            self.config.hook.pytest_runtest_logreport(report=report)
            self.start(process.number, process.left)
        elif status or process.left:
            raise RuntimeError(f"a process has ended before its first test: {status}")


class _Worker:
    """Runs tests in a forked process."""

    def __init__(self, run: _Run, number: int, messages: Connection) -> None:
        self.whole, self.session, self.config, self.messages = run, run.session, run.config, messages
        os.environ["PYTEST_XDIST_WORKER"] = f"gw{number}"
        folder = run.base / f"gw{number}"
        folder.mkdir(exist_ok=True)
        self.config._tmp_path_factory._basetemp = folder
        capture = self.config.pluginmanager.getplugin("capturemanager")
        capture.stop_global_capturing()  # into files that processes would share
        capture.start_global_capturing()
        capture.suspend_global_capture()
        self.config.pluginmanager.unregister(name="terminalreporter")
        self.config.pluginmanager.register(self)

    def tests(self) -> Iterator[int]:
        """The numbers of the tests of all files that this process takes."""
        while number := os.read(self.whole.todo, NUMBER.size):
            file = NUMBER.unpack(number)[0]
            self.messages.send({"file": file})
            yield from self.whole.files[file]

    def run(self, first: list[int]) -> None:
        items = self.session.items
        for test, following in pairwise(chain(first, self.tests(), [None])):
            self.messages.send({"test": test})
            self.config.hook.pytest_runtest_protocol(item=items[test], nextitem=None if following is None else items[following])
            if self.session.shouldfail or self.session.shouldstop:
                break
        self.messages.send({"test": None})

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.messages.send(self.config.hook.pytest_report_to_serializable(config=self.config, report=report))

    def pytest_warning_recorded(
        self, warning_message: warnings.WarningMessage, when: str, nodeid: str, location: tuple[str, int, str] | None,
    ) -> None:
        if when != "runtest":
            return  # of the collection, which this plugin hears when it is registered
        warning = [f"{warning_message.category.__name__}: {warning_message.message}", warning_message.filename, warning_message.lineno]
        self.messages.send({"warning": warning, "nodeid": nodeid})
