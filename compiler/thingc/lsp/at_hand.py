"""Answers for parts without waiting: what the store and the lock have now. What they have not, workers find out meanwhile."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from thingc.realize import ABSENT
from thingc.realize.record import PartDefinition, PartFailure, PartRecord, PartSchema

if TYPE_CHECKING:
    from thingc.realize import BadLock, Decision, GeometryService, Module, Slicing
    from thingc.workspace import Workspace

_T = TypeVar("_T")

WAITED_FOR = "unlocked"
"""The kind of failure of a part of which only workers could tell. (Nothing else fails so where code may run.)"""


class AtHand:
    """What a geometry service without workers knows of parts. Others have failed with `WAITED_FOR`, and whoever compiles with these answers
    leaves out what is said of that: so nothing is said of what depends on them either.

    `failed` are the answers of workers that are not kept in the store: parts that crash or hang. `missing` is what was asked for in vain
    since it was last taken.
    """

    def __init__(self, service: GeometryService) -> None:
        self.service = service
        self.workspace: Workspace = service.workspace
        self.unknown: list[str] = []
        self.broken: list[BadLock] = service.broken
        self.failed: dict[str, PartFailure] = {}
        self.missing_references: dict[str, None] = {}
        self.missing_definitions: dict[str, tuple[PartDefinition, bool]] = {}
        self.missing_slices: dict[str, tuple[PartDefinition, PartRecord, Collection[Slicing]]] = {}

    @property
    def decisions(self) -> Mapping[str, Decision]:
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
        answers = self._answers(self.service.describe(references))
        self.missing_references.update((one, None) for one in references if _waited_for(answers.get(one)))
        return answers

    def hiding(self, reference: str) -> tuple[Module, ...]:
        """The modules in reach of `module:Class` that hide others of their name."""
        return self.service.hiding(reference)

    def realize(self, definitions: Sequence[PartDefinition], convex: Collection[str] = ()) -> dict[str, PartRecord | PartFailure]:
        """The record of each definition, by text."""
        answers = self._answers(self.service.realize(definitions, convex))
        self.missing_definitions.update((one.text, (one, one.text in convex)) for one in definitions if _waited_for(answers.get(one.text)))
        return answers

    def slice(
        self, definitions: Sequence[PartDefinition], records: Mapping[str, PartRecord | PartFailure],
        wanted: Mapping[str, Collection[Slicing]],
    ) -> dict[str, PartRecord | PartFailure]:
        """The `records` with what is laid into them when they are sliced as `wanted`, by text."""
        answers = self._answers(self.service.slice(definitions, records, wanted))
        for one in definitions:
            record = records.get(one.text)
            if isinstance(record, PartRecord) and _waited_for(answers.get(one.text)):
                self.missing_slices[one.text] = (one, record, wanted[one.text])
        return answers

    def _answers(self, answers: Mapping[str, _T | PartFailure]) -> dict[str, _T | PartFailure]:
        return {
            name: self.failed.get(name, replace(answer, kind=WAITED_FOR))
            if isinstance(answer, PartFailure) and answer.kind == ABSENT else answer
            for name, answer in answers.items()
        }


def _waited_for(answer: object) -> bool:
    return isinstance(answer, PartFailure) and answer.kind == WAITED_FOR
