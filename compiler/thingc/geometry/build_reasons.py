"""Why a part was modelled or not, in words; and the records that a service keeps at hand with those words."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.geometry.key.build_key import BuildKey, difference
from thingc.geometry.key.result_cache import Results
from thingc.geometry.record import PartDefinition, PartFailure, PartRecord

RECENT = 512
"""How many records a service keeps at hand for its next answer; the oldest goes first."""


class BuildReason(FrozenStruct):
    """Why a part was modelled, or not: `reason` in words: "module `arm` changed"."""

    text: str
    reused: bool
    reason: str


def unchanged(reason: str) -> str:
    """Why a part is reused that was modelled for a reason."""
    return "nothing that it depends on changed" + (f" since it was modelled ({reason})" if reason else "")


def why(definition: PartDefinition, build_key: BuildKey, results: Results) -> str:
    """Why a part has to be modelled."""
    last = results.last(definition.text)
    if last is None:
        return "parameters are new" if results.met_before(definition.reference) else "first time"
    if last.key == build_key.key:
        return results.changed_read(build_key.key) or "its files were missing from the store"
    return difference(last.ingredients, build_key.ingredients)


class RecentRecords:
    """The last records of a service, by definition and by whether they have convex pieces: asked for again, they cost nothing."""

    def __init__(self) -> None:
        self._kept: dict[tuple[PartDefinition, bool], tuple[PartRecord, str]] = {}

    def get(self, definition: PartDefinition, convex: bool) -> tuple[PartRecord, str] | None:
        """The record, and why it is reused."""
        return self._kept.get((definition, convex))

    def keep(
        self, definitions: Mapping[str, PartDefinition], answers: Mapping[str, PartRecord | PartFailure], convex: Collection[str],
        decisions: Mapping[str, BuildReason],
    ) -> None:
        """Remember the records of one answer, with what another service would say of them then."""
        for text, definition in definitions.items():
            record, decision, place = answers[text], decisions.get(text), (definition, text in convex)
            if isinstance(record, PartRecord) and decision is not None and place not in self._kept:
                reason = decision.reason if decision.reused else unchanged(decision.reason)
                self._kept[place] = (record, reason)
        while len(self._kept) > RECENT:
            del self._kept[next(iter(self._kept))]
