"""What the passes ask of parts, whoever answers: the geometry service, or a lock alone."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from thingc.diagnostics import Code, Note, Report, Severity
from thingc.realize.lock.lock import LOCK_FILE, REMAKE, lock_path, report_bad, top_of
from thingc.realize.lock.values import BadLock
from thingc.realize.record import PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.realize.slices import Slicing

if TYPE_CHECKING:
    from thingc.realize.service import Decision
    from thingc.workspace import Workspace

SHOWN = 8


class PartAnswers(Protocol):
    """Part schemas and part records.

    `unknown` are definitions of which nobody may know more than their names, `broken` faults of the lock that were met."""

    workspace: Workspace
    unknown: list[str]
    broken: list[BadLock]

    @property
    def decisions(self) -> Mapping[str, Decision]:
        """Why each record was modelled or found, by definition text."""

    @property
    def inputs(self) -> frozenset[str]:
        """Absolute paths of everything that decided about answers, there or not."""

    def anticipate(self) -> bool:
        """Get ready to model, where that is likely to be needed: whether it is, and the kernel loads now."""

    def close(self) -> None:
        """End what was started."""

    def describe(self, references: Sequence[str]) -> dict[str, PartSchema | PartFailure]:
        """What each `module:Class` takes, by reference."""

    def realize(self, definitions: Sequence[PartDefinition], convex: Collection[str] = ()) -> Mapping[str, PartRecord | PartFailure]:
        """The record of each definition, by text; one that nobody may know is absent."""

    def slice(
        self, definitions: Sequence[PartDefinition], records: Mapping[str, PartRecord | PartFailure],
        wanted: Mapping[str, Collection[Slicing]],
    ) -> Mapping[str, PartRecord | PartFailure]:
        """The `records` of `definitions` with what is laid into them when they are sliced as `wanted`, by text. One of which nobody
        may know that is not `exact`."""


def report_gaps(parts: PartAnswers, report: Report, *, severity: Severity = Severity.ERROR) -> None:
    """Say what was wrong with entries of the lock, and how many definitions could not be looked at for want of a record."""
    file = lock_path(parts.workspace)
    for fault in parts.broken[:SHOWN]:
        report_bad(file, fault, report, severity=severity)
    texts = sorted(set(parts.unknown))
    if not texts:
        return
    what = "1 part has" if len(texts) == 1 else f"{len(texts)} parts have"
    their = "its" if len(texts) == 1 else "their"
    more = [Note(message=f"and {len(texts) - SHOWN} more")] if len(texts) > SHOWN else []
    report.add(
        Code.NOT_LOOKED_AT, f"{what} parameters or a process that `{LOCK_FILE}` does not hold: {their} geometry was not looked at",
        top_of(file), help=REMAKE, notes=[*(Note(message=f"`{text[:200]}`") for text in texts[:SHOWN]), *more], severity=Severity.NOTE,
    )
