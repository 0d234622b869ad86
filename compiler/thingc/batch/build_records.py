"""What a batch has done, read in plan order whichever its layout: the lines of its variants, and their files."""

from __future__ import annotations

import contextlib
import json
import os
import re
from array import array
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Protocol

from thingc.base.filesystem import listing
from thingc.batch import folder_layout, journal, packed_layout
from thingc.batch.journal import Line
from thingc.batch.packed_layout import Chunk, Chunks, packed
from thingc.batch.rules import LENGTHS
from thingc.targets.artifact import Content, StoredArtifact

MESHES = "mjcf/assets/"
"""Where in a variant's folder the meshes of its models lie."""

_ID = re.compile("[0-9a-f]{12}")

File = tuple[Any, ...]
"""What a file is: equal where it is the same file."""


class VariantFiles(Protocol):
    """The files of a built variant."""

    def read(self, path: str) -> bytes:
        """One of them, by path in the build folder. Raises `FileNotFoundError`."""

    def models(self) -> list[str]:
        """The names of the files in `mjcf/`, sorted."""

    def meshes(self) -> dict[str, tuple[File, str]]:
        """Those of its models by name: what the file is, and its path on the disk."""


class BuildRecords(Protocol):
    """What a batch has done, by place in the plan."""

    @property
    def done(self) -> Sequence[int]:
        """The variants that are done, ascending."""

    @property
    def built(self) -> Sequence[int]:
        """Those that are built, and there."""

    def line(self, index: int) -> Line:
        """What is told of one. Raises `KeyError` for one that is not done."""

    def find(self, key: str) -> int | None:
        """The variant of this id, or else of this name."""

    def files(self, index: int) -> VariantFiles:
        """Its files, if it is built."""


def load_records(folder: str) -> BuildRecords:
    """What the batch in this folder has done until now."""
    return _Packed(folder) if packed(folder) else _Folders(folder)


def in_order(folder: str) -> Iterator[Line]:
    """The lines of all variants that are done, by index, one in memory at a time."""
    return packed_layout.in_order(folder) if packed(folder) else journal.in_order(os.path.join(folder, folder_layout.JOURNAL))


def spread(folder: str, most: int) -> tuple[int, Iterator[Line]]:
    """How many of these lines there are, and at most so many of them, evenly spread; one is in memory at a time."""
    if packed(folder):
        records = _Packed(folder)
        return len(records.done), (records.line(index) for index in _spread(records.done, most))
    path = os.path.join(folder, folder_layout.JOURNAL)
    begins = [at for at in journal.places(path) if at >= 0]
    return len(begins), (journal.line_at(path, at) for at in _spread(begins, most))


