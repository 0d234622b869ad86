"""The reasons why parts are built or reused, and an in-memory cache of recent part records."""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.geometry.key.build_key import BuildKey, difference
from thingc.geometry.key.result_cache import Results
from thingc.geometry.record import PartDefinition, PartFailure, PartRecord, WantedPieces

RECENT = 512
"""Maximum number of part records that a geometry service caches in memory. If the cache is full, the oldest record is removed."""


class BuildReason(FrozenStruct):
    """The reason for building a part (`reused` is False) or for reusing it, for example "module `arm` changed"."""

    text: str
    reused: bool
    reason: str


def unchanged(reason: str) -> str:
    """Return the reason for reusing a part that has not changed. `reason` is the reason why the part was built ("" if unknown)."""
    return "no dependency changed" + (f" since it was modelled ({reason})" if reason else "")


def why(definition: PartDefinition, build_key: BuildKey, results: Results) -> str:
    """Describe why a part must be built."""
    last = results.last(definition.text)
    if last is None:
        return "parameters are new" if results.met_before(definition.reference) else "first time"
    if last.key == build_key.key:
        return results.changed_read(build_key.key) or "its files were missing from the cache"
    return difference(last.ingredients, build_key.ingredients)


class RecentRecords:
    """An in-memory cache of the latest part records of a geometry service. The cache key consists of the part definition and of the
    convex decompositions in the record.
    """

    def __init__(self) -> None:
        self._kept: dict[tuple[PartDefinition, tuple[int, ...]], tuple[PartRecord, str]] = {}

    def get(self, definition: PartDefinition, convex: tuple[int, ...]) -> tuple[PartRecord, str] | None:
        """Return the cached record of a part definition and the reason for reusing it, or None if the record is not cached."""
        return self._kept.get((definition, convex))

    def keep(
        self, definitions: Mapping[str, PartDefinition], answers: Mapping[str, PartRecord | PartFailure], convex: WantedPieces,
        decisions: Mapping[str, BuildReason],
    ) -> None:
        """Cache part records that were built or loaded, each with the reason that a later service would give for reusing it."""
        for text, definition in definitions.items():
            record, decision, place = answers[text], decisions.get(text), (definition, convex.get(text, ()))
            if isinstance(record, PartRecord) and decision is not None and place not in self._kept:
                reason = decision.reason if decision.reused else unchanged(decision.reason)
                self._kept[place] = (record, reason)
        while len(self._kept) > RECENT:
            del self._kept[next(iter(self._kept))]
