"""Plans: how settings of one form become a model, or results, without a compilation. Made once for many, and checked against
compilations."""

from __future__ import annotations

import random
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from typing import Any, Generic, Protocol, TypeVar

from thingc.families.exchange import Exchange, Exchanged
from thingc.families.program import Run, compiled
from thingc.families.reading import Read, SettingsReader
from thingc.families.rehearsal import NotTraceable, Rehearsal, pinned
from thingc.frozen import dataclass
from thingc.units import Quantity

Made = TypeVar("Made")

Attempt = Callable[[Mapping[str, Quantity], Mapping[str, str]], "tuple[Rehearsal | None, NotTraceable | None]"]


class Rehearse(Protocol):
    """How a compilation is rehearsed."""

    def __call__(self, numbers: Mapping[str, Quantity], texts: Mapping[str, str], *, exact: Collection[str]) -> Rehearsal:
        """With numbers traced and texts as they are; by numbers that are `exact` parts may be modelled. Raises `NotTraceable`."""


MOST = 32
"""Plans that are kept of one form of settings: those used least lately are given up."""
PAYS = 32
"""After so many settings that plans were of, another plan is made for the next that none is of: it takes as long as some compilations."""
CHECKED = 2
"""Settings near those that a plan is made for with which it is compared before it is used, besides these themselves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe(Generic[Made]):
    """How numbers of some names become `made`. `fixed` are those of the names that it is of one value of; `run` takes the values of the
    others, `free`, and, where parts are modelled by some of them, what `exchange` gives of their records."""

    free: tuple[int, ...]
    fixed: tuple[tuple[int, float], ...]
    run: Run
    made: Made
    exchange: Exchange | None = None

    def outputs(self, values: Sequence[float]) -> tuple[float, ...] | None:
        """What `made` works with, of the values of all names; None where the plan is not of these."""
        for at, value in self.fixed:
            if values[at] != value:
                return None
        given: Sequence[float] = [values[at] for at in self.free]
        try:
            if self.exchange is not None:
                found = self.exchange.of(given)
                if found is None:
                    return None
                given = (*given, *found.numbers)
            return self.run(*given)
        except (ArithmeticError, ValueError):
            return None

    def exchanged(self, values: Sequence[float]) -> Exchanged | None:
        """What comes of the records of parts that are modelled by values of which there are outputs; None where none is."""
        return None if self.exchange is None else self.exchange.of([values[at] for at in self.free])

    def is_due(self, count: int, verify: int | None) -> bool:
        """Whether what the plan gives now should be compared with a compilation: as the `count`-th of those that plans gave (of which
        one in `verify` is; None: the first, the second, the fourth, the eighth ...), or as one of the first with other parts."""
        first = self.exchange is not None and self.exchange.is_due()
        if verify is None:
            return first or count & (count - 1) == 0
        return verify > 0 and (first or count % verify == 0)


class Form(Generic[Made]):
    """The plans of settings of the same names and the same texts. `why` says in words of each name that is not followed why that is so,
    `modelled` of each name that is followed which part is modelled by it; `refused` why there is no plan at all."""

    def __init__(self) -> None:
        self.plans: list[Recipe[Made]] = []
        self.why: dict[str, str] = {}
        self.modelled: dict[str, str] = {}
        self.refused: str | None = None
        self.missed = self.met = 0
        self._seen: dict[tuple[float, ...], int] = {}

    def plan_for(self, read: Read) -> tuple[Recipe[Made], tuple[float, ...]] | None:
        """The plan that is of these settings, and what it works with."""
        for number, plan in enumerate(self.plans):
            outputs = plan.outputs(read.values)
            if outputs is not None:
                self.met += 1
                if number:
                    self.plans.insert(0, self.plans.pop(number))
                return plan, outputs
        return None

    def worth_it(self, read: Read) -> bool:
        """Whether a plan should be made for settings that none is of, which takes as long as some compilations: not for those that come
        once, and a number that is modelled is often never the same again."""
        if self.refused is not None:
            return False
        if not self.why:
            self.missed, self.met = (2, 0) if self.met >= PAYS else (self.missed + 1, self.met)
            return self.missed > 1 and self.missed & (self.missed - 1) == 0
        held = tuple(value for name, value in zip(read.names, read.values) if name in self.why)
        if len(self._seen) > 1000:
            self._seen.clear()
        self._seen[held] = seen = self._seen.get(held, 0) + 1
        return len(self.why) < len(read.names) and seen > 1 and seen & (seen - 1) == 0

    def add(self, plan: Recipe[Made]) -> None:
        """Another plan, which is tried first."""
        self.plans = [plan, *self.plans[: MOST - 1]]


def make(
    read: Read, reader: SettingsReader, rehearse: Rehearse,
    finish: Callable[[Rehearsal, Exchange | None], tuple[Sequence[Any], Made]], form: Form[Made],
    exchanged: Callable[[Rehearsal], Exchange] | None = None,
) -> Recipe[Made] | None:
    """A plan for these settings; None, and the reason in `form`, where there is none. `finish` makes of a rehearsal what a plan needs, and
    the numbers that this works with. `exchanged` makes of one by whose numbers parts are modelled what gives the records of others; None:
    such numbers are not followed."""
    quantities = reader.quantities(read)
    texts = dict(read.texts)

    def blame(names: Iterable[str], why: str) -> None:
        form.why.update((name, f"{form.modelled[name]}, and {why}" if name in form.modelled else why) for name in names)

    while True:
        free = [name for name in read.names if name not in form.why]
        held = {name: _as_text(quantities[name]) for name in read.names if name in form.why}
        if not free:
            form.refused = "none of the numbers is followed"
            return None
        exact = [name for name in free if name in form.modelled]
        attempt = partial(_attempt, partial(rehearse, exact=exact))
        near = {name: quantities[name] if name in exact else _near(quantities[name], random.Random(name)) for name in free}
        rehearsal, fault = attempt(near, {**texts, **held})
        if rehearsal is None:
            rehearsal, fault = attempt({name: quantities[name] for name in free}, {**texts, **held})
        if fault is not None:
            named = [name for name in fault.names if name in free]
            if fault.modelled and exchanged is not None and (new := [name for name in named if name not in exact]):
                form.modelled.update(dict.fromkeys(new, fault.why))
                continue
            blamed = named or exact or _culprits(attempt, near, {**texts, **held})
            if not blamed:
                form.refused = fault.why
                return None
            blame(blamed, fault.why)
            continue
        assert rehearsal is not None
        if known := pinned(rehearsal):
            blame(known, "a pass wants to know the very value")
            continue
        exchange = exchanged(rehearsal) if exchanged is not None and rehearsal.parts is not None else None
        try:
            outputs, made = finish(rehearsal, exchange)
        except NotTraceable as refused:
            if refused.names:
                blame(refused.names, refused.why)
                continue
            form.refused = refused.why
            return None
        return Recipe(
            free=tuple(read.names.index(name) for name in free),
            fixed=tuple((at, read.values[at]) for at, name in enumerate(read.names) if name in form.why),
            run=compiled(rehearsal.tape, outputs), made=made, exchange=exchange,
        )


def samples(read: Read, reader: SettingsReader, form: Form[Any]) -> list[Read]:
    """Settings by which a plan is judged: these, and some near them, for which no other part is modelled."""
    found = [read]
    for number in range(CHECKED):
        source = random.Random(number)
        quantities = reader.quantities(read)
        values = [
            read.values[at] if name in form.why or name in form.modelled else _near(quantities[name], source).value
            for at, name in enumerate(read.names)
        ]
        found.append(Read(names=read.names, values=tuple(values), texts=read.texts))
    return found


def _attempt(
    rehearse: Callable[[Mapping[str, Quantity], Mapping[str, str]], Rehearsal], numbers: Mapping[str, Quantity], texts: Mapping[str, str],
) -> tuple[Rehearsal | None, NotTraceable | None]:
    try:
        return rehearse(numbers, texts), None
    except NotTraceable as fault:
        return None, fault


def _culprits(attempt: Attempt, numbers: Mapping[str, Quantity], texts: Mapping[str, str]) -> list[str]:
    """Those of several numbers that cannot be followed by themselves."""
    if len(numbers) == 1:
        return list(numbers)
    alone = {
        name: {**texts, **{other: _as_text(one) for other, one in numbers.items() if other != name}} for name in numbers
    }
    return [name for name, others in alone.items() if attempt({name: numbers[name]}, others)[0] is None]


def _near(quantity: Quantity, source: random.Random) -> Quantity:
    """A number beside another, which is nothing in particular."""
    share = source.uniform(-1e-3, 1e-3)
    return Quantity(quantity.value * (1.0 + share) if quantity.value else share, quantity.dimension)


def _as_text(quantity: Quantity) -> str:
    from thingc.variants.values import text_of

    return text_of(quantity)
