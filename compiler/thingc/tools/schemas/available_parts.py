"""What is known of parts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from thingc.geometry.record import PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.tools.schemas.document_facts import Names, Records, usual_mounts


class AvailableParts(Protocol):
    """Who answers for parts, and can say which there are: a geometry service, or what stands before one."""

    def catalogue(self) -> list[str]:
        """`module:Class` of every public class in reach."""

    def not_python(self) -> list[PartFailure]:
        """The files of parts that cannot be parsed now."""

    def describe(self, references: Sequence[str]) -> dict[str, PartSchema | PartFailure]:
        """What each `module:Class` takes, by reference."""

    def realize(self, definitions: Sequence[PartDefinition]) -> Mapping[str, PartRecord | PartFailure]:
        """The record of each definition, by text."""


@dataclass(slots=True)
class Parts:
    """The answers of one geometry service."""

    service: AvailableParts
    schemas: dict[str, PartSchema | PartFailure] = field(default_factory=dict)
    records: dict[str, PartRecord | PartFailure] = field(default_factory=dict)
    unreadable: frozenset[str] = frozenset()
    _reach: tuple[str, ...] | None = None

    def describe(self, references: Iterable[str]) -> Mapping[str, PartSchema | PartFailure]:
        """What every class in reach takes, and those that are named."""
        if self._reach is None:
            self._reach = tuple(self.service.catalogue())
            self.unreadable = frozenset(failure.subject for failure in self.service.not_python())
        wanted = [one for one in dict.fromkeys((*self._reach, *references)) if one not in self.schemas]
        if wanted:
            self.schemas.update(self.service.describe(wanted))
        return self.schemas

    def realize(self, definitions: Iterable[PartDefinition]) -> Records:
        """The records of definitions."""
        wanted = {one.text: one for one in definitions if one.text not in self.records}
        if wanted:
            self.records.update(self.service.realize(list(wanted.values())))
        return self.records

    def things(self) -> dict[str, PartSchema]:
        """The Things in reach, and the other parts that are named, by reference."""
        return {
            name: one for name, one in sorted(self.schemas.items())
            if isinstance(one, PartSchema) and (one.kind == "thing" or name not in (self._reach or ()))
        }

    def defaults(self) -> dict[str, PartDefinition]:
        """The member of every Thing's family with every parameter at its default, for those that have one."""
        return {name: made for name, one in self.things().items() if (made := one.default) is not None}

    def usual(self, definitions: Iterable[PartDefinition]) -> dict[str, Names]:
        """The mounts that a part has as a rule: those of its default member, else of the first that is known."""
        mounts: dict[str, Names] = {}
        defaults = self.defaults()
        for one in (*defaults.values(), *sorted(definitions, key=lambda one: one.text)):
            record = self.records.get(one.text)
            if isinstance(record, PartRecord):
                mounts.setdefault(one.reference, usual_mounts(record))
        return mounts

    def unsure(self, references: Iterable[str]) -> list[str]:
        """The references that cannot be described now because their file is being edited."""
        return [one for one in references if self._is_unsure(self.schemas.get(one), one.partition(":")[0] in self.unreadable)]

    @staticmethod
    def _is_unsure(answer: PartSchema | PartFailure | None, unreadable: bool) -> bool:
        if isinstance(answer, PartFailure):
            return unreadable or answer.kind not in ("missing", "refused")
        return answer is None and unreadable
