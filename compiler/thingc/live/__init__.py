"""A document while somebody works on it: built again after every save."""

from __future__ import annotations

from thingc.live.rounds import Live, Round

__all__ = ["Live", "Round"]
