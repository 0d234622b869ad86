"""A cache of the slices of printed parts, by mesh and slicing settings. If the store does not contain the slices, workers compute them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

from msgspec import convert
from msgspec.structs import asdict, replace

from thingc.geometry.print_slices import SliceFailure, SliceResult, Slicing
from thingc.geometry.record import PartFailure, PartRecord
from thingc.geometry.worker_calls import WorkerCalls

KEPT = 4096
"""Maximum number of results that are held in memory."""

Records = dict[str, "PartRecord | PartFailure"]


class SliceCache:
    """A cache of slices in the store, by mesh. The keys contain all inputs on which the slices depend.

    A change of print settings does not rebuild a part. Equal meshes are sliced only once. `versions` returns the versions of the software
    that slices meshes.
    """

    def __init__(self, calls: WorkerCalls, versions: Callable[[], Mapping[str, str]]) -> None:
        self._calls = calls
        self._versions = versions
        self._results: dict[tuple[str, Slicing], SliceResult | SliceFailure] = {}
        self._sliced: dict[str, tuple[PartRecord, frozenset[Slicing], PartRecord]] = {}

    def add_slices(self, records: Mapping[str, PartRecord | PartFailure], requested: Mapping[str, Collection[Slicing]]) -> Records:
        """Return part records with the slices that `requested` lists, keyed by definition text.

        Slices that are not in the store are computed. Records without a mesh are unchanged.
        """
        sliced: Records = dict(records)
        texts = {text: frozenset(slicings) for text, slicings in requested.items() if slicings and _lacks(records.get(text), slicings)}
        missing: dict[tuple[str, Slicing], list[str]] = {}
        for text, slicings in texts.items():
            for slicing in slicings:
                key = (_mesh(records[text]), slicing)
                if key[0] and self._find_slice(*key) is None:
                    missing.setdefault(key, []).append(text)
        self._slice_missing(missing, sliced)
        for text, slicings in texts.items():
            record = sliced[text]
            if isinstance(record, PartRecord) and _mesh(record):
                sliced[text] = self._with_slices(text, record, slicings)
        return sliced

    def _slice_missing(self, missing: Mapping[tuple[str, Slicing], list[str]], records: Records) -> None:
        ordered = sorted(missing, key=repr)
        requests = [
            self._calls.request(op="slice", mesh=mesh, slicing=asdict(slicing), number=number)
            for number, (mesh, slicing) in enumerate(ordered)
        ]
        for request, answer in self._calls.run(requests, "slicing"):
            key = ordered[request["number"]]
            if "failed" in answer:
                for text in missing[key]:
                    records[text] = self._calls.failure(text, answer)
                continue
            self._keep(key, answer["answer"])

    def keep(self, record: PartRecord | PartFailure, slices: Iterable[tuple[Mapping[str, Any], Any]]) -> None:
        """Store the slices that a worker computed when it built the part. Slicing settings and results are JSON values."""
        for slicing, value in slices:
            self._keep((_mesh(record), convert(slicing, Slicing)), value)

    def _keep(self, key: tuple[str, Slicing], value: Any) -> None:
        self._calls.store.put_json("slices", self._store_key(*key), value)
        self._remember(key, value)

    def _find_slice(self, mesh: str, slicing: Slicing) -> SliceResult | SliceFailure | None:
        key = (mesh, slicing)
        if key not in self._results:
            value = self._calls.store.get_json("slices", self._store_key(mesh, slicing))
            if value is None:
                return None
            self._remember(key, value)
        return self._results[key]

    def _store_key(self, mesh: str, slicing: Slicing) -> str:
        """Return the key under which the store contains the slices of a mesh for the given slicing settings."""
        return repr([sorted(self._versions().items()), mesh, sorted(asdict(slicing).items())])

    def _remember(self, key: tuple[str, Slicing], value: Any) -> None:
        while len(self._results) >= KEPT:
            del self._results[next(iter(self._results))]
        self._results[key] = convert(value, SliceResult | SliceFailure)

    def _with_slices(self, text: str, record: PartRecord, slicings: frozenset[Slicing]) -> PartRecord:
        """Return a part record with the slices for the given slicing settings.

        If the slices have not changed, return the same object as in the last call.
        """
        last = self._sliced.get(text)
        if last is None or last[0] is not record or last[1] != slicings:
            slices = {slicing: answer for slicing in slicings if (answer := self._find_slice(_mesh(record), slicing)) is not None}
            last = self._sliced[text] = (record, slicings, replace(record, slices={**record.slices, **slices}))
        return last[2]


def lacking(records: Mapping[str, PartRecord | PartFailure], requested: Mapping[str, Collection[Slicing]]) -> list[str]:
    """Return the definition texts of the records that lack slices listed in `requested` and have no mesh that can be sliced."""
    return [text for text, slicings in requested.items() if _lacks(records.get(text), slicings) and not _mesh(records[text])]


def _lacks(record: PartRecord | PartFailure | None, slicings: Collection[Slicing]) -> bool:
    return isinstance(record, PartRecord) and any(slicing not in record.slices for slicing in slicings)


def _mesh(record: PartRecord | PartFailure) -> str:
    """Return the SHA-256 of the mesh that is sliced for a part record. Return an empty string if the record has no such mesh."""
    mesh = record.meshes.get("slicing") if isinstance(record, PartRecord) else None
    return mesh.sha256 if mesh is not None else ""