def _spread(numbers: Sequence[int], most: int) -> Iterator[int]:
    count = len(numbers)
    return (numbers[k * count // most] for k in range(most)) if count > most else iter(numbers)


def outcomes(folder: str, chance: Callable[[Line], bool] | None = None) -> Iterator[tuple[int, str, bool]]:
    """Of each variant that is done its place in the plan, its status, and whether that holds: not where it is said to be built and is
    not there, nor where another attempt has a `chance`."""
    if packed(folder):
        for chunk in _chunks(folder):
            for index, _, _, status in chunk.heads():
                yield index, status, status == "built" or chance is None or not chance(chunk.line(index))
        return
    for line in in_order(folder):
        there = os.path.isfile(folder_layout.manifest_of(folder, line["id"])) if line["status"] == "built" else True
        yield int(line["index"]), line["status"], there and not (chance is not None and chance(line))


def lengths_in(folder: str) -> list[str]:
    """The results `length.JOINT` that any variant has, sorted."""
    names: set[str] = set()
    if packed(folder):
        for chunk in _chunks(folder):
            names.update(chunk.lengths)
    else:
        for line in in_order(folder):
            names.update(name for name in line.get("results", ()) if name.startswith(LENGTHS))
    return sorted(names)


def losses(folder: str) -> tuple[int, Counter[str]]:
    """How many variants have losses, and how many there are in all, by what becomes of them."""
    counts: Counter[str | None] = Counter()
    if packed(folder):
        for chunk in _chunks(folder):
            counts += chunk.losses()
    else:
        counts.update(json.dumps(line.get("losses")) for line in in_order(folder))
    lossy, total = 0, Counter[str]()
    for text, count in counts.items():
        each = json.loads(text or "null")
        lossy += count if each else 0
        total.update({how: number * count for how, number in (each or {}).items()})
    return lossy, total


def _chunks(folder: str) -> Iterator[Chunk]:
    for number in packed_layout.numbers(folder):
        chunk = Chunk(folder, number)
        yield chunk
        chunk.close()


class _Folders:
    """Of a batch with a folder for each variant."""

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self._lines = {int(line["index"]): line for line in journal.in_order(os.path.join(folder, folder_layout.JOURNAL))}
        self.done = tuple(self._lines)
        self.built = tuple(
            index for index, line in self._lines.items()
            if line["status"] == "built" and os.path.isfile(folder_layout.manifest_of(folder, line["id"]))
        )
        self._known: dict[str, int] = {}

    def line(self, index: int) -> Line:
        return self._lines[index]

    def find(self, key: str) -> int | None:
        if not self._known:
            self._known = {line[name]: index for name in ("name", "id") for index, line in self._lines.items()}
        return self._known.get(key)

    def files(self, index: int) -> VariantFiles:
        return _InFolder(folder_layout.variant_folder(self.folder, self._lines[index]["id"]))


class _InFolder:
    """The files of a variant's folder."""

    def __init__(self, folder: str) -> None:
        self.folder = folder

    def read(self, path: str) -> bytes:
        with open(os.path.join(self.folder, path), "rb") as stream:
            return stream.read()

    def models(self) -> list[str]:
        return listing(os.path.join(self.folder, "mjcf"))

    def meshes(self) -> dict[str, tuple[File, str]]:
        """Hard links to one mesh are one file (a number of a deleted file is given to another one, which has other times)."""
        place = os.path.join(self.folder, MESHES)
        if not os.path.isdir(place):
            return {}
        with os.scandir(place) as entries:
            states = {entry.name: (entry.stat(), entry.path) for entry in entries}
        return {name: ((one.st_dev, one.st_ino, one.st_size, one.st_mtime_ns), path) for name, (one, path) in sorted(states.items())}


class _Packed:
    """Of a packed batch: a few bytes for each variant, and what is asked for."""

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self.chunks = Chunks(folder)
        self.done = array("q")
        self.built = array("q")
        self._ids = array("Q")
        for chunk in _chunks(folder):
            heads = chunk.heads()
            self.done.extend(head[0] for head in heads)
            self.built.extend(head[0] for head in heads if head[3] == "built")
            self._ids.extend(int(head[1], 16) for head in heads)

    def line(self, index: int) -> Line:
        with self.chunks.holding(index) as chunk:
            return chunk.line(index)

    def find(self, key: str) -> int | None:
        if _ID.fullmatch(key):
            with contextlib.suppress(ValueError):
                return self.done[self._ids.index(int(key, 16))]
        number = re.search("[0-9]+$", key)
        index = int(number[0]) if number is not None else -1  # as names are counted, unless the document gives others
        if _holds(self.done, index) and self.line(index)["name"] == key:
            return index
        return next((head[0] for chunk in _chunks(self.folder) for head in chunk.heads() if head[2] == key), None)

    def files(self, index: int) -> VariantFiles:
        return _InChunk(self.chunks, index)


class _InChunk:
    """The files of a packed variant."""

    def __init__(self, of: Chunks, index: int) -> None:
        self.chunks = of
        self.index = index

    def read(self, path: str) -> bytes:
        with self.chunks.holding(self.index) as chunk:
            data = chunk.read(self.index, path)
            shared = chunk.shared(self.index).get(path) if data is None else None
        if data is not None:
            return data
        if shared is None:
            raise FileNotFoundError(path)
        return folder_layout.SharedAssets(self.chunks.folder).read(shared)

    def models(self) -> list[str]:
        with self.chunks.holding(self.index) as chunk:
            return sorted(path.removeprefix("mjcf/") for path in chunk.row(self.index).files if path.startswith("mjcf/"))

    def meshes(self) -> dict[str, tuple[File, str]]:
        with self.chunks.holding(self.index) as chunk:
            shared = chunk.shared(self.index)
        return {
            path.removeprefix(MESHES): ((sha256,), folder_layout.asset_path(self.chunks.folder, sha256))
            for path, sha256 in shared.items() if path.startswith(MESHES)
        }


def unpack(folder: str, index: int) -> str:
    """Write the folder of a built variant of a packed batch, `variants/<id>/` as of any other batch; the folder's path. Meshes are hard
    links. Raises `OSError`."""
    with Chunks(folder).holding(index) as chunk:
        row, id = chunk.row(index), str(chunk.line(index)["id"])
        files: dict[str, Content] = {
            **row.files, **{path: StoredArtifact(sha256=sha256, size=0) for path, sha256 in chunk.shared(index).items()}
        }
    os.makedirs(os.path.join(folder, folder_layout.VARIANTS), exist_ok=True)
    folder_layout.write_variant(folder, id, files, folder_layout.SharedAssets(folder))
    return folder_layout.variant_folder(folder, id)


def _holds(done: Sequence[int], index: int) -> bool:
    """Whether an ascending sequence has a number."""
    at = bisect_left(done, index)
    return at < len(done) and done[at] == index
