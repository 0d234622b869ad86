"""The progress, the result and the interruption of a batch."""

from __future__ import annotations

from collections.abc import Callable

from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr, counted


class Interrupted(Exception):
    """Raised if a batch was interrupted. `done` of `count` variants are in the journal of `folder`."""

    def __init__(self, folder: str, done: int, count: int) -> None:
        super().__init__(f"interrupted after {done} of {counted(count, 'variant')}")
        self.folder = folder
        self.done = done
        self.count = count


class Progress(OneLineRepr, FrozenStruct):
    """The progress of a batch.

    `before` is the number of variants from earlier runs, and `counts` are the numbers of variants of this run by status. `rate` is in
    variants per second.
    """

    count: int
    before: int
    counts: dict[str, int]
    rate: float

    @property
    def done(self) -> int:
        """The number of finished variants."""
        return self.before + sum(self.counts.values())

    @property
    def left(self) -> float | None:
        """The estimated remaining time [s], or None if unknown."""
        return (self.count - self.done) / self.rate if self.rate > 0.0 else None


class Summary(OneLineRepr, FrozenStruct):
    """The summary of a batch that has finished.

    `statuses` are the numbers of variants by status, and `before` is the number of variants from earlier runs. `modelled` is the number of
    parts built in this run, which took `seconds` [s]. `duplicates` is the number of additional equal variants. `lossy` is the number of
    variants with export losses, and `losses` counts all losses by kind; both include earlier runs. `notes` are warnings about the
    documents.
    """

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
