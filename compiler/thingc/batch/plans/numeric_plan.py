"""Compute models or results for other numbers with a plan instead of a compilation.

Before a new plan is used, its results are compared with the results of compilations.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import count
from typing import Any, Generic, TypeVar

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import nan
from thingc.base.units import Quantity
from thingc.batch.plans.columns import Booleans, ColumnFunction, Floats, column_function
from thingc.batch.plans.part_exchange import Exchange, Exchanged
from thingc.batch.plans.program import Argument, Program, program_of
from thingc.batch.plans.tape import Const, Tape, Traced
from thingc.batch.plans.trace_compilation import NotTraceable, TraceResult, pinned, trace_compilation
from thingc.documents.expressions.value_text import text_of
from thingc.driver.pipeline import Compilation
from thingc.driver.session import Session
from thingc.driver.settings import ParsedSettings, SettingsReader
from thingc.targets.artifact import StoredArtifact

Made = TypeVar("Made")

MOST = 32
"""Maximum number of plans for settings with the same names and texts. The least recently used plans are dropped."""
PAYS = 32
"""Number of uses of existing plans after which another plan may be created, because creating a plan takes several compilations."""
SIDES = (1.0, -1.0)
"""Directions in which settings are changed to get sample settings. A plan is checked at the samples before it is used.

