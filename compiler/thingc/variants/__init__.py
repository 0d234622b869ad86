"""Families of robots: one `variants/1` document to hundreds or tens of thousands of builds, each as a single build would be.

    thingc.variants.plan("leg_sweep.yaml")      the variants, in their order
    thingc.variants.run("leg_sweep.yaml")       builds them
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from thingc.variants.batch import Interrupted, Summary, run
    from thingc.variants.folder import BatchFault
    from thingc.variants.planning import Plan, PlanError, Variant, plan

_EXPORTS = {
    "BatchFault": "folder", "Interrupted": "batch", "Plan": "planning", "PlanError": "planning", "Summary": "batch",
    "Variant": "planning", "plan": "planning", "run": "batch",
}

__all__ = ["BatchFault", "Interrupted", "Plan", "PlanError", "Summary", "Variant", "plan", "run"]


def __getattr__(name: str) -> Any:
    """The exported object, from its module; `AttributeError` for any other name."""
    if name in _EXPORTS:
        from importlib import import_module

        return getattr(import_module(f"thingc.variants.{_EXPORTS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
