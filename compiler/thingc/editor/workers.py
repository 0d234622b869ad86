"""Workers for a geometry service that must never wait, and for one that can be ended from another thread."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from thingc.realize.client import WorkerBroken, Workers

ABSENT = "absent"
"""The kind of failure of a part of which the store knows nothing."""


class NoWorkers(Workers):
    """None at all: what is not in the store is `ABSENT`."""

    def __init__(self) -> None:
        super().__init__(1)

    def warm(self) -> None:
        """Nothing to start."""

    def run(self, requests: Iterable[Mapping[str, Any]]) -> Iterator[tuple[Mapping[str, Any], dict[str, Any]]]:
        """Every request fails."""
        for request in requests:
            yield request, {"failed": ABSENT, "words": "the store does not have it", "detail": ""}


class EndingWorkers(Workers):
    """Workers that stay ended: after `end` whoever still waits for an answer gets failures, and none is started again."""

    ended = False

    def ensure(self) -> None:
        """Start those that are missing. Raises `WorkerBroken` after the end."""
        if self.ended:
            raise WorkerBroken("the watch has ended")
        super().ensure()

    def end(self) -> None:
        """End them for good."""
        self.ended = True
        self.close()
