"""A document while somebody works on it: built again after every save, and shown in a browser."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from thingc.live.rounds import Live, Round

if TYPE_CHECKING:
    from thingc.live.server import Server, findings_of

__all__ = ["Live", "Round", "Server", "findings_of"]


def __getattr__(name: str) -> Any:
    """What only a browser needs, imported when it is asked for."""
    if name in ("Server", "findings_of"):
        from thingc.live import server

        return getattr(server, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
