"""What emitters give back: files by relative path, and what their target could not say."""

from __future__ import annotations

from dataclasses import field

from thingc.frozen import dataclass
from thingc.source import Origin, Span

MANIFEST = "manifest.json"
"""The manifest's own path in a build folder; the only file that it does not list."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stored:
    """A file that already lies in the content-addressed store: copied, not read, when the build is written."""

    sha256: str
    size: int


Content = bytes | Stored


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """Something a target cannot say. `how` is `approximated | carried as custom data | omitted`; `mode` None where it
    is not of one mode; `path` of the occurrence, joint or mount; `what` in words."""

    target: str
    mode: str | None
    path: str
    what: str
    how: str
    span: Span | None

    @staticmethod
    def of(origin: Origin, target: str, mode: str | None, path: str, what: str, how: str) -> Loss:
        """The loss of what an origin made: it is shown at the first place."""
        return Loss(target=target, mode=mode, path=path, what=what, how=how, span=next(iter(origin), None))


@dataclass(frozen=True, slots=True, kw_only=True)
class Artifacts:
    """One emitter's answer: `{path in the build folder: content}` and the losses."""

    files: dict[str, Content]
    losses: tuple[Loss, ...] = field(default=())
