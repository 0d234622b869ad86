"""The geometry service: the only door to the CAD kernel. Start reading at `service`; the worker starts at `worker.server`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from thingc.realize.answers import PartAnswers
    from thingc.realize.client import ABSENT, EndingWorkers, NoWorkers, Workers
    from thingc.realize.decisions import Decision
    from thingc.realize.inputs import PartInputs, part_inputs
    from thingc.realize.key.modules import Module
    from thingc.realize.lock.lock import read_lock
    from thingc.realize.lock.locked import LockedGeometry
    from thingc.realize.lock.values import BadLock
    from thingc.realize.service import GeometryService
    from thingc.realize.slices import Slicing
    from thingc.realize.store.local import BlobMissing, Store, StoreUnusable
    from thingc.realize.store.meshes import arrays

_EXPORTS = {
    "ABSENT": "client", "BadLock": "lock.values", "BlobMissing": "store.local", "Decision": "decisions", "EndingWorkers": "client",
    "GeometryService": "service", "LockedGeometry": "lock.locked", "Module": "key.modules", "NoWorkers": "client", "PartAnswers":
    "answers", "PartInputs": "inputs", "Slicing": "slices", "Store": "store.local", "StoreUnusable": "store.local", "Workers":
    "client", "arrays": "store.meshes", "part_inputs": "inputs", "read_lock": "lock.lock",
}
"""Exported name to the module that has it: whoever imports a module of this room needs few of the others."""

__all__ = [
    "ABSENT", "BadLock", "BlobMissing", "Decision", "EndingWorkers", "GeometryService", "LockedGeometry", "Module", "NoWorkers",
    "PartAnswers", "PartInputs", "Slicing", "Store", "StoreUnusable", "Workers", "arrays", "part_inputs", "read_lock",
]


def __getattr__(name: str) -> Any:
    """The exported object, from its module; `AttributeError` for any other name."""
    if name in _EXPORTS:
        from importlib import import_module

        return getattr(import_module(f"thingc.realize.{_EXPORTS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
