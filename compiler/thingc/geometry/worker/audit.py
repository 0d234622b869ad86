"""Observe the actions of part code with an audit hook of Python. Python cannot remove an audit hook. Therefore, each process installs only
one hook, which calls all handlers.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

Handler = Callable[[str, tuple[Any, ...]], None]

_handlers: dict[str, tuple[Handler, ...]] = {}
_hooked = False


def listen(events: tuple[str, ...], handler: Handler) -> None:
    """Call `handler(event, arguments)` for each of the given audit events. Handlers are called in the order in which they were added.

    If a handler raises an exception, the audited function does not run and raises this exception.
    """
    global _hooked
    for event in events:
        if handler not in _handlers.get(event, ()):
            _handlers[event] = (*_handlers.get(event, ()), handler)
    if not _hooked:
        _hooked = True
        sys.addaudithook(_hook)


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    for handler in _handlers.get(event, ()):
        handler(event, arguments)
