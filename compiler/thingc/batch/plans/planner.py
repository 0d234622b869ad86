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
from thingc.batch.plans.numeric_plan import NumericPlan, PlanCache, Template
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

Result = TypeVar("Result")

FORMS = 256
"""Maximum number of caches, and maximum total number of plans in all caches. If this number is exceeded, all plans are dropped."""
SIDES = (1.0, -1.0)
"""Directions in which settings are changed to get sample settings. A plan is checked at the samples before it is used.

If a number is at its bound, the sample in one of the two directions is valid.
"""


Make = Callable[[Compilation, Tape], Any]
"""A function that computes a model, files or results from a traced compilation."""
Finish = Callable[[TraceResult, Exchange | None], tuple[Sequence[Any], Template]]
"""A function that returns the inputs that a plan computes, and the object that uses these inputs."""


class PlanMaker(ABC, Generic[Template, Result]):
    """Creates plans that compute objects of the type `Result`, from traced compilations of the given modes (none: all modes).

    A new plan is compared with compilations before its first use. Then, some uses of the plan are compared, too. If `verify` is a number n,
    these are the first use of each plan, and then one in n (0: none). If `verify` is None, these are the first, second, fourth, eighth and
    so on.

    Attributes:
        wrong: The text for messages about a plan whose result differs from a compilation.
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
    def run_passes(self, parsed: ParsedSettings) -> Result | None:
        """Compile the document with the given settings. Return None if the settings are refused."""

    @abstractmethod
    def compute(self, plan: NumericPlan[Template], outputs: Any, parsed: ParsedSettings) -> Result | None:
        """Insert the outputs of a plan into its template. If it becomes invalid, return None or raise `ValueError`."""

    def difference(self, computed: Result, compiled: Result) -> str:
        """Compare the object that a plan computed with the compiled object. Describe the difference, or return an empty string."""
        return "" if computed == compiled else self.wrong

    def assets(self, traced: Any) -> Mapping[str, StoredArtifact]:
        """Return the meshes in the result of a traced compilation."""
        return {}

    def new_plan(
        self, parsed: ParsedSettings, cache: PlanCache[Template], first: Result, make: Make, finish: Finish[Template], *,
        applies: bool = True,
    ) -> NumericPlan[Template] | None:
        """Create a plan for settings with the same names as these settings, and compare the plan with compilations.

        If no plan can be created, store the reason in `cache` and return None. `first` is the result of a compilation with these settings.
        The compilation is traced with numbers near the given numbers, because round numbers can be special cases. If the resulting plan
        does not apply to the settings, for example to integers, and `applies` is True, the compilation is traced with the numbers
        themselves.
        """
        plan = self._traced_plan(parsed, cache, make, finish, nearby=True)
        if applies and plan is not None and plan.outputs(parsed.values) is None:
            plan = self._traced_plan(parsed, cache, make, finish, nearby=False)
        if plan is None:
            return None
        for sample in self._samples(parsed, cache):
            outputs = plan.outputs(sample.values)
            compiled = None if outputs is None else first if sample is parsed else self.run_passes(sample)
            if compiled is None:
                continue
            try:
                computed = self.compute(plan, outputs, sample)
                difference = "" if computed is None else self.difference(computed, compiled)
            except ValueError as fault:
                difference = f"{self.wrong}: {' '.join(str(fault).split())}"
            if difference:
                cache.failure = f"a plan gave {difference}"
                return None
        return plan

    def confirms(self, computed: Result, compiled: Result | None, parsed: ParsedSettings, cache: PlanCache[Template]) -> bool:
        """Return whether the object that a plan computed equals the compiled object.

        Otherwise, drop the plans of `cache` and create no further plans. `compiled` is None if the compilation refused the settings.
        """
        difference = self.wrong if compiled is None else self.difference(computed, compiled)
        if difference:
            cache.plans, cache.failure = [], f"a plan gave {difference} for {dict(zip(parsed.names, parsed.values))}"
        return not difference

    def _traced_plan(
        self, parsed: ParsedSettings, cache: PlanCache[Template], make: Make, finish: Finish[Template], *, nearby: bool,
    ) -> NumericPlan[Template] | None:
        while cache.failure is None:
            free = [name for name in parsed.names if name not in cache.reasons]
            if not free:
                cache.failure = "no number can be traced"
                break
            trace = self._trace(parsed, cache, make, nearby=nearby)
            if trace is None:  # retry with fewer numbers
                continue
            exchange: Exchange | None = None
            if self.exchanges_parts and trace.parts is not None:
                exchange = Exchange(trace.parts, self.session.environment.parts, self.assets(trace.result))
            try:
                outputs, template = finish(trace, exchange)
            except NotTraceable as fault:
                cache.give_up(fault.names, fault.why)
                continue
            return NumericPlan(
                free=tuple(parsed.names.index(name) for name in free),
                fixed=tuple((at, parsed.values[at]) for at, name in enumerate(parsed.names) if name in cache.reasons),
                program=program_of(trace.tape, outputs), template=template, exchange=exchange,
            )
        return None

    def _samples(self, parsed: ParsedSettings, cache: PlanCache[Any]) -> list[ParsedSettings]:
        """Return the settings for which a new plan is compared with compilations: the given ones, and nearby ones with the same parts."""
        settings = [parsed]
        same = cache.reasons.keys() | cache.modelled.keys()
        for side in SIDES:
            source = random.Random(0)
            quantities = self.reader.quantities(parsed)
            values = [
                parsed.values[at] if name in same else _nearby_quantity(quantities[name], source, side).value
                for at, name in enumerate(parsed.names)
            ]
            settings.append(ParsedSettings(names=parsed.names, values=tuple(values), texts=parsed.texts))
        return list(dict.fromkeys(settings))

    def _trace(self, parsed: ParsedSettings, cache: PlanCache[Any], make: Make, *, nearby: bool) -> TraceResult | None:
        """Trace a compilation in which all settings are variables that are numbers and can be traced.

        If the trace fails, record in `cache` which numbers cannot be traced, and return None. The caller then tries again.
        """
        quantities = self.reader.quantities(parsed)
        free = {name: quantities[name] for name in parsed.names if name not in cache.reasons}
        texts = {**{name: text_of(number) for name, number in quantities.items()}, **dict(parsed.texts)}  # ordered as in `SettingsReader`
        exact = [name for name in free if name in cache.modelled]
        varied = {name: free[name] if name in exact or not nearby else _nearby_quantity(free[name], random.Random(name)) for name in free}
        attempt = partial(self._attempt, make)
        trace, fault = attempt(varied, texts, exact)
        if fault is not None:
            trace, other = attempt(free, texts, exact)
            fault = fault if other is not None and other.unused else other  # the document already has this value, so no pass asks for it
        if fault is not None:
            culprits = [name for name in fault.names if name in free]
            if fault.modelled and self.exchanges_parts and (new := [name for name in culprits if name not in exact]):
                cache.modelled.update(dict.fromkeys(new, fault.why))
            else:
                cache.give_up(culprits or exact or _culprits(varied, texts, attempt), fault.why)
            return None
        assert trace is not None
        if pinned := pinned_names(trace):
            cache.give_up(pinned, "a pass needs the exact value")
            return None
        return trace

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
    """Return the names of the numbers that cannot be traced even if all other numbers are constant."""
    if len(numbers) == 1:
        return list(numbers)
    fixed_texts = {name: {**texts, **{other: text_of(number) for other, number in numbers.items() if other != name}} for name in numbers}
    return [name for name, others in fixed_texts.items() if attempt({name: numbers[name]}, others)[0] is None]


def _nearby_quantity(quantity: Quantity, source: random.Random, side: float = 1.0) -> Quantity:
    """Return a quantity that is close to the given quantity.

    For a quantity near 0, return a positive quantity, because many numbers must not be negative.
    """
    share = side * source.uniform(-1e-3, 1e-3)
    return Quantity(quantity.value * (1.0 + share) if quantity.value else abs(share), quantity.dimension)


class Planner(PlanMaker[Template, Result]):
    """Computes an object of the type `Result` for many settings, with plans or by compilations.

    A plan is created when `patience` settings with the same names have been compiled, but not for settings that `refusals` recognizes as
    invalid.
    """

    def __init__(
        self, session: Session, reader: SettingsReader, modes: Sequence[str], refusals: Refusals, *, verify: int | None, patience: int = 2,
    ) -> None:
        super().__init__(session, reader, modes, verify=verify)
        self.refusals = refusals
        self.caches: dict[Hashable, PlanCache[Template]] = {}
        self._patience = patience

    @abstractmethod
    def plan(self, parsed: ParsedSettings, cache: PlanCache[Template]) -> NumericPlan[Template] | None:
        """Create a plan that gives the same objects as compilations.

        If no plan can be created, store the reason in `cache` and return None.
        """

    def cache_for(self, parsed: ParsedSettings) -> PlanCache[Template]:
        """Return the cache of plans for settings with the same names of numbers and the same values of all other settings."""
        key = (parsed.names, parsed.texts)
        if key not in self.caches:
            if len(self.caches) >= FORMS or sum(len(cache.plans) for cache in self.caches.values()) >= FORMS:
                self.caches.clear()
            self.caches[key] = PlanCache(self._patience)
        return self.caches[key]

    def find_plan(self, parsed: ParsedSettings) -> tuple[NumericPlan[Template], tuple[float, ...]] | None:
        """Return the plan that applies to the settings, and the outputs of the plan. Return None if no plan applies.

        If no plan applies, and the settings are not known to be refused, create a plan if this is likely to save time.
        """
        if parsed.report is not None or not parsed.names:
            return None
        cache = self.cache_for(parsed)
        known = cache.find(parsed)
        if known is not None or self.refusals.problems(parsed) is not None or not cache.should_create_plan(parsed):
            return known
        plan = self.plan(parsed, cache)
        if plan is None:
            return None
        cache.add(plan)
        return cache.find(parsed)
