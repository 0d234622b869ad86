"""One document compiled many times in one process: what does not depend on the settings is done once.

A `Session` drives the same passes as a single compilation (`pipeline.Compilation`) and gives the same files and the same
diagnostics; it only keeps what the passes may share: the documents and their models, part schemas, records, the worker.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

from thingc.diagnostics import Report
from thingc.frozen import dataclass
from thingc.pipeline import Compilation, Front, Options


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What one compilation has of its own. `parameters` are texts as `-p` takes them (`{"reach": "120 mm"}`), `choices` texts by
    dotted path in the root document (`{"components.foot.part": "feet:Wide"}`)."""

    parameters: Mapping[str, str] = field(default_factory=dict)
    choices: Mapping[str, str] = field(default_factory=dict)


class Session:
    """One document, compiled again and again with other settings. A context manager: leaving it ends the geometry service.

    `options` say how to compile; their own parameters and choices hold where the settings of a compilation do not say
    otherwise. The documents are read when the session begins: later changes of files are not seen, of documents, parts and the
    store. Where a blob of the store was lost meanwhile, reading it raises `BlobMissing`, and a new session makes it anew.
    """

    def __init__(self, document: str, options: Options) -> None:
        self.options = options
        self.front = Front(document, options)
        self.front.read()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *exception: object) -> None:
        self.front.__exit__(*exception)

    @property
    def report(self) -> Report:
        """Faults of the documents themselves, which every compilation has."""
        return self.front.report

    def compile(self, settings: Settings, modes: Sequence[str] = ()) -> Compilation:
        """The document with these settings, through every pass up to `root`, for the modes named (none: all).

        What is wrong is in the compilation's `report`. Raises `UnknownChoice` for a mode that is not there.
        """
        options = replace(
            self.options,
            parameters={**self.options.parameters, **settings.parameters}, choices={**self.options.choices, **settings.choices},
        )
        compilation = Compilation(self.front.document, options, self.front)
        compilation.run(modes)
        return compilation
