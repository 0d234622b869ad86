"""What linking has to say: each thing once, however often its definition is used, and whether anything was left out."""

from __future__ import annotations

from collections.abc import Iterable

from thingc.base.diagnostics import MAX_FAULTS, Code, Note, Report
from thingc.base.source import Origin, Span, line_of

_Key = tuple[Code, str, Span | None]


class LinkReport:
    """A `Report` as `link` uses it.

    A definition that stands in several places has the same fault in each: the first place is reported, with its chain
    of documents, and the others are not. `failed` says whether linking found an error, `incomplete` whether something
    was left out because it was wrong (here or in an earlier pass), `earlier` whether an earlier pass found an error.
    """

    def __init__(self, report: Report) -> None:
        self.report = report
        self.earlier = report.failed
        self.failed = False
        self.incomplete = False
        self._said: set[_Key] = set()

    def error(
        self, code: Code, message: str, origin: Origin, *, path: str | None = None, help: str | None = None, notes: Iterable[Note] = (),
        detail: str | None = None,
    ) -> None:
        """Say an error at `origin`, unless the same was said of the same place."""
        self.failed = True
        key = _key(code, message, origin)
        if self._may_say(key):
            self._said.add(key)
            self.report.add(code, message, origin or None, help=help, path=path, notes=notes, detail=detail)

    def warn(
        self, code: Code, message: str, origin: Origin, *, path: str | None = None, help: str | None = None, notes: Iterable[Note] = (),
    ) -> bool:
        """Say a warning at `origin`, unless the same was said of the same place. False where it is allowed there."""
        key = _key(code, message, origin)
        if key in self._said:
            self.report.allows(code, origin)  # what allows it at this place is needed, too
        if not self._may_say(key):
            return True
        said = self.report.warn(code, message, origin or None, help=help, path=path, notes=notes)
        if said:  # where it is allowed, it may still be said of another place that the definition is used at
            self._said.add(key)
        return said

    def has_said(self, code: Code) -> bool:
        """Whether something of this code was said while linking."""
        return any(known is code for known, _, _ in self._said)

    def leave_out(self) -> None:
        """Note that something could not be linked because what it needs is wrong and has been reported."""
        self.incomplete = True

    def _may_say(self, key: _Key) -> bool:
        """Whether it is new, and not one too many: of that is said, once, that there are more."""
        if len(self._said) == MAX_FAULTS and key not in self._said:
            self._said.add(key)
            self.report.add(Code.TOO_LARGE, f"more than {MAX_FAULTS} faults; the rest is not said", None)
        return key not in self._said and len(self._said) < MAX_FAULTS


def _key(code: Code, message: str, origin: Origin) -> _Key:
    """What makes two findings the same one."""
    return code, message, origin[0] if origin else None


def written_at(what: str, code: tuple[str, int] | None) -> tuple[Note, ...]:
    """The note "`arm:Pen` is written here", or none where the place is not known (a part of a file, a built-in)."""
    return (Note(message=f"{what} is written here", span=line_of(*code)),) if code is not None else ()
