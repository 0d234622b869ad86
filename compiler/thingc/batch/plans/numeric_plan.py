"""Compute models or results for other numbers with a plan instead of a compilation."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import count
from typing import Any, Generic, TypeVar

from thingc.base.diagnostics import Diagnostic
from thingc.base.numeric import nan
from thingc.batch.plans.columns import Booleans, ColumnFunction, Floats, column_function
from thingc.batch.plans.part_exchange import Exchange, Exchanged
from thingc.batch.plans.program import Argument, Program
from thingc.batch.plans.tape import Const, Traced
from thingc.driver.settings import ParsedSettings

Made = TypeVar("Made")

MOST = 32
"""Maximum number of plans for settings with the same names and texts. The least recently used plans are dropped."""
PAYS = 32
"""Number of uses of existing plans after which another plan may be created, because creating a plan takes several compilations."""
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
            given = self.to_variables(values)
            return None if given is None else self.program.run(*given)
        except (ArithmeticError, ValueError):
            return None

    def prepare(self, many: Sequence[Sequence[float]]) -> None:
        """Build the parts for several settings at the same time. Each element of `many` contains the values of all settings."""
        if self.exchange is not None and many:
            with suppress(ArithmeticError, ValueError):
                self.exchange.prepare([values[at] for at in self.free] for values in many)

    def to_variables(self, values: Sequence[float]) -> tuple[float, ...] | None:
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
    """The results of a traced compilation, by name. `outputs` contains all results that are traced numbers.

    `problems` contains the diagnostics that are the same for all numbers.
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
