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

CACHED = 512
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
    number. If parts must not depend on the number, `PartDependsOnNumber` is raised. `tape_before` is a copy of the tape before the new
    variables were added, or None if no part definition contains traced numbers.
    """

    def __init__(self, parts: PartSource, allowed: Callable[[Traced], bool]) -> None:
        self._parts = parts
        self._allowed = allowed
        self.definitions: tuple[PartDefinition, ...] = ()
        self.convex: Mapping[str, tuple[int, ...]] = {}
        self.slicings: dict[str, Collection[Slicing]] = {}
        self.expected: list[str] = []
        self.tape_before: Tape | None = None
        self._records: dict[str, PartRecord] = {}
        self._walk = _RecordWalk((), float)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._parts, name)

    def realize(self, definitions: Sequence[PartDefinition], convex: Any = None, likely: object = None, **named: Any) -> Any:
        """Return the part records for the given definitions, in the same way as `PartSource`. Call this method only once.

        The argument `likely` is ignored, because it may contain traced numbers.
        """
        traced = [definition for definition in definitions if numbers_of(definition)]
        for definition in traced:
            if forbidden := [number for number in numbers_of(definition) if not self._allowed(number)]:
                raise PartDependsOnNumber(definition, forbidden[0])
        records = self._parts.realize([_plain(definition) for definition in definitions], convex=convex or {}, **named)
        if not traced:
            return records
        self.definitions, self.convex = tuple(definitions), convex or {}
        numbers = self.parameters
        tape = numbers[0].tape
        self.tape_before = tape.copy()
        self._walk = _RecordWalk([definition.text for definition in definitions], lambda value: tape.variable(value, numbers))
        answers = dict(records)
        others = [records[definition.text] for definition in definitions if not numbers_of(definition)]
        self.expected = [one.text for record in others if isinstance(record, PartRecord) for one in record.expectations]
        for definition in traced:
            record = records[definition.text]
            if not isinstance(record, PartRecord):
                raise PartDependsOnNumber(definition)
            if definition.text not in self._records:
                self._records[definition.text] = record
                answers[definition.text] = self._walk.replace_record(record)
        return answers

    @property
    def fixed_values(self) -> tuple[Hashable, ...]:
        """All values in part records except numbers and meshes. A plan applies to other numbers only if these values are the same."""
        return tuple(self._walk.other_values)

    @property
    def parameters(self) -> list[Traced]:
        """All traced numbers in part definitions, in order."""
        return [number for definition in self.definitions for number in numbers_of(definition)]

    @property
    def quotable_texts(self) -> list[str]:
        """The strings with digits in part records that messages may quote, such as labels of other parts."""
        records = self._records.values()
        texts = [one.interface or "" for record in records for one in record.mounts.values()]
        texts += [text for record in records for one in record.expectations for text in (one.label, one.text)]
        return [text for text in texts if any(map(str.isdigit, text))]

    def slice(self, definitions: Sequence[PartDefinition], records: Any, slicings: Mapping[str, Collection[Slicing]]) -> Any:
        """Return the part records with slicing results, in the same way as `PartSource`."""
        for definition in definitions:
            for slicing in slicings.get(definition.text, ()):
                for value in (*slicing.up, *astuple(slicing)):
                    if isinstance(value, Traced):
                        raise PartDependsOnNumber(definition, value)
        answers = self._parts.slice([_plain(definition) for definition in definitions], {**records, **self._records}, slicings)
        self.slicings = {text: slicings[text] for text in self._records if text in slicings}
        sliced = {}
        for definition in (definition for definition in definitions if definition.text in self._records and definition.text not in sliced):
            record = answers[definition.text]
            if not isinstance(record, PartRecord):
                raise PartDependsOnNumber(definition)
            sliced[definition.text] = replace(records[definition.text], slices=self._walk.replace_slices(record))
        return {**answers, **sliced}


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

    `traced` contains the parts of the traced compilation, and `parts` provides further part records. `assets` contains the meshes of the
    traced model, keyed by file name, and `names` contains the names of all meshes that are replaced.
    """

    def __init__(self, traced: TracedParts, parts: PartSource, assets: Mapping[str, StoredArtifact]) -> None:
        assert traced.tape_before is not None
        self._parts = parts
        self._run = program_of(traced.tape_before, traced.parameters).run
        self._schemas = parts.describe([definition.reference for definition in traced.definitions if numbers_of(definition)])
        self._definitions = traced.definitions
        self._convex = [traced.convex.get(definition.text, ()) for definition in traced.definitions]
        self._slicings = [traced.slicings.get(definition.text, ()) for definition in traced.definitions]
        self._expected = traced.expected
        self._pattern = self._pattern_of(traced.definitions)
        self._fixed_values = traced.fixed_values
        self._fixed_meshes = {file: stored for file, stored in assets.items() if not stored.sha256.startswith(TOKEN)}
        stems = {text: definition.stem for text, definition in self._traced_definitions(traced.definitions).items()}
        order = list(stems)
        self.names: list[str] = []
        self._mesh_names: list[tuple[int, int, str]] = []
        for file, stored in assets.items():
            if stored.sha256.startswith(TOKEN):
                record, mesh = map(int, stored.sha256.removeprefix(TOKEN).split(":"))
                name = file.rpartition(".")[0]
                self.names.append(name)
                self._mesh_names.append((record, mesh, name.removeprefix(stems[order[record]])))
        self._cached: OrderedDict[tuple[float, ...], Exchanged | None] = OrderedDict()

    def of(self, values: Sequence[float]) -> Exchanged | None:
        """Return the numbers and meshes of the parts for these values of the variables.

        Return None if the plan does not apply to these values. Parts that the store does not contain are built.
        """
        numbers = self._run(*values)
        if numbers is None:
            return None
        if numbers not in self._cached:
            self._cached[numbers] = self._find_parts(numbers)
            if len(self._cached) > CACHED:
                self._cached.popitem(last=False)
        self._cached.move_to_end(numbers)
        return self._cached[numbers]

    def prepare(self, rows: Iterable[Sequence[float]]) -> None:
        """Build the parts for several sets of values of the variables at the same time."""
        new = (numbers for numbers in map(self._run, *zip(*rows, strict=True)) if numbers is not None and numbers not in self._cached)
        if definitions := [self._definitions_at(numbers) for numbers in new]:
            self._records_of(definitions)

    def _traced_definitions(self, definitions: Sequence[PartDefinition]) -> dict[str, PartDefinition]:
        """Return those new definitions that depend on traced numbers in the traced compilation, keyed by definition text."""
        return {new.text: new for new, traced in zip(definitions, self._definitions, strict=True) if numbers_of(traced)}

    def _pattern_of(self, definitions: Sequence[PartDefinition]) -> list[int]:
        """For each part definition, return the index of the first definition with the same text. Include the expected definitions.

        If two definitions become equal for other numbers, or no longer equal, the plan does not apply.
        """
        first: dict[str, int] = {}
        texts = (*(definition.text for definition in definitions), *self._expected)
        return [first.setdefault(text, place) for place, text in enumerate(texts)]

    def _find_parts(self, values: tuple[float, ...]) -> Exchanged | None:
        definitions = self._definitions_at(values)
        if self._pattern_of(definitions) != self._pattern:
            return None
        traced, texts = self._traced_definitions(definitions), [definition.text for definition in definitions]
        records = self._records_of([definitions])
        modelled = [record for text in traced if isinstance(record := records.get(text), PartRecord) and record.exact]
        if len(modelled) < len(traced):
            return None
        walk = _RecordWalk(texts, lambda value: value)
        for record in modelled:
            walk.replace_record(record)
        for record in modelled:
            walk.replace_slices(record)
        if tuple(walk.other_values) != self._fixed_values:
            return None
        stems = [definition.stem for definition in traced.values()]
        names = tuple(stems[record] + suffix for record, _, suffix in self._mesh_names)
        meshes = [walk.meshes[record, mesh] for record, mesh, _ in self._mesh_names]
        own_meshes = {f"{name}.obj": StoredArtifact(sha256=mesh.sha256, size=mesh.size) for name, mesh in zip(names, meshes, strict=True)}
        if len({file.casefold() for file in (*own_meshes, *self._fixed_meshes)}) < len(names) + len(self._fixed_meshes):
            return None  # two meshes with the same name, which is an error
        return Exchanged(numbers=tuple(walk.numbers), names=names, assets={**self._fixed_meshes, **own_meshes})

    def _definitions_at(self, values: Sequence[float]) -> list[PartDefinition]:
        """Return all part definitions of the traced compilation, with `values` in place of the traced numbers."""
        numbers = iter(values)
        return [self._make_definition(definition, numbers) if numbers_of(definition) else definition for definition in self._definitions]

    def _records_of(self, groups: Sequence[Sequence[PartDefinition]]) -> Mapping[str, PartRecord | PartFailure]:
        """Return a mapping from definition texts to part records, for those definitions that depend on traced numbers.

        Records of parts that could be built also contain slicing results.
        """
        requested = {text: definition for definitions in groups for text, definition in self._traced_definitions(definitions).items()}
        rows = [
            (definition.text, pieces, slicings) for definitions in groups
            for definition, pieces, slicings in zip(definitions, self._convex, self._slicings, strict=True)
        ]
        records = self._parts.realize(list(requested.values()), convex={text: pieces for text, pieces, _ in rows if pieces})
        exact = {text for text, record in records.items() if isinstance(record, PartRecord) and record.exact}
        built = [definition for text, definition in requested.items() if text in exact]
        texts = {definition.text for definition in built}
        return self._parts.slice(built, records, {text: slicings for text, _, slicings in rows if text in texts and slicings})

    def _make_definition(self, traced: PartDefinition, numbers: Any) -> PartDefinition:
        """Return a part definition of the traced compilation with other numbers in place of its traced numbers."""
        if traced.plain is not None and traced.mirror is not None:
            return self._make_definition(traced.plain, numbers).mirror_image(traced.mirror)
        values = {name: next(numbers) if isinstance(value, Traced) else value for name, value in traced.parameters}
        schema = self._schemas[traced.reference]
        assert isinstance(schema, PartSchema)
        return schema.definition(values)


