"""A value that another thread works out."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Value = TypeVar("Value")


class BackgroundValue(Generic[Value]):
    """What `work()` gives, begun now, for whoever has something else to do while another process works. Nobody need ask for it."""

    def __init__(self, work: Callable[[], Value]) -> None:
        self._work = work
        self._value: Value
        self._fault: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def result(self) -> Value:
        """The value, waited for. Raises what `work` raises."""
        self._thread.join()
        if self._fault is not None:
            raise self._fault
        return self._value

    def _run(self) -> None:
        try:
            self._value = self._work()
        except BaseException as fault:
            self._fault = fault
