"""The base classes of everything that is computed with plans: results, models, builds and diagnostics.

Plans are created from traced compilations. Before a new plan is used, its results are compared with the results of compilations.
"""

from __future__ import annotations

import random
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from thingc.base.units import Quantity
from thingc.batch.plans.numeric_plan import Made, NumericPlan, PlanCache
from thingc.batch.plans.part_exchange import Exchange
from thingc.batch.plans.program import program_of
from thingc.batch.plans.tape import Tape
from thingc.batch.plans.trace_compilation import NotTraceable, TraceResult, pinned_names, trace_compilation
from thingc.documents.expressions.value_text import text_of
from thingc.driver.pipeline import Compilation
from thingc.driver.session import Session
from thingc.driver.settings import ParsedSettings, SettingsReader
from thingc.targets.artifact import StoredArtifact

if TYPE_CHECKING:
    from thingc.batch.plans.refusals import Refusals

Whole = TypeVar("Whole")

FORMS = 256
"""Maximum number of caches, and maximum total number of plans in all caches. If this number is exceeded, all plans are dropped."""
SIDES = (1.0, -1.0)
"""Directions in which settings are changed to get sample settings. A plan is checked at the samples before it is used.

If a number is at its bound, the sample in one of the two directions is valid.
"""


Make = Callable[[Compilation, Tape], Any]
"""A function that computes a model, files or results from a traced compilation."""
Finish = Callable[[TraceResult, Exchange | None], tuple[Sequence[Any], Made]]
"""A function that returns the inputs that a plan computes, and the object that uses these inputs."""


class PlanMaker(ABC, Generic[Made, Whole]):
    """Creates plans for objects of the type `Whole` from traced compilations of the given modes (none: all modes).

    A new plan is compared with compilations before its first use. Then, some uses of the plan are compared, too. If `verify` is a number n,
    these are the first use of each plan, and then one in n (0: none). If `verify` is None, these are the first, second, fourth, eighth and
    so on.

    Attributes:
        wrong: A description of a difference between an object and a compilation.
        exchanges_parts: Whether parts may depend on traced numbers.
        traces_failures: Whether the traced compilations fail.
    """

    wrong = "different results"
    exchanges_parts = True
    traces_failures = False

    def __init__(self, session: Session, reader: SettingsReader, modes: Sequence[str], *, verify: int | None) -> None:
        self.session = session
        self.reader = reader
        self.modes = tuple(modes)
        self.verify = verify

    @abstractmethod
    def whole(self, read: ParsedSettings) -> Whole | None:
        """Compile the document with the given settings. Return None if the settings are refused."""

    @abstractmethod
    def compute(self, plan: NumericPlan[Made], outputs: Any, read: ParsedSettings) -> Whole | None:
        """Compute the object with a plan from its outputs. Return None, or raise `ValueError`, if the object would be invalid."""

    def difference(self, made: Whole, whole: Whole) -> str:
        """Return a description of the difference between two objects, or an empty string if they are equal."""
        return "" if made == whole else self.wrong

    def assets(self, made: Any) -> Mapping[str, StoredArtifact]:
        """Return the meshes in the result of a traced compilation."""
        return {}

    def new_plan(
        self, read: ParsedSettings, form: PlanCache[Made], first: Whole, make: Make, finish: Finish[Made], *, applies: bool = True,
    ) -> NumericPlan[Made] | None:
        """Create a plan for settings with the same names as these settings, and compare the plan with compilations.

        If no plan can be created, store the reason in `form` and return None. `first` is the result of a compilation with these settings.
        The compilation is traced with numbers near the given numbers, because round numbers can be special cases. If the resulting plan
        does not apply to the settings, for example to integers, and `applies` is True, the compilation is traced with the numbers
        themselves.
        """
        plan = self._traced_plan(read, form, make, finish, nearby=True)
        if applies and plan is not None and plan.outputs(read.values) is None:
            plan = self._traced_plan(read, form, make, finish, nearby=False)
        if plan is None:
            return None
        for sample in self._samples(read, form):
            outputs = plan.outputs(sample.values)
            whole = None if outputs is None else first if sample is read else self.whole(sample)
            if whole is None:
                continue
            try:
                made = self.compute(plan, outputs, sample)
                wrong = "" if made is None else self.difference(made, whole)
            except ValueError as fault:
                wrong = f"{self.wrong}: {' '.join(str(fault).split())}"
            if wrong:
                form.refused = f"a plan gave {wrong}"
                return None
        return plan

    def confirms(self, made: Whole, whole: Whole | None, read: ParsedSettings, form: PlanCache[Made]) -> bool:
        """Return whether a plan has given the same object as a compilation. Otherwise, stop using plans for such settings."""
        wrong = self.wrong if whole is None else self.difference(made, whole)
        if wrong:
            form.plans, form.refused = [], f"a plan gave {wrong} for {dict(zip(read.names, read.values))}"
        return not wrong

    def _traced_plan(
        self, read: ParsedSettings, form: PlanCache[Made], make: Make, finish: Finish[Made], *, nearby: bool,
    ) -> NumericPlan[Made] | None:
        while form.refused is None:
            free = [name for name in read.names if name not in form.why]
            if not free:
                form.refused = "no number can be traced"
                break
            rehearsal = self._rehearse(read, form, make, nearby=nearby)
            if rehearsal is None:  # retry with fewer numbers
                continue
            exchange: Exchange | None = None
            if self.exchanges_parts and rehearsal.parts is not None:
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

    def _samples(self, read: ParsedSettings, form: PlanCache[Any]) -> list[ParsedSettings]:
        """Return settings at which a plan is compared with a compilation: the given settings, and nearby settings with the same parts."""
        settings = [read]
        for side in SIDES:
            source = random.Random(0)
            quantities = self.reader.quantities(read)
            values = [
                read.values[at] if name in form.why or name in form.modelled else _nearby_quantity(quantities[name], source, side).value
                for at, name in enumerate(read.names)
            ]
            settings.append(ParsedSettings(names=read.names, values=tuple(values), texts=read.texts))
        return list(dict.fromkeys(settings))

    def _rehearse(self, read: ParsedSettings, form: PlanCache[Any], make: Make, *, nearby: bool) -> TraceResult | None:
        """Trace a compilation with all settings that are numbers and can be traced.

        If another attempt is necessary because `form` has changed, return None.
        """
        quantities = self.reader.quantities(read)
        free = {name: quantities[name] for name in read.names if name not in form.why}
        texts = {**{name: text_of(one) for name, one in quantities.items()}, **dict(read.texts)}  # ordered as in `SettingsReader`
        exact = [name for name in free if name in form.modelled]
        near = {name: one if name in exact or not nearby else _nearby_quantity(one, random.Random(name)) for name, one in free.items()}
        attempt = partial(self._attempt, make)
        rehearsal, fault = attempt(near, texts, exact)
        if fault is not None:
            rehearsal, other = attempt(free, texts, exact)
            fault = fault if other is not None and other.unused else other  # the document already has this value, so no pass asks for it
        if fault is not None:
            named = [name for name in fault.names if name in free]
            if fault.modelled and self.exchanges_parts and (new := [name for name in named if name not in exact]):
                form.modelled.update(dict.fromkeys(new, fault.why))
            else:
                form.give_up(named or exact or _culprits(near, texts, attempt), fault.why)
            return None
        assert rehearsal is not None
        if known := pinned_names(rehearsal):
            form.give_up(known, "a pass needs the exact value")
            return None
        return rehearsal

    def _attempt(
        self, make: Make, numbers: Mapping[str, Quantity], texts: Mapping[str, str], exact: Collection[str] = (),
    ) -> tuple[TraceResult | None, NotTraceable | None]:
        """Trace a compilation in which the given numbers are variables.

        Return the result of the compilation, or the exception with the reason why the compilation cannot be traced. The settings in `texts`
        have fixed values. Parts may depend on the numbers in `exact`.
        """
        try:
            return trace_compilation(self.session, self.modes, numbers, texts, make, exact, refused=self.traces_failures), None
        except NotTraceable as fault:
            return None, fault


