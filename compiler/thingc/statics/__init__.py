"""Statics: what drives have to give for a robot to stay where it is, and what part of their limits that is."""

from __future__ import annotations

from thingc.statics.efforts import static_efforts
from thingc.statics.footing import lifted, stance
from thingc.statics.types import Efforts, Fall

__all__ = ["Efforts", "Fall", "lifted", "stance", "static_efforts"]
