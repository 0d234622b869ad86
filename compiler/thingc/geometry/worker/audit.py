"""Python's audit events, for whoever wants to know what part code does. A hook cannot be taken away: there is one per process."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

Handler = Callable[[str, tuple[Any, ...]], None]

_handlers: dict[str, tuple[Handler, ...]] = {}
_hooked = False


def listen(events: tuple[str, ...], handler: Handler) -> None:
    """Let `handler(event, arguments)` hear of these events, after who heard of them before. What it raises, the function that the
    event is about raises instead of doing anything."""
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
