"""A process of ours that is asked, and answers, in lines of JSON."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any

FAREWELL = 5.0
"""How long [s] a process may take to end once its input has."""
KEPT = 10_000
"""How many bytes of the end of a process's standard error are looked at."""


class Lost(Exception):
    """A process that cannot be asked any more: `hung`, or what it died of."""

    def __init__(self, words: str, *, hung: bool = False) -> None:
        super().__init__(words)
        self.words = words
        self.hung = hung


class LineProcess:
    """`python -m MODULE` in a session of its own (an interrupt of the terminal is the driver's to act on), and the pipes to it. Raises
    `OSError` where the system has no process for it."""

    def __init__(self, module: str, cwd: str | None = None) -> None:
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", module], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors, cwd=cwd,
                start_new_session=True,
            )
        except OSError:
            self._errors.close()
            raise
        self._buffer = b""

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def ask(self, value: Any) -> None:
        """Send it a line."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # the answer that does not come will tell
            self._process.stdin.write(json.dumps(value, separators=(",", ":")).encode() + b"\n")
            self._process.stdin.flush()

    def answer(self, timeout: float) -> Any:
        """The next line that it says, waited for at most `timeout` [s]. Raises `Lost` where it dies or is silent too long; then `close`
        it."""
        assert self._process.stdout is not None
        descriptor = self._process.stdout.fileno()
        deadline = time.monotonic() + timeout
        while b"\n" not in self._buffer:
            left = deadline - time.monotonic()
            if left <= 0.0 or not select.select([descriptor], [], [], left)[0]:
                raise Lost(f"it took longer than {timeout:g} s", hung=True)
            data = os.read(descriptor, 1 << 16)
            if not data:
                raise Lost(self._death())
            self._buffer += data
        line, _, self._buffer = self._buffer.partition(b"\n")
        return json.loads(line)

    def errors(self) -> str:
        """The end of what it wrote to standard error."""
        size = self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(0, size - KEPT))
        return self._errors.read().decode(errors="replace")

    def kill(self) -> None:
        """End it at once; safe from any thread."""
        with contextlib.suppress(OSError):
            self._process.kill()

    def close(self) -> None:
        """End it, at once where it does not end by itself, and forget it."""
        assert self._process.stdin is not None and self._process.stdout is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(FAREWELL)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()
        self._errors.close()

    def _death(self) -> str:
        code = self._process.wait()
        if code < 0:
            with contextlib.suppress(ValueError):
                return f"it was ended by {signal.Signals(-code).name}"
        return f"it ended with exit code {code}"
