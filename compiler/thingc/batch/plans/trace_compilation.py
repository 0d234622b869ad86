"""One compilation with numbers on a tape: what of a document's numbers reaches a model, and how."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from pydantic import BaseModel

from thingc.base.frozen import dataclass
from thingc.base.memo import Memo
from thingc.base.source import Document
from thingc.base.units import Quantity
from thingc.batch.plans.part_exchange import PartDependsOnNumber, TracedParts
from thingc.batch.plans.program import variables_of
from thingc.batch.plans.tape import TOKENS, Tape, Traced, tracing
from thingc.documents.expressions.value_text import text_of
from thingc.documents.spec.assembly import AssemblySpec, ParameterSpec
from thingc.documents.spec.invalid_entries import Specs
from thingc.driver import pipeline
from thingc.driver.pipeline import Compilation
from thingc.driver.session import Session
from thingc.geometry.store.local import BlobMissing
from thingc.model.resolve import assembly
from thingc.model.resolve.set_values import substituted
from thingc.model.resolve.sources import Settings, Sources
from thingc.targets.artifact import StoredArtifact
from thingc.targets.mjcf.emit import sources as model_sources


class NotTraceable(Exception):
    """A number that cannot be followed: `names` are the settings that it comes from (none: nobody knows), `why` in words. `modelled`: a
    part is modelled by it. `unused`: no pass has asked for it."""

    def __init__(self, why: str, names: Sequence[str] = (), *, modelled: bool = False, unused: bool = False) -> None:
        super().__init__(why)
        self.why = why
        self.names = tuple(names)
        self.modelled = modelled
        self.unused = unused


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceResult:
    """What came of it: `made` of the compilation, whose numbers may be traced, the tape, and the names of the variables in their order
    (behind them those of records); `parts` where some are modelled by traced numbers."""

    made: Any
    tape: Tape
    names: tuple[str, ...]
    parts: TracedParts | None = None


def trace_compilation(
    session: Session, modes: Sequence[str], numbers: Mapping[str, Quantity], texts: Mapping[str, str],
    make: Callable[[Compilation, Tape], Any], exact: Collection[str] = (),
) -> TraceResult:
    """Compile modes (none named: all) with `numbers` traced, and `texts` as they are, both by parameter or path, and `make` something of
    that. By numbers that are `exact` parts may be modelled. Raises `NotTraceable`."""
    tape = Tape()
    parts = TracedParts(session.environment.parts, lambda number: set(_names(tape, list(numbers), number)) <= set(exact))
    environment = copy.copy(session.environment)
    environment.memo = Memo()
    environment.__dict__["parts"] = parts
    setting = _Setting(session, numbers, texts, tape)
    with tracing((assembly, "substituted", setting.substituted)):
        try:
            compilation = pipeline.recompile(environment, setting.sources(), setting.settings, modes)
            if lost := [name for name in setting.tokens.values() if name not in setting.put]:
                raise NotTraceable("it is not used", lost, unused=True)
            if compilation.report.failed or not compilation.robots:
                raise NotTraceable("it is not sound there")
            made = make(compilation, tape)
        except PartDependsOnNumber as fault:
            raise NotTraceable(f"`{fault.label}` is modelled by it", _names(tape, list(numbers), fault.number), modelled=True) from None
        except BlobMissing:
            raise NotTraceable("a pass looks at the mesh of a part that is modelled by it") from None
        except (TypeError, ValueError, ArithmeticError, AttributeError) as fault:
            raise NotTraceable(f"a pass takes no number that differs ({type(fault).__name__}: {fault})") from fault
    return TraceResult(made=made, tape=tape, names=tuple(numbers), parts=parts if parts.before is not None else None)


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenModel:
    """The text of a model, with tokens of the tape in it, and its meshes by file."""

    text: str
    assets: Mapping[str, StoredArtifact]


def written(session: Session, mode: str, *, floor: bool) -> Callable[[Compilation, Tape], WrittenModel]:
    """For `trace_compilation`: the model as it is written."""

    def make(compilation: Compilation, tape: Tape) -> WrittenModel:
        request = replace(pipeline.request_of(session.environment, compilation, verify=False), memo=Memo())
        tape.writing = True
        try:
            texts, assets = model_sources(request, floor=floor)
        finally:
            tape.writing = False
        if any(tape.forms.get(word) != "xml" for word in TOKENS.findall(texts[mode])):
            raise NotTraceable("it is worked with where the model is written")
        return WrittenModel(text=texts[mode], assets=assets)

    return make


def pinned(rehearsal: TraceResult) -> list[str]:
    """The settings of which a pass wanted to know the very value."""
    names: dict[str, None] = {}
    for number in rehearsal.tape.pinned:
        names.update(dict.fromkeys(_names(rehearsal.tape, rehearsal.names, number)))
    return list(names)


def _names(tape: Tape, names: Sequence[str], number: Traced) -> list[str]:
    return [names[k] for k in variables_of(tape, number) if k < len(names)]


class _Setting:
    """Numbers on a tape, put where settings go: in place of the values of parameters, and of what is put into a document by its path. There
    each has a stand-in first, a number beside it that nothing else in the document is, by which its place is found again."""

    def __init__(self, session: Session, numbers: Mapping[str, Quantity], texts: Mapping[str, str], tape: Tape) -> None:
        assert session.sources is not None
        self.own = session.sources
        self.traced = {
            name: Quantity(tape.variable(one.value), one.dimension) for name, one in numbers.items()  # type: ignore[arg-type]
        }
        self.numbers = numbers
        self.tokens: dict[str, str] = {}
        for name, one in numbers.items():
            if "." in name:
                self.tokens[text_of(_beside(one, lambda other: text_of(other) in {*self.tokens, *texts.values()}))] = name
        self.settings = Settings(
            parameters={name: text for name, text in texts.items() if "." not in name},
            choices={
                **{name: text for name, text in texts.items() if "." in name}, **{name: text for text, name in self.tokens.items()},
            },
        )
        self.put: set[str] = set()

    def sources(self) -> Sources:
        """The documents with traced numbers for the values of parameters."""
        relative = self.own.documents.root.relative
        spec = self.own.specs[relative]
        assert isinstance(spec, AssemblySpec)
        entries = dict(spec.parameters)
        for name in self.numbers:
            if "." not in name:
                entry, value = entries[name], self.traced[name]
                entries[name] = entry.model_copy(update={"value": value}) if isinstance(entry, ParameterSpec) else value
        changed = Specs({**self.own.specs, relative: spec.model_copy(update={"parameters": entries})})
        changed.doubts, changed.allowances = self.own.specs.doubts, self.own.specs.allowances
        return replace(self.own, specs=changed)

    def substituted(
        self, context: Any, document: Document, spec: AssemblySpec, values: Mapping[str, str],
    ) -> tuple[Document, AssemblySpec]:
        """What `resolve` does with values at paths, and then traced numbers in their place. (The document is validated anew: what was put
        into the values of its parameters is put there again.)"""
        parameters = spec.parameters
        named = {path: self.tokens[text] for path, text in values.items() if text in self.tokens}
        document, spec = substituted(context, document, spec, {path: text for path, text in values.items() if path not in named})
        there = set(_quantities(spec)) if named else set()
        stand_ins: dict[str, Quantity] = {}
        for path, name in named.items():
            stand_ins[path] = _beside(self.numbers[name], there.__contains__)
            there.add(stand_ins[path])
        document, spec = substituted(context, document, spec, {path: text_of(one) for path, one in stand_ins.items()})
        if values:
            spec = spec.model_copy(update={"parameters": parameters})
        for path, name in named.items():
            spec, places = _replaced(spec, stand_ins[path], self.traced[name])
            if not places:
                raise NotTraceable("it is no number where it is used", [name])
            self.put.add(name)
        return document, spec


def _beside(number: Quantity, taken: Callable[[Quantity], bool]) -> Quantity:
    """A number, or where that is taken the nearest one towards 0 (of next to nothing: above it) that is not."""
    towards = 0.0 if abs(number.value) > 1e-300 else 1.0
    while taken(number):
        number = Quantity(math.nextafter(number.value, towards), number.dimension)
    return number


def _quantities(value: Any) -> Iterator[Quantity]:
    """The numbers of a model."""
    if isinstance(value, Quantity):
        if type(value.value) is float:
            yield value
    elif isinstance(value, (BaseModel, Mapping, list, tuple)):
        inner = vars(value).values() if isinstance(value, BaseModel) else value.values() if isinstance(value, Mapping) else value
        for one in inner:
            yield from _quantities(one)


def _replaced(value: Any, old: Quantity, new: Quantity) -> tuple[Any, int]:
    """A model with `new` wherever it has `old`, and at how many places."""
    if isinstance(value, Quantity):
        return (new, 1) if type(value.value) is float and value == old else (value, 0)
    if isinstance(value, BaseModel):
        made = {name: _replaced(one, old, new) for name, one in vars(value).items()}
        count = sum(places for _, places in made.values())
        return (value.model_copy(update={name: one for name, (one, places) in made.items() if places}), count) if count else (value, 0)
    if isinstance(value, Mapping):
        entries = {name: _replaced(one, old, new) for name, one in value.items()}
        return {name: one for name, (one, _) in entries.items()}, sum(places for _, places in entries.values())
    if isinstance(value, (list, tuple)):
        items = [_replaced(one, old, new) for one in value]
        return type(value)(one for one, _ in items), sum(places for _, places in items)
    return value, 0
