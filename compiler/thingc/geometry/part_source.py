"""The interface that returns parts to the passes of the compiler. Parts come from the geometry service or from a lock file."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Protocol

from thingc.base.diagnostics import Code, Note, Report, Severity
from thingc.base.one_line_repr import format_count
from thingc.base.source import Span, line_of
from thingc.documents.workspace import Workspace
from thingc.geometry.build_reasons import BuildReason
from thingc.geometry.key.modules import Module
from thingc.geometry.lock.json_format import BadLock
from thingc.geometry.lock.lock import LOCK_FILE, REMAKE, lock_path, report_bad
from thingc.geometry.part_requests import Likely
from thingc.geometry.print_slices import Slicing
from thingc.geometry.record import NO_PIECES, Mesh, PartDefinition, PartFailure, PartRecord, PartSchema, WantedPieces

SHOWN = 8


class PartSource(Protocol):
    """A source of part schemas and part records.

    `unknown` contains the labels of definitions without a record or with an inexact record. `broken` contains the errors in the lock file.
    """

    workspace: Workspace
    unknown: list[str]
    broken: list[BadLock]

    @property
    def decisions(self) -> Mapping[str, BuildReason]:
        """The reason why each part record was built or reused, keyed by definition text."""

    @property
    def inputs(self) -> frozenset[str]:
        """Absolute paths of the files and folders that the returned schemas and records depend on, including paths that do not exist."""

    def anticipate(self) -> bool:
        """If parts probably have to be built, begin to load the kernel and return True."""

    def close(self) -> None:
        """End all processes that were started."""

    def describe(self, references: Sequence[str]) -> dict[str, PartSchema | PartFailure]:
        """Return the schema or failure of each `module:Class`, by reference."""

    def hiding(self, reference: str) -> tuple[Module, ...]:
        """Return the modules that hide other modules of the same name, among the modules on which the part `module:Class` depends."""

    def realize(
        self, definitions: Sequence[PartDefinition], convex: WantedPieces = NO_PIECES, likely: Likely = None,
    ) -> Mapping[str, PartRecord | PartFailure]:
        """Build or load parts, and return the record or failure of each part definition by its text.

        Definitions without an available record are omitted. The function `likely` returns the expected slicings of the parts that must be
        built.
        """

    def decompose(self, meshes: Collection[tuple[str, int]]) -> Mapping[tuple[str, int], tuple[Mesh, ...] | PartFailure]:
        """Decompose meshes in the store into convex pieces, and return the pieces or the failure of each mesh.

        A mesh is given by its digest and by the largest number of pieces (0 for any number). Meshes whose pieces are not available are
        omitted.
        """

    def slice(
        self, definitions: Sequence[PartDefinition], records: Mapping[str, PartRecord | PartFailure],
        requested: Mapping[str, Collection[Slicing]],
    ) -> Mapping[str, PartRecord | PartFailure]:
        """Slice parts for printing, and return their records with the resulting slices, keyed by definition text.

        `requested` contains the slicings to compute for each definition text. If the slices of a record are not available, the returned
        record is not `exact`.
        """


def report_hidden(parts: PartSource, references: Iterable[tuple[str, Span | None]], report: Report) -> None:
    """Report a warning for each module of a part that hides another module of the same name.

    The location of the warning is the first reference to a part with this module. If no reference has a location, the warning is reported
    at the module itself.
    """
    reported: set[str] = set()
    for reference, where in references:
        for module in parts.hiding(reference):
            if module.file is not None and module.name not in reported:
                reported.add(module.name)
                hidden = " and ".join(f"`{parts.workspace.relative(file)}`" for file in module.hides)
                report.warn(
                    Code.HIDDEN, f"the module `{parts.workspace.relative(module.file)}` of `{reference}` hides {hidden}",
                    where or line_of(module.file), help="rename one of the files", allow=where is not None,
                )


def report_gaps(parts: PartSource, report: Report, *, severity: Severity = Severity.ERROR) -> None:
    """Report the errors in the lock file.

    Also report the number of part definitions that could not be checked because they have no record.
    """
    file = lock_path(parts.workspace)
    for fault in parts.broken[:SHOWN]:
        report_bad(file, fault, report, severity=severity)
    labels = sorted(set(parts.unknown))
    if not labels:
        return
    more = [Note(message=f"and {len(labels) - SHOWN} more")] if len(labels) > SHOWN else []
    report.add(
        Code.NOT_LOOKED_AT, f"`{LOCK_FILE}` does not contain the geometry of {format_count(len(labels), 'part')}",
        line_of(file), help=REMAKE, notes=[*(Note(message=f"`{label[:200]}`") for label in labels[:SHOWN]), *more], severity=Severity.NOTE,
    )
