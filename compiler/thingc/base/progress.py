"""Report the progress of long computations."""

from __future__ import annotations

import time
from collections.abc import Callable

Progress = Callable[[str, int, int, float], None]
"""Callback `progress(what, done, total, seconds)`, such as `progress("modelling parts", 3, 9, 1.2)`. `seconds` is the elapsed time [s]."""


class ProgressCounter:
    """Counts the steps of a computation, and reports the count after each step if more than a second has passed."""

    def __init__(self, progress: Progress | None, what: str, total: int) -> None:
        self._progress, self._what, self._total = progress, what, total
        self._started, self._done = time.monotonic(), 0

    def add(self, count: int = 1) -> None:
        """Count `count` more steps."""
        self._done += count
        seconds = time.monotonic() - self._started
        if self._progress is not None and seconds >= 1.0:
            self._progress(self._what, self._done, self._total, seconds)
