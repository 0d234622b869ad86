"""The layout of the folder of a batch: one folder for each variant, and meshes that variants share.

    <name>/batch.json            description of the batch and of its document
    <name>/journal.jsonl         one line per finished variant
    <name>/results.csv, .parquet the table of results
    <name>/variants/<id>/        the files that `thingc build` writes for the variant
    <name>/chunks/               instead of journal and variants for a packed batch (`packed_layout.py`)
    <name>/assets/<sha256>       every mesh once; variants have hard links or references to it
    <name>/index.html            the page, with pictures/<id>.png
    <name>/shown.json            states of table and page when they were written
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from thingc.base.filesystem import BINARY, check_tree, hash_name, listing, write_new
from thingc.base.safe_text import json_text
from thingc.driver.output import Blobs
from thingc.targets.artifact import Content, StoredArtifact

BATCH = "batch.json"
JOURNAL = "journal.jsonl"
TABLE_CSV = "results.csv"
TABLE_PARQUET = "results.parquet"
VARIANTS = "variants"
CHUNKS = "chunks"
ASSETS = "assets"
PAGE = "index.html"
PICTURES = "pictures"
SHOWN = "shown.json"
OWN = frozenset((BATCH, JOURNAL, TABLE_CSV, TABLE_PARQUET, VARIANTS, CHUNKS, ASSETS, PAGE, PICTURES, SHOWN))
"""Names of all files and folders that thingc writes into the folder of a batch."""

NEW = ".new-"
"""Prefix of the names of temporary folders and files."""

ATTEMPTS = 100
"""Maximum number of attempts to create a hard link to a shared file that other processes replace."""

_OWN_END = f"{os.getpid()}-{os.urandom(4).hex()}"
"""Suffix of names of temporary files. The suffix is unique across all machines that share the folder."""


def variant_folder(folder: str, id: str) -> str:
    """Return the path of the folder of the variant with this id. Raises `BadPath` if the id of the variant is invalid."""
    return os.path.join(folder, VARIANTS, hash_name(id, 12))


def ids_with_pictures(folder: str) -> frozenset[str]:
    """Return the ids of all variants that have a picture."""
    names = listing(os.path.join(folder, PICTURES))
    return frozenset(name.removesuffix(".png") for name in names if name.endswith(".png") and not name.startswith(NEW))


def write_variant(folder: str, id: str, files: Mapping[str, Content], store: Blobs) -> None:
    """Write the folder of a variant atomically. Files in the store become hard links to shared files in `assets/`.

    A folder from an earlier run is replaced. Raises `BlobMissing` if the store lacks a file, and `OSError` if writing fails or a path is
    outside the folder.
    """
    check_tree(files)
    place = variant_folder(folder, id)
    fresh = os.path.join(folder, VARIANTS, f"{NEW}{id}-{_OWN_END}")
    os.mkdir(fresh)
    try:
        created = {""}
        for path, content in files.items():
            _make_subfolder(fresh, path.rpartition("/")[0], created)
            target = f"{fresh}/{path}"
            if isinstance(content, StoredArtifact):
                _share(folder, content.sha256, store, target)
            else:
                write_new(target, content)
        for superseded in (place, fresh):  # the second time, another worker, which was considered lost, has just written the variant
            try:
                os.rename(fresh, place)
                break
            except OSError as fault:
                if fault.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                    raise
            shutil.rmtree(superseded, ignore_errors=True)
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)
        raise


def keep_asset(folder: str, sha256: str, store: Blobs) -> None:
    """Copy a file from the store to the folder `assets/` atomically, unless the folder already contains the file.

    Raises the same errors as `write_variant`.
    """
    asset = asset_path(folder, sha256)
    if os.path.exists(asset):
        return
    fresh = os.path.join(folder, ASSETS, f"{NEW}{sha256}-{_OWN_END}")
    try:
        write_new(fresh, store.read(sha256))
        os.rename(fresh, asset)
    except BaseException:
        remove(fresh)
        raise


class SharedAssets:
    """Reads the shared files in the folder `assets/` of a batch by their SHA-256."""

    def __init__(self, folder: str) -> None:
        self.folder = folder

    def read(self, sha256: str) -> bytes:
        """Return the content of the shared file with this SHA-256. Raises `OSError` if the file cannot be read."""
        return read_file(asset_path(self.folder, sha256))


def read_file(path: str) -> bytes:
    """Return the content of a file. Raises `OSError` if the file cannot be read."""
    with open(path, "rb") as stream:
        return stream.read()


def asset_path(folder: str, sha256: str) -> str:
    """Return the path of the shared file with this SHA-256. Raises `BadPath` if the SHA-256 is invalid."""
    return os.path.join(folder, ASSETS, hash_name(sha256))


def _make_subfolder(fresh: str, folder: str, created: set[str]) -> None:
    """Create the subfolder `folder` of the new folder `fresh`, unless this function has created the subfolder before.

    `created` contains the paths of subfolders that have been created.
    """
    if folder not in created:
        _make_subfolder(fresh, folder.rpartition("/")[0], created)
        os.mkdir(f"{fresh}/{folder}")
        created.add(folder)


def _share(folder: str, sha256: str, store: Blobs, target: str) -> None:
    """Create the file `target` as a hard link to the shared file with this SHA-256, or as a copy if links are not supported.

    If the shared file does not exist, write the shared file first. If another process replaces the shared file by an equal file at the same
    time, the system cannot create a link to the old file. In this case, try again.
    """
    for attempt in range(ATTEMPTS):
        keep_asset(folder, sha256, store)
        try:
            os.link(asset_path(folder, sha256), target)
            return
        except FileNotFoundError:
            if attempt == ATTEMPTS - 1:
                raise
        except OSError as fault:
            if fault.errno not in (errno.EMLINK, errno.EPERM, errno.ENOTSUP, errno.EXDEV, errno.ENOSYS):
                raise
            write_new(target, store.read(sha256))
            if fault.errno == errno.EMLINK:  # ext4 allows at most 65 000 links to a file: later variants use the new file
                fresh = os.path.join(folder, ASSETS, f"{NEW}{sha256}-{_OWN_END}")
                os.link(target, fresh)
                os.rename(fresh, asset_path(folder, sha256))
            return


def remove(path: str) -> None:
    """Delete a file, or a folder with its content. Errors during deletion are ignored."""
    if os.path.isdir(path) and not os.path.islink(path):
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            os.unlink(path)


def sweep(folder: str) -> None:
    """Delete temporary files that interrupted runs of the batch have left in its folder."""
    for inner in (VARIANTS, CHUNKS, ASSETS, PICTURES):
        place = os.path.join(folder, inner)
        for name in listing(place):
            if name.startswith(NEW):
                remove(os.path.join(place, name))


Line = dict[str, Any]


class Journal(contextlib.AbstractContextManager["Journal"]):
    """The journal of a batch, opened for appending. On exit, this context manager closes the file.

    Each journal line is written with a single system call. An incomplete last line is removed when the journal is opened, and after a
    failed write. Raises `OSError` if writing a line fails.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        if os.path.exists(path):
            with open(path, "rb+") as stream:
                stream.truncate(sum(len(line) for line in stream if line.endswith(b"\n")))
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | BINARY, 0o666)

    def __exit__(self, *exception: object) -> None:
        os.close(self._descriptor)

    def append(self, line: Line) -> None:
        """Append the line of a finished variant to the journal."""
        data = json_text(json.dumps(line, separators=(",", ":"), ensure_ascii=False)).encode() + b"\n"
        size = os.fstat(self._descriptor).st_size
        try:
            written = os.write(self._descriptor, data)
            while written < len(data):
                written += os.write(self._descriptor, data[written:])
        except OSError:
            os.ftruncate(self._descriptor, size)
            raise

    def sync(self) -> None:
        """Write the journal to disk, so that it is not lost after a power failure."""
        os.fsync(self._descriptor)


def lines(journal: Iterable[bytes]) -> Iterator[tuple[int, Line]]:
    """Yield the offset in the file [bytes] and the content of every complete line of a journal, which is open for reading."""
    at = 0
    for data in journal:
        if data.endswith(b"\n"):
            yield at, json.loads(data)
        at += len(data)
