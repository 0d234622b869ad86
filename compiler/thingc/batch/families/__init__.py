"""Compile a document as a family of robots in memory, which quickly computes results and models for any settings.

    family = thingc.family("assemblies/arm.yaml")
    family.evaluate({"reach": "120 mm"})["mass"]
    for model in family.models(many, mode="bench", share=True): ...
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.exports import getattr_of

if TYPE_CHECKING:
    from thingc.batch.families.batching import Batched, Batches
    from thingc.batch.families.family import RobotFamily
    from thingc.batch.families.function import FamilyFunction, FamilyJacobian, FamilyValues, NotDifferentiable
    from thingc.batch.families.mjx_family import FamilyMjx
    from thingc.batch.families.results import Evaluated, Explanation, NoModel
    from thingc.batch.families.search_space import SearchSpace, SpaceDimension

__all__ = [
    "Batched", "Batches", "Evaluated", "Explanation", "FamilyFunction", "FamilyJacobian", "FamilyMjx", "FamilyValues", "NoModel",
    "NotDifferentiable", "RobotFamily", "SearchSpace", "SpaceDimension",
]

__getattr__ = getattr_of(__name__, {
    "Batched": "batching", "Batches": "batching",
    "FamilyFunction": "function", "FamilyJacobian": "function", "NotDifferentiable": "function", "FamilyValues": "function",
    "FamilyMjx": "mjx_family",
    "Evaluated": "results", "Explanation": "results", "NoModel": "results", "RobotFamily": "family", "SearchSpace": "search_space",
    "SpaceDimension": "search_space",
})
