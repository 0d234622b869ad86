"""The geometry service: the only door to the CAD kernel. Start reading at `service`; the worker starts at `worker.server`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.exports import exported

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
    from thingc.realize.store.digests import Digests
    from thingc.realize.store.local import BlobMissing, Store, StoreUnusable
    from thingc.realize.store.meshes import arrays

__all__ = [
    "ABSENT", "BadLock", "BlobMissing", "Decision", "Digests", "EndingWorkers", "GeometryService", "LockedGeometry", "Module", "NoWorkers",
    "PartAnswers", "PartInputs", "Slicing", "Store", "StoreUnusable", "Workers", "arrays", "part_inputs", "read_lock",
]

__getattr__ = exported(__name__, {
    "ABSENT": "client", "BadLock": "lock.values", "BlobMissing": "store.local", "Decision": "decisions", "Digests": "store.digests",
    "EndingWorkers": "client", "GeometryService": "service", "LockedGeometry": "lock.locked", "Module": "key.modules",
    "NoWorkers": "client", "PartAnswers": "answers", "PartInputs": "inputs", "Slicing": "slices", "Store": "store.local",
    "StoreUnusable": "store.local", "Workers": "client", "arrays": "store.meshes", "part_inputs": "inputs", "read_lock": "lock.lock",
})
