"""Read and write the packed layout of a batch. Each file, such as `chunks/000012.parquet`, contains 1024 variants with their files.

    chunks/000012.parquet       one row per variant, with the cells of the table, and a column per file, by its path in the build folder
    chunks/000012.run.parquet   the same rows, with data about the run (seconds, modelled parts)
    chunks/000012.jsonl         the journal of an incomplete chunk, including files

A chunk is *sealed* when all of its variants have finished: the chunk file is written and renamed, and the journal of the chunk is removed.
The plan determines the variants and their order, so a batch always has the same chunks. Files of neighbouring variants differ only in a few
numbers. A compressed file therefore takes some hundred bytes, and reading a file decompresses one column of one group of rows. Files in the
store are written to `assets/` once, and rows refer to these files in the column `shared`. The index of a variant in the plan determines the
chunk and the row of this variant. No separate index of the variants is needed.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import sys
import threading
from array import array
from bisect import bisect_right
from collections import Counter, OrderedDict
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from thingc.base.diagnostics import shown_path
from thingc.batch import folder_layout
from thingc.batch.folder_layout import Journal, Line, lines
from thingc.batch.rules import LENGTHS

if TYPE_CHECKING:
    from pyarrow.parquet import ParquetFile

LARGEST = 2**31 - 1
"""Maximum total size [bytes] of the strings in one Arrow array."""


CHUNK = 1024
"""Number of variants in a chunk."""
GROUP, GROUP_BYTES = 64, 32 * 2**20
"""Number of rows in a group, and maximum total size [bytes] of the files in a group.

To read a single file, the whole group is decompressed.
"""
RUN = ("seconds", "modelled", "reused", "pid", "printed", "detail")
"""Keys of a journal line that describe the run."""
FILES, SHARED = "files", "shared"
"""Keys in the journal line of a built variant.

The first value maps paths to files in base64, and the second value maps paths to the SHA-256 of files in `assets/`.
"""
HEADS = ("index", "id", "name", "status")
CELLS = (*HEADS, "losses", "line", SHARED)
"""The columns of a chunk file that precede the columns of files.

