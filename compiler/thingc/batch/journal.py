"""The journal: one line of JSON for each variant that is done, only ever appended to. It alone says what a batch has done."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from typing import Any

Line = dict[str, Any]


class Journal:
    """An open journal. A context manager: leaving it closes the file.

    A line is written by one call and stands as a whole; a last line that a kill has torn is cut off when the journal is opened
    again. Raises `OSError` where the system refuses; what had been written of the line is taken back then.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o666)
        try:
            _mend(self._descriptor)
        except BaseException:
            os.close(self._descriptor)
            raise

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *exception: object) -> None:
        os.close(self._descriptor)

    def append(self, line: Line) -> None:
        """Write a line."""
        data = json.dumps(line, separators=(",", ":"), ensure_ascii=False).encode() + b"\n"
        size = os.fstat(self._descriptor).st_size
        try:
            done = os.write(self._descriptor, data)
            while done < len(data):
                done += os.write(self._descriptor, data[done:])
        except OSError:
            os.ftruncate(self._descriptor, size)
            raise

    def sync(self) -> None:
        """Down to the disk."""
        os.fsync(self._descriptor)


def _mend(descriptor: int) -> None:
    """Cut off a last line without an end."""
    size = os.fstat(descriptor).st_size
    keep = size
    while keep > 0:
        start = max(0, keep - 65536)
        block = os.pread(descriptor, keep - start, start)
        at = block.rfind(b"\n")
        if at >= 0:
            keep = start + at + 1
            break
        keep = start
    if keep != size:
        os.ftruncate(descriptor, keep)


def lines(path: str) -> Iterator[tuple[int, Line]]:
    """Every whole line and the place where it begins, in the order written; a torn last one is passed over."""
    at = 0
    if not os.path.exists(path):
        return
    with open(path, "rb") as stream:
        for data in stream:
            if data.endswith(b"\n"):
                yield at, json.loads(data)
            at += len(data)
