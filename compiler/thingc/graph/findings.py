"""What linking has to say: each thing once, however often its definition is used, and whether anything was left out."""

from __future__ import annotations

from collections.abc import Iterable

from thingc.diagnostics import MAX_FAULTS, Code, Note, Report, Severity
from thingc.source import Origin, Span


class Findings:
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
        self._said: set[tuple[Code, str, Span | None]] = set()

    def error(
        self,
        code: Code,
        message: str,
        origin: Origin,
        *,
        path: str | None = None,
        help: str | None = None,
        notes: Iterable[Note] = (),
        detail: str | None = None,
    ) -> None:
        """Say an error at `origin`, unless the same was said of the same place."""
        self.failed = True
        self._say(Severity.ERROR, code, message, origin, path, help, notes, detail)

    def warn(
        self,
        code: Code,
        message: str,
        origin: Origin,
        *,
        path: str | None = None,
        help: str | None = None,
        notes: Iterable[Note] = (),
    ) -> bool:
        """Say a warning at `origin`, unless the same was said of the same place. False where it is allowed there."""
        return self._say(Severity.WARNING, code, message, origin, path, help, notes, None)

    def has_said(self, code: Code) -> bool:
        """Whether something of this code was said while linking."""
        return any(known is code for known, _, _ in self._said)

    def leave_out(self) -> None:
        """Note that something could not be linked because what it needs is wrong and has been reported."""
        self.incomplete = True

    def _say(
        self, severity: Severity, code: Code, message: str, origin: Origin, path: str | None, help: str | None,
        notes: Iterable[Note], detail: str | None,
    ) -> bool:
        key = (code, message, origin[0] if origin else None)
        if key in self._said and severity is Severity.WARNING:
            self.report.allows(code, origin)  # what allows it at this place is needed, too
        if key in self._said or len(self._said) > MAX_FAULTS:
            return True
        if len(self._said) == MAX_FAULTS:
            self._said.add(key)
            return self.report.add(Code.TOO_LARGE, f"more than {MAX_FAULTS} faults; the rest is not said", None)
        said = self.report.add(
            code, message, origin or None, help=help, path=path, notes=notes, severity=severity, detail=detail,
        )
        if said:  # where it is allowed, it may still be said of another place that the definition is used at
            self._said.add(key)
        return said


def line_of(file: str, line: int) -> Span:
    """The beginning of a line of a part file, for a note."""
    return Span(file=file, line=line, column=1, end_line=line, end_column=1)


def noted(message: str, origin: Origin) -> tuple[Note, ...]:
    """A note at the innermost place of `origin`, or none where it has no place."""
    return (Note(message=message, span=origin[0]),) if origin else ()


def written_at(what: str, code: tuple[str, int] | None) -> tuple[Note, ...]:
    """The note "`arm:Pen` is written here", or none where the place is not known (a part of a file, a built-in)."""
    return (Note(message=f"{what} is written here", span=line_of(*code)),) if code is not None else ()
