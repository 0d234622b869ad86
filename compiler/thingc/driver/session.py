"""Compile a document many times in one process, with different settings. Work that does not depend on the settings is done once.

A `Session` runs the same passes as `pipeline`, with the same output files and diagnostics. The session caches documents, part schemas and
part records, and keeps the worker process running.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager

from thingc.base.diagnostics import Report
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.model.resolve.resolver import Settings, Sources
from thingc.targets.artifact import Artifacts, Content

MAX_FAILED = 64
"""Maximum number of failed compilations in the cache. Learning algorithms may request the same settings several times, and a plan requests
each failed compilation twice.
"""


class Session(AbstractContextManager["Session"]):
    """Compiles a document repeatedly with different settings. At the end of a `with` statement, the geometry service is closed.

    The settings of a single compilation take precedence over the parameters and choices in `options`. The documents are read when the
    session is created. The session does not detect later changes of documents, parts and the store. If a file of the store is deleted
    during the session, reading the file raises `BlobMissing`. To restore the file, create a new session.
    """

    def __init__(self, document: str, options: Options) -> None:
        self.environment = Environment(document, options)
        self.sources = pipeline.read(self.environment)
        self._failed: dict[tuple[object, ...], Compilation] = {}

    def __exit__(self, *exception: object) -> None:
        self.environment.__exit__(*exception)

    @property
    def report(self) -> Report:
        """The diagnostics of the document itself, which are the same for all compilations of this session."""
        return self.environment.report

    def compile(self, settings: Settings, modes: Sequence[str] = ()) -> Compilation:
        """Compile the document with the given settings, up to the pass `root`.

        `modes` contains the names of the modes to compile (default: all). Errors are added to the `report` of the result. A failed
        compilation is cached unless parts were built, because the build of a part can succeed next time. Raises `UnknownChoice` for an
        unknown mode.
        """
        options = self.environment.options
        settings = Settings(parameters={**options.parameters, **settings.parameters}, choices={**options.choices, **settings.choices})
        key = (*settings.parameters.items(), *settings.choices.items(), *modes)
        compilation = self._failed.get(key) or self.passes(self.environment, self.sources, settings, modes)
        if compilation.report.failed and not compilation.modelled:
            self._failed[key] = compilation
            if len(self._failed) > MAX_FAILED:
                del self._failed[next(iter(self._failed))]
        return compilation

    def passes(self, environment: Environment, sources: Sources | None, settings: Settings, modes: Sequence[str]) -> Compilation:
        """Run the passes of one compilation. Subclasses can override this method, for example to pass copies of the arguments."""
        return pipeline.recompile(environment, sources, settings, modes)

    def emit(self, compilation: Compilation, targets: Sequence[str], *, verify: int = 1) -> dict[str, Artifacts]:
        """Create the files of the given targets. The arguments have the same meaning as for `pipeline.emit`."""
        return pipeline.emit(self.environment, compilation, targets, verify=verify)

    def files(self, compilation: Compilation, artifacts: Mapping[str, Artifacts]) -> dict[str, Content]:
        """Return the contents of all files of a build folder, keyed by path in the folder."""
        return pipeline.files(self.environment, compilation, artifacts)
