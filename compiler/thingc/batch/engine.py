"""Build variants in runner processes. The function `evaluate` can be called through any executor with the `concurrent.futures` interface.

A batch submits chunks of tasks with `executor.submit(evaluate, job, tasks)`. On the machine that executes the call, a separate process
(`thingc.batch.runner`) builds the variants. If the runner process dies or hangs, its current variant is recorded as failed, and a new
process continues with the next variant.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

from msgspec.structs import asdict

from thingc.base.diagnostics import Code
from thingc.base.exceptions import PicklableError
from thingc.base.json_lines_process import JsonLinesProcess, ProcessLost
from thingc.batch.job import STOPPED, Job, Row, row
from thingc.batch.variant import Variant

LOADING = 120.0
"""Time limit [s] for a runner process to read the documents."""
STARTS = 3
"""Maximum number of attempts to start a runner process."""

T = TypeVar("T")
OnRow = Callable[[Row], None]


class Cancelled(Exception):
    """Raised in a waiting call if another thread has ended all runner processes."""


class RunnersBroken(PicklableError):
    """Raised if a runner process cannot be started. `detail` is the output of the last attempt to start a process."""

    def __init__(self, message: str, detail: str) -> None:
        super().__init__(message)
        self.detail = detail


class RunnerProcess(JsonLinesProcess):
    """A runner process, which builds the variants of one job."""

    def __init__(self, job: str) -> None:
        super().__init__("thingc.batch.runner", cwd=Job.decode(job).cwd)
        self.job = job
        self.ask(json.loads(job))


class Runners:
    """The runner processes that this process has started. Idle runner processes are reused for the same job. This class is thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[RunnerProcess] = []
        self._busy: set[RunnerProcess] = set()
        self._closed = False

    def take(self, job: str) -> RunnerProcess:
        """Return an idle runner process for the job, or start a new runner process.

        Raises `RunnersBroken` if no process can be started, and `Cancelled` after a call of `cancel`.
        """
        with self._lock:
            if self._closed:
                raise Cancelled
            known = next((runner for runner in self._idle if runner.job == job), None)
            if known is not None:
                self._idle.remove(known)
                self._busy.add(known)
                return known
            others, self._idle = self._idle, []
        for runner in others:  # runners of a finished batch
            runner.close()
        output = ""
        for _ in range(STARTS):
            try:
                runner = RunnerProcess(job)
            except OSError as fault:
                output = f"cannot start a process: {fault.strerror or fault}"
                continue
            with self._lock:
                self._busy.add(runner)
                if self._closed:
                    runner.kill()
            try:
                runner.answer(LOADING)  # this waits until the runner has read the documents
                return runner
            except ProcessLost as fault:
                output = f"{fault}\n{runner.errors()}"
                self.drop(runner)
            except BaseException:
                self.drop(runner)
                raise
        self.raise_if_cancelled()
        raise RunnersBroken(f"cannot start a process for variants: {output.splitlines()[0]}", output)

    def give_back(self, runner: RunnerProcess) -> None:
        """Return a runner process after use, so that another call can reuse the process."""
        with self._lock:
            self._busy.discard(runner)
            self._idle.append(runner)

    def drop(self, runner: RunnerProcess) -> None:
        """End a runner process that cannot be reused."""
        runner.kill()
        runner.close()
        with self._lock:
            self._busy.discard(runner)

    def cancel(self) -> None:
        """End all runner processes immediately. Calls in other threads that wait for a result raise `Cancelled`."""
        with self._lock:
            self._closed = True
            busy = [*self._busy, *self._idle]
        for runner in busy:
            runner.kill()

    def close(self) -> None:
        """End all idle runner processes, and wait until the processes have ended."""
        with self._lock:
            idle, self._idle = self._idle, []
        for runner in idle:
            runner.close()

    def raise_if_cancelled(self) -> None:
        """Raise `Cancelled` if `cancel` has been called."""
        with self._lock:
            if self._closed:
                raise Cancelled


RUNNERS = Runners()
"""The runner processes of this process, for executors that do not manage runner processes themselves.

All of these runner processes end when this process ends.
"""


def evaluate(job: str, tasks: Sequence[Variant], timeout: float, on_row: OnRow | None = None, runners: Runners | None = None) -> list[Row]:
    """Build the variants of a chunk, and return a row of results for each variant, in order.

    Each row is also passed to the callback `on_row` as soon as the row is available. `job` is the result of `Job.encode()`, and `timeout`
    [s] is the time limit for one variant. If a runner process dies or hangs, its current variant is recorded as failed, and a new runner
    process continues. If files cannot be written, the last row has the status `stopped`, and further variants are not built.
    """
    pool = runners if runners is not None else RUNNERS
    rows: list[Row] = []
    remaining = list(tasks)

    def take(answer: Row) -> None:
        rows.append(answer)
        if on_row is not None:
            on_row(answer)

    while remaining:
        runner = pool.take(job)
        try:
            runner.ask([asdict(task) for task in remaining])
            while remaining:
                answer = runner.answer(timeout)
                answer["pid"] = runner.pid
                take(answer)
                remaining.pop(0)
                if answer["status"] == STOPPED:
                    pool.drop(runner)
                    return rows
        except ProcessLost as fault:
            pool.raise_if_cancelled()
            code = Code.VARIANT_HUNG if fault.hung else Code.VARIANT_DIED
            message = f"the process of the variant {'was terminated' if fault.hung else 'crashed'}: {fault}"
            take(row(remaining.pop(0), "failed", code=code.code, message=message, detail=runner.errors(), pid=runner.pid))
            pool.drop(runner)
        except BaseException:  # the state of the runner is unknown, so the runner is not reused
            pool.drop(runner)
            raise
        else:
            pool.give_back(runner)
    return rows


class LocalExecutor(ThreadPoolExecutor):
    """An executor for this machine with `jobs` threads, each of which uses a runner process."""

    def __init__(self, jobs: int) -> None:
        super().__init__(max_workers=jobs, thread_name_prefix="thingc-runner")
        self.runners = Runners()

    def submit(self, fn: Callable[..., T], /, *arguments: Any, **named: Any) -> Future[T]:
        """Run a function call in a thread, and return a future of its result.

        If the function is `evaluate`, it uses the runner processes of this executor.
        """
        if fn is evaluate:
            named.setdefault("runners", self.runners)
        return super().submit(fn, *arguments, **named)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all runner processes.

        With `cancel_futures`, end the processes immediately; otherwise, let the processes finish their work first.
        """
        if cancel_futures:
            self.runners.cancel()
        super().shutdown(wait=wait, cancel_futures=cancel_futures)
        self.runners.close()
