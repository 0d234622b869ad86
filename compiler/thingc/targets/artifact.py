"""The result of an emitter: files by relative path, and export losses.

An export loss is a feature of the robot that the target cannot express.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Final, Literal, get_args

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Origin, Span
from thingc.geometry.store.local import Store

MANIFEST = "manifest.json"
"""The path of the manifest in a build folder. The manifest lists all other files of the build folder, but not itself."""


class StoredArtifact(FrozenStruct):
    """A file in the content-addressed store. A build copies such a file to the build folder without reading its content."""

    sha256: str
    size: int


Content = bytes | StoredArtifact

How = Literal["omitted", "approximated", "carried as custom data"]
"""How a target treats a feature that it cannot express, from worst to best. "Carried as custom data" means that the feature is written in a
form that only some readers support.
"""

CARRIED: Final = "carried as custom data"

HOW: tuple[How, ...] = get_args(How)


class Loss(FrozenStruct, kw_only=False):
    """An export loss: a feature of a robot that a target cannot express.

    `mode` is None if the export loss does not belong to a single mode. `path` is the path of the occurrence, joint or mount that the export
    loss concerns. `what` describes the loss, and `origin` lists the locations in the documents that cause the loss.
    """

    target: str
    mode: str | None
    path: str
    what: str
    how: How
    origin: Origin = ()

    @property
    def span(self) -> Span | None:
        """The innermost location of the export loss in the documents, or None if the location is unknown."""
        return next(iter(self.origin), None)


def counts_of(losses: Iterable[Loss]) -> dict[str, int]:
    """Count the export losses for each value of `how`."""
    counts = Counter(loss.how for loss in losses)
    return {how: counts[how] for how in HOW if counts[how]}


class Artifacts(FrozenStruct):
    """The result of an emitter: the contents of files by path in the build folder, and the losses."""

    files: dict[str, Content]
    losses: tuple[Loss, ...] = ()

    def contents(self, store: Store) -> dict[str, bytes]:
        """Return the bytes of all files by path. Files that are in the store are read."""
        return {path: content if isinstance(content, bytes) else store.read(content.sha256) for path, content in self.files.items()}
