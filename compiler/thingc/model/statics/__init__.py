"""Statics: what drives have to give for a robot to stay where it is, and what part of their limits that is."""

from __future__ import annotations

from thingc.model.statics.efforts import static_efforts
from thingc.model.statics.footing import lifted, stance
from thingc.model.statics.types import Efforts, Fall

__all__ = ["Efforts", "Fall", "lifted", "stance", "static_efforts"]
