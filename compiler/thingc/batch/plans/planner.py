"""The base class of everything that is computed with plans: results, models, builds and diagnostics."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Sequence
from typing import Any, Generic, TypeVar

from thingc.batch.plans.numeric_plan import Made, NumericPlan, PlanCache
from thingc.driver.session import Session
from thingc.driver.settings import ParsedSettings, SettingsReader

Whole = TypeVar("Whole")

FORMS = 256
"""Maximum number of caches, and maximum total number of plans in all caches. If this number is exceeded, all plans are dropped."""


class PlanChecker(ABC, Generic[Made, Whole]):
    """Compares objects of the type `Whole` that plans compute with compilations of the given modes (none: all modes).

    A new plan is compared with compilations before its first use. Then, some uses of the plan are compared, too. If `verify` is a number n,
    these are the first use of each plan, and then one in n (0: none). If `verify` is None, these are the first, second, fourth, eighth and
    so on. The class attribute `wrong` describes a difference.
    """

    wrong = "different results"

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

    def checked(
        self, plan: NumericPlan[Made] | None, samples: Sequence[ParsedSettings], form: PlanCache[Made], first: Whole,
    ) -> NumericPlan[Made] | None:
        """Compare a new plan with compilations of `samples`. If an object differs, do not create further plans, and return None.

        `first` is the result of a compilation of the first sample.
        """
        if plan is None:
            return None
        for sample in samples:
            outputs = plan.outputs(sample.values)
            whole = None if outputs is None else first if sample is samples[0] else self.whole(sample)
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


class Planner(PlanChecker[Made, Whole]):
    """Computes an object of the type `Whole` for many settings, with plans or by compilations.

    A plan is created when `patience` settings with the same names have been compiled. If `is_refused` returns True for some settings, no
    plan is created for them.
    """

    def __init__(
        self, session: Session, reader: SettingsReader, modes: Sequence[str], *, verify: int | None,
        is_refused: Callable[[ParsedSettings], bool] = lambda read: False, patience: int = 2,
    ) -> None:
        super().__init__(session, reader, modes, verify=verify)
        self._is_refused = is_refused
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
        if known is not None or self._is_refused(read) or not form.worth_it(read):
            return known
        plan = self.plan(read, form)
        if plan is None:
            return None
        form.add(plan)
        return form.plan_for(read)
