"""Count imported robots by collection and by result. The results are equal, different with losses that explain the differences, rejected
with a reason, and wrong.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path

from thingc import __version__

HOW = ("as it was", "with losses that say so", "refused, and why", "wrong")


class Tally:
    """The results of a run, printed as a table with one row per collection. `reader` is the program that read the original files."""

    def __init__(self, reader: str) -> None:
        self.reader = reader
        self.counts: dict[str, Counter[str]] = {}

    def add(self, collection: str, said: str, fine: bool) -> None:
        """Count the result of one robot."""
        how = HOW[3] if not fine else HOW[0] if said == HOW[0] else HOW[2] if said.startswith("refused") else HOW[1]
        self.counts.setdefault(collection, Counter())[how] += 1

    @property
    def failed(self) -> int:
        """The number of robots with a wrong result."""
        return sum(counts[HOW[3]] for counts in self.counts.values())

    def __str__(self) -> str:
        rows = [["collection", "robots", *HOW], *(
            [name, str(counts.total()), *(str(counts[how]) for how in HOW)] for name, counts in self.counts.items()
        )]
        lines = [f"| {' | '.join(row)} |" for row in rows]
        head = f"{date.today().isoformat()}, thingc {__version__}, {self.reader}"
        return "\n".join([head, "", lines[0], "|---" * len(rows[0]) + "|", *lines[1:]])


def collections(arguments: Sequence[str], *endings: str) -> Iterator[tuple[str, Path]]:
    """Yield every file with one of the suffixes `endings`, with the name of its collection. The arguments have the form
    `NAME=FILE_OR_FOLDER`.
    """
    for argument in arguments:
        name, _, path = argument.rpartition("=")
        folder = Path(path)
        files = sorted(one for one in folder.rglob("*") if one.suffix in endings) if folder.is_dir() else [folder]
        yield from ((name or folder.name, file) for file in files)
