"""Start child processes that exchange one JSON value per line over pipes, such as the worker processes that build parts."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping
from typing import Any

FAREWELL = 5.0
"""Time [s] for a process to exit after its input is closed."""
KEPT = 10_000
"""Number of bytes to read from the end of standard error."""


Lines = queue.SimpleQueue["tuple[JsonLinesProcess, Any]"]


class ProcessLost(Exception):
    """Raised if a child process has ended, or if it does not answer in time (`hung`). The message describes the cause."""

    def __init__(self, message: str, *, hung: bool = False) -> None:
        super().__init__(message)
        self.hung = hung


class JsonLinesProcess:
    """A child process `python -m MODULE ARGUMENTS` that exchanges lines of JSON over its standard input and output.

    The process runs in its own session, so that Ctrl-C in the terminal does not interrupt it. A thread reads the output of the process and
    puts each value into the queue `lines` as a tuple `(process, value)`. When the output ends, the thread puts `(process, None)` into the
    queue. Several processes can share one queue. Raises `OSError` if the process cannot be started.
    """

    def __init__(
        self, module: str, *arguments: str, cwd: str | None = None, env: Mapping[str, str] | None = None, lines: Lines | None = None,
    ) -> None:
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", module, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors,
                cwd=cwd, env=env, start_new_session=True,
            )
        except OSError:
            self._errors.close()
            raise
        self._lines: Lines = queue.SimpleQueue() if lines is None else lines
        threading.Thread(target=self._read, daemon=True).start()

    @property
    def pid(self) -> int:
        """The process id of the child process."""
        return self._process.pid

    def ask(self, value: Any) -> None:
        """Send a value to the standard input of the process as one line of JSON. Errors because the process has ended are ignored."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # `answer` reports the death of the process
            self._process.stdin.write(json.dumps(value, separators=(",", ":")).encode() + b"\n")
            self._process.stdin.flush()

    def answer(self, timeout: float) -> Any:
        """Wait for the next value that the process sends, and return this value.

        Raises `ProcessLost` if the process ends or does not answer within `timeout` seconds. After this exception, call `close`.
        """
        try:
            _, value = self._lines.get(timeout=timeout)
        except queue.Empty:
            raise ProcessLost(f"it took longer than {timeout:g} s", hung=True) from None
        if value is None:
            raise ProcessLost(self._death())
        return value

    def errors(self) -> str:
        """Return the end of the output that the process has written to its standard error."""
        size = self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(0, size - KEPT))
        return self._errors.read().decode(errors="replace")

    def kill(self) -> None:
        """Kill the process immediately. This method can be called from any thread."""
        with contextlib.suppress(OSError):
            self._process.kill()

    def close(self) -> None:
        """Close the standard input of the process, wait until the process ends, and release its resources.

        If the process does not end within `FAREWELL` seconds, it is killed.
        """
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(FAREWELL)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._errors.close()

    def _read(self) -> None:
        """Read the output of the process line by line and put the decoded values into the queue. This method runs in a separate thread.

        Lone surrogates are replaced by question marks. An incomplete last line is dropped.
        """
        assert self._process.stdout is not None
        try:
            with self._process.stdout as stream:
                for line in stream:
                    if line.endswith(b"\n"):
                        value = json.loads(line)
                        if b"\\ud" in line:
                            value = json.loads(json.dumps(value, ensure_ascii=False).encode("utf-8", "replace"))
                        self._lines.put((self, value))
        finally:
            self._lines.put((self, None))

    def _death(self) -> str:
        code = self._process.wait()
        if code < 0:
            with contextlib.suppress(ValueError):
                return f"it was terminated by {signal.Signals(-code).name}"
        return f"it exited with code {code}"


def connect_to_parent() -> Callable[[Any], None]:
    """Return a function that sends a value to the parent process, which started this process as a `JsonLinesProcess`.

    If the parent process has died, the function exits. All other output to standard output is redirected to standard error.
    """
    answers = os.dup(1)
    os.dup2(2, 1)

    def answer(value: Any) -> None:
        data = memoryview(json.dumps(value, separators=(",", ":")).encode() + b"\n")
        try:
            while data:
                data = data[os.write(answers, data):]
        except BrokenPipeError:
            os._exit(0)

    return answer
