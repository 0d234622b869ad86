"""Support for plans in which parts depend on numbers. Such a plan computes the definition of a part, and requests the record of this part.

The numbers in the requested record then replace the numbers in the record of the traced compilation.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from typing import Any

from msgspec.structs import astuple, replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.batch.plans.program import program_of
from thingc.batch.plans.tape import Tape, Traced, value_of
from thingc.geometry.part_source import PartSource
from thingc.geometry.print_slices import Slicing
from thingc.geometry.record import Mesh, MountExpectation, MountRecord, PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.targets.artifact import StoredArtifact

KEPT = 512
"""Maximum number of part records that a plan caches."""

_PLAIN = (0.0, 1.0, -1.0)
"""Numbers that must be the same in all part records of a plan, because they are frequent in rotations and many decisions depend on them."""
_MEASURED = frozenset(("volume", "area", "centre", "inertia", "box", "fits", "slices"))
"""Fields of part records in which the numbers 0, 1 and -1 may change, because these fields contain such numbers only by chance."""
_ASIDE = frozenset(("text", "bom", "brep", "code", "slices"))
"""Fields of a part record that do not affect models and diagnostics, or that are handled separately."""


class Exchanged(FrozenStruct):
    """The numbers and meshes of the parts for particular values of the numbers on which these parts depend.

    `numbers` contains the numbers in the part records, in order. `names` contains the names that the meshes of these parts have in the
    model. `assets` maps file names to all meshes of the model.
    """

    numbers: tuple[float, ...]
    names: tuple[str, ...]
    assets: Mapping[str, StoredArtifact]


class TracedParts:
    """The source of part records during a traced compilation.

    For a part definition with traced numbers, this class returns the record for the current values of these numbers. In such a record, each
    number is a new variable of the tape, and each mesh hash is a token. The function `allowed` returns whether parts may depend on a traced
    number. If parts must not depend on the number, `PartDependsOnNumber` is raised. `before` is a copy of the tape before the new variables
    were added, or None if no part definition contains traced numbers.
    """

    def __init__(self, parts: PartSource, allowed: Callable[[Traced], bool]) -> None:
        self._parts = parts
        self._allowed = allowed
        self.definitions: tuple[PartDefinition, ...] = ()
        self.convex: Mapping[str, tuple[int, ...]] = {}
        self.slicings: dict[str, Collection[Slicing]] = {}
        self.expected: list[str] = []
        self.before: Tape | None = None
        self._records: dict[str, PartRecord] = {}
        self._walk = _Walk((), float)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._parts, name)

    def realize(self, definitions: Sequence[PartDefinition], convex: Any = None, likely: object = None, **named: Any) -> Any:
        """Return the part records for the given definitions, in the same way as `PartSource`. Call this method only once.

        The argument `likely` is ignored, because it may contain traced numbers.
        """
        traced = [one for one in definitions if numbers_of(one)]
        for one in traced:
            if forbidden := [number for number in numbers_of(one) if not self._allowed(number)]:
                raise PartDependsOnNumber(one, forbidden[0])
        records = self._parts.realize([_plain(one) for one in definitions], convex=convex or {}, **named)
        if not traced:
            return records
        self.definitions, self.convex = tuple(definitions), convex or {}
        numbers = self.parameters
        tape = numbers[0].tape
        self.before = tape.copy()
        self._walk = _Walk([one.text for one in definitions], lambda value: tape.variable(value, numbers))
        answers = dict(records)
        others = [records[one.text] for one in definitions if not numbers_of(one)]
        self.expected = [one.text for record in others if isinstance(record, PartRecord) for one in record.expectations]
        for one in traced:
            record = records[one.text]
            if not isinstance(record, PartRecord):
                raise PartDependsOnNumber(one)
            if one.text not in self._records:
                self._records[one.text] = record
                answers[one.text] = self._walk.through(record)
        return answers

    @property
    def likeness(self) -> tuple[Hashable, ...]:
        """The values in part records that must be the same when a plan is used for other numbers."""
        return tuple(self._walk.rest)

    @property
    def parameters(self) -> list[Traced]:
        """All traced numbers in part definitions, in order."""
        return [number for one in self.definitions for number in numbers_of(one)]

    @property
    def words(self) -> list[str]:
        """The strings in part records that messages may quote. These strings may contain numbers of other parts."""
        records = self._records.values()
        found = [one.interface or "" for record in records for one in record.mounts.values()]
        found += [text for record in records for one in record.expectations for text in (one.label, one.text)]
        return [text for text in found if any(map(str.isdigit, text))]

    def slice(self, definitions: Sequence[PartDefinition], records: Any, slicings: Mapping[str, Collection[Slicing]]) -> Any:
        """Return the part records with slicing results, in the same way as `PartSource`."""
        for one in definitions:
            for slicing in slicings.get(one.text, ()):
                for value in (*slicing.up, *astuple(slicing)):
                    if isinstance(value, Traced):
                        raise PartDependsOnNumber(one, value)
        answers = self._parts.slice([_plain(one) for one in definitions], {**records, **self._records}, slicings)
        self.slicings = {text: slicings[text] for text in self._records if text in slicings}
        made = {}
        for one in (one for one in definitions if one.text in self._records and one.text not in made):
            record = answers[one.text]
            if not isinstance(record, PartRecord):
                raise PartDependsOnNumber(one)
            made[one.text] = replace(records[one.text], slices=self._walk.slices(record))
        return {**answers, **made}


class PartDependsOnNumber(Exception):
    """Raised if a part depends on a traced number although this is not allowed.

    `number` is the traced number (default: the first traced number in the definition).
    """

    def __init__(self, definition: PartDefinition, number: Traced | None = None) -> None:
        super().__init__(definition.label)
        self.label = definition.label
        self.number = numbers_of(definition)[0] if number is None else number


class Exchange:
    """Replaces the part records of a plan by the records of the same parts for other numbers.

    `rehearsed` contains the parts of the traced compilation. The object `parts` is the source of further part records. `assets` contains
    the meshes of the traced model, and `names` contains the names of all meshes that are replaced.
    """

    def __init__(self, rehearsed: TracedParts, parts: PartSource, assets: Mapping[str, StoredArtifact]) -> None:
        assert rehearsed.before is not None
        self._parts = parts
        self._run = program_of(rehearsed.before, rehearsed.parameters).run
        self._schemas = parts.describe([one.reference for one in rehearsed.definitions if numbers_of(one)])
        self._definitions = rehearsed.definitions
        self._convex = [rehearsed.convex.get(one.text, ()) for one in rehearsed.definitions]
        self._slicings = [rehearsed.slicings.get(one.text, ()) for one in rehearsed.definitions]
        self._expected = rehearsed.expected
        self._pattern = self._pattern_of(rehearsed.definitions)
        self._likeness = rehearsed.likeness
        self._others = {file: stored for file, stored in assets.items() if not stored.sha256.startswith(TOKEN)}
        stems = {text: one.stem for text, one in self._traced_definitions(rehearsed.definitions).items()}
        order = list(stems)
        self.names: list[str] = []
        self._named: list[tuple[int, int, str]] = []
        for file, stored in assets.items():
            if stored.sha256.startswith(TOKEN):
                record, mesh = map(int, stored.sha256.removeprefix(TOKEN).split(":"))
                name = file.rpartition(".")[0]
                self.names.append(name)
                self._named.append((record, mesh, name.removeprefix(stems[order[record]])))
        self._kept: OrderedDict[tuple[float, ...], Exchanged | None] = OrderedDict()

    def of(self, values: Sequence[float]) -> Exchanged | None:
        """Return the numbers and meshes of the parts for these values of the variables.

        Return None if the plan does not apply to these values. Parts that the store does not contain are built.
        """
        given = self._run(*values)
        if given is None:
            return None
        if given not in self._kept:
            self._kept[given] = self._find_parts(given)
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(given)
        return self._kept[given]

    def prepare(self, many: Iterable[Sequence[float]]) -> None:
        """Build the parts for several sets of values of the variables at the same time."""
        given = (one for one in map(self._run, *zip(*many, strict=True)) if one is not None and one not in self._kept)
        if definitions := [self._definitions_at(one) for one in given]:
            self._records_of(definitions)

    def _traced_definitions(self, definitions: Sequence[PartDefinition]) -> dict[str, PartDefinition]:
        """Map the texts of all definitions that depend on traced numbers in the traced compilation to the new definitions."""
        return {one.text: one for one, rehearsed in zip(definitions, self._definitions, strict=True) if numbers_of(rehearsed)}

    def _pattern_of(self, definitions: Sequence[PartDefinition]) -> list[int]:
        """For each part definition, return the index of the first definition with the same text.

        The list includes definitions that other parts expect.
        """
        first: dict[str, int] = {}
        return [first.setdefault(text, place) for place, text in enumerate((*(one.text for one in definitions), *self._expected))]

    def _find_parts(self, given: tuple[float, ...]) -> Exchanged | None:
        definitions = self._definitions_at(given)
        if self._pattern_of(definitions) != self._pattern:
            return None
        traced, texts = self._traced_definitions(definitions), [one.text for one in definitions]
        records = self._records_of([definitions])
        modelled = [record for text in traced if isinstance(record := records.get(text), PartRecord) and record.exact]
        if len(modelled) < len(traced):
            return None
        walk = _Walk(texts, lambda value: value)
        for record in modelled:
            walk.through(record)
        for record in modelled:
            walk.slices(record)
        if tuple(walk.rest) != self._likeness:
            return None
        stems = [one.stem for one in traced.values()]
        names = tuple(stems[record] + suffix for record, _, suffix in self._named)
        meshes = [walk.meshes[record, mesh] for record, mesh, _ in self._named]
        own = {f"{name}.obj": StoredArtifact(sha256=mesh.sha256, size=mesh.size) for name, mesh in zip(names, meshes, strict=True)}
        if len({file.casefold() for file in (*own, *self._others)}) < len(names) + len(self._others):
            return None  # two meshes with the same name, which is an error
        return Exchanged(numbers=tuple(walk.numbers), names=names, assets={**self._others, **own})

    def _definitions_at(self, given: Sequence[float]) -> list[PartDefinition]:
        """Return all part definitions of the traced compilation, with the numbers `given` in place of the traced numbers."""
        numbers = iter(given)
        return [self._make_definition(one, numbers) if numbers_of(one) else one for one in self._definitions]

    def _records_of(self, many: Sequence[Sequence[PartDefinition]]) -> Mapping[str, PartRecord | PartFailure]:
        """Return a mapping from definition texts to part records, for those definitions that depend on traced numbers.

        Records of parts that could be built also contain slicing results.
        """
        asked = {text: one for definitions in many for text, one in self._traced_definitions(definitions).items()}
        wanted = [
            (one.text, pieces, slicings) for definitions in many
            for one, pieces, slicings in zip(definitions, self._convex, self._slicings, strict=True)
        ]
        records = self._parts.realize(list(asked.values()), convex={text: pieces for text, pieces, _ in wanted if pieces})
        made = [one for text, one in asked.items() if isinstance(record := records.get(text), PartRecord) and record.exact]
        texts = {one.text for one in made}
        return self._parts.slice(made, records, {text: slicings for text, _, slicings in wanted if text in texts and slicings})

    def _make_definition(self, rehearsed: PartDefinition, numbers: Any) -> PartDefinition:
        """Return a part definition of the traced compilation with other numbers in place of its traced numbers."""
        if rehearsed.plain is not None and rehearsed.mirror is not None:
            return self._make_definition(rehearsed.plain, numbers).mirror_image(rehearsed.mirror)
        values = {name: next(numbers) if isinstance(value, Traced) else value for name, value in rehearsed.parameters}
        schema = self._schemas[rehearsed.reference]
        assert isinstance(schema, PartSchema)
        return schema.definition(values)


TOKEN = "mesh "
"""Prefix of the token that replaces the hash of a varying mesh. The prefix is followed by the numbers of the record and of the mesh."""


class _Walk:
    """Visits all numbers in part records in a fixed order, and replaces each number by the result of the function `number`.

    The list `rest` collects all other values on which models depend. `texts` contains the texts of all part definitions. In `rest`, each
    text is replaced by its index.
    """

    def __init__(self, texts: Sequence[str], number: Callable[[float], Any]) -> None:
        self._texts = list(texts)
        self._number = number
        self._record = self._mesh = 0
        self._plain: Collection[float] = _PLAIN
        self.numbers: list[Any] = []
        self.meshes: dict[tuple[int, int], Mesh] = {}
        self.rest: list[Hashable] = []

    def slices(self, record: PartRecord) -> Any:
        """Return the slicing results of a part record, with replaced numbers."""
        return self._replace_field("slices", record)

    def through(self, record: PartRecord) -> PartRecord:
        """Return a copy of a part record with replaced numbers and meshes. The copy does not contain slicing results."""
        known = {name: getattr(record, name) for name in record.__struct_fields__ if name in _ASIDE}
        changed = {name: self._replace_field(name, record) for name in record.__struct_fields__ if name not in known}
        self._record, self._mesh = self._record + 1, 0
        return PartRecord(**known, **changed)

    def _replace_field(self, name: str, record: PartRecord) -> Any:
        """Return the value of one field of a part record, with replaced numbers."""
        self._plain = () if name in _MEASURED else _PLAIN
        return self._of(getattr(record, name))

    def _of(self, value: Any) -> Any:
        if type(value) is float and value not in self._plain:
            made = self._number(value)
            self.numbers.append(made)
            return made
        if isinstance(value, Mesh):
            place = (self._record, self._mesh)
            self.meshes[place] = value
            self._mesh += 1
            self.rest.append((value.closed, value.flat))
            return replace(value, sha256=f"{TOKEN}{place[0]}:{place[1]}")
        if isinstance(value, MountRecord):  # `interface` is used in messages only
            features = self._of(value.features)
            self.rest.append(value.contradictions)
            return replace(value, pose=self._of(value.pose), tolerance=self._of(value.tolerance), features=features)
        if isinstance(value, MountExpectation):
            what: Hashable = self._texts.index(value.text) if value.text in self._texts else value.text
            self.rest.append((value.mount, what, value.child_mount))
            return value
        if isinstance(value, Mapping):
            self.rest.append(tuple(value))
            return {name: self._of(one) for name, one in value.items()}
        if isinstance(value, tuple):
            self.rest.append(len(value))
            return tuple(self._of(one) for one in value)
        if isinstance(value, FrozenStruct):
            self.rest.append(type(value))
            return replace(value, **{name: self._of(getattr(value, name)) for name in value.__struct_fields__})
        self.rest.append(repr(value))
        return value


def numbers_of(definition: PartDefinition) -> list[Traced]:
    """Return the traced numbers in a part definition, in order."""
    values: Sequence[tuple[str, Any]] = definition.parameters
    return [value for _, value in values if isinstance(value, Traced)]


def _plain(definition: PartDefinition) -> PartDefinition:
    """Return a copy of a part definition in which each traced number is replaced by its value."""
    plain = None if definition.plain is None else _plain(definition.plain)
    return replace(definition, parameters=tuple((name, value_of(one)) for name, one in definition.parameters), plain=plain)
