"""Where a part was when its process died or was stopped: read off what the interpreter wrote with its last breath."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from thingc.geometry.record import PartFailure
from thingc.geometry.record_json import full

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace

_FRAME = re.compile(r'^\s*File "(?P<file>.+?)", line (?P<line>\d+)', re.MULTILINE)


def failure_of(subject: str, answer: Mapping[str, Any], timeout: float, workspace: Workspace) -> PartFailure:
    """What to say of a part that has ended its process, by the answer of the worker; `timeout` [s] is what it was given."""
    file, line = _place_of(answer.get("detail", ""), workspace)
    message = f"it was not done after {timeout:g} s" if answer["failed"] == "hung" else answer["words"]
    return PartFailure(
        subject=subject, kind=answer["failed"], message=message, file=full(file, workspace.root), line=line,
        detail=answer.get("detail") or None,
    )


def _place_of(trace: str, workspace: Workspace) -> tuple[str | None, int | None]:
    """The innermost `(file, line)` of a part folder in what `faulthandler` wrote (most recent call first)."""
    folders = tuple(os.path.join(folder, "") for folder in workspace.parts)
    # of several threads, and of a trace before the last, the one that was written last counts
    for match in _FRAME.finditer(trace[max(trace.rfind("most recent call first"), 0) :]):
        if match["file"].startswith(folders):
            return match["file"], int(match["line"])
    return None, None
