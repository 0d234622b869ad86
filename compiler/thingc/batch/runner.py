"""The main module of a runner process, which builds variants one by one: `python -m thingc.batch.runner`.

The first line of standard input is the job, and each following line is a list of tasks (JSON). After reading the documents, the process
prints `{"ready": true}`, and then one row per task, in order. When its input ends, the process and its geometry worker end, so that no
process outlives the driver.
"""

from __future__ import annotations

import base64
import json
import math
import os
import queue
import sys
import threading
import time
import traceback
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

from thingc.base.diagnostic_output import as_json
from thingc.base.diagnostics import Code, Diagnostic, Severity
from thingc.base.json_lines_process import connect_to_parent
from thingc.base.units import Dimension, Quantity
from thingc.batch.folder_layout import keep_asset, write_variant
from thingc.batch.job import STOPPED, Job, Row, refusal, row
from thingc.batch.measurements import Results, UnknownMount, measure
from thingc.batch.packed_layout import FILES, SHARED
from thingc.batch.plans.build_templates import Builds
from thingc.batch.rules import Rule, violations
from thingc.batch.variant import Variant
from thingc.documents.expressions.evaluation import ExpressionValue
from thingc.documents.expressions.parsing import parse_expression
from thingc.driver.environment import Options
from thingc.driver.pipeline import Compilation
from thingc.driver.session import Session
from thingc.driver.settings import SettingsReader
from thingc.model.resolve.resolver import Settings
from thingc.targets.artifact import Content, StoredArtifact, counts_of

SHOWN = 5
"""Maximum number of diagnostics in the journal for a refused variant."""


