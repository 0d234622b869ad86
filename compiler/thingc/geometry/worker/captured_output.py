"""What part code prints: kept in the part's own folder as it comes, so that it is there whatever becomes of the part."""

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
"""How many bytes are kept of what a part prints."""
SHOWN = 40
"""How many lines of it are shown: of more the first half and the last."""
WIDTH = 400
"""How many characters of a line are shown."""


class _Kept(io.RawIOBase):
    """The first `MOST` bytes of what is written, in a file that is made when there are any. Who prints hears of no failure."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._room = MOST

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        """Of the process's own standard error, for programs that the part starts: what they say is not kept."""
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
    """While it lasts, `print` and whatever else writes to standard output and standard error by Python is kept in `folder`."""
    kept = io.TextIOWrapper(_Kept(os.path.join(folder, NAME)), encoding="utf-8", errors="backslashreplace", write_through=True)  # type: ignore[type-var]
    with contextlib.redirect_stdout(kept), contextlib.redirect_stderr(kept):
        yield


def lines_of(folder: str) -> list[str]:
    """What was kept there, for people. Nobody may be at work there any more; whatever else a part has put in the place is not read."""
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
