"""Models of MuJoCo that come of others by writing arrays: of numbers that differ (`Arrays`), or of many texts (`TextModels`)."""

from __future__ import annotations

from thingc.batch.patching.arrays import TOGETHER, Arrays
from thingc.batch.patching.exact import content, differing, names
from thingc.batch.patching.many import ModelText, TextModels
from thingc.batch.patching.places import NotInArrays

__all__ = ["TOGETHER", "Arrays", "ModelText", "NotInArrays", "TextModels", "content", "differing", "names"]
