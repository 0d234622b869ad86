"""Statics: what drives have to give for a robot to stay where it is, and what part of their limits that is."""

from __future__ import annotations

from thingc.statics.efforts import Efforts, Fall, static_efforts
from thingc.statics.footing import lifted, stance

__all__ = ["Efforts", "Fall", "lifted", "stance", "static_efforts"]
