"""Diagnostics of every form on existing files, and a repository that contains the files."""

from __future__ import annotations

from pathlib import Path

from thingc.base.diagnostics import Code, Diagnostic, Note, Severity
from thingc.base.source import Span


def span(file: Path, line: int, column: int, end_column: int, end_line: int | None = None) -> Span:
    return Span(file=str(file), line=line, column=column, end_line=end_line or line, end_column=end_column)


def repository(folder: Path) -> Path:
    """Create a repository with documents whose names need every kind of escaping; thingc runs in its folder `work`."""
    (folder / ".git").mkdir()
    (folder / "work").mkdir()
    for name in ("robot.yaml", "a b,c%d#é.yaml", "c:d.yaml"):
        (folder / "work" / name).write_text("thingc: assembly/1\nname: two\ncomponents:\n  plate: {frame: true}\n")
    return folder


def every_shape(folder: Path) -> list[Diagnostic]:
    """Return diagnostics with and without a second location, on several lines, on a whole line, without a location, of each severity,
    and with special characters."""
    robot, odd, colon = (folder / "work" / name for name in ("robot.yaml", "a b,c%d#é.yaml", "c:d.yaml"))
    return [
        Diagnostic(code=Code.UNKNOWN_MOUNT, severity=Severity.ERROR, message="`plate` has no mount `topp`", span=span(robot, 4, 3, 8),
                   path="components.plate", help="did you mean `top`?", notes=(Note(message="written here", span=span(odd, 1, 1, 1)),)),
        Diagnostic(code=Code.UNKNOWN_MOUNT, severity=Severity.ERROR, message="`plate` has no mount `topp`", span=span(robot, 2, 1, 5)),
        Diagnostic(code=Code.EFFORT, severity=Severity.WARNING, message="100 % more,\nand: more\r", span=span(odd, 3, 1, 4, end_line=4),
                   notes=(Note(message="in words alone"),)),
        Diagnostic(code=Code.EFFORT, severity=Severity.NOTE, message="a note", span=span(colon, 1, 1, 7)),
        Diagnostic(code=Code.PART_RAISED, severity=Severity.ERROR, message="elsewhere", span=span(folder.parent / "part x.py", 7, 1, 1)),
        Diagnostic(code=Code.COMMAND_LINE, severity=Severity.ERROR, message="there is no option `--x`", help="try `--y`"),
        Diagnostic(code=Code.INTERNAL, severity=Severity.ERROR, message="thingc itself failed"),
    ]


def on_one_line(message: str) -> str:
    """Return a message of `every_shape` as it is printed: quoted line breaks are escaped."""
    return message.replace("\n", "\\n").replace("\r", "\\r")
