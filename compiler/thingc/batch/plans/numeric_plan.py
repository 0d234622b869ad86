"""Compute models or results for other numbers with a plan instead of a compilation."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import count
from typing import Any, Generic, TypeVar

from thingc.base.diagnostics import Diagnostic
from thingc.base.numeric import inf, nan
from thingc.batch.plans.columns import Booleans, ColumnFunction, Floats, column_function
from thingc.batch.plans.part_exchange import Exchange, Exchanged
from thingc.batch.plans.program import Argument, Program
from thingc.batch.plans.tape import Const, Traced
from thingc.driver.settings import ParsedSettings

Template = TypeVar("Template")

MOST = 32
"""Maximum number of plans for settings with the same names and texts. The least recently used plans are dropped."""
PAYS = 32
"""Number of uses of existing plans after which another plan may be created, because creating a plan takes several compilations."""
EXCHANGED = (2, 4)
"""The numbers of uses after which a plan with exchanged parts is compared with a compilation, in addition to `verify`."""


@dataclass(frozen=True, eq=False, kw_only=True)
class NumericPlan(Generic[Template]):
    """A plan, which computes the numbers in a model, in files or in results from the values of settings.

    `program` computes the numbers, and `template` inserts them into a model, files or results. `free` contains the indices of the settings
    that are variables of the program. `fixed` contains the indices and values of settings that must have these values. If parts depend on
    the variables, `exchange` returns the numbers in the records of these parts, which are further variables of the program.
    """

    free: tuple[int, ...]
    fixed: tuple[tuple[int, float], ...]
    program: Program
    template: Template
    exchange: Exchange | None = None
    _uses: Iterator[int] = field(default_factory=partial(count, 1), init=False, repr=False, compare=False)

    def outputs(self, values: Sequence[float]) -> tuple[float, ...] | None:
        """Compute the numbers for `template` from the values of all settings. Return None if the plan does not apply to these values."""
        try:
            variables = self.to_variables(values)
            return None if variables is None else self.program.run(*variables)
        except (ArithmeticError, ValueError):
            return None

    def prepare(self, rows: Sequence[Sequence[float]]) -> None:
        """Build the parts for several sets of settings in parallel. Each row contains the values of all settings."""
        if self.exchange is not None and rows:
            with suppress(ArithmeticError, ValueError):
                self.exchange.prepare([values[at] for at in self.free] for values in rows)

    def to_variables(self, values: Sequence[float]) -> tuple[float, ...] | None:
        """Convert the values of all settings to the values of the variables of `program`.

        Return None if the plan does not apply to the given values. A plan never applies to infinite values, which documents cannot contain.
        """
        variables = tuple(values[at] for at in self.free)
        if any(values[at] != value for at, value in self.fixed) or not all(-inf < value < inf for value in variables):
            return None
        if self.exchange is None:
            return variables
        exchanged = self.exchange.of(variables)
        return None if exchanged is None else (*variables, *exchanged.numbers)

    def columns(self, values: Floats) -> tuple[Floats, Booleans]:
        """Compute the m numbers for `template` for k sets of settings at once, as an array `(k, m)`.

        Each row of `values` `(k, n)` contains the values of all settings. Also return an array of flags `(k,)` that are True for the rows
        to which the plan applies. This method requires that no parts depend on the settings.
        """
        outputs, ok = self._columns(values[:, list(self.free)])
        ok &= (abs(values) < inf).all(axis=1)
        for at, value in self.fixed:
            ok &= values[:, at] == value
        return outputs, ok

    @cached_property
    def _columns(self) -> ColumnFunction:
        return column_function(self.program)

    def exchange_parts(self, values: Sequence[float]) -> Exchanged | None:
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


class PlanCache(Generic[Template]):
    """Caches plans for settings that differ only in numbers.

    The settings of all cached plans have the same names of numbers, and the same values of all other settings.

    Attributes:
        patience: The number of settings without a plan after which a plan is created, a power of two.
        reasons: For each number that cannot be traced, the reason.
        modelled: For each traced number on which a part depends, a message that names the part.
        failure: The reason why no plan can be created, or None.
        hits: The number of settings for which a plan was found.
    """

    def __init__(self, patience: int = 2) -> None:
        self.patience = patience
        self.plans: list[NumericPlan[Template]] = []
        self.reasons: dict[str, str] = {}
        self.modelled: dict[str, str] = {}
        self.failure: str | None = None
        self.misses = self.hits = 0
        self._seen: dict[tuple[float, ...], int] = {}

    def find(self, parsed: ParsedSettings) -> tuple[NumericPlan[Template], tuple[float, ...]] | None:
        """Return the plan that applies to the given settings, together with the numbers that the plan computes.

        Return None if no plan applies.
        """
        for number, plan in enumerate(self.plans):
            outputs = plan.outputs(parsed.values)
            if outputs is not None:
                self.hits += 1
                if number:
                    self.plans.insert(0, self.plans.pop(number))
                return plan, outputs
        return None

    def should_create_plan(self, parsed: ParsedSettings) -> bool:
        """Return whether to create a plan for these settings, to which no existing plan applies. Each call counts as a miss.

        Creating a plan takes as long as several compilations, so the settings must have occurred often enough. Numbers that cannot be
        traced must have the same values in all of these settings.
        """
        if self.failure is not None:
            return False
        if not self.reasons:
            self.misses, self.hits = (self.patience, 0) if self.hits >= PAYS else (self.misses + 1, self.hits)
            return self.misses >= self.patience and self.misses & (self.misses - 1) == 0
        key = tuple(value for name, value in zip(parsed.names, parsed.values) if name in self.reasons)
        if len(self._seen) > 1000:
            self._seen.clear()
        self._seen[key] = occurrences = self._seen.get(key, 0) + 1
        return len(self.reasons) < len(parsed.names) and occurrences >= self.patience and occurrences & (occurrences - 1) == 0

    def add(self, plan: NumericPlan[Template]) -> None:
        """Add a plan to the cache. If the cache contains too many plans, drop the least recently used plan."""
        self.plans = [plan, *self.plans[: MOST - 1]]

    def give_up(self, names: Collection[str], why: str) -> None:
        """Stop tracing the numbers with these names, for the reason `why`. If `names` is empty, do not create any further plans."""
        self.reasons.update((name, f"{self.modelled[name]}, and {why}" if name in self.modelled else why) for name in names)
        if not names:
            self.failure = why


class TracedResults:
    """The results of a traced compilation, keyed by name. `outputs` contains all results that are traced numbers.

    `problems` contains the diagnostics of the compilation, which do not depend on the numbers.
    """

    def __init__(self, values: Mapping[str, Any], problems: tuple[Diagnostic, ...] = ()) -> None:
        self.problems = problems
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
