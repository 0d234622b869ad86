"""`thingc schema --watch`: looks at the workspace a few times a second, and never lets a save wait for a part.

A save is answered from the store alone; what the store does not have (a part that was edited, a new value of a parameter)
is found out by a warm worker meanwhile, and a second refresh follows.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from thingc.diagnostics import Report
from thingc.editor.parts import Missing, ask
from thingc.editor.refresh import RefreshOutcome, Schemas
from thingc.realize import EndingWorkers, NoWorkers
from thingc.watching import looks
from thingc.workspace import OWN_FILE, Workspace

if TYPE_CHECKING:
    from thingc.realize import GeometryService, Store

PAUSE = 0.2
"""Between two looks [s]."""

Say = Callable[[RefreshOutcome, float], None]
"""`say(outcome, seconds)` after every refresh."""


class Watch:
    """Watches one workspace until `stop` is set. `model`: workers find out what the store does not have."""

    def __init__(
        self, workspace: Workspace, store: Store, jobs: int, timeout: float, *, only: list[str] | None = None, model: bool = True,
    ) -> None:
        self.workspace = workspace
        self.stop = threading.Event()
        self._store, self._jobs, self._timeout = store, jobs, timeout
        self._only = only
        self._workers = EndingWorkers(jobs) if model else None
        self._helper: threading.Thread | None = None
        self._asked = Missing()
        self._schemas = Schemas(workspace, self._at_hand(), only)

    def run(self, say: Say) -> None:
        """Refresh now, and after every change. Ends the workers when it ends. Raises OSError where it cannot write."""
        try:
            self._refresh(say)
            for changed in looks(self._schemas.changed, self.stop, PAUSE):
                found_out = self._helper is not None and not self._helper.is_alive()
                if found_out:
                    self._helper = None
                if changed and self._schemas.moved():
                    self._move()
                elif found_out or (changed and self._schemas.outdated()):
                    self._schemas.renew(self._at_hand())
                if changed:  # what was asked in vain before may be answered now
                    self._asked = Missing()
                if changed or found_out:
                    self._refresh(say)
        finally:
            if self._workers is not None:
                self._workers.end()
            if self._helper is not None:
                self._helper.join(5.0)

    def _refresh(self, say: Say) -> None:
        started = time.monotonic()
        outcome = self._schemas.refresh()
        say(outcome, time.monotonic() - started)
        if self._workers is not None and self._helper is None and outcome.missing and outcome.missing != self._asked:
            self._asked = outcome.missing
            self._helper = threading.Thread(target=self._find_out, args=(outcome.missing, self._workers), daemon=True)
            self._helper.start()

    def _find_out(self, missing: Missing, workers: EndingWorkers) -> None:
        """Ask workers for what is missing: it is in the store then."""
        service = ask(self.workspace, self._store, jobs=self._jobs, timeout=self._timeout, workers=workers)
        service.describe(missing.references)
        service.realize(missing.definitions)

    def _at_hand(self) -> GeometryService:
        return ask(self.workspace, self._store, timeout=self._timeout, workers=NoWorkers())

    def _move(self) -> None:
        """The workspace's own file has changed; one that is wrong changes nothing."""
        workspace = Workspace.find(f"{self.workspace.root}/{OWN_FILE}", Report())
        if workspace is not None and workspace.root == self.workspace.root:
            self.workspace = workspace
        self._schemas = Schemas(self.workspace, self._at_hand(), self._only)
