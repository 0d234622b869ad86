"""Read the results of a batch: the journal lines and the files of its variants, in the order of the plan.

The module supports the layouts `folders` and `packed`.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from array import array
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from thingc.base.diagnostics import Code, shown_path
from thingc.base.filesystem import hash_name, listing
from thingc.batch import folder_layout
from thingc.batch.folder import BatchFault, check_chunks, explain_os_error, read_batch
from thingc.batch.folder_layout import Line
from thingc.batch.packed_layout import Chunk, Chunks, is_packed, numbers
from thingc.batch.planning import Plan
from thingc.batch.variant import Variant
from thingc.targets.artifact import MANIFEST, Content, StoredArtifact

MESHES = "mjcf/assets/"
"""Path of the folder with the meshes of models, inside the folder of a variant."""

File = tuple[Any, ...]
"""The type of the values that identify files. Equal values identify the same file."""


def in_order(folder: str) -> Iterator[Line]:
    """Yield the journal lines of all finished variants of a batch, in the order of the plan."""
    for chunk in _chunks(folder):
        yield from map(chunk.line, chunk.indices)


def sample_records(folder: str, max_records: int) -> tuple[int, Iterator[Line]]:
    """Return the number of finished variants of a batch, and an iterator over at most `max_records` of their journal lines, evenly
    spaced."""
    records = BuildRecords(folder)
    count = len(records.done)
    places = range(count) if count <= max_records else (k * count // max_records for k in range(max_records))
    return count, (records.line(records.done[place]) for place in places)


def outcomes(folder: str, chance: Callable[[Line], bool] | None = None) -> Iterator[tuple[int, str, bool]]:
    """Yield the index, the status and a flag for each finished variant of a batch. The flag is True if the outcome of the variant is final.

    The outcome of a built variant whose files are missing is not final. If `chance` is given, the outcome of any other variant whose
    journal line satisfies `chance` is also not final.
    """
    for chunk in _chunks(folder):
        for index, id, _, status in chunk.heads():
            is_final = _has_files(folder, id) if status == "built" else chance is None or not chance(chunk.line(index))
            yield index, status, is_final


def lengths_in(folder: str) -> list[str]:
    """Return the sorted names of all results `length.JOINT` that occur in a batch."""
    return sorted({name for chunk in _chunks(folder) for name in chunk.lengths})


def losses(folder: str) -> tuple[int, Counter[str]]:
    """Return the number of variants with export losses, and the total number of export losses of each kind."""
    counts: Counter[str | None] = Counter()
    for chunk in _chunks(folder):
        counts += chunk.losses()
    lossy, total = 0, Counter[str]()
    for text, count in counts.items():
        counts_by_kind = json.loads(text or "null")
        lossy += count if counts_by_kind else 0
        total.update({kind: number * count for kind, number in (counts_by_kind or {}).items()})
    return lossy, total


def _chunks(folder: str) -> Iterator[Chunk]:
    for number in numbers(folder):
        with contextlib.closing(Chunk(folder, number)) as chunk:
            yield chunk


def _has_files(folder: str, id: str) -> bool:
    """Return whether the files of a built variant exist.

    The function checks only the manifest of the variant, because the manifest is written last.
    """
    return is_packed(folder) or os.path.isfile(os.path.join(folder_layout.variant_folder(folder, id), MANIFEST))


class BuildRecords:
    """The finished variants of the batch in a folder. The methods identify a variant by its index in the plan.

    `done` contains the indices of all finished variants in ascending order. `built` contains the indices of the built variants whose files
    exist. The class uses a few bytes of memory per variant, and caches the chunk that was read last.
    """

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self.done = array("q")
        self.built = array("q")
        self._ids = array("Q")
        self._chunks = Chunks(folder)
        for number in numbers(folder):
            with self._chunks.of(number) as chunk:
                heads = chunk.heads()
            self.done.extend(index for index, *_ in heads)
            self.built.extend(index for index, id, _, status in heads if status == "built" and _has_files(folder, id))
            self._ids.extend(int(hash_name(id, 12), 16) for _, id, *_ in heads)

    def line(self, index: int) -> Line:
        """Return the journal line of the variant with the index `index` in the plan. Raises `KeyError` if the variant is not finished."""
        with self._chunks.holding(index) as chunk:
            return chunk.line(index)

    def find(self, key: str) -> int | None:
        """Return the index of the finished variant with the id or name `key`. Return None if no finished variant has this id or name."""
        with contextlib.suppress(ValueError):
            return self.done[self._ids.index(int(hash_name(key, 12), 16))]
        number = re.search("[0-9]+$", key)
        index = int(number[0]) if number is not None else -1  # default names; documents can define other names
        if contains(self.done, index) and self.line(index)["name"] == key:
            return index
        return next((head[0] for chunk in _chunks(self.folder) for head in chunk.heads() if head[2] == key), None)

    def files(self, index: int) -> VariantFiles:
        """Return an object that reads the files of a built variant."""
        if is_packed(self.folder):
            return _InChunk(self._chunks, index)
        return _InFolder(folder_layout.variant_folder(self.folder, self.line(index)["id"]))


class _InFolder:
    """Reads the files of a variant that has its own folder.

    `read` returns the content of a file by its path in the build folder, or raises `FileNotFoundError`. `models` returns the sorted names
    of the files in `mjcf/`. `meshes` maps the file name of each mesh to its identity and its path on disk.
    """

    def __init__(self, folder: str) -> None:
        self.folder = folder

    def read(self, path: str) -> bytes:
        return folder_layout.read_file(os.path.join(self.folder, path))

    def models(self) -> list[str]:
        return listing(os.path.join(self.folder, "mjcf"))

    def meshes(self) -> dict[str, tuple[File, str]]:
        """Return a mapping from the file name of each mesh of the variant to its identity and its path on disk.

        All hard links to the same mesh file have the same identity. The identity includes the modification time, because inode numbers are
        reused.
        """
        place = os.path.join(self.folder, MESHES)
        if not os.path.isdir(place):
            return {}
        with os.scandir(place) as entries:
            states = {entry.name: (entry.stat(), entry.path) for entry in entries}
        return {name: ((stat.st_dev, stat.st_ino, stat.st_size, stat.st_mtime_ns), path) for name, (stat, path) in sorted(states.items())}


class _InChunk:
    """Reads the files of a variant in a packed batch. The class has the same methods as `_InFolder`."""

    def __init__(self, chunks: Chunks, index: int) -> None:
        self.chunks = chunks
        self.index = index

    def read(self, path: str) -> bytes:
        with self.chunks.holding(self.index) as chunk:
            if path in chunk.paths and (data := chunk.cell(self.index, path)) is not None:
                return bytes(data)
            shared = chunk.asset_digests(self.index)
        if path not in shared:
            raise FileNotFoundError(path)
        return folder_layout.SharedAssets(self.chunks.folder).read(shared[path])

    def models(self) -> list[str]:
        with self.chunks.holding(self.index) as chunk:
            paths = [path for path in chunk.paths if path.startswith("mjcf/") and chunk.cell(self.index, path) is not None]
        return [path.removeprefix("mjcf/") for path in paths]

    def meshes(self) -> dict[str, tuple[File, str]]:
        with self.chunks.holding(self.index) as chunk:
            shared = chunk.asset_digests(self.index)
        return {
            path.removeprefix(MESHES): ((sha256,), folder_layout.asset_path(self.chunks.folder, sha256))
            for path, sha256 in shared.items() if path.startswith(MESHES)
        }


VariantFiles = _InFolder | _InChunk


def unpack(folder: str, index: int) -> None:
    """Write the files of a built variant of a packed batch to the folder `variants/<id>/`.

    Mesh files become hard links to shared files. Raises `OSError` if a file cannot be read or written.
    """
    with Chunks(folder).holding(index) as chunk:
        id = str(chunk.line(index)["id"])
        files: dict[str, Content] = {
            **chunk.files(index), **{path: StoredArtifact(sha256=sha256, size=0) for path, sha256 in chunk.asset_digests(index).items()}
        }
    os.makedirs(os.path.join(folder, folder_layout.VARIANTS), exist_ok=True)
    folder_layout.write_variant(folder, id, files, folder_layout.SharedAssets(folder))


def contains(indices: Sequence[int], index: int) -> bool:
    """Return whether the sorted sequence `indices` contains `index`."""
    at = bisect_left(indices, index)
    return at < len(indices) and indices[at] == index


def find_variant(plan: Plan, key: str, folder: str) -> tuple[Variant, str | None] | None:
    """Return the variant of a plan whose id or name is `key`, and the rule that it violates, if any.

    Return None if the plan does not contain the variant. If the batch in `folder` contains `key`, the function returns the variant with the
    settings recorded there: after changes of the documents, the same id or name can refer to other settings, because the id depends on the
    assembly document, and a default name on the order of variants. Raises `BatchFault` if no variant of the plan has these settings.
    """
    line = _find_record(plan, key, folder)
    if line is None:
        variant = next((planned for planned in plan if key in (planned.id, planned.name)), None)
        return None if variant is None else (variant, variant.failed)
    for variant in plan:
        if (dict(variant.values), plan.choices_of(variant)) == (line["parameters"], line["choices"]):
            return variant, variant.failed or line.get("rule")
    raise BatchFault(
        Code.BATCH_CHANGED,
        f"the variant `{key}` in `{shown_path(folder)}` does not match `{plan.relative}`",
        "build the batch again, and use an identifier from the new table",
    )


def _find_record(plan: Plan, key: str, folder: str) -> Line | None:
    """Return the journal line of the variant with the id or name `key` in the batch in `folder`.

    Return None if the folder contains a batch of another document.
    """
    described = read_batch(folder)
    if described is None or described.get("document") != plan.relative:
        return None
    try:
        check_chunks(folder, described)
        records = BuildRecords(folder)
        index = records.find(key)
        return None if index is None else records.line(index)
    except OSError as fault:
        raise explain_os_error(folder, fault) from fault
