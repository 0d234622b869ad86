"""Find cached part records in the store. A record is found by the cache key of the part, or by the outline of its code and the functions
that ran when the part was built.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from msgspec import convert
from msgspec.structs import replace

from thingc.documents.workspace import Workspace
from thingc.geometry.key.build_key import record_key
from thingc.geometry.key.module_key import CodeIngredients
from thingc.geometry.key.part_code import PartCode
from thingc.geometry.key.result_cache import CANDIDATES, CachedResult, Results
from thingc.geometry.part_requests import RecordRequest
from thingc.geometry.record import Mesh, PartDefinition, PartFailure, PartRecord, WantedPieces
from thingc.geometry.record_json import blobs_of
from thingc.geometry.slice_cache import Records
from thingc.geometry.store.local import Store, StoreUnusable
from thingc.geometry.store.shared_store import CONVEX
from thingc.geometry.worker_calls import WorkerCalls

Ran = Mapping[str, Sequence[int] | None]
"""Numbers of the functions that ran, by file or label of the module. The value None means that all functions count as executed."""


def _digest(code: CodeIngredients, ran: Ran) -> str | None:
    """Return a digest of the functions that ran, or None if the code does not contain one of the modules or functions."""
    facts = {one.label: one.facts for one in code.sources.values()}
    digest = hashlib.sha256()
    for label, numbers in sorted(ran.items()):
        if label not in facts or numbers and numbers[-1] >= len(facts[label].bodies):
            return None
        texts = [facts[label].syntax] if numbers is None else [facts[label].bodies[number] for number in numbers]
        digest.update(f"{label} {numbers} {texts}\n".encode())
    return digest.hexdigest()


class CachedRecords:
    """Finds the cached part records of a workspace. A record counts as cached only if the store contains all files to which it refers."""

    def __init__(self, workspace: Workspace, store: Store, parts: PartCode, results: Results) -> None:
        self._workspace, self._store, self._parts, self._results = workspace, store, parts, results

    def find_record(self, key: str) -> CachedResult | None:
        """Return the cached record or failure of the part with the build key `key`, or None."""
        return self._results.find("record", key, self._has_files)

    def find(self, request: RecordRequest) -> CachedResult | None:
        """Return the cached record of a part, or None.

        If no record has the part's build key, look for a record with the same outline of the code whose executed functions have not
        changed.
        """
        cached, code = self.find_record(request.build_key.key), request.code
        if cached is not None or code is None or not code.sources:
            return cached
        for entry in self._store.get_json("ran", self._outline_key(request.definition, code)) or ():
            if _digest(code, entry["ran"]) != entry["digest"]:
                continue
            cached = self.find_record(entry["record"])
            if cached is not None and [list(read) for read in cached.reads] == entry["reads"]:  # other reads may run other functions
                with contextlib.suppress(StoreUnusable):  # this entry is only an optimisation
                    self._results.keep("record", request.build_key, cached.value, list(cached.reads), cached.reason)
                return cached
        return None

    def note_ran(self, request: RecordRequest, ran: Ran | None, reads: list[list[str]]) -> None:
        """Store the functions that ran when a part was built, together with its build key and the states of the files that it read.

        `ran` contains the numbers of the functions by file (None if unknown).
        """
        code = request.code
        if code is None or not code.sources or ran is None:
            return
        by_label = {code.sources[file].label: numbers for file, numbers in ran.items() if file in code.sources}
        digest = _digest(code, by_label)
        if digest is not None and len(by_label) == len(ran):
            key = self._outline_key(request.definition, code)
            others = [one for one in self._store.get_json("ran", key) or () if (one["digest"], one["reads"]) != (digest, reads)]
            newest = {"ran": by_label, "digest": digest, "record": request.build_key.key, "reads": reads}
            self._store.note_json("ran", key, [newest, *others[: CANDIDATES - 1]])

    def _outline_key(self, definition: PartDefinition, code: CodeIngredients) -> str:
        """Return the key of a part record whose code is reduced to an outline without function bodies."""
        outlines = {one.label: f"{one.facts.outline} {one.path}" for one in code.sources.values()}
        outline = dataclasses.replace(code, ingredients=outlines)
        return record_key(definition, outline, self._parts.versions(code, definition.reference), self._workspace).key

    def _has_files(self, value: Any) -> bool:
        return "failure" in value or all(self._store.has(sha256, size) for sha256, size in blobs_of(value["record"]))


class ConvexAnswers:
    """A cache of the convex pieces of meshes. `versions` returns the versions of the software that computes them."""

    def __init__(self, calls: WorkerCalls, versions: Callable[[], Mapping[str, str]]) -> None:
        self._calls = calls
        self._versions = versions

    def add(self, records: Records, convex: WantedPieces) -> None:
        """Add the convex pieces in `convex` to the records."""
        meshes = {
            text: [(record.simulated.sha256, most) for most in convex[text]] for text in sorted(convex)
            if isinstance(record := records.get(text), PartRecord) and record.simulated is not None
        }
        answers = self.pieces(dict.fromkeys(mesh for requested in meshes.values() for mesh in requested))
        for text, requested in meshes.items():
            for sha256, most in requested:
                answer, record = answers[sha256, most], records[text]
                if isinstance(answer, PartFailure):
                    records[text] = replace(answer, subject=text)
                elif isinstance(record, PartRecord):
                    records[text] = replace(record, convex={**record.convex, most: answer})

    def pieces(self, requested: Collection[tuple[str, int]]) -> dict[tuple[str, int], tuple[Mesh, ...] | PartFailure]:
        """Return the convex pieces of meshes, each with the largest number of pieces (0 for any number)."""
        store = self._calls.store
        version = "".join(self._versions().values()) if requested else ""
        pieces: dict[tuple[str, int], tuple[Mesh, ...] | PartFailure] = {}
        requests = []
        for mesh, most in requested:
            cached = convert(store.get_json(CONVEX, f"{version} {mesh} {most}"), tuple[Mesh, ...] | None)
            if cached is not None and all(store.has(piece.sha256, piece.size) for piece in cached):
                pieces[mesh, most] = cached
            else:
                requests.append(self._calls.request(op="decompose", mesh=mesh, most=most))
        for request, answer in self._calls.run(requests, "decomposing"):
            mesh, most = request["mesh"], request["most"]
            if "failed" in answer:
                pieces[mesh, most] = self._calls.failure(mesh, answer)
                continue
            values = answer["answer"]["pieces"]
            store.put_json(CONVEX, f"{version} {mesh} {most}", values)
            pieces[mesh, most] = convert(values, tuple[Mesh, ...])
        return pieces
