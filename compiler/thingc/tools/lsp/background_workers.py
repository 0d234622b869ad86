"""The warm workers of one workspace: they find out of parts what is not in the store, while documents are looked at without it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from thingc.driver.environment import Options, geometry_of
from thingc.geometry.client import EndingWorkers
from thingc.geometry.record import PartFailure
from thingc.geometry.store.local import StoreUnusable
from thingc.tools.lsp.cached_parts import PendingRequests

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace
    from thingc.geometry.store.local import Store

QUIET = 0.3
"""How long [s] nothing else may have been wanted before definitions are modelled: who types `120 mm` means no part of 1 mm."""
IMPATIENT = 1.0
"""How long [s] what is not wanted any more may go on; then its workers are ended."""

Answered = Callable[["Workspace", Mapping[str, PartFailure], Mapping[str, PartFailure]], None]
"""`answered(workspace, undescribed, failed)`: what was wanted is in the store, but for these, by reference and by definition text."""


class BackgroundWorkers:
    """One thread that asks workers for what is wanted last. `answered` is called in it."""

    def __init__(self, workspace: Workspace, store: Store, options: Options, answered: Answered) -> None:
        self.workspace = workspace
        self._store, self._options, self._answered = store, options, answered
        self._workers = EndingWorkers(options.jobs or 1)
        self._changed = threading.Condition()
        self._wanted = PendingRequests()
        self._at_work: PendingRequests | None = None
        self._asked = PendingRequests()
        self._ended = False
        self._thread: threading.Thread | None = None

    def want(self, wanted: PendingRequests) -> None:
        """Find this out, and nothing else. What was asked before is not asked again."""
        with self._changed:
            if self._ended or wanted == self._wanted or wanted.within(self._asked):
                return
            self._wanted = wanted
            self._changed.notify_all()
            if self._thread is None and wanted:
                self._thread = threading.Thread(target=self._run, name="workers", daemon=True)
                self._thread.start()
            self._give_up_soon()

    def renew(self) -> None:
        """A file that parts depend on was saved: whatever is asked from now on is another question."""
        with self._changed:
            self._asked, self._wanted = PendingRequests(), PendingRequests()
            self._give_up_soon()

    def end(self) -> None:
        """End the workers."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        self._workers.end()

    def _give_up_soon(self) -> None:
        if self._at_work is not None and not self._at_work.within(self._wanted):
            timer = threading.Timer(IMPATIENT, self._give_up, [self._at_work])
            timer.daemon = True
            timer.start()

    def _give_up(self, work: PendingRequests) -> None:
        """End the workers where they still do what is not wanted."""
        with self._changed:
            if self._at_work is not work or self._wanted is work or self._ended:
                return
            ended, self._workers, self._at_work = self._workers, EndingWorkers(self._options.jobs or 1), None
        ended.end()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._wanted or self._ended)
                quiet = time.monotonic() + QUIET
                while not self._ended and self._wanted.definitions and self._changed.wait(max(0.0, quiet - time.monotonic())):
                    quiet = time.monotonic() + QUIET
                if self._ended:
                    return
                work = self._at_work = self._wanted
                workers = self._workers
            undescribed, failed = self._found_out(work, workers)
            with self._changed:
                if self._at_work is not work:  # given up
                    continue
                self._at_work = None
                if self._wanted is not work:  # something else is wanted now, or the same of other files
                    undescribed, failed = {}, {}
                else:
                    self._wanted = PendingRequests()
                    self._asked.add(work)
            self._answered(self.workspace, undescribed, failed)

    def _found_out(self, work: PendingRequests, workers: EndingWorkers) -> tuple[dict[str, PartFailure], dict[str, PartFailure]]:
        """What failed of what is wanted, which is in the store then."""
        service = geometry_of(self.workspace, self._options, self._store, workers=workers)
        definitions = [definition for definition, _ in work.definitions.values()]
        convex = {text for text, (_, pieces) in work.definitions.items() if pieces}
        try:
            described = service.describe(list(work.references))
            known = service.realize(definitions, convex)
            records = {text: record for text, (_, record, _) in work.slices.items()}
            slices = {text: slicings for text, (_, _, slicings) in work.slices.items()}
            sliced = service.slice([definition for definition, _, _ in work.slices.values()], records, slices)
        except StoreUnusable as fault:
            refused = {
                text: PartFailure(subject=text, kind="invalid", message=f"the store `{fault.root}` cannot be used: {fault.reason}")
                for text in (*work.references, *work.definitions, *work.slices)
            }
            return {one: refused[one] for one in work.references}, {one: refused[one] for one in refused if one not in work.references}
        return (
            {name: answer for name, answer in described.items() if isinstance(answer, PartFailure)},
            {name: answer for name, answer in {**known, **sliced}.items() if isinstance(answer, PartFailure)},
        )
