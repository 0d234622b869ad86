"""The output of part code, stored in the part's own folder as it is written, so that it is available even if the part crashes."""

from __future__ import annotations

import contextlib
import io
import os
import stat
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing_extensions import Buffer

NAME = "printed"
MOST = 64 * 1024
"""Bytes of a part's output that are stored."""
SHOWN = 40
"""Lines of output that are shown: the first and the last half of these if there are more."""
WIDTH = 400
"""Characters of a line that are shown."""


class _Kept(io.RawIOBase):
    """The first `MOST` bytes of output, in a file that is created when there are any. Failures are ignored."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._room = MOST

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        """Return that of the process's own standard error, for programs that the part starts: their output is not stored."""
        return 2

    def write(self, data: Buffer, /) -> int:
        given = bytes(data)
        kept, self._room = given[: self._room], self._room - min(self._room, len(given))
        if kept:
            with contextlib.suppress(OSError), open(self._path, "ab") as stream:
                stream.write(kept)
        return len(given)


@contextlib.contextmanager
def keep(folder: str) -> Iterator[None]:
    """Store in `folder` what `print` and other Python code write to standard output and standard error."""
    kept = io.TextIOWrapper(_Kept(os.path.join(folder, NAME)), encoding="utf-8", errors="backslashreplace", write_through=True)  # type: ignore[type-var]
    with contextlib.redirect_stdout(kept), contextlib.redirect_stderr(kept):
        yield


def lines_of(folder: str) -> list[str]:
    """Return the stored lines, shortened for display.

    The part must have ended. A file of another type that the part put in the place is not read.
    """
    try:
        descriptor = os.open(os.path.join(folder, NAME), os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    except OSError:  # nothing was printed
        return []
    with open(descriptor, "rb") as stream:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            return []
        data = stream.read(MOST)
    lines = [line[:WIDTH] for line in data.decode("utf-8", "replace").splitlines()]
    if len(data) == MOST:
        lines.append("...")
    if len(lines) <= SHOWN:
        return lines
    return [*lines[: SHOWN // 2], f"... ({len(lines) - SHOWN} lines)", *lines[-SHOWN // 2 :]]
