"""Two snapshots -> all that changed, and what follows from it."""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.tools.diff.change import Change
from thingc.tools.diff.consequences import Farthest, add_consequences
from thingc.tools.diff.document_changes import compare_stated
from thingc.tools.diff.name_mapping import NameMapping
from thingc.tools.diff.snapshot import Snapshot


class Comparison(OneLineRepr, FrozenStruct):
    """What changed of one robot: what somebody changed first, then what follows; `unknown` says what could not be compared. `pictures` are
    PNG files, `before`, `after` and `overlay`, where they were asked for."""

    name: str
    changes: tuple[Change, ...]
    unknown: tuple[str, ...] = ()
    pictures: Mapping[str, bytes] = {}


def compare(old: Snapshot, new: Snapshot, farthest: Farthest = lambda old, new: None) -> Comparison:
    """What changed from one snapshot to another. `farthest` measures how far surfaces are apart; without it nothing says so."""
    pairing = NameMapping(old, new)
    changes = compare_stated(pairing)
    add_consequences(pairing, changes, farthest)
    ordered = sorted(changes.found, key=lambda change: change.caused)
    return Comparison(name=new.name, changes=tuple(ordered), unknown=tuple(sorted(old.lacks | new.lacks)))
