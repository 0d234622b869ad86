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
from thingc.geometry.key.build_key import BuildKey, record_key
from thingc.geometry.key.module_key import CodeIngredients
from thingc.geometry.key.part_code import PartCode
from thingc.geometry.key.result_cache import CANDIDATES, CachedResult, Results
from thingc.geometry.record import Mesh, PartDefinition, PartFailure, PartRecord, WantedPieces
from thingc.geometry.record_json import blobs_of
from thingc.geometry.store.local import Store, StoreUnusable
from thingc.geometry.store.shared_store import CONVEX
from thingc.geometry.store.slice_cache import MeshWork, Records

Ran = Mapping[str, Sequence[int] | None]
"""Numbers of the functions that ran, by label of the module. The value None means that all functions count as executed."""


def outline(code: CodeIngredients) -> CodeIngredients:
    """Return the inputs of a part with its source code reduced to an outline without function bodies."""
    return dataclasses.replace(code, ingredients={one.label: f"{one.facts.outline} {one.path}" for one in code.sources.values()})


def executed_functions(code: CodeIngredients, ran: Mapping[str, Sequence[int] | None]) -> dict[str, Any] | None:
    """Convert the record of executed functions to the format of the cache: the numbers of the functions by module, and their digest.

    `ran` contains the numbers of the functions by file. Return None if the code does not contain one of the files or functions.
    """
    labelled = {code.sources[file].label: numbers for file, numbers in ran.items() if file in code.sources}
    digest = _digest(code, labelled)
    return None if digest is None or len(labelled) < len(ran) else {"ran": labelled, "digest": digest}


def is_unchanged(code: CodeIngredients, kept: Mapping[str, Any]) -> bool:
    """Return whether the functions that ran when the cached part was built are unchanged in this code."""
    digest: str = kept["digest"]
    return _digest(code, kept["ran"]) == digest


def _digest(code: CodeIngredients, ran: Ran) -> str | None:
    facts = {one.label: one.facts for one in code.sources.values()}
    digest = hashlib.sha256()
    for label, numbers in sorted(ran.items()):
        if label not in facts or numbers and numbers[-1] >= len(facts[label].bodies):
            return None
        texts = [facts[label].syntax] if numbers is None else [facts[label].bodies[number] for number in numbers]
        digest.update(f"{label} {numbers} {texts}\n".encode())
    return digest.hexdigest()


class KeptRecords:
    """Finds the cached part records of a workspace. A record counts as cached only if the store contains all files to which it refers."""

    def __init__(self, workspace: Workspace, store: Store, parts: PartCode, results: Results) -> None:
        self._workspace, self._store, self._parts, self._results = workspace, store, parts, results

    def find_record(self, key: str) -> CachedResult | None:
        """Return the cached record or failure of the part with the build key `key`, or None."""
        return self._results.find("record", key, self._whole)

    def find(self, definition: PartDefinition, build_key: BuildKey, code: CodeIngredients | None) -> CachedResult | None:
        """Return the cached record of a part, or None.

        If no record has the part's build key, look for a record with the same outline of the code whose executed functions have not
        changed.
        """
        kept = self.find_record(build_key.key)
        if kept is not None or code is None or not code.sources:
            return kept
        for one in self._store.get_json("ran", self._outline_key(definition, code)) or ():
            if not is_unchanged(code, one):
                continue
            kept = self.find_record(one["record"])
            if kept is not None and [list(read) for read in kept.reads] == one["reads"]:  # other reads may run other functions
                with contextlib.suppress(StoreUnusable):  # this entry is only an optimisation
                    self._results.keep("record", build_key, kept.value, list(kept.reads), kept.reason)
                return kept
        return None

    def note_ran(
        self, definition: PartDefinition, build_key: BuildKey, code: CodeIngredients | None, ran: Mapping[str, Sequence[int] | None] | None,
        reads: list[list[str]],
    ) -> None:
        """Store the functions that ran when a part was built, together with its build key and the states of the files that it read.

        `ran` contains the numbers of the functions by file (None if unknown).
        """
        if code is None or not code.sources or ran is None:
            return
        traces = executed_functions(code, ran)
        if traces is not None:
            key = self._outline_key(definition, code)
            others = [one for one in self._store.get_json("ran", key) or () if (one["digest"], one["reads"]) != (traces["digest"], reads)]
            newest = {**traces, "record": build_key.key, "reads": reads}
            self._store.note_json("ran", key, [newest, *others[: CANDIDATES - 1]])

    def _outline_key(self, definition: PartDefinition, code: CodeIngredients) -> str:
        return record_key(definition, outline(code), self._parts.versions(code, definition.reference), self._workspace).key

    def _whole(self, value: Any) -> bool:
        return "failure" in value or all(self._store.has(sha256, size) for sha256, size in blobs_of(value["record"]))


class ConvexAnswers:
    """A cache of the convex pieces of meshes. `versions` returns the versions of the software that computes them."""

    def __init__(self, work: MeshWork, versions: Callable[[], Mapping[str, str]]) -> None:
        self._work = work
        self._versions = versions

    def add(self, records: Records, convex: WantedPieces) -> None:
        """Add the convex pieces in `convex` to the records."""
        meshes = {
            text: [(record.simulated.sha256, most) for most in convex[text]] for text in sorted(convex)
            if isinstance(record := records.get(text), PartRecord) and record.simulated is not None
        }
        made = self.pieces(dict.fromkeys(mesh for several in meshes.values() for mesh in several))
        for text, several in meshes.items():
            for sha256, most in several:
                answer, record = made[sha256, most], records[text]
                if isinstance(answer, PartFailure):
                    records[text] = replace(answer, subject=text)
                elif isinstance(record, PartRecord):
                    records[text] = replace(record, convex={**record.convex, most: answer})

    def pieces(self, wanted: Collection[tuple[str, int]]) -> dict[tuple[str, int], tuple[Mesh, ...] | PartFailure]:
        """Return the convex pieces of meshes, each with the largest number of pieces (0 for any number)."""
        store = self._work.store
        version = "".join(self._versions().values()) if wanted else ""
        pieces: dict[tuple[str, int], tuple[Mesh, ...] | PartFailure] = {}
        requests = []
        for mesh, most in wanted:
            kept = convert(store.get_json(CONVEX, f"{version} {mesh} {most}"), tuple[Mesh, ...] | None)
            if kept is not None and all(store.has(piece.sha256, piece.size) for piece in kept):
                pieces[mesh, most] = kept
            else:
                requests.append(self._work.request("decompose", mesh, most=most))
        for request, answer in self._work.run(requests, "decomposing"):
            mesh, most = request["mesh"], request["most"]
            if "failed" in answer:
                pieces[mesh, most] = self._work.broken(mesh, answer)
                continue
            made = answer["answer"]["pieces"]
            store.put_json(CONVEX, f"{version} {mesh} {most}", made)
            pieces[mesh, most] = convert(made, tuple[Mesh, ...])
        return pieces
