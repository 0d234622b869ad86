"""Compute models or results for other numbers by a plan instead of a compilation. A plan is created once, and is checked against
compilations.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
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
"""Maximum number of plans for settings with the same names and texts; the least recently used are dropped."""
PAYS = 32
"""Number of uses of plans after which another plan may be created, because creating a plan takes several compilations."""
FORMS = 256
"""Maximum number of caches, and of plans in all caches. If it is exceeded, all plans are dropped."""
SIDES = (1.0, -1.0)
"""Directions of the samples near the settings of a plan at which the plan is checked before it is used.

If a number is at its bound, one of them is valid.
"""
EXCHANGED = (2, 4)
"""The uses of a plan with exchanged parts that are compared with compilations, in addition to those that `verify` selects.
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class NumericPlan(Generic[Made]):
    """A plan: a function that maps numbers to the inputs of `made`, which creates the result.

    `fixed` are the indices and values of numbers that must not change. `program` takes the values at `free`, and, if parts depend on them,
    the numbers that `exchange` returns from their records.
    """

    free: tuple[int, ...]
    fixed: tuple[tuple[int, float], ...]
    program: Program
    made: Made
    exchange: Exchange | None = None
    _uses: Iterator[int] = field(default_factory=partial(count, 1), init=False, repr=False, compare=False)

    def outputs(self, values: Sequence[float]) -> tuple[float, ...] | None:
        """Compute the inputs of `made` for the values of all names. Return None if the plan does not apply to these values."""
        try:
            given = self.given(values)
            return None if given is None else self.program.run(*given)
        except (ArithmeticError, ValueError):
            return None

    def prepare(self, many: Sequence[Sequence[float]]) -> None:
        """Build the parts for the values of all names of several settings at the same time."""
        if self.exchange is not None and many:
            with suppress(ArithmeticError, ValueError):
                self.exchange.prepare([values[at] for at in self.free] for values in many)

    def given(self, values: Sequence[float]) -> tuple[float, ...] | None:
        """Return the variables of `program` for the values of all names; None if the plan does not apply to them."""
        if any(values[at] != value for at, value in self.fixed):
            return None
        given = tuple(values[at] for at in self.free)
        if self.exchange is None:
            return given
        exchanged = self.exchange.of(given)
        return None if exchanged is None else (*given, *exchanged.numbers)

    def columns(self, values: Floats) -> tuple[Floats, Booleans]:
        """Compute the outputs for values `(k, n)`, and return whether the plan applies to each row. Parts must not depend on the numbers.
        """
        outputs, ok = self._columns(values[:, list(self.free)])
        for at, value in self.fixed:
            ok &= values[:, at] == value
        return outputs, ok

    @cached_property
    def _columns(self) -> ColumnFunction:
        return column_function(self.program)

    def exchanged(self, values: Sequence[float]) -> Exchanged | None:
        """Return the records of parts for values to which the plan applies. Return None if no parts depend on the values."""
        return None if self.exchange is None else self.exchange.of([values[at] for at in self.free])

    def is_due(self, verify: int | None) -> bool:
        """Count a use of the plan, and return whether its result must be compared with a compilation: the first use, then one in `verify`
        uses (None: the first, second, fourth, eighth ...; 0: none).
        """
        use = next(self._uses)
        if verify is None:
            return use & (use - 1) == 0
        return verify > 0 and (use % verify == 1 % verify or (self.exchange is not None and use in EXCHANGED))


class PlanCache(Generic[Made]):
    """The plans for settings that set the same names to the same texts and differ only in numbers.

    `why` has the reason for each number that is not traced, `modelled` the part that depends on each traced number, `refused` the reason
    why there is no plan at all. A plan is made for the `patience`-th (a power of two) settings without one.
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
        """Return the plan that applies to these settings, and its outputs, or None."""
        for number, plan in enumerate(self.plans):
            outputs = plan.outputs(read.values)
            if outputs is not None:
                self.met += 1
                if number:
                    self.plans.insert(0, self.plans.pop(number))
                return plan, outputs
        return None

    def worth_it(self, read: ParsedSettings) -> bool:
        """Return whether a plan should be created for settings that have no plan.

        This takes as long as some compilations, so it is not done for settings that may occur once only; numbers that parts depend on often
        do not occur again.
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
        """Add a plan, and drop the least recently used one if there are too many."""
        self.plans = [plan, *self.plans[: MOST - 1]]

    def give_up(self, names: Collection[str], why: str) -> None:
        """Stop tracing these numbers. Without numbers, stop creating plans."""
        self.why.update((name, f"{self.modelled[name]}, and {why}" if name in self.modelled else why) for name in names)
        if not names:
            self.refused = why

    def wrong(self, why: str) -> None:
        """Drop all plans and stop creating plans, because a plan gave a wrong result."""
        self.plans, self.refused = [], why


