"""The reasons why parts are built or reused."""

from __future__ import annotations

from thingc.base.frozen_struct import FrozenStruct
from thingc.geometry.key.build_key import BuildKey, difference
from thingc.geometry.key.result_cache import Results
from thingc.geometry.record import PartDefinition


class BuildReason(FrozenStruct):
    """The reason for building a part (`reused` is False) or for reusing it, for example "module `arm` changed"."""

    reused: bool
    reason: str


def unchanged_reason(reason: str) -> str:
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