The column `line` contains the journal line. The columns `line`, `losses` and `shared` contain JSON.
"""
OPEN_MOST, COLUMNS_MOST = 16, 24
"""Maximum number of chunks that a reader has open, and maximum number of cached columns per open chunk."""

SEALED, RUN_FILE, JOURNAL = ".parquet", ".run.parquet", ".jsonl"
"""Suffixes of the names of chunk files, of files with data about the run, and of journals."""


class DamagedChunk(OSError):
    """Raised if a file of a chunk is damaged."""

    state = "is damaged"
    cure = "delete the file, and continue with --resume"

    def __init__(self, path: str) -> None:
        self.words = f"`{shown_path(path)}` {self.state}"
        super().__init__(f"{self.words}: {self.cure}")


class MissingChunk(DamagedChunk):
    """Raised if the variants of a chunk are finished, but a file of this chunk does not exist."""

    state = "no longer exists"
    cure = "continue with --resume"


@contextlib.contextmanager
def _reading(path: str) -> Iterator[None]:
    """Convert errors while reading a chunk file to `DamagedChunk`."""
    from pyarrow import ArrowException

    try:
        yield
    except (ArrowException, OSError) as fault:
        raise DamagedChunk(path) from fault


def _chunk_path(folder: str, number: int, end: str) -> str:
    return os.path.join(folder, folder_layout.CHUNKS, f"{number:06d}{end}")


def sealed_path(index: int) -> str:
    """Return the path of the chunk file that contains the variant with this index, relative to the folder of the batch."""
    return f"{folder_layout.CHUNKS}/{index // CHUNK:06d}.parquet"


def is_packed(folder: str) -> bool:
    """Return whether the batch in this folder has the packed layout."""
    return os.path.isdir(os.path.join(folder, folder_layout.CHUNKS))


def complete(folder: str, count: int) -> None:
    """Raise `MissingChunk` if the chunk of one of the first `count` variants is missing, or if a finished chunk lacks a file.

    When a chunk is sealed, its run file is written first, and its journal is removed last.
    """
    sealed = _numbers(folder, SEALED) | _numbers(folder, RUN_FILE) if is_packed(folder) else set()
    for number in sorted({*range(-(-count // CHUNK)), *sealed}):
        for ends in ((RUN_FILE,), (SEALED, JOURNAL)):
            if not any(os.path.exists(_chunk_path(folder, number, end)) for end in ends):
                raise MissingChunk(_chunk_path(folder, number, ends[0]))


def numbers(folder: str) -> list[int]:
    """Return the numbers of all chunks that contain finished variants, in ascending order.

    A batch that is not packed is treated as a single chunk that has only a journal.
    """
    return sorted(_numbers(folder, SEALED) | _numbers(folder, JOURNAL)) if is_packed(folder) else [0]


def _numbers(folder: str, end: str) -> set[int]:
    """Return the numbers of the chunks that have a file whose name ends with `end`."""
    names = os.listdir(os.path.join(folder, folder_layout.CHUNKS))
    return {int(name[:6]) for name in names if name[6:] == end and name[:6].isdecimal()}


# --- writing ----------------------------------------------------------------------------------------------------------


class PackedWriter(contextlib.AbstractContextManager["PackedWriter"]):
    """Records the finished variants of a packed batch. The writer first writes variants to the journal of their chunk.

    `done` contains a flag for each variant that is True if the variant has finished. On exit, this context manager closes the journals of
    the chunks without sealing the chunks.

    All methods raise `OSError` if writing fails. After such an error, the journal does not contain an incomplete line.
    """

    def __init__(self, folder: str, done: Sequence[int]) -> None:
        self.folder = folder
        self.done = done
        self._open: dict[int, tuple[Journal, set[int]]] = {}

    def __exit__(self, *exception: object) -> None:
        for journal, _ in self._open.values():
            journal.__exit__()
        self._open.clear()

    def append(self, line: Line) -> None:
        """Record a finished variant in the journal of its chunk. If all variants of the chunk have finished, seal the chunk."""
        number = int(line["index"]) // CHUNK
        journal, missing = self._open[number] if number in self._open else self._open_chunk(number)
        journal.append(line)
        missing.discard(int(line["index"]))
        if not missing:
            self._seal(number)

    def sync(self) -> None:
        """Seal every chunk that contains new variants, even if it is incomplete. Call this method at the end of a batch."""
        for number in sorted(_numbers(self.folder, JOURNAL)):
            self._seal(number)

    def _open_chunk(self, number: int) -> tuple[Journal, set[int]]:
        journal = Journal(_chunk_path(self.folder, number, JOURNAL))
        indices = range(number * CHUNK, min((number + 1) * CHUNK, len(self.done)))
        self._open[number] = journal, {index for index in indices if not self.done[index]}
        return self._open[number]

    def _seal(self, number: int) -> None:
        if number in self._open:
            self._open.pop(number)[0].__exit__()
        seal(self.folder, number)


def seal(folder: str, number: int) -> None:
    """Write the chunk file from the old chunk file and the chunk's journal, and remove the journal.

    After an interruption, the old chunk file or the journal still exists.
    """
    from pyarrow import parquet

    chunk = Chunk(folder, number)
    schema, run_schema = _schemas(chunk.paths, chunk.lengths)
    options: dict[str, Any] = {
        "compression": "zstd", "compression_level": 3, "use_dictionary": ["status", "losses", SHARED], "write_statistics": False,
        "data_page_size": 2 * GROUP_BYTES,
    }
    new = f"{folder_layout.NEW}{number:06d}"
    fresh = {end: _chunk_path(folder, number, end).replace(f"{number:06d}", new) for end in (RUN_FILE, SEALED)}
    with (
        contextlib.closing(chunk), parquet.ParquetWriter(fresh[SEALED], schema, **options) as rows,
        parquet.ParquetWriter(fresh[RUN_FILE], run_schema, compression="zstd", write_statistics=False) as runs,
    ):
        for group in _groups(chunk, ("run", *schema.names)):
            rows.write_table(arrow_table(schema, [cells[1:] for cells in group]))
            runs.write_table(arrow_table(run_schema, [(index, run_cell) for run_cell, index, *_ in group]))
    for end, path in fresh.items():  # write the run file first, because a chunk requires it
        with open(path, "rb") as stream:
            os.fsync(stream.fileno())
        os.replace(path, _chunk_path(folder, number, end))
    with contextlib.suppress(FileNotFoundError):
        os.unlink(_chunk_path(folder, number, JOURNAL))


def _groups(chunk: Chunk, columns: Sequence[str]) -> Iterator[list[tuple[Any, ...]]]:
    """Yield groups of rows for a chunk file. `columns` contains the column names. The paths of files are the last columns."""
    group: list[tuple[Any, ...]] = []
    size = 0
    for index in chunk.indices:
        cells = tuple(chunk.cell(index, name) for name in columns)
        group.append(cells)
        size += sum(len(data) for data in cells[len(cells) - len(chunk.paths):] if data is not None)
        if len(group) == GROUP or size > GROUP_BYTES:
            yield group
            group, size = [], 0
    if group:
        yield group


def _schemas(paths: Sequence[str], lengths: Sequence[str]) -> tuple[Any, Any]:
    """Return the Parquet schemas of a chunk file and of its run file.

    The metadata of the first schema contains `lengths`, the names of the results `length.JOINT`.
    """
    import pyarrow

    text = [pyarrow.field(name, pyarrow.int64() if name == "index" else pyarrow.string()) for name in CELLS]
    schema = pyarrow.schema([*text, *(pyarrow.field(path, pyarrow.binary()) for path in paths)], {"lengths": json.dumps(lengths)})
    return schema, pyarrow.schema([pyarrow.field("index", pyarrow.int64()), pyarrow.field("run", pyarrow.string())])


def _json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False)


# --- reading ----------------------------------------------------------------------------------------------------------


class Chunk:
    """The finished variants of one chunk, read from its chunk file and from its journal.

    If both contain a variant, the journal has precedence. `indices` contains the plan indices of the variants in ascending order. `paths`
    contains the paths of all files that are not in `assets/`. A batch that is not packed has a single chunk, which is its journal. An open
    chunk remains readable while the batch continues. This class is not thread-safe.
    """

    def __init__(self, folder: str, number: int) -> None:
        self._journal: Any = None
        self._offsets: dict[int, int] = {}
        self._cached_line = lru_cache(1)(self._read_line)
        paths: set[str] = set()
        lengths: set[str] = set()
        path = _chunk_path(folder, number, JOURNAL) if is_packed(folder) else os.path.join(folder, folder_layout.JOURNAL)
        with contextlib.suppress(FileNotFoundError):
            self._journal = open(path, "rb")  # noqa: SIM115 - closed with the chunk
            for at, line in lines(self._journal):
                self._offsets[int(line["index"])] = at
                paths.update(line.get(FILES, ()))
                lengths.update(name for name in line.get("results", ()) if name.startswith(LENGTHS))
        self._path = _chunk_path(folder, number, SEALED)
        self._run = _open_parquet(_chunk_path(folder, number, RUN_FILE))
        self._sealed = _open_parquet(self._path) if self._run is not None else None
        self._rows: dict[int, int] = {}
        self._starts: list[int] = []
        self._sealed_columns = {"run"}
        if self._sealed is not None:
            metadata = self._sealed.metadata
            self._starts = [0, *accumulate(metadata.row_group(k).num_rows for k in range(metadata.num_row_groups))]
            self._rows = {index: row for row, index in enumerate(self._read(["index"])["index"].to_pylist())}
            self._sealed_columns.update(self._sealed.schema_arrow.names)
            paths.update(self._sealed.schema_arrow.names[len(CELLS):])
            lengths.update(json.loads(self._sealed.schema_arrow.metadata[b"lengths"]))
        self.indices = sorted(self._rows.keys() | self._offsets.keys())
        self.paths = sorted(paths)
        self._cells = lru_cache(max(COLUMNS_MOST, 2 * len(paths)))(self._read_cells)
        self.lengths = sorted(lengths)

    def close(self) -> None:
        """Close the files of the chunk, and clear its caches, which refer to the chunk."""
        self._cells.cache_clear()
        for file in (self._journal, self._sealed, self._run):
            if file is not None:
                file.close()

    def heads(self) -> list[tuple[int, str, str, str]]:
        """Return a tuple with the index, the id, the name and the status of each finished variant of the chunk."""
        heads = self._columns(HEADS)
        return [heads[index] for index in self.indices]

    def losses(self) -> Counter[str | None]:
        """Count the variants of the chunk by their export losses. The keys are JSON objects that map kinds of losses to numbers."""
        return Counter(text for (text,) in self._columns(("losses",)).values())

    def _columns(self, names: Sequence[str]) -> dict[int, Any]:
        """Return the cells in the given columns as a tuple for each finished variant of the chunk, keyed by plan index."""
        rows: dict[int, Any] = {}
        if self._sealed is not None:
            cells = self._read(list(names))
            rows.update(zip(self._rows, zip(*(cells[name].to_pylist() for name in names), strict=True), strict=True))
        rows.update((index, tuple(self.cell(index, name) for name in names)) for index in self._offsets)
        return rows

    def line(self, index: int) -> Line:
        """Return the journal line of the variant with this plan index, in the same form as in a batch that is not packed."""
        if index in self._offsets:
            return {key: value for key, value in self._cached_line(index).items() if key not in (FILES, SHARED)}
        return {**json.loads(self.cell(index, "line")), **json.loads(self.cell(index, "run"))}

    def asset_digests(self, index: int) -> dict[str, str]:
        """For a variant, return the SHA-256 of each file in `assets/`, keyed by the path of the file."""
        digests: dict[str, str] = json.loads(self.cell(index, SHARED) or "{}")
        return digests

    def files(self, index: int) -> dict[str, bytes]:
        """For a variant, return the contents of all files that are not in `assets/`, keyed by the path of the file."""
        return {path: data for path in self.paths if (data := self.cell(index, path)) is not None}

    def cell(self, index: int, column: str) -> Any:
        """Return the value of a variant in one column, or None if the cell is empty.

        For the column of a file, return the content of the file as bytes.
        """
        if index in self._offsets:
            return _cell_of(self._cached_line(index), column)
        return self._sealed_cell(self._rows[index], column) if column in self._sealed_columns else None

    def _read(self, columns: list[str]) -> Any:
        """Read the given columns of the chunk file."""
        assert self._sealed is not None
        with _reading(self._path):
            return self._sealed.read(columns)

    def _read_line(self, index: int) -> Line:
        """Read the line of a variant in the journal of the chunk."""
        self._journal.seek(self._offsets[index])
        line: Line = json.loads(self._journal.readline())
        return line

    def _sealed_cell(self, row: int, column: str) -> Any:
        group = bisect_right(self._starts, row) - 1
        return self._cells(group, column)[row - self._starts[group]].as_py()

    def _read_cells(self, group: int, column: str) -> Any:
        """Read one column of a group of rows."""
        file = self._run if column == "run" else self._sealed
        assert file is not None
        with _reading(self._path):
            return file.read_row_group(group, columns=[column]).column(0)


def _cell_of(line: Line, column: str) -> Any:
    """Return the value in a journal line that belongs to a column of a chunk file."""
    match column:
        case "line":
            return _json({key: value for key, value in line.items() if key not in (*RUN, FILES, SHARED)})
        case "run":
            return _json({key: line[key] for key in RUN if key in line})
        case "losses":
            return _json(line["losses"]) if "losses" in line else None
        case "shared":
            return _json(dict(sorted(line[SHARED].items()))) if SHARED in line else None
        case "index" | "id" | "name" | "status":
            return line[column]
        case _:
            encoded = line.get(FILES, {}).get(column)
            return None if encoded is None else base64.b64decode(encoded)


def _open_parquet(path: str) -> ParquetFile | None:
    if not os.path.exists(path):
        return None
    from pyarrow.parquet import ParquetFile

    with _reading(path):
        return ParquetFile(path)


class Chunks:
    """The open chunks of a packed batch. A chunk is opened when it is first used, and the least recently used chunks are closed.

    This class is thread-safe. A pickled copy opens the files again.
    """

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self._variants = CHUNK if is_packed(folder) else sys.maxsize
        self._open: OrderedDict[int, Chunk] = OrderedDict()
        self._lock = threading.RLock()

    def __reduce__(self) -> tuple[Any, ...]:
        return Chunks, (self.folder,)

    @contextlib.contextmanager
    def of(self, number: int) -> Iterator[Chunk]:
        """Open the chunk with this number while the context is active. Only one thread at a time can use the same chunk."""
        with self._lock:
            if number not in self._open:
                self._open[number] = Chunk(self.folder, number)
                if len(self._open) > OPEN_MOST:
                    self._open.popitem(last=False)[1].close()
            self._open.move_to_end(number)
            yield self._open[number]

    def holding(self, index: int) -> contextlib.AbstractContextManager[Chunk]:
        """Open the chunk that contains the variant with this index in the plan, while the context is active."""
        return self.of(index // self._variants)


def arrow_table(schema: Any, rows: Sequence[Sequence[Any]]) -> Any:
    """Create an Arrow table with the given rows, of which there must be at least one."""
    import pyarrow

    columns = [_column(cells, field.type) for cells, field in zip(zip(*rows, strict=True), schema, strict=True)]
    return pyarrow.Table.from_arrays(columns, schema=schema)


def _column(values: Sequence[Any], type: Any) -> Any:
    """Create an Arrow array from a list of values, in which None is a missing value.

    The function returns the same array and raises the same errors as `pyarrow.array(values, type)`, for the types `int64`, `float64`,
    `bool_`, `string` and `binary`. In contrast, `pyarrow.array` imports pandas, if installed, to check for pandas types. Importing pandas
    takes as long as building a dozen variants.
    """
    import pyarrow

    data: list[Any]
    if type in (pyarrow.int64(), pyarrow.float64()):
        data = [array("q" if type == pyarrow.int64() else "d", [0 if value is None else value for value in values])]
    elif type == pyarrow.bool_():
        data = [_bits(values)]
    else:
        encoded = [b"" if value is None else value.encode() if isinstance(value, str) else value for value in values]
        ends = list(accumulate(map(len, encoded), initial=0))
        if ends[-1] > LARGEST:
            return pyarrow.array(values, type)
        data = [array("i", ends), b"".join(encoded)]
    validity = _bits([value is not None for value in values])
    return pyarrow.Array.from_buffers(type, len(values), [pyarrow.py_buffer(buffer) for buffer in (validity, *data)])


def _bits(flags: Sequence[Any]) -> bytes:
    """Pack a sequence of booleans into bytes. The first boolean is the lowest bit of the first byte."""
    return int("0" + "".join("1" if flag else "0" for flag in reversed(flags)), 2).to_bytes(len(flags) // 8 + 1, "little")
