"""Report the diagnostics of the pass `link` without duplicates, and record whether elements of the robot were omitted."""

from __future__ import annotations

from collections.abc import Iterable

from thingc.base.diagnostics import MAX_FAULTS, Code, Note, Report
from thingc.base.source import Origin, Span, line_of
from thingc.base.suggestions import Hint

_Key = tuple[Code, str, Span | None]


class LinkReport:
    """Collects the diagnostics of the pass `link` and removes duplicates.

    Errors of a definition that is used several times are reported once, at the first use, with the chain of documents. `failed` is True if
    the pass has reported an error, and `earlier` is True if an earlier pass has reported an error. `incomplete` is True if an element of
    the robot was omitted because of an error in any pass.
    """

    def __init__(self, report: Report) -> None:
        self.report = report
        self.earlier = report.failed
        self.failed = False
        self.incomplete = False
        self._reported: set[_Key] = set()

    def error(
        self, code: Code, message: str, origin: Origin, *, path: str | None = None, help: Hint | None = None, notes: Iterable[Note] = (),
        detail: str | None = None,
    ) -> None:
        """Report an error at `origin`, unless an equal error has been reported."""
        self.failed = True
        key = _key(code, message, origin)
        if self._may_report(key):
            self._reported.add(key)
            self.report.add(code, message, origin or None, help=help, path=path, notes=notes, detail=detail)

    def warn(
        self, code: Code, message: str, origin: Origin, *, path: str | None = None, help: Hint | None = None, notes: Iterable[Note] = (),
        allow: bool = True,
    ) -> bool:
        """Report a warning at `origin`, unless an equal warning has been reported. With `allow`, the output shows how to suppress it.

        Return False if the document suppresses the warning at this location.
        """
        key = _key(code, message, origin)
        if key in self._reported:
            self.report.allows(code, origin)  # this call also marks the `allow` at this location as used
        if not self._may_report(key):
            return True
        reported = self.report.warn(code, message, origin or None, help=help, path=path, notes=notes, allow=allow)
        if reported:  # a warning that is suppressed at this use of the definition may still be reported at another use
            self._reported.add(key)
        return reported

    def has_reported(self, code: Code) -> bool:
        """Return whether the pass `link` has reported a diagnostic with this code."""
        return any(reported_code is code for reported_code, _, _ in self._reported)

    def _may_report(self, key: _Key) -> bool:
        """Return whether to report a diagnostic: it is not a duplicate, and the maximum number of diagnostics has not been reached.

        A diagnostic about the exceeded maximum is reported once.
        """
        if len(self._reported) == MAX_FAULTS and key not in self._reported:
            self._reported.add(key)
            self.report.add(Code.TOO_LARGE, f"more than {MAX_FAULTS} errors; further errors are not shown", None)
        return key not in self._reported and len(self._reported) < MAX_FAULTS


def _key(code: Code, message: str, origin: Origin) -> _Key:
    """Return the key of a diagnostic. Diagnostics with equal keys are duplicates."""
    return code, message, origin[0] if origin else None


def written_at(label: str, code: tuple[str, int] | None) -> tuple[Note, ...]:
    """Return a note with the location of part code: "`arm:Pen` is defined here". `label` is the quoted name of the part.

    If the location is unknown, as for parts from files and built-in parts, return no notes.
    """
    return (Note(message=f"{label} is defined here", span=line_of(*code)),) if code is not None else ()
