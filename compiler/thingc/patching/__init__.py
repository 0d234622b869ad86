"""Models of MuJoCo that come of others by writing arrays: of numbers that differ (`Arrays`), or of many texts (`TextModels`)."""

from __future__ import annotations

from thingc.patching.arrays import TOGETHER, Arrays
from thingc.patching.exact import content, differing, names
from thingc.patching.many import ModelText, TextModels
from thingc.patching.places import NotInArrays

__all__ = ["TOGETHER", "Arrays", "ModelText", "NotInArrays", "TextModels", "content", "differing", "names"]
