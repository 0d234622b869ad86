"""Statics: what drives have to give for a robot to stay where it is, and what part of their limits that is."""

from __future__ import annotations

from thingc.statics.efforts import Efforts, static_efforts

__all__ = ["Efforts", "static_efforts"]
