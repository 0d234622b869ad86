"""One document compiled many times in one process: what does not depend on the settings is done once.

A `Session` drives the same passes as a single compilation (`pipeline`) and gives the same files and the same diagnostics; it only keeps
what the passes may share: the documents and their models, part schemas, records, the worker.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from thingc.base.diagnostics import Report
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.model.resolve.resolver import Settings

if TYPE_CHECKING:
    from thingc.targets.artifact import Artifacts, Content

REFUSED = 64
"""How many refused settings are remembered: a learner draws the same again, and what makes plans asks for them twice."""


class Session:
    """One document, compiled again and again with other settings. A context manager: leaving it ends the geometry service.

    `options` say how to compile; their own parameters and choices hold where the settings of a compilation do not say
    otherwise. The documents are read when the session begins: later changes of files are not seen, of documents, parts and the
    store. Where a blob of the store was lost meanwhile, reading it raises `BlobMissing`, and a new session makes it anew.
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
        """Faults of the documents themselves, which every compilation has."""
        return self.environment.report

    def compile(self, settings: Settings, modes: Sequence[str] = ()) -> Compilation:
        """The document with these settings, through every pass up to `root`, for the modes named (none: all).

        What is wrong is in the compilation's `report`; a refused one is remembered unless it has modelled parts, which may go better the
        next time. Raises `UnknownChoice` for a mode that is not there.
        """
        own = self.environment.options
        settings = Settings(parameters={**own.parameters, **settings.parameters}, choices={**own.choices, **settings.choices})
        key = (*settings.parameters.items(), *settings.choices.items(), *modes)
        made = self._refused.get(key) or pipeline.recompile(self.environment, self.sources, settings, modes)
        if made.report.failed and not made.modelled:
            self._refused[key] = made
            if len(self._refused) > REFUSED:
                del self._refused[next(iter(self._refused))]
        return made

    def emit(self, compilation: Compilation, targets: Sequence[str], *, verify: int = 1) -> dict[str, Artifacts]:
        """Artifacts per target: see `pipeline.emit`."""
        return pipeline.emit(self.environment, compilation, targets, verify=verify)

    def files(self, compilation: Compilation, artifacts: Mapping[str, Artifacts]) -> dict[str, Content]:
        """What a build folder holds, by path in it."""
        return pipeline.files(self.environment, compilation, artifacts)
