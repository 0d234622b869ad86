"""Where a batch lies: its folder, the folder of each variant, and the meshes that variants share.

    <name>/batch.json            what the batch is of; whose folder it is
    <name>/journal.jsonl         one line for each variant that is done
    <name>/results.csv, .parquet the table
    <name>/variants/<id>/        what `thingc build` writes of the variant
    <name>/chunks/               in place of journal and variants where the batch is packed (`packed_layout.py`)
    <name>/assets/<sha256>       every mesh once; variants have hard links to it, or name it
    <name>/index.html            the page, with pictures/<id>.png
    <name>/shown.json            what table and page held when they were written
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from typing import Any

from thingc.base.filesystem import check_tree, hash_name, listing, write_new
from thingc.driver.output import Blobs
from thingc.targets.artifact import MANIFEST, Content, StoredArtifact

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
"""Everything that lies in a batch's folder."""

NEW = ".new-"
"""What the name of a folder or file begins with while it is written."""

_OWN_END = f"{os.getpid()}-{os.urandom(4).hex()}"
"""What such a name ends with: two machines that share a folder may have processes of the same number."""


def set_aside() -> str:
    """A new name of a folder for what is taken out of the way, to be deleted."""
    return f".old-{os.getpid()}-{os.urandom(4).hex()}"


def variant_folder(folder: str, id: str) -> str:
    """The folder of a variant. Raises `BadPath` if the identifier is not one."""
    return os.path.join(folder, VARIANTS, hash_name(id, 12))


def manifest_of(folder: str, id: str) -> str:
    """The manifest of a variant: where it is, the variant is there, whole."""
    return os.path.join(variant_folder(folder, id), MANIFEST)


def pictured(folder: str) -> frozenset[str]:
    """The ids of the variants that there are pictures of."""
    names = listing(os.path.join(folder, PICTURES))
    return frozenset(name.removesuffix(".png") for name in names if name.endswith(".png") and not name.startswith(NEW))


def write_variant(folder: str, id: str, files: Mapping[str, Content], store: Blobs) -> None:
    """Write a variant's folder: it appears as a whole, by one rename, or not at all. Files that lie in the store are hard links
    to one file in `assets/`.

    Replaces what an earlier run left there. Raises `OSError` when the system refuses or a path leaves the folder, `BlobMissing` of the
    store.
    """
    check_tree(files)
    place = variant_folder(folder, id)
    fresh = os.path.join(folder, VARIANTS, f"{NEW}{id}-{_OWN_END}")
    os.mkdir(fresh)
    try:
        made = {""}
        for path, content in files.items():
            _make(fresh, path.rpartition("/")[0], made)
            target = f"{fresh}/{path}"
            if isinstance(content, StoredArtifact):
                _share(folder, content, store, target)
            else:
                write_new(target, content)
        try:
            os.rename(fresh, place)
        except OSError as fault:
            if fault.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
            shutil.rmtree(place, ignore_errors=True)
            try:
                os.rename(fresh, place)
            except OSError as again:
                if again.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                    raise
                shutil.rmtree(fresh)  # a worker that was thought lost has written the same variant at this moment
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)
        raise


def keep_asset(folder: str, sha256: str, store: Blobs) -> None:
    """Have a file of the store in `assets/`, where it appears as a whole. Raises as `write_variant` does."""
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
    """The files of `assets/`, by content."""

    def __init__(self, folder: str) -> None:
        self.folder = folder

    def read(self, sha256: str) -> bytes:
        """One of them. Raises `OSError`."""
        with open(asset_path(self.folder, sha256), "rb") as stream:
            return stream.read()


def asset_path(folder: str, sha256: str) -> str:
    """Where a file that variants share lies. Raises `BadPath` if the hash is not one."""
    return os.path.join(folder, ASSETS, hash_name(sha256))


def _make(fresh: str, folder: str, made: set[str]) -> None:
    """Make a folder inside the new one, and those around it, as far as they have not been `made`."""
    if folder not in made:
        _make(fresh, folder.rpartition("/")[0], made)
        os.mkdir(f"{fresh}/{folder}")
        made.add(folder)


def _share(folder: str, content: StoredArtifact, store: Blobs, target: str) -> None:
    """Make `target` a link to the asset with this content, which is written first where it is not there; a copy where the file
    system has no links."""
    asset = asset_path(folder, content.sha256)
    full = False
    try:
        os.link(asset, target)
        return
    except FileNotFoundError:
        pass
    except OSError as fault:
        if fault.errno in (errno.EPERM, errno.ENOTSUP, errno.EXDEV, errno.ENOSYS):
            write_new(target, store.read(content.sha256))
            return
        if fault.errno != errno.EMLINK:  # ext4 has at most 65 000 links to a file: begin another one
            raise
        full = True
    fresh = os.path.join(folder, ASSETS, f"{NEW}{content.sha256}-{_OWN_END}")
    write_new(fresh, store.read(content.sha256))
    try:
        if full:
            os.link(fresh, target)
            os.rename(fresh, asset)
            return
        with contextlib.suppress(FileExistsError):  # of another runner at this moment: then its file is the one
            os.link(fresh, asset)
        os.link(asset, target)
    except OSError as fault:
        if fault.errno not in (errno.EPERM, errno.ENOTSUP, errno.EXDEV, errno.ENOSYS):
            raise
        os.rename(fresh, target)
    finally:
        remove(fresh)


def remove(path: str) -> None:
    """Delete a file, or a folder with all that is in it, as far as the system allows."""
    if os.path.isdir(path) and not os.path.islink(path):
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            os.unlink(path)


def sweep(folder: str) -> None:
    """Remove what a killed run was writing."""
    for inner in (VARIANTS, CHUNKS, ASSETS, PICTURES):
        place = os.path.join(folder, inner)
        for name in listing(place):
            if name.startswith(NEW):
                remove(os.path.join(place, name))


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
