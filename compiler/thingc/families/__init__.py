"""One document, or one of variants, as a family of robots in memory: results and models of any settings, quickly.

    family = thingc.family("assemblies/arm.yaml")
    family.evaluate({"reach": "120 mm"})["mass"]
    for model in family.models(many, mode="bench", share=True): ...
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from thingc.families.batching import Batched, Batches
    from thingc.families.exact import differing
    from thingc.families.family import RobotFamily
    from thingc.families.results import Evaluated, Explanation, NoModel
    from thingc.families.space import Space, SpaceDimension

_EXPORTS = {
    "Batched": "batching", "Batches": "batching",
    "Evaluated": "results", "Explanation": "results", "NoModel": "results", "RobotFamily": "family", "Space": "space",
    "SpaceDimension": "space",
    "differing": "exact",
}

__all__ = ["Batched", "Batches", "Evaluated", "Explanation", "NoModel", "RobotFamily", "Space", "SpaceDimension", "differing"]


def __getattr__(name: str) -> Any:
    """The exported object, from its module; `AttributeError` for any other name."""
    if name in _EXPORTS:
        from importlib import import_module

        return getattr(import_module(f"thingc.families.{_EXPORTS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