TOKEN = "mesh "
"""Prefix of the token that replaces the hash of a varying mesh. The prefix is followed by the numbers of the record and of the mesh."""


class _RecordWalk:
    """Visits all numbers in part records in a fixed order, and replaces each number by the result of the function `number`.

    `other_values` collects all other values on which models depend. `texts` contains the texts of all part definitions. In
    `other_values`, each text is replaced by its index.
    """

    def __init__(self, texts: Sequence[str], number: Callable[[float], Any]) -> None:
        self._texts = list(texts)
        self._number = number
        self._record = self._mesh = 0
        self._plain: Collection[float] = _PLAIN
        self.numbers: list[Any] = []
        self.meshes: dict[tuple[int, int], Mesh] = {}
        self.other_values: list[Hashable] = []

    def replace_slices(self, record: PartRecord) -> Any:
        """Return the slicing results of a part record, with the numbers of the current settings."""
        return self._replace_field("slices", record)

    def replace_record(self, record: PartRecord) -> PartRecord:
        """Return a copy of a part record with replaced numbers and meshes. The copy does not contain slicing results."""
        known = {name: getattr(record, name) for name in record.__struct_fields__ if name in _ASIDE}
        changed = {name: self._replace_field(name, record) for name in record.__struct_fields__ if name not in known}
        self._record, self._mesh = self._record + 1, 0
        return PartRecord(**known, **changed)

    def _replace_field(self, name: str, record: PartRecord) -> Any:
        """Return the value of one field of a part record, with replaced numbers."""
        self._plain = () if name in _MEASURED else _PLAIN
        return self._replace(getattr(record, name))

    def _replace(self, value: Any) -> Any:
        if type(value) is float and value not in self._plain:
            replaced = self._number(value)
            self.numbers.append(replaced)
            return replaced
        if isinstance(value, Mesh):
            place = (self._record, self._mesh)
            self.meshes[place] = value
            self._mesh += 1
            self.other_values.append((value.closed, value.flat))
            return replace(value, sha256=f"{TOKEN}{place[0]}:{place[1]}")
        if isinstance(value, MountRecord):  # `interface` is used in messages only
            features = self._replace(value.features)
            self.other_values.append(value.contradictions)
            return replace(value, pose=self._replace(value.pose), tolerance=self._replace(value.tolerance), features=features)
        if isinstance(value, MountExpectation):
            child: Hashable = self._texts.index(value.text) if value.text in self._texts else value.text
            self.other_values.append((value.mount, child, value.child_mount))
            return value
        if isinstance(value, Mapping):
            self.other_values.append(tuple(value))
            return {name: self._replace(item) for name, item in value.items()}
        if isinstance(value, tuple):
            self.other_values.append(len(value))
            return tuple(self._replace(item) for item in value)
        if isinstance(value, FrozenStruct):
            self.other_values.append(type(value))
            return replace(value, **{name: self._replace(getattr(value, name)) for name in value.__struct_fields__})
        self.other_values.append(repr(value))
        return value


def numbers_of(definition: PartDefinition) -> list[Traced]:
    """Return the traced numbers in a part definition, in order."""
    values: Sequence[tuple[str, Any]] = definition.parameters
    return [value for _, value in values if isinstance(value, Traced)]


def _plain(definition: PartDefinition) -> PartDefinition:
    """Return a copy of a part definition in which each traced number is replaced by its value."""
    plain = None if definition.plain is None else _plain(definition.plain)
    return replace(definition, parameters=tuple((name, value_of(value)) for name, value in definition.parameters), plain=plain)
