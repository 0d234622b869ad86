"""Observe the actions of part code with an audit hook of Python. Python cannot remove an audit hook. Therefore, each process installs only
one hook, which calls all handlers.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any

Handler = Callable[[str, tuple[Any, ...]], None]

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_TRUNC

_handlers: dict[str, dict[Handler, None]] = {}


def listen(events: tuple[str, ...], handler: Handler) -> None:
    """Call `handler(event, arguments)` for each of the given audit events. Handlers are called in the order in which they were added.

    If a handler raises an exception, the audited function does not run and raises this exception.
    """
    if not _handlers:
        sys.addaudithook(_hook)
    for event in events:
        _handlers.setdefault(event, {})[handler] = None


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    for handler in tuple(_handlers.get(event, ())):  # a handler or another thread may call `listen`
        handler(event, arguments)


def writes(mode: Any, flags: Any) -> bool:
    """Return whether an `open` event with these arguments opens a file for writing."""
    return any(letter in mode for letter in "wax+") if isinstance(mode, str) else bool((flags or 0) & _WRITING)
