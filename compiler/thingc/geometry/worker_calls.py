"""Send requests to the worker processes of a geometry service, and convert crashes of workers to failures of parts."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

from thingc.base.progress import Progress
from thingc.documents.workspace import Workspace
from thingc.geometry.record import AssemblyFailed, PartFailure
from thingc.geometry.record_json import full
from thingc.geometry.store.local import Store, StoreUnusable

if TYPE_CHECKING:
    from thingc.geometry.client import Workers

_FRAME = re.compile(r'^\s*File "(?P<file>.+?)", line (?P<line>\d+)', re.MULTILINE)


class WorkerCalls:
    """The requests of one geometry service to its workers, each with a time limit of `timeout` [s].

    `workers` are shared workers, which `close` does not end, or None. In this case, own workers for `jobs` parts at a time are started with
    the Python hash seed `seed` when they are first needed. `on_progress` is called for each answer.
    """

    def __init__(
        self, workspace: Workspace, store: Store, jobs: int, timeout: float, workers: Workers | None, seed: int,
        on_progress: Progress | None,
    ) -> None:
        self.store, self.timeout = store, timeout
        self.workers = workers
        self._is_shared = workers is not None
        self._workspace, self._jobs, self._seed, self._on_progress = workspace, jobs, seed, on_progress

    def pool(self) -> Workers:
        """Return the workers. Raises `StoreUnusable` if own workers have to be created and the store is not writable."""
        if self.workers is None:
            from thingc.geometry.client import Workers

            self.store.check()
            self.workers = Workers(self._jobs, seed=self._seed)
        return self.workers

    def close(self) -> None:
        """End the workers, unless they are shared."""
        if self.workers is not None and not self._is_shared:
            self.workers.close()
            self.workers = None

    def request(self, **fields: Any) -> dict[str, Any]:
        """Create a request with the given fields, the store and the time limit."""
        return {**fields, "store": self.store.root, "timeout": self.timeout}

    def run(
        self, requests: Sequence[dict[str, Any]], what: str = "", needed: Iterator[dict[str, Any]] | None = None,
    ) -> Iterator[tuple[Mapping[str, Any], dict[str, Any]]]:
        """Send requests to the worker processes, and yield each request with its answer as the answer arrives.

        If no worker starts, every request fails. `needed` yields the requests that are still needed when they are about to be sent. `what`
        names the work for `on_progress`, which is not called without a name.
        """
        source = iter(requests) if needed is None else needed
        first = next(source, None)
        if first is None:
            return
        from thingc.geometry.client import WorkerBroken

        started = time.monotonic()
        self._progress(what, 0, len(requests), 0.0)
        answered: set[int] = set()
        try:
            for done, (request, answer) in enumerate(self.pool().run(chain((first,), source)), 1):
                answered.add(id(request))
                self._progress(what, done, len(requests), time.monotonic() - started)
                if answer.get("failed") == "unusable":
                    raise StoreUnusable(self.store.root, answer["message"])
                yield request, answer
        except WorkerBroken as fault:
            failed = {"failed": "crashed", "message": str(fault), "detail": fault.detail}
            yield from ((request, failed) for request in requests if id(request) not in answered)

    def begin_kernel_call(self, name: str, **fields: Any) -> Callable[[], dict[str, Any]]:
        """Send a request that only requires OCP to a running worker, or to a new process if no worker is running.

        Return a function that waits for the answer. `name` names the request in the error. The function raises `AssemblyFailed` if the
        worker has no answer.
        """
        request = self.request(**fields)
        wait = None
        if self.workers is not None and self.workers.running:
            self.workers.begin([request])
        else:
            from thingc.geometry.client import begin_once

            self.store.check()
            wait = begin_once(request)

        def finish() -> dict[str, Any]:
            if wait is not None:
                answer = wait()
            else:
                ((_, answer),) = self.run([request])
            if "answer" not in answer:
                raise AssemblyFailed(name, answer.get("message") or answer["failed"], answer.get("detail", ""))
            return answer["answer"]  # type: ignore[no-any-return]

        return finish

    def failure(self, subject: str, answer: Mapping[str, Any]) -> PartFailure:
        """Create the failure of a part whose worker process ended before it answered. `answer` describes how the process ended.

        The failure is not cached, so that the next run builds the part again.
        """
        detail = answer.get("detail", "")
        file, line = self._part_line(detail)
        message = f"more than {self.timeout:g} s" if answer["failed"] == "hung" else answer["message"]
        return PartFailure(
            subject=subject, kind=answer["failed"], message=message, file=full(file, self._workspace.root), line=line,
            detail=detail or None,
        )

    def _part_line(self, trace: str) -> tuple[str | None, int | None]:
        """Find the innermost line of part code in a crash trace of `faulthandler`, which lists the most recent call first.

        Return the file and the line. Return `(None, None)` if the trace contains no line of a file in a part folder.
        """
        folders = tuple(os.path.join(folder, "") for folder in self._workspace.parts)
        # with several threads, or after an earlier trace, use the last match
        for match in _FRAME.finditer(trace[max(trace.rfind("most recent call first"), 0) :]):
            if match["file"].startswith(folders):
                return match["file"], int(match["line"])
        return None, None

    def _progress(self, what: str, done: int, total: int, seconds: float) -> None:
        if self._on_progress is not None and what:
            self._on_progress(f"{what} parts", done, total, seconds)