class PlanCaches(Generic[Made]):
    """The caches of plans, by the names and texts of settings. `patience` has the same meaning as in `PlanCache`.

    No plan is made for settings that `is_refused` returns True for.
    """

    def __init__(self, patience: int = 2, is_refused: Callable[[ParsedSettings], bool] = lambda read: False) -> None:
        self._patience = patience
        self._is_refused = is_refused
        self.kept: dict[Hashable, PlanCache[Made]] = {}

    def of(self, read: ParsedSettings) -> PlanCache[Made]:
        """Return the cache of plans for settings with these names and texts."""
        key = (read.names, read.texts)
        if key not in self.kept:
            if len(self.kept) >= FORMS or sum(len(form.plans) for form in self.kept.values()) >= FORMS:
                self.kept.clear()
            self.kept[key] = PlanCache(self._patience)
        return self.kept[key]

    def planned(
        self, read: ParsedSettings, make: Callable[[ParsedSettings, PlanCache[Made]], NumericPlan[Made] | None],
    ) -> tuple[NumericPlan[Made], tuple[float, ...]] | None:
        """Return the plan for settings and its outputs; None if the settings contain no numbers, or no plan applies to them.

        If there is no plan, and the settings are not known to be refused, make one if it is worth it.
        """
        if read.report is not None or not read.names:
            return None
        form = self.of(read)
        known = form.plan_for(read)
        if known is not None or self._is_refused(read) or not form.worth_it(read):
            return known
        plan = make(read, form)
        if plan is None:
            return None
        form.add(plan)
        return form.plan_for(read)


class TracedResults:
    """The results of a traced compilation by name. Some of the values are traced numbers, which are listed in `outputs`."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.outputs = [value for value in values.values() if isinstance(value, Traced)]
        self._names = [name for name, value in values.items() if isinstance(value, Traced)]
        self._all = {name: None if isinstance(value, Traced) else value for name, value in values.items()}

    def argument(self, name: str, program: Program) -> Argument:
        """Return the output of a program that corresponds to a name, or NaN if the name has no value."""
        if name in self._names:
            return program.outputs[self._names.index(name)]
        value = self._all.get(name)
        return Const(nan if value is None else value)

    def of(self, outputs: Sequence[float]) -> dict[str, Any]:
        """Return the results with the given numbers in the places of `outputs`."""
        return {**self._all, **dict(zip(self._names, outputs, strict=True))}


Finish = Callable[[TraceResult, Exchange | None], tuple[Sequence[Any], Made]]
"""Returns the inputs that a plan computes, and the object that uses them."""
Differs = Callable[[NumericPlan[Made], ParsedSettings, tuple[float, ...]], bool]
"""Returns whether a plan, with these outputs for settings, gives something else than their compilation."""


class Tracing(FrozenStruct):
    """Makes plans from traced compilations of `modes` (none: all), which may fail if `refused`, and what `make` computes from them.

    `assets` returns the meshes of a traced model; None: parts may not depend on traced numbers.
    """

    session: Session
    reader: SettingsReader
    modes: Sequence[str]
    make: Callable[[Compilation, Tape], Any]
    refused: bool = False
    assets: Callable[[Any], Mapping[str, StoredArtifact]] | None = None

    def plan(self, read: ParsedSettings, finish: Finish[Made], form: PlanCache[Made], *, nearby: bool = True) -> NumericPlan[Made] | None:
        """Create a plan for these settings. If this is impossible, return None and store the reason in `form`.

        `nearby`: trace numbers near these, which may be special.
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
        """Return a plan that is traced near the settings, or at them if it does not apply to them, such as to whole numbers."""
        plan = self.plan(read, finish, form)
        if plan is not None and plan.outputs(read.values) is None:
            return self.plan(read, finish, form, nearby=False)
        return plan

    def checked(
        self, plan: NumericPlan[Made] | None, read: ParsedSettings, form: PlanCache[Made], differs: Differs[Made], what: str,
    ) -> NumericPlan[Made] | None:
        """Return a plan if `what` it computes differs for no sample; else None, and make no more plans."""
        if plan is None:
            return None
        for sample in self.samples(read, form):
            outputs = plan.outputs(sample.values)
            if outputs is not None and differs(plan, sample, outputs):
                form.refused = f"a plan gave different {what}"
                return None
        return plan

    def samples(self, read: ParsedSettings, form: PlanCache[Any]) -> list[ParsedSettings]:
        """Return settings for checking a plan: the given settings, then settings near them that use the same parts."""
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
        """Trace the numbers that `form` does not exclude. Return None if `form` was changed and another attempt is necessary."""
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
        """Trace numbers; return the result, or why it is impossible. Texts are not traced. Parts may depend on numbers in `exact`."""
        try:
            return trace_compilation(self.session, self.modes, numbers, texts, self.make, exact, refused=self.refused), None
        except NotTraceable as fault:
            return None, fault

    def _culprits(self, numbers: Mapping[str, Quantity], texts: Mapping[str, str]) -> list[str]:
        """Return the numbers that cannot be traced even if no other number is traced."""
        if len(numbers) == 1:
            return list(numbers)
        alone = {name: {**texts, **{other: text_of(one) for other, one in numbers.items() if other != name}} for name in numbers}
        return [name for name, others in alone.items() if self._attempt({name: numbers[name]}, others)[0] is None]


def _near(quantity: Quantity, source: random.Random, side: float = 1.0) -> Quantity:
    """Return a number near another number. Near 0, the result is positive, because many numbers must not be negative."""
    share = side * source.uniform(-1e-3, 1e-3)
    return Quantity(quantity.value * (1.0 + share) if quantity.value else abs(share), quantity.dimension)