def _culprits(numbers: Mapping[str, Quantity], texts: Mapping[str, str], attempt: Callable[..., tuple[Any, Any]]) -> list[str]:
    """Return the names of all numbers that cannot be traced even if no other number is traced."""
    if len(numbers) == 1:
        return list(numbers)
    alone = {name: {**texts, **{other: text_of(one) for other, one in numbers.items() if other != name}} for name in numbers}
    return [name for name, others in alone.items() if attempt({name: numbers[name]}, others)[0] is None]


def _nearby_quantity(quantity: Quantity, source: random.Random, side: float = 1.0) -> Quantity:
    """Return a quantity that is close to the given quantity.

    For a quantity near 0, return a positive quantity, because many numbers must not be negative.
    """
    share = side * source.uniform(-1e-3, 1e-3)
    return Quantity(quantity.value * (1.0 + share) if quantity.value else abs(share), quantity.dimension)


class Planner(PlanMaker[Made, Whole]):
    """Computes an object of the type `Whole` for many settings, with plans or by compilations.

    A plan is created when `patience` settings with the same names have been compiled. No plan is created for settings that `refusals`
    recognizes.
    """

    def __init__(
        self, session: Session, reader: SettingsReader, modes: Sequence[str], refusals: Refusals, *, verify: int | None, patience: int = 2,
    ) -> None:
        super().__init__(session, reader, modes, verify=verify)
        self.refusals = refusals
        self.forms: dict[Hashable, PlanCache[Made]] = {}
        self._patience = patience

    @abstractmethod
    def plan(self, read: ParsedSettings, form: PlanCache[Made]) -> NumericPlan[Made] | None:
        """Create a plan that gives the same objects as compilations.

        If no plan can be created, store the reason in `form` and return None.
        """

    def form_of(self, read: ParsedSettings) -> PlanCache[Made]:
        """Return the cache of plans for settings with the same names of numbers and the same values of all other settings."""
        key = (read.names, read.texts)
        if key not in self.forms:
            if len(self.forms) >= FORMS or sum(len(form.plans) for form in self.forms.values()) >= FORMS:
                self.forms.clear()
            self.forms[key] = PlanCache(self._patience)
        return self.forms[key]

    def find_plan(self, read: ParsedSettings) -> tuple[NumericPlan[Made], tuple[float, ...]] | None:
        """Return the plan that applies to the settings, and the outputs of the plan. Return None if no plan applies.

        If no plan applies, and the settings are not known to be refused, create a plan if this is likely to save time.
        """
        if read.report is not None or not read.names:
            return None
        form = self.form_of(read)
        known = form.plan_for(read)
        if known is not None or self.refusals.applies(read) or not form.worth_it(read):
            return known
        plan = self.plan(read, form)
        if plan is None:
            return None
        form.add(plan)
        return form.plan_for(read)