If a number is at its bound, the sample in one of the two directions is valid.
"""
EXCHANGED = (2, 4)
"""The numbers of uses after which a plan with exchanged parts is compared with a compilation, in addition to `verify`."""


@dataclass(frozen=True, eq=False, kw_only=True)
class NumericPlan(Generic[Made]):
    """A plan, which computes the numbers in a model, in files or in results from the values of settings.

    `program` computes the numbers, and `made` inserts the numbers into a model, files or results. `free` contains the indices of the
    settings that are variables of the program. `fixed` contains the indices of settings that must not change, and their values. If parts
    depend on the variables, `exchange` returns numbers from the records of these parts, which are further variables of the program.
    """

    free: tuple[int, ...]
    fixed: tuple[tuple[int, float], ...]
    program: Program
    made: Made
    exchange: Exchange | None = None
    _uses: Iterator[int] = field(default_factory=partial(count, 1), init=False, repr=False, compare=False)

    def outputs(self, values: Sequence[float]) -> tuple[float, ...] | None:
        """Compute the numbers for the object `made` from the values of all settings.

        Return None if the plan does not apply to the given values.
        """
        try:
            given = self.given(values)
            return None if given is None else self.program.run(*given)
        except (ArithmeticError, ValueError):
            return None

    def prepare(self, many: Sequence[Sequence[float]]) -> None:
        """Build the parts for several settings at the same time. Each element of `many` contains the values of all settings."""
        if self.exchange is not None and many:
            with suppress(ArithmeticError, ValueError):
                self.exchange.prepare([values[at] for at in self.free] for values in many)

    def given(self, values: Sequence[float]) -> tuple[float, ...] | None:
        """Convert the values of all settings to the values of the variables of `program`.

        Return None if the plan does not apply to the given values.
        """
        if any(values[at] != value for at, value in self.fixed):
            return None
        given = tuple(values[at] for at in self.free)
        if self.exchange is None:
            return given
        exchanged = self.exchange.of(given)
        return None if exchanged is None else (*given, *exchanged.numbers)

    def columns(self, values: Floats) -> tuple[Floats, Booleans]:
        """Compute the numbers for the object `made` for many settings at once.

        Each row of `values` `(k, n)` contains the values of all settings. Also return an array of flags that are True for the rows to which
        the plan applies. This method requires that no parts depend on the settings.
        """
        outputs, ok = self._columns(values[:, list(self.free)])
        for at, value in self.fixed:
            ok &= values[:, at] == value
        return outputs, ok

    @cached_property
    def _columns(self) -> ColumnFunction:
        return column_function(self.program)

    def exchanged(self, values: Sequence[float]) -> Exchanged | None:
        """Return the numbers and meshes of the parts for these values of settings, or None if no parts depend on the settings.

        The plan must apply to the given values.
        """
        return None if self.exchange is None else self.exchange.of([values[at] for at in self.free])

    def is_due(self, verify: int | None) -> bool:
        """Count a use of the plan, and return True if the result of this use must be compared with a compilation.

        The first use is compared, and then one in `verify` uses (None: the first, second, fourth, eighth ...; 0: none).
        """
        use = next(self._uses)
        if verify is None:
            return use & (use - 1) == 0
        return verify > 0 and (use % verify == 1 % verify or (self.exchange is not None and use in EXCHANGED))


class PlanCache(Generic[Made]):
    """Caches plans for settings that differ only in numbers.

    All cached plans have the same names of numbers, and the same values of all other settings. `why` contains the reason for each number
    that cannot be traced. For each traced number on which a part depends, `modelled` contains the part. `refused` is the reason why no plan
    can be created for any of the settings. A plan is created when `patience` settings without a plan have occurred. `patience` is a power
    of two.
    """

    def __init__(self, patience: int = 2) -> None:
        self.patience = patience
        self.plans: list[NumericPlan[Made]] = []
        self.why: dict[str, str] = {}
        self.modelled: dict[str, str] = {}
        self.refused: str | None = None
        self.missed = self.met = 0
        self._seen: dict[tuple[float, ...], int] = {}

    def plan_for(self, read: ParsedSettings) -> tuple[NumericPlan[Made], tuple[float, ...]] | None:
        """Return the plan that applies to the given settings, together with the numbers that the plan computes.

        Return None if no plan applies.
        """
        for number, plan in enumerate(self.plans):
            outputs = plan.outputs(read.values)
            if outputs is not None:
                self.met += 1
                if number:
                    self.plans.insert(0, self.plans.pop(number))
                return plan, outputs
        return None

    def worth_it(self, read: ParsedSettings) -> bool:
        """Return whether a plan should be created for these settings, to which no existing plan applies.

        Creating a plan takes as long as several compilations. For settings that may occur only once, a plan is therefore not created.
        Settings with numbers on which parts depend often occur only once.
        """
        if self.refused is not None:
            return False
        if not self.why:
            self.missed, self.met = (self.patience, 0) if self.met >= PAYS else (self.missed + 1, self.met)
            return self.missed >= self.patience and self.missed & (self.missed - 1) == 0
        held = tuple(value for name, value in zip(read.names, read.values) if name in self.why)
        if len(self._seen) > 1000:
            self._seen.clear()
        self._seen[held] = seen = self._seen.get(held, 0) + 1
        return len(self.why) < len(read.names) and seen >= self.patience and seen & (seen - 1) == 0

    def add(self, plan: NumericPlan[Made]) -> None:
        """Add a plan to the cache. If the cache contains too many plans, drop the least recently used plan."""
        self.plans = [plan, *self.plans[: MOST - 1]]

    def give_up(self, names: Collection[str], why: str) -> None:
        """Stop tracing the numbers with these names, for the reason `why`. If `names` is empty, do not create any further plans."""
        self.why.update((name, f"{self.modelled[name]}, and {why}" if name in self.modelled else why) for name in names)
        if not names:
            self.refused = why


class TracedResults:
    """The results of a traced compilation, by name. `outputs` contains all results that are traced numbers."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.outputs = [value for value in values.values() if isinstance(value, Traced)]
        self._names = [name for name, value in values.items() if isinstance(value, Traced)]
        self._all = {name: None if isinstance(value, Traced) else value for name, value in values.items()}

    def argument(self, name: str, program: Program) -> Argument:
        """Return the argument of a program that represents the result with this name.

        If the result has no value, return the constant NaN.
        """
        if name in self._names:
            return program.outputs[self._names.index(name)]
        value = self._all.get(name)
        return Const(nan if value is None else value)

    def of(self, outputs: Sequence[float]) -> dict[str, Any]:
        """Return a mapping from names to results, in which the traced numbers have the values `outputs`."""
        return {**self._all, **dict(zip(self._names, outputs, strict=True))}


Finish = Callable[[TraceResult, Exchange | None], tuple[Sequence[Any], Made]]
"""A function that returns the inputs that a plan computes, and the object that uses these inputs."""


