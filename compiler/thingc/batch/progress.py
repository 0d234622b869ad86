"""The progress of a batch, the summary of a finished batch, and the exception for an interrupted batch."""

from __future__ import annotations

from collections.abc import Callable

from thingc.base.diagnostics import Diagnostic
from thingc.base.one_line_repr import OneLineStruct, format_count


class Interrupted(Exception):
    """Raised if a batch was interrupted. The journal in `folder` contains the results of `done` of `count` variants."""

    def __init__(self, folder: str, done: int, count: int) -> None:
        super().__init__(f"interrupted after {done} of {format_count(count, 'variant')}")
        self.folder = folder
        self.done = done
        self.count = count


class Progress(OneLineStruct):
    """The progress of a batch with `count` variants.

    `before` is the number of variants that were finished in earlier runs. `counts` maps each status to the number of variants that this run
    has finished with this status. `rate` is the number of variants that finish per second.
    """

    count: int
    before: int
    counts: dict[str, int]
    rate: float

    @property
    def done(self) -> int:
        """The number of variants that have finished, in this run and in earlier runs."""
        return self.before + sum(self.counts.values())

    @property
    def left(self) -> float | None:
        """The estimated remaining time [s] of the batch, or None if it is unknown."""
        return (self.count - self.done) / self.rate if self.rate > 0.0 else None


class Summary(OneLineStruct):
    """The summary of a finished batch.

    `statuses` maps each status to a number of variants, and `before` is the number of variants that earlier runs have finished. `modelled`
    is the number of parts that this run has built, and `seconds` [s] is the duration of this run. `duplicates` is the number of variants
    with the same settings as another variant. `lossy` is the number of variants with export losses, and `losses` maps each kind of export
    loss to a count; both include earlier runs. `notes` contains warnings about the documents.
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
