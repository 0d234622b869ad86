"""Build up to tens of thousands of variants of a robot from a `variants/1` document.

The files of each variant are identical to the files of a single build.

    thingc.batch.plan("leg_sweep.yaml")      return the variants, in order
    thingc.batch.run("leg_sweep.yaml")       build them
    thingc.batch.load("build/leg_sweep")     read their models and rows of the table
    thingc.batch.fields("build/leg_sweep")   return one model, and the arrays in which the variants differ
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.exports import getattr_of

if TYPE_CHECKING:
    from thingc.batch.batch import run
    from thingc.batch.folder import BatchFault
    from thingc.batch.planning import Plan, PlanError
    from thingc.batch.progress import Interrupted, Progress, Summary
    from thingc.batch.results import BatchResults, BuiltVariant, FamilyError, UnknownVariant, load
    from thingc.batch.shared_model import StructuresDiffer, apply, fields, write
    from thingc.batch.variant import Variant
    from thingc.batch.variants_document import plan, read_plan

__all__ = [
    "BatchFault", "BatchResults", "BuiltVariant", "FamilyError", "Interrupted", "Plan", "PlanError", "Progress", "StructuresDiffer",
    "Summary", "UnknownVariant", "Variant", "apply", "fields", "load", "plan", "read_plan", "run", "write",
]

__getattr__ = getattr_of(__name__, {
    "BatchFault": "folder", "BuiltVariant": "results", "BatchResults": "results", "FamilyError": "results", "Interrupted": "progress",
    "StructuresDiffer": "shared_model", "Plan": "planning", "PlanError": "planning", "Progress": "progress", "Summary": "progress",
    "UnknownVariant": "results", "Variant": "variant", "apply": "shared_model", "fields": "shared_model", "load": "results",
    "plan": "variants_document", "read_plan": "variants_document", "run": "batch", "write": "shared_model",
})
