"""A process of ours that is asked, and answers, in lines of JSON: the worker that models parts, runners of batches, and what draws their
pictures."""

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
"""How long [s] a process may take to end once its input has."""
KEPT = 10_000
"""How many bytes of the end of a process's standard error are looked at."""


Lines = queue.SimpleQueue["tuple[JsonLinesProcess, Any]"]


class ProcessLost(Exception):
    """A process that cannot be asked any more: `hung`, or what it died of."""

    def __init__(self, words: str, *, hung: bool = False) -> None:
        super().__init__(words)
        self.words = words
        self.hung = hung


class JsonLinesProcess:
    """`python -m MODULE WORDS` in a session of its own (an interrupt of the terminal is the driver's to act on), and the pipes to it. What
    it says is put into `lines`, each with the process, and None when it has said its last; several processes may share one. Raises
    `OSError` where the system has no process for it."""

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
        """Its process id."""
        return self._process.pid

    def ask(self, value: Any) -> None:
        """Send it a line."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # the answer that does not come will tell
            self._process.stdin.write(json.dumps(value, separators=(",", ":")).encode() + b"\n")
            self._process.stdin.flush()

    def answer(self, timeout: float) -> Any:
        """The next line that it says, waited for at most `timeout` [s]. Raises `ProcessLost` where it dies or is silent too long; then
        `close` it."""
        try:
            _, said = self._lines.get(timeout=timeout)
        except queue.Empty:
            raise ProcessLost(f"it took longer than {timeout:g} s", hung=True) from None
        if said is None:
            raise ProcessLost(self._death())
        return said

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
        """Lines as they come. Halves of characters, which nobody can write to a file, become question marks; of a line that breaks off
        nobody is told."""
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
                return f"it was ended by {signal.Signals(-code).name}"
        return f"it ended with exit code {code}"