class Tracing(FrozenStruct):
    """Creates plans from traced compilations of the given modes (none: all modes).

    The function `make` computes a model, files or results from each traced compilation. If `refused` is True, the compilation may fail. The
    function `assets` returns the meshes of a traced model. If `assets` is None, parts must not depend on traced numbers.
    """

    session: Session
    reader: SettingsReader
    modes: Sequence[str]
    make: Callable[[Compilation, Tape], Any]
    refused: bool = False
    assets: Callable[[Any], Mapping[str, StoredArtifact]] | None = None

    def plan(self, read: ParsedSettings, finish: Finish[Made], form: PlanCache[Made], *, nearby: bool = True) -> NumericPlan[Made] | None:
        """Create a plan for settings with the same names as these settings.

        If no plan can be created, store the reason in `form` and return None. With `nearby`, the compilation is traced with numbers near
        the given numbers, because round numbers can be special cases.
        """
        while form.refused is None:
            free = [name for name in read.names if name not in form.why]
            if not free:
                form.refused = "no number can be traced"
                break
            rehearsal = self._rehearse(read, form, nearby=nearby)
            if rehearsal is None:  # retry with fewer numbers
                continue
            exchange: Exchange | None = None
            if self.assets is not None and rehearsal.parts is not None:
                exchange = Exchange(rehearsal.parts, self.session.environment.parts, self.assets(rehearsal.made))
            try:
                outputs, made = finish(rehearsal, exchange)
            except NotTraceable as fault:
                form.give_up(fault.names, fault.why)
                continue
            return NumericPlan(
                free=tuple(read.names.index(name) for name in free),
                fixed=tuple((at, read.values[at]) for at, name in enumerate(read.names) if name in form.why),
                program=program_of(rehearsal.tape, outputs), made=made, exchange=exchange,
            )
        return None

    def plan_for(self, read: ParsedSettings, finish: Finish[Made], form: PlanCache[Made]) -> NumericPlan[Made] | None:
        """Create a plan that applies to the given settings. The compilation is traced with nearby numbers if possible.

        If the resulting plan does not apply to the settings, for example to integers, the compilation is traced with the numbers
        themselves.
        """
        plan = self.plan(read, finish, form)
        if plan is not None and plan.outputs(read.values) is None:
            return self.plan(read, finish, form, nearby=False)
        return plan

    def samples(self, read: ParsedSettings, form: PlanCache[Any]) -> list[ParsedSettings]:
        """Return settings at which a plan is compared with a compilation: the given settings, and nearby settings with the same parts."""
        settings = [read]
        for side in SIDES:
            source = random.Random(0)
            quantities = self.reader.quantities(read)
            values = [
                read.values[at] if name in form.why or name in form.modelled else _near(quantities[name], source, side).value
                for at, name in enumerate(read.names)
            ]
            settings.append(ParsedSettings(names=read.names, values=tuple(values), texts=read.texts))
        return list(dict.fromkeys(settings))

    def _rehearse(self, read: ParsedSettings, form: PlanCache[Any], *, nearby: bool) -> TraceResult | None:
        """Trace a compilation with all settings that are numbers and can be traced.

        If another attempt is necessary because `form` has changed, return None.
        """
        quantities = self.reader.quantities(read)
        free = {name: quantities[name] for name in read.names if name not in form.why}
        texts = {**{name: text_of(one) for name, one in quantities.items()}, **dict(read.texts)}  # ordered as in `SettingsReader`
        exact = [name for name in free if name in form.modelled]
        near = {name: one if name in exact or not nearby else _near(one, random.Random(name)) for name, one in free.items()}
        rehearsal, fault = self._attempt(near, texts, exact)
        if fault is not None:
            rehearsal, other = self._attempt(free, texts, exact)
            fault = fault if other is not None and other.unused else other  # the document already has this value, so no pass asks for it
        if fault is not None:
            named = [name for name in fault.names if name in free]
            if fault.modelled and self.assets is not None and (new := [name for name in named if name not in exact]):
                form.modelled.update(dict.fromkeys(new, fault.why))
            else:
                form.give_up(named or exact or self._culprits(near, texts), fault.why)
            return None
        assert rehearsal is not None
        if known := pinned(rehearsal):
            form.give_up(known, "a pass needs the exact value")
            return None
        return rehearsal

    def _attempt(
        self, numbers: Mapping[str, Quantity], texts: Mapping[str, str], exact: Collection[str] = (),
    ) -> tuple[TraceResult | None, NotTraceable | None]:
        """Trace a compilation in which the given numbers are variables.

        Return the result of the compilation, or the exception with the reason why the compilation cannot be traced. The settings in `texts`
        have fixed values. Parts may depend on the numbers in `exact`.
        """
        try:
            return trace_compilation(self.session, self.modes, numbers, texts, self.make, exact, refused=self.refused), None
        except NotTraceable as fault:
            return None, fault

    def _culprits(self, numbers: Mapping[str, Quantity], texts: Mapping[str, str]) -> list[str]:
        """Return the names of all numbers that cannot be traced even if no other number is traced."""
        if len(numbers) == 1:
            return list(numbers)
        alone = {name: {**texts, **{other: text_of(one) for other, one in numbers.items() if other != name}} for name in numbers}
        return [name for name, others in alone.items() if self._attempt({name: numbers[name]}, others)[0] is None]


def _near(quantity: Quantity, source: random.Random, side: float = 1.0) -> Quantity:
    """Return a quantity that is close to the given quantity.

    For a quantity near 0, return a positive quantity, because many numbers must not be negative.
    """
    share = side * source.uniform(-1e-3, 1e-3)
    return Quantity(quantity.value * (1.0 + share) if quantity.value else abs(share), quantity.dimension)
