"""What emitters give back: files by relative path, and what their target could not say."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Final, Literal, get_args

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Origin, Span

MANIFEST = "manifest.json"
"""The manifest's own path in a build folder; the only file that it does not list."""


class StoredArtifact(FrozenStruct):
    """A file that already lies in the content-addressed store: copied, not read, when the build is written."""

    sha256: str
    size: int


Content = bytes | StoredArtifact

How = Literal["omitted", "approximated", "carried as custom data"]
"""What becomes of what a target cannot say, the worst first. What is carried is in the files, for who knows of it; nothing acts on it by
itself."""

CARRIED: Final = "carried as custom data"

HOW: tuple[How, ...] = get_args(How)


class Loss(FrozenStruct):
    """Something a target cannot say. `mode` None where it is not of one mode; `path` of the occurrence, joint or
    mount; `what` in words; `origin` what in the documents made it."""

    target: str
    mode: str | None
    path: str
    what: str
    how: How
    origin: Origin = ()

    @property
    def span(self) -> Span | None:
        """Where it is shown: the first place of its origin."""
        return next(iter(self.origin), None)

    @staticmethod
    def of(origin: Origin, target: str, mode: str | None, path: str, what: str, how: How) -> Loss:
        """The loss of what an origin made."""
        return Loss(target=target, mode=mode, path=path, what=what, how=how, origin=origin)


def counts_of(losses: Iterable[Loss]) -> dict[str, int]:
    """How many there are, by what becomes of them."""
    counts = Counter(loss.how for loss in losses)
    return {how: counts[how] for how in HOW if counts[how]}


class Artifacts(FrozenStruct):
    """One emitter's answer: `{path in the build folder: content}` and the losses."""

    files: dict[str, Content]
    losses: tuple[Loss, ...] = ()
