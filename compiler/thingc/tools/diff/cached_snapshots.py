"""Compile a document and take a snapshot of the robot. The results of document tests are cached."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Sequence

from msgspec import convert, to_builtins
from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic, Severity
from thingc.base.one_line_repr import format_count
from thingc.base.source import Document
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.driver.up_to_date import fingerprint
from thingc.geometry.store.local import Store, StoreUnusable
from thingc.model.assembly.types import Assembly
from thingc.tools.diff.snapshot import Snapshot, TestOutcome
from thingc.tools.diff.take_snapshot import take_snapshot

ASSETS = "mjcf/assets/"
"""Folder of the MuJoCo meshes, relative to the build folder."""


class BrokenDocument(Exception):
    """Raised if a document cannot be compiled. `diagnostics` contains its errors."""

    def __init__(self, diagnostics: Sequence[Diagnostic]) -> None:
        super().__init__(format_count(len(diagnostics), "error"))
        self.diagnostics = tuple(diagnostics)


class Subject(contextlib.AbstractContextManager["Subject"]):
    """A context manager that compiles a document for a comparison. The method `snapshot_with_tests` runs the tests in the document.

    The context manager stops the worker processes on exit. Raises `BrokenDocument` if the document has errors.
    """

    def __init__(self, document: str, options: Options) -> None:
        self._environment = Environment(document, options)
        self._compilation: Compilation = pipeline.compile(self._environment)
        errors = [d for d in self._compilation.report.sorted_diagnostics() if d.severity is Severity.ERROR]
        if errors or self._compilation.assembly is None:
            self._environment.__exit__()
            raise BrokenDocument(errors)
        self.snapshot: Snapshot = take_snapshot(self._compilation)

    def __exit__(self, *exception: object) -> None:
        self._environment.__exit__(*exception)

    @property
    def store(self) -> Store:
        """The cache of built parts and of test results."""
        return self._environment.store

    @property
    def document(self) -> Document:
        """The compiled document."""
        assert self._compilation.documents is not None
        return self._compilation.documents.root

    @property
    def assembly(self) -> Assembly:
        """The linked robot, without a root."""
        assert self._compilation.assembly is not None
        return self._compilation.assembly

    def snapshot_with_tests(self) -> Snapshot:
        """Run the tests in the document, and return the snapshot of the robot with the test results. The test results are cached."""
        key = self._key()
        earlier = self.store.get_json("diff-tests", key)
        if earlier is not None:
            return replace(self.snapshot, outcomes=convert(earlier, tuple[TestOutcome, ...]))
        outcomes = self._outcomes()
        with contextlib.suppress(StoreUnusable):
            self.store.put_json("diff-tests", key, to_builtins(outcomes))
        return replace(self.snapshot, outcomes=outcomes)

    def model(self) -> tuple[str, dict[str, bytes]]:
        """Return the MuJoCo model of the first mode of the robot as XML text, and its meshes keyed by file name."""
        compilation = replace(self._compilation, robots=self._compilation.robots[:1])
        read = pipeline.emit(self._environment, compilation, ["mjcf"], verify=0)["mjcf"].contents(self.store)
        robot = compilation.robots[0]
        xml = read[f"mjcf/{robot.name}_{robot.mode.name}.xml"].decode()
        return xml, {path.removeprefix(ASSETS): data for path, data in read.items() if path.startswith(ASSETS)}

    def _outcomes(self) -> tuple[TestOutcome, ...]:
        from thingc.driver.testing.test_runner import Selection, run

        assembly = self._compilation.assembly
        if assembly is None or not assembly.tests:
            return ()
        return tuple(
            TestOutcome(
                test=result.name, where=result.where, passed=result.passed,
                measured={
                    name: float(value) for name, value in result.outcome.measured.items()
                    if isinstance(value, (int, float)) and not isinstance(value, bool)
                },
            )
            for result in run(pipeline.request_of(self._environment, self._compilation), Selection())
        )

    def _key(self) -> str:
        """Return the cache key of the test results: a hash of the documents, the parts, the settings and the version of thingc."""
        documents, assembly = self._compilation.documents, self._compilation.assembly
        assert documents is not None and assembly is not None
        parts = sorted({
            (o.definition.text, json.dumps([
                o.record.volume, o.record.centre, o.record.inertia,
                {name: [m.pose.rotation, m.pose.translation] for name, m in o.record.mounts.items()},
                {name: mesh.sha256 for name, mesh in o.record.meshes.items()},
                [o.mass_source, o.properties.mass],
            ], sort_keys=True))
            for o in assembly.occurrences if o.record is not None
        })
        links = sorted({o.definition.text for o in assembly.occurrences if o.listed is not None})  # definitions contain hashes of meshes
        settings = self._compilation.settings
        about = [
            fingerprint(), documents.root.relative, sorted((path, one.sha256) for path, one in documents.by_path.items()), parts, links,
            sorted(settings.parameters.items()), sorted(settings.choices.items()), self._environment.compat,
        ]
        return hashlib.sha256(json.dumps(about).encode()).hexdigest()
