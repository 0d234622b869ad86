"""The geometry service: the only door to the CAD kernel. Start reading at `service`; the worker starts at `worker.server`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.exports import exported

if TYPE_CHECKING:
    from thingc.geometry.answers import PartAnswers
    from thingc.geometry.client import ABSENT, EndingWorkers, NoWorkers, Workers
    from thingc.geometry.decisions import Decision
    from thingc.geometry.inputs import PartInputs, part_inputs
    from thingc.geometry.key.modules import Module
    from thingc.geometry.lock.lock import read_lock
    from thingc.geometry.lock.locked import LockedGeometry
    from thingc.geometry.lock.values import BadLock
    from thingc.geometry.service import GeometryService
    from thingc.geometry.slices import Slicing
    from thingc.geometry.store.digests import Digests
    from thingc.geometry.store.local import BlobMissing, Store, StoreUnusable
    from thingc.geometry.store.meshes import arrays

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
