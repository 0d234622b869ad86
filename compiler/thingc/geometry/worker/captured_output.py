"""Capture the output of part code in a file, so that the output is available even if the part crashes."""

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
"""Maximum number of bytes of a part's output that are stored."""
SHOWN = 40
"""Maximum number of lines of output that are shown. If the output is longer, half of these lines are from its beginning and half from its
end.
"""
WIDTH = 400
"""Maximum number of characters of a line that are shown."""


class _LimitedFile(io.RawIOBase):
    """A file object that stores the first `MOST` bytes of output in a file. The first write operation creates the file. Write errors are
    ignored.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        self._room = MOST

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        """Return the file descriptor of the standard error of the process. Programs that the part starts use this descriptor.

        The output of these programs is not stored.
        """
        return 2

    def write(self, data: Buffer, /) -> int:
        output = bytes(data)
        kept, self._room = output[: self._room], self._room - min(self._room, len(output))
        if kept:
            with contextlib.suppress(OSError), open(self._path, "ab") as stream:
                stream.write(kept)
        return len(output)


@contextlib.contextmanager
def keep(folder: str) -> Iterator[None]:
    """Store in `folder` the output of `print` and other Python code to standard output and standard error."""
    stream = io.TextIOWrapper(_LimitedFile(os.path.join(folder, NAME)), encoding="utf-8", errors="backslashreplace", write_through=True)  # type: ignore[type-var]
    with contextlib.redirect_stdout(stream), contextlib.redirect_stderr(stream):
        yield


def lines_of(folder: str) -> list[str]:
    """Return the lines of output that a part wrote, shortened for display. The part must have ended before this call.

    If the part replaced the output file by an object that is not a regular file, the object is not read.
    """
    try:
        descriptor = os.open(os.path.join(folder, NAME), os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    except OSError:  # the part did not print any output
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
