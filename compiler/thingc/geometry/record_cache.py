"""Part records in the store: found under a part's key, or under that of its outline together with what ran when they were made."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from thingc.geometry.key.build_key import BuildKey, record_key
from thingc.geometry.key.module_key import CodeIngredients
from thingc.geometry.key.outline import executed_functions, is_unchanged, outlined
from thingc.geometry.key.part_code import PartCode
from thingc.geometry.key.result_cache import CANDIDATES, CachedResult, Results
from thingc.geometry.record import PartDefinition
from thingc.geometry.record_json import blobs_of
from thingc.geometry.store.local import Store, StoreUnusable

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace


class KeptRecords:
    """The records of a workspace's parts that are whole: everything that they speak of is in the store."""

    def __init__(self, workspace: Workspace, store: Store, parts: PartCode, results: Results) -> None:
        self._workspace, self._store, self._parts, self._results = workspace, store, parts, results

    def under(self, key: str) -> CachedResult | None:
        """The record, or failure, under a part's key."""
        return self._results.find("record", key, self._whole)

    def find(self, definition: PartDefinition, build_key: BuildKey, code: CodeIngredients | None) -> CachedResult | None:
        """What is under the part's key; else a record with the same outline, where what ran for it is as it was."""
        kept = self.under(build_key.key)
        if kept is not None or code is None or not code.sources:
            return kept
        for one in self._store.get_json("ran", self._outline_key(definition, code)) or ():
            if not is_unchanged(code, one):
                continue
            kept = self.under(one["record"])
            if kept is not None and [list(read) for read in kept.reads] == one["reads"]:  # with other files something else may have run
                with contextlib.suppress(StoreUnusable):  # kept for speed only
                    self._results.keep("record", build_key, kept.value, list(kept.reads), kept.reason)
                return kept
        return None

    def note_ran(
        self, definition: PartDefinition, build_key: BuildKey, code: CodeIngredients | None, ran: Mapping[str, Sequence[int] | None] | None,
        reads: list[list[str]],
    ) -> None:
        """Keep which functions ran, by file (None: nobody knows), for the record under a part's key with these reads."""
        if code is None or not code.sources or ran is None:
            return
        traces = executed_functions(code, ran)
        if traces is not None:
            key = self._outline_key(definition, code)
            others = [one for one in self._store.get_json("ran", key) or () if (one["digest"], one["reads"]) != (traces["digest"], reads)]
            newest = {**traces, "record": build_key.key, "reads": reads}
            self._store.note_json("ran", key, [newest, *others[: CANDIDATES - 1]])

    def _outline_key(self, definition: PartDefinition, code: CodeIngredients) -> str:
        return record_key(definition, outlined(code), self._parts.versions(code, definition.reference), self._workspace).key

    def _whole(self, value: Any) -> bool:
        return "failure" in value or all(self._store.has(sha256, size) for sha256, size in blobs_of(value["record"]))
