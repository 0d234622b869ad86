"""What a batch says of itself: how far it is, what came of it, and that somebody stopped it."""

from __future__ import annotations

from collections.abc import Callable

from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr, counted


class Interrupted(Exception):
    """Somebody stopped the batch: `done` of `count` variants are in the journal of `folder`."""

    def __init__(self, folder: str, done: int, count: int) -> None:
        super().__init__(f"interrupted after {done} of {counted(count, 'variant')}")
        self.folder = folder
        self.done = done
        self.count = count


class Progress(OneLineRepr, FrozenStruct):
    """How far a batch is. `before` are the variants that an earlier run has done; `rate` variants per second of this one."""

    count: int
    before: int
    counts: dict[str, int]
    rate: float

    @property
    def done(self) -> int:
        """Variants in the journal."""
        return self.before + sum(self.counts.values())

    @property
    def left(self) -> float | None:
        """The estimate [s] of what is left to wait, None while nobody knows."""
        return (self.count - self.done) / self.rate if self.rate > 0.0 else None


class Summary(OneLineRepr, FrozenStruct):
    """What came of a batch: how many variants have each status (those of earlier runs included), parts that were modelled in this
    run, and how long it took [s]. `duplicates` were asked for more than once; `lossy` variants, those of earlier runs included, have
    `losses`, by what becomes of them; `notes` are the warnings about the documents, `layout` how variants lie in the folder."""

    folder: str
    name: str
    count: int
    statuses: dict[str, int]
    before: int
    modelled: int
    duplicates: int
    seconds: float
    lossy: int
    losses: dict[str, int]
    layout: str
    notes: tuple[Diagnostic, ...] = ()


OnProgress = Callable[[Progress], None]
