"""Answers for parts without waiting: what the store and the lock have now. The rest is left to workers (`background_workers`).

With them, what a document of a workspace can name besides its own names: available parts and other documents; and its schema."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from msgspec.structs import replace

from thingc.base.source import Path
from thingc.geometry.client import ABSENT
from thingc.geometry.record import FailureKind, PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.tools.schemas.refresh_schemas import Schemas

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace
    from thingc.geometry.build_reasons import BuildReason
    from thingc.geometry.key.modules import Module
    from thingc.geometry.lock.json_format import BadLock
    from thingc.geometry.print_slices import Slicing
    from thingc.geometry.service import GeometryService
    from thingc.tools.lsp.analysis import Analysis

_T = TypeVar("_T")

WAITED_FOR: FailureKind = "unlocked"
"""The kind of failure of a part of which only workers could tell. (Nothing else fails so where code may run.)"""


@dataclass(slots=True)
class PendingRequests:
    """What is asked of workers: `references` to describe; `definitions` to model by text, with whether convex pieces are wanted; and how
    records of such definitions are sliced."""

    references: dict[str, None] = field(default_factory=dict)
    definitions: dict[str, tuple[PartDefinition, bool]] = field(default_factory=dict)
    slices: dict[str, tuple[PartDefinition, PartRecord, Collection[Slicing]]] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.references or self.definitions or self.slices)

    def within(self, other: PendingRequests) -> bool:
        """Whether the other one wants all of this, too."""
        return (
            self.references.keys() <= other.references.keys() and self.definitions.keys() <= other.definitions.keys()
            and self.slices.keys() <= other.slices.keys()
        )

    def add(self, other: PendingRequests) -> None:
        """Want what the other one wants, too."""
        self.references.update(other.references)
        self.definitions.update(other.definitions)
        self.slices.update(other.slices)


class CachedParts:
    """What a geometry service without workers knows of parts. Others have failed with `WAITED_FOR`, and whoever compiles with these answers
    leaves out what is said of that: so nothing is said of what depends on them either.

    `failed` and `undescribed` are answers of workers that no store keeps: parts that crash or hang. `unanswered` is what was asked for in
    vain since it was last taken.
    """

    def __init__(self, service: GeometryService) -> None:
        self.service = service
        self.workspace: Workspace = service.workspace
        self.unknown: list[str] = []
        self.broken: list[BadLock] = service.broken
        self.failed: dict[str, PartFailure] = {}
        self.undescribed: dict[str, PartFailure] = {}
        self.unanswered = PendingRequests()

    @property
    def decisions(self) -> Mapping[str, BuildReason]:
        """Why each record was found, by definition text."""
        return self.service.decisions

    @property
    def inputs(self) -> frozenset[str]:
        """Absolute paths of everything that decided about answers, there or not."""
        return self.service.inputs

    def anticipate(self) -> bool:
        """Nothing is modelled here."""
        return False

    def close(self) -> None:
        """Nothing was started."""

    def describe(self, references: Sequence[str]) -> dict[str, PartSchema | PartFailure]:
        """What each `module:Class` takes, by reference."""
        answers = _answers(self.service.describe(references), self.undescribed)
        self.unanswered.references.update((one, None) for one in references if _waited_for(answers.get(one)))
        return answers

    def hiding(self, reference: str) -> tuple[Module, ...]:
        """The modules in reach of `module:Class` that hide others of their name."""
        return self.service.hiding(reference)

    def realize(
        self, definitions: Sequence[PartDefinition], convex: Collection[str] = (), likely: object = None,
    ) -> dict[str, PartRecord | PartFailure]:
        """The record of each definition, by text."""
        answers = _answers(self.service.realize(definitions, convex), self.failed)
        waited_for = [one for one in definitions if _waited_for(answers.get(one.text))]
        self.unanswered.definitions.update((one.text, (one, one.text in convex)) for one in waited_for)
        return answers

    def slice(
        self, definitions: Sequence[PartDefinition], records: Mapping[str, PartRecord | PartFailure],
        wanted: Mapping[str, Collection[Slicing]],
    ) -> dict[str, PartRecord | PartFailure]:
        """The `records` with what is laid into them when they are sliced as `wanted`, by text."""
        answers = _answers(self.service.slice(definitions, records, wanted), self.failed)
        for one in definitions:
            record = records.get(one.text)
            if isinstance(record, PartRecord) and _waited_for(answers.get(one.text)):
                self.unanswered.slices[one.text] = (one, record, wanted[one.text])
        return answers


def _answers(answers: Mapping[str, _T | PartFailure], failed: Mapping[str, PartFailure]) -> dict[str, _T | PartFailure]:
    return {
        name: failed.get(name, replace(answer, kind=WAITED_FOR)) if isinstance(answer, PartFailure) and answer.kind == ABSENT else answer
        for name, answer in answers.items()
    }


def _waited_for(answer: object) -> bool:
    return isinstance(answer, PartFailure) and answer.kind == WAITED_FOR


class AvailableNames:
    """The surroundings of the documents of one workspace. `at_hand` answers for parts; None where nothing of the workspace may run: then
    none are known but those that a document names. `wake` is called where workers are to be asked for more."""

    def __init__(self, workspace: Workspace, at_hand: CachedParts | None, wake: Callable[[], None]) -> None:
        self.workspace = workspace
        self.at_hand = at_hand
        self._schemas = Schemas(workspace, _Parts(at_hand, wake))

    def schema_of(self, analysis: Analysis, scalars: Mapping[Path, str]) -> dict[str, Any] | None:
        """The schema of a document as it is being written; of one that was never well-formed what every document of its kind may say, by
        its `scalars`. None for what is no document."""
        tree = analysis.tree
        if tree is None:
            return self._schemas.general(scalars.get(("thingc",), "").partition("/")[0] or "assembly")
        return analysis.once(
            "schema", lambda: self._schemas.schema_of(analysis.path, tree, analysis.model, analysis.records, analysis.schemas),
        )


class _Parts:
    """Parts in reach, as far as they are known at once. What their classes take is asked of workers, too; nothing is modelled for it."""

    def __init__(self, at_hand: CachedParts | None, wake: Callable[[], None]) -> None:
        self._at_hand = at_hand
        self._wake = wake

    def catalogue(self) -> list[str]:
        """See `PartsInReach`."""
        return [] if self._at_hand is None else self._at_hand.service.catalogue()

    def not_python(self) -> list[PartFailure]:
        """See `PartsInReach`."""
        return [] if self._at_hand is None else self._at_hand.service.not_python()

    def describe(self, references: Sequence[str]) -> dict[str, PartSchema | PartFailure]:
        """See `PartsInReach`. Those that are waited for are left out."""
        answers = {} if self._at_hand is None else self._at_hand.describe(references)
        known = {name: one for name, one in answers.items() if not isinstance(one, PartFailure) or one.kind != WAITED_FOR}
        if len(known) < len(answers):
            self._wake()
        return known

    def realize(self, definitions: Sequence[PartDefinition]) -> Mapping[str, PartRecord | PartFailure]:
        """See `PartsInReach`."""
        return {} if self._at_hand is None else self._at_hand.service.realize(definitions)
