"""Compile a document many times in one process, with different settings. Work that does not depend on the settings is done once.

A `Session` runs the same passes as a single compilation (see `pipeline`), with the same files and diagnostics. It caches the documents, the
part schemas and the part records, and it keeps the worker process running.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from thingc.base.diagnostics import Report
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.model.resolve.resolver import Settings, Sources
from thingc.targets.artifact import Artifacts, Content

REFUSED = 64
"""Maximum number of cached failures. A learner may draw the same settings several times, and plans request each failure twice."""


class Session:
    """Compiles a document repeatedly with different settings. On exit, this context manager closes the geometry service.

    The settings of a compilation override the parameters and choices in `options`. The documents are read when the session is created.
    Later changes of documents, parts and the store are not detected. If a file of the store is deleted in the meantime, reading it raises
    `BlobMissing`. A new session restores the file.
    """

    def __init__(self, document: str, options: Options) -> None:
        self.environment = Environment(document, options)
        self.sources = pipeline.read(self.environment)
        self._refused: dict[tuple[object, ...], Compilation] = {}

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *exception: object) -> None:
        self.environment.__exit__(*exception)

    @property
    def report(self) -> Report:
        """The diagnostics of the document itself, which are the same for all compilations of this session."""
        return self.environment.report

    def compile(self, settings: Settings, modes: Sequence[str] = ()) -> Compilation:
        """Compile the document with the given settings, up to the pass `root`.

        `modes` are the names of the modes to compile (default: all). Errors are in the `report` of the compilation. A failed compilation is
        cached, unless parts were built, because building them may succeed next time. Raises `UnknownChoice` for an unknown mode.
        """
        own = self.environment.options
        settings = Settings(parameters={**own.parameters, **settings.parameters}, choices={**own.choices, **settings.choices})
        key = (*settings.parameters.items(), *settings.choices.items(), *modes)
        made = self._refused.get(key) or self.passes(self.environment, self.sources, settings, modes)
        if made.report.failed and not made.modelled:
            self._refused[key] = made
            if len(self._refused) > REFUSED:
                del self._refused[next(iter(self._refused))]
        return made

    def passes(self, environment: Environment, sources: Sources | None, settings: Settings, modes: Sequence[str]) -> Compilation:
        """Run the passes of one compilation. A subclass can override this method.

        `environment` and `sources` are the environment and the sources of this session, or copies of them.
        """
        return pipeline.recompile(environment, sources, settings, modes)

    def emit(self, compilation: Compilation, targets: Sequence[str], *, verify: int = 1) -> dict[str, Artifacts]:
        """Create the files of the given targets, as `pipeline.emit` does."""
        return pipeline.emit(self.environment, compilation, targets, verify=verify)

    def files(self, compilation: Compilation, artifacts: Mapping[str, Artifacts]) -> dict[str, Content]:
        """Return the contents of all files of a build folder, by path in the folder."""
        return pipeline.files(self.environment, compilation, artifacts)
