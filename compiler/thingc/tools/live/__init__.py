"""A document while somebody works on it: built again after every save, and shown in a browser."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.exports import exported
from thingc.tools.live.rounds import Live, Round

if TYPE_CHECKING:
    from thingc.tools.live.server import Server, findings_of

__all__ = ["Live", "Round", "Server", "findings_of"]

__getattr__ = exported(__name__, {"Server": "server", "findings_of": "server"})
