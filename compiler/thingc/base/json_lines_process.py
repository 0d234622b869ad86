"""Start child processes that exchange lines of JSON, such as workers that build parts."""

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
from collections.abc import Mapping
from typing import Any

FAREWELL = 5.0
"""Time [s] for a process to exit after its input is closed."""
KEPT = 10_000
"""Number of bytes to read from the end of standard error."""


Lines = queue.SimpleQueue["tuple[JsonLinesProcess, Any]"]


class ProcessLost(Exception):
    """Raised if a process has died or does not answer (`hung`). `words` describes the cause."""

    def __init__(self, words: str, *, hung: bool = False) -> None:
        super().__init__(words)
        self.words = words
        self.hung = hung


class JsonLinesProcess:
    """A child process `python -m MODULE WORDS` with pipes. Its own session protects it from interrupts in the terminal.

    A thread puts the output of the process into the queue `lines` as `(process, value)`, with None as the last value. Several processes may
    share a queue. Raises `OSError` if the process cannot be started.
    """

    def __init__(
        self, module: str, *words: str, cwd: str | None = None, env: Mapping[str, str] | None = None, lines: Lines | None = None,
    ) -> None:
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", module, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors,
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
        """Send a value to the process as a line of JSON. A broken pipe is ignored."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # `answer` reports the death of the process
            self._process.stdin.write(json.dumps(value, separators=(",", ":")).encode() + b"\n")
            self._process.stdin.flush()

    def answer(self, timeout: float) -> Any:
        """Return the next value that the process sends. Raises `ProcessLost` if the process dies or does not answer within `timeout` [s];
        then call `close`.
        """
        try:
            _, said = self._lines.get(timeout=timeout)
        except queue.Empty:
            raise ProcessLost(f"it took longer than {timeout:g} s", hung=True) from None
        if said is None:
            raise ProcessLost(self._death())
        return said

    def errors(self) -> str:
        """Return the end of the standard error of the process."""
        size = self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(0, size - KEPT))
        return self._errors.read().decode(errors="replace")

    def kill(self) -> None:
        """Kill the process. Any thread can call this method."""
        with contextlib.suppress(OSError):
            self._process.kill()

    def close(self) -> None:
        """Close the input, wait for the process (kill it after `FAREWELL` seconds), and release its resources."""
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
        """Put arriving lines into the queue. Replace lone surrogates by question marks, and drop an incomplete last line."""
        assert self._process.stdout is not None
        try:
            with self._process.stdout as stream:
                for line in stream:
                    if line.endswith(b"\n"):
                        said = json.loads(line)
                        if b"\\ud" in line:
                            said = json.loads(json.dumps(said, ensure_ascii=False).encode("utf-8", "replace"))
                        self._lines.put((self, said))
        finally:
            self._lines.put((self, None))

    def _death(self) -> str:
        code = self._process.wait()
        if code < 0:
            with contextlib.suppress(ValueError):
                return f"it was terminated by {signal.Signals(-code).name}"
        return f"it exited with code {code}"