class Runner(AbstractContextManager["Runner"]):
    """Builds the variants of a job in a runner process. On exit, this context manager ends the worker process that builds parts."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.printed: dict[str, list[str]] = {}
        options = Options(store=job.store, jobs=1, part_timeout=job.part_timeout, printed=self._store_printed_lines)
        self.session = Session(job.assembly, options)
        self.dimensions = {name: Dimension(*exponents) for name, exponents in job.dimensions.items()}
        self.rules = [Rule(text=text, expression=parse_expression(text, dotted=True), names=names) for text, names in job.rules]
        sources = self.session.sources
        self.builds = None if job.verify == 1 or sources is None or self.session.report.failed else Builds(
            self.session, SettingsReader(sources), modes=job.modes, targets=job.emit, verify=job.verify, measured=self._results,
        )

    def __exit__(self, *exception: object) -> None:
        self.session.__exit__(*exception)

    def build(self, task: Variant) -> Row:
        """Build one variant, and return its row of results. The row records all errors, including internal errors."""
        from thingc.geometry.store.local import BlobMissing, StoreUnusable

        started = time.perf_counter()
        try:
            try:
                outcome = self._build_variant(task)
            except BlobMissing:  # a blob in the store is damaged: build the variant again
                outcome = self._build_by_passes(task)
        except StoreUnusable as fault:
            outcome = row(task, STOPPED, code=Code.OUTPUT.code, message=f"the cache `{fault.root}` cannot be used: {fault.reason}")
        except OSError as fault:
            if fault.filename is None and fault.errno is None:
                outcome = _crash_row(task, fault)
            else:
                outcome = row(task, STOPPED, code=Code.OUTPUT.code, message=refusal(fault))
        except Exception as fault:
            outcome = _crash_row(task, fault)
        if self.printed:
            outcome["printed"], self.printed = self.printed, {}
        outcome["seconds"] = round(time.perf_counter() - started, 6)
        return outcome

    def _store_printed_lines(self, part: str, lines: Sequence[str]) -> None:
        self.printed.setdefault(part, []).extend(lines)

    def _build_variant(self, task: Variant) -> Row:
        settings = Settings(parameters=task.parameters, choices=task.choices)
        planned = self.builds.build_by_plan(settings) if self.builds is not None else None
        if planned is None:
            refused = self.builds.find_refusal(settings) if self.builds is not None else None
            return self._build_by_passes(task) if refused is None else row(
                task, "refused", **_error_cells(refused[0]), modelled=[], reused=refused[1],
            )
        parts: dict[str, Any] = {"modelled": [], "reused": planned.parts}
        displayed = _displayed_results(planned.results)
        verdict = self._judge(task, planned.results)
        if verdict is not None:
            return row(task, **verdict, results=displayed, **parts)
        if self.job.folder is not None:
            parts |= self._write_files(self.job.folder, task, planned.files())
        return row(task, "built", results=displayed, losses=dict(planned.losses), **parts)

    def _build_by_passes(self, task: Variant) -> Row:
        """Build a variant by running all compiler passes on its documents."""
        compilation = self.session.compile(Settings(parameters=task.parameters, choices=task.choices), self.job.modes)
        parts: dict[str, Any] = {"modelled": compilation.modelled, "reused": len(compilation.reused)}
        if compilation.report.failed:
            if self.builds is not None and not compilation.modelled:
                self.builds.learn(compilation.settings, tuple(compilation.report.sorted_diagnostics()))
            return row(task, "refused", **_error_cells(compilation.report.sorted_diagnostics()), **parts)
        try:
            results = self._measure(compilation)
        except UnknownMount as fault:
            return row(task, "refused", **_error_cells([fault.diagnostic]), **parts)
        displayed = _displayed_results(results)
        verdict = self._judge(task, results)
        if verdict is not None:
            return row(task, **verdict, results=displayed, **parts)
        artifacts = self.session.emit(compilation, self.job.emit, verify=self.job.verify)
        if compilation.report.failed:
            return row(task, "refused", **_error_cells(compilation.report.sorted_diagnostics()), results=displayed, **parts)
        if self.job.folder is not None:
            parts |= self._write_files(self.job.folder, task, self.session.files(compilation, artifacts))
        losses = counts_of(loss for artifact in artifacts.values() for loss in artifact.losses)
        return row(task, "built", results=displayed, losses=losses, **parts)

    def _write_files(self, folder: str, task: Variant, files: Mapping[str, Content]) -> dict[str, Any]:
        """Write the files of a variant to its folder, and return the additional cells of its row.

        For a packed batch, write only shared files, and include the contents of all other files in the row.
        """
        store = self.session.environment.store
        if not self.job.packed:
            write_variant(folder, task.id, files, store)
            return {}
        shared = {path: content.sha256 for path, content in files.items() if isinstance(content, StoredArtifact)}
        for sha256 in shared.values():
            keep_asset(folder, sha256, store)
        contents = {path: base64.b64encode(data).decode() for path, data in files.items() if isinstance(data, bytes)}
        return {FILES: contents, SHARED: shared}

    def _measure(self, compilation: Compilation) -> Results:
        robot = next(robot for robot in compilation.robots if robot.mode.name == self.job.results_mode)
        return measure(robot, self.job.pose, self.job.reach)

    def _results(self, compilation: Compilation) -> Results | None:
        """Return the results of a compiled variant, or None if a mount that the result `reach` requires does not exist."""
        try:
            return self._measure(compilation)
        except UnknownMount:
            return None

    def _judge(self, task: Variant, results: Results) -> dict[str, Any] | None:
        """Return the cells with the status and the violated rule if a variant violates a rule.

        Return None if the variant satisfies all rules.
        """
        if not self.rules:
            return None
        values: dict[str, ExpressionValue] = {
            name: Quantity(float(value), self.dimensions[name]) if name in self.dimensions else value  # type: ignore[misc]
            for name, value in task.values.items()
        }
        for rule, error in violations(self.rules, values, results, self.job.results_mode):
            return {"status": "kept_out", "rule": rule.text} if error is None else {"status": "refused", **_error_cells([error])}
        return None


def _displayed_results(results: Results) -> dict[str, float | str]:
    """Convert a mapping of results to values that can be serialized as JSON. Infinity is converted to the string `inf`."""
    return {name: value if math.isfinite(value) else "inf" for name, value in results.items() if value is not None}


def _error_cells(diagnostics: Iterable[Diagnostic]) -> dict[str, Any]:
    """Return the row cells that describe errors: the code and the message of the first error, and the first errors for the journal."""
    errors = [diagnostic for diagnostic in diagnostics if diagnostic.severity is Severity.ERROR]
    return {"code": errors[0].code.code, "message": errors[0].message, "diagnostics": as_json(errors[:SHOWN])}


def _crash_row(task: Variant, fault: BaseException) -> Row:
    message = " ".join(str(fault).split())
    return row(
        task, "failed", code=Code.VARIANT_RAISED.code, message=f"internal error: {type(fault).__name__}: {message}",
        detail="".join(traceback.format_exception(fault)),
    )


def main() -> None:
    """Run the main loop of the runner process: read a line of standard input, and write the answers to standard output."""
    answer = connect_to_parent()
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()
    job = Job.decode(sys.stdin.readline())

    def listen() -> None:
        for line in sys.stdin:
            lines.put(line)
        os._exit(0)  # the driver has ended

    threading.Thread(target=listen, daemon=True).start()
    with Runner(job) as runner:
        answer({"ready": True})
        while True:
            for fields in json.loads(lines.get()):
                answer(runner.build(Variant(**fields)))


if __name__ == "__main__":
    main()
