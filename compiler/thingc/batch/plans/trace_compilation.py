"""Trace a compilation: record on a tape how a model, files or results depend on numbers in a document."""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.units import Quantity
from thingc.batch.plans.part_exchange import PartDependsOnNumber, TracedParts
from thingc.batch.plans.searches import SearchMemo
from thingc.batch.plans.tape import Tape, Traced, variables_of
from thingc.documents.expressions.value_text import text_of
from thingc.documents.spec.assembly import AssemblySpec, ParameterSpec
from thingc.documents.spec.invalid_entries import Specs
from thingc.driver.pipeline import Compilation
from thingc.driver.session import Session
from thingc.geometry.store.local import BlobMissing
from thingc.model.resolve.resolver import Settings, Sources


class NotTraceable(Exception):
    """Raised if a compilation cannot be traced with the given numbers. `why` is the reason for the failure.

    `names` contains the settings that cause the problem. If the cause is unknown, `names` is empty. `modelled` is True if a part depends on
    a number. `unused` is True if no compiler pass uses a number.
    """

    def __init__(self, why: str, names: Sequence[str] = (), *, modelled: bool = False, unused: bool = False) -> None:
        super().__init__(why)
        self.why = why
        self.names = tuple(names)
        self.modelled = modelled
        self.unused = unused


class TraceResult(FrozenStruct):
    """A traced compilation.

    `result` is the return value of the function `make`, and can contain traced numbers. `names` contains the names of the first variables
    of the tape. Further variables are numbers in part records. `parts` is None if no part depends on traced numbers.
    """

    result: Any
    tape: Tape
    names: tuple[str, ...]
    parts: TracedParts | None = None


def trace_compilation(
    session: Session, modes: Sequence[str], numbers: Mapping[str, Quantity], texts: Mapping[str, str],
    make: Callable[[Compilation, Tape], Any], exact: Collection[str] = (), *,
    refused: bool = False,
) -> TraceResult:
    """Compile modes (none: all), record on a tape how the compilation depends on `numbers`, and return the result of `make`.

    `numbers` and `texts` are mappings from names of parameters, or from paths in the document, to values. Settings in `texts` have the
    given values, but are not traced. Parts may depend on the numbers in `exact`. If `refused` is True, the compilation may fail, and its
    diagnostics contain slots for numbers. Raises `NotTraceable` if the compilation cannot be traced.
    """
    tape = Tape()
    tape.reporting = refused
    parts = TracedParts(session.environment.parts, lambda number: set(_names(tape, list(numbers), number)) <= set(exact))
    environment = copy.copy(session.environment)
    environment.memo = SearchMemo(tape)
    environment.__dict__["parts"] = parts
    traced = {name: Quantity(tape.variable(quantity.value), quantity.dimension) for name, quantity in numbers.items()}  # type: ignore[arg-type]
    changed = {} if refused else {name: quantity for name, quantity in traced.items() if "." not in name}  # defaults need fewer plans
    quantities = _Quantities({name: quantity for name, quantity in traced.items() if name not in changed})
    texts_by_name = {**texts, **{name: text_of(quantity) for name, quantity in (traced if refused else numbers).items()}}
    settings = Settings(
        parameters={name: text for name, text in texts_by_name.items() if "." not in name and name not in changed},
        choices={name: text for name, text in texts_by_name.items() if "." in name}, quantities=quantities,
    )
    sources = _with_parameters(session, changed)
    try:
        compilation = session.passes(environment, sources, settings, modes)
        if lost := [name for name in quantities if name not in quantities.used]:
            raise NotTraceable("the number is not used", lost, unused=True)
        if not refused and compilation.report.failed:
            raise NotTraceable("the document has errors with other values")
        result = make(compilation, tape)
    except PartDependsOnNumber as fault:
        why = f"the part `{fault.label}` depends on the number"
        raise NotTraceable(why, _names(tape, list(numbers), fault.number), modelled=True) from None
    except BlobMissing:
        raise NotTraceable("a pass reads the mesh of a part that depends on the number") from None
    except (TypeError, ValueError, ArithmeticError, AttributeError) as fault:
        raise NotTraceable(f"a pass does not support a varying number ({type(fault).__name__}: {fault})") from fault
    return TraceResult(result=result, tape=tape, names=tuple(numbers), parts=parts if parts.tape_before is not None else None)


def pinned_names(trace: TraceResult) -> list[str]:
    """Return the names of the settings whose values a compiler pass has converted to `int`, `float` or text.

    The tape applies only to these values.
    """
    return list(dict.fromkeys(name for number in trace.tape.pinned for name in _names(trace.tape, trace.names, number)))


def _names(tape: Tape, names: Sequence[str], number: Traced) -> list[str]:
    return [names[k] for k in variables_of(tape, number) if k < len(names)]


class _Quantities(dict[str, Quantity]):
    """A mapping from names of parameters, or from paths, to traced numbers.

    The set `used` contains the names that a compiler pass has looked up.
    """

    def __init__(self, numbers: Mapping[str, Quantity]) -> None:
        super().__init__(numbers)
        self.used: set[str] = set()

    def get(self, name: str, default: Any = None) -> Any:
        """Return the traced number with this name, and record the name in `used`. Return `default` if no traced number has this name."""
        self.used.add(name)
        return super().get(name, default)


def _with_parameters(session: Session, numbers: Mapping[str, Quantity]) -> Sources:
    """Return the documents in which the given numbers are the default values of parameters."""
    sources = session.sources
    assert sources is not None
    relative = sources.documents.root.relative
    spec = sources.specs[relative]
    assert isinstance(spec, AssemblySpec)
    entries = dict(spec.parameters)
    for name, value in numbers.items():
        entry = entries[name]
        entries[name] = entry.model_copy(update={"value": value}) if isinstance(entry, ParameterSpec) else value
    changed = Specs({**sources.specs, relative: spec.model_copy(update={"parameters": entries})})
    changed.doubts, changed.allowances = sources.specs.doubts, sources.specs.allowances
    return replace(sources, specs=changed)
