"""Pack a workspace into an archive, which can be sent to machines that cannot access the folder of the workspace.

Equal workspaces result in equal archives. The files that the code of parts opens are not known in advance. The archive therefore contains
all files of the workspace except
- hidden files and folders, `__pycache__`, `node_modules`, `*.pyc`, and virtual environments;
- the build folder of the workspace, and the folders of batches.

Documents, part folders and the code of parts that the plan uses are included in any case. A symbolic link is packed as a link. A symbolic
link to a target outside the workspace is an error, because the target can differ on another machine.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import stat
import tarfile
import zlib
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

from thingc.base.diagnostics import Code
from thingc.base.filesystem import check_tree
from thingc.base.frozen_struct import FrozenStruct
from thingc.batch.folder import BatchFault, read_batch
from thingc.batch.variant import OUTSIDE
from thingc.documents.workspace import OWN_FILE, Workspace

if TYPE_CHECKING:
    from thingc.batch.planning import Plan

MOST_BYTES = 100_000_000
"""Maximum total size [bytes] of the files in an archive."""
MOST_FILES = 20_000
"""Maximum number of files, folders and links in an archive."""
NAMES = frozenset(("__pycache__", "node_modules"))
"""Names of folders that the archive omits, in addition to hidden folders."""
MODIFIED = 946_684_800
"""Modification time [s] of all entries of an archive (2000-01-01)."""


class WorkspaceArchive(FrozenStruct):
    """A workspace that has been packed into an archive.

    `root` is the absolute path of the workspace on this machine. `data` is a tar archive compressed with zlib, and `sha256` (hex) is the
    hash of the uncompressed archive.
    """

    root: str
    sha256: str
    data: bytes

    def unpack(self, folder: str) -> None:
        """Unpack the workspace from the archive into a new folder. Files outside this folder are never written.

        Raises `OSError` if writing fails, and `ValueError` if the archive is damaged or contains unsafe paths.
        """
        if not hasattr(tarfile, "data_filter"):
            raise ValueError("safe unpacking of archives requires Python 3.11.4 or newer")
        data = b""
        with contextlib.suppress(zlib.error):
            data = zlib.decompress(self.data)
        if hashlib.sha256(data).hexdigest() != self.sha256:
            raise ValueError("the packed workspace was damaged during the transfer")
        os.makedirs(folder)
        with tarfile.open(fileobj=io.BytesIO(data), mode="r:") as archive:
            members = sorted(archive.getmembers(), key=tarfile.TarInfo.issym)  # create links last
            check_tree(member.name for member in members if not member.isdir())
            try:
                archive.extractall(folder, members, filter="data")
            except tarfile.FilterError as fault:
                raise ValueError(str(fault)) from fault


def pack(plan: Plan, batch: str) -> WorkspaceArchive:
    """Pack the workspace of a plan into an archive. `batch` is the folder of the batch, which the archive omits.

    Raises `BatchFault` if the workspace is too large, contains an unreadable file or a link to an outside target, or has changed since
    planning.
    """
    workspace = plan.workspace
    names = _Search(workspace, (workspace.build, batch)).names(plan)
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w", format=tarfile.PAX_FORMAT) as archive:
        if workspace.origin is None:  # otherwise, thingc would use a workspace file above the unpacked folder
            _add(archive, OWN_FILE, b'thingc = "workspace/1"\n', 0o644)
        for name in sorted(names):
            _put(archive, workspace, name, plan.inputs.get(name))
    data = stream.getvalue()
    return WorkspaceArchive(root=workspace.root, sha256=hashlib.sha256(data).hexdigest(), data=zlib.compress(data))


class _Search:
    """Finds the files of a workspace that an archive must contain. `without` contains the absolute paths of folders to omit."""

    def __init__(self, workspace: Workspace, without: tuple[str, ...]) -> None:
        self.workspace = workspace
        self.root = workspace.root
        self.without = frozenset(os.path.normpath(folder) for folder in without) - {self.root}
        self.sizes: Counter[str] = Counter()
        self.found: set[str] = set()

    def names(self, plan: Plan) -> set[str]:
        """Return the paths of all files to pack, relative to the workspace, with `/` as separator."""
        self._folder(self.root)
        for folder in self.workspace.parts:
            if folder != self.root:
                self._add(folder)
                self._folder(folder)
        for name in plan.inputs:
            path = os.path.join(self.root, name)
            if not name.startswith(OUTSIDE) and os.path.lexists(path):
                self._add(path)
        return self.found

    def _folder(self, folder: str) -> None:
        waiting = [folder]
        while waiting:
            for entry in _entries(waiting.pop()):
                is_folder = entry.is_dir(follow_symlinks=False)
                if not self._is_omitted(entry, is_folder=is_folder):
                    self._add(entry.path)
                    waiting.extend([entry.path] if is_folder else [])

    def _is_omitted(self, entry: os.DirEntry[str], *, is_folder: bool) -> bool:
        if entry.name.startswith(".") or not is_folder:
            return entry.name.startswith(".") or entry.name.endswith(".pyc")
        return (
            entry.name in NAMES or entry.path in self.without or os.path.exists(os.path.join(entry.path, "pyvenv.cfg"))
            or read_batch(entry.path) is not None
        )

    def _add(self, path: str) -> None:
        folder, file_name = os.path.split(path)
        if self.workspace.contains(folder):  # a file in a linked folder is packed at its target
            path = os.path.join(os.path.realpath(folder), file_name)
        name = os.path.relpath(path, os.path.realpath(self.root)).replace(os.sep, "/")
        if name in self.found:
            return
        try:
            state = os.lstat(path)
        except OSError as fault:
            raise _unreadable(path, fault) from fault
        if not (stat.S_ISREG(state.st_mode) or stat.S_ISDIR(state.st_mode) or stat.S_ISLNK(state.st_mode)):
            return  # pipes and sockets
        self.found.add(name)
        if stat.S_ISREG(state.st_mode):
            self.sizes[name.partition("/")[0]] += state.st_size
        if len(self.found) > MOST_FILES or self.sizes.total() > MOST_BYTES:
            raise self._too_large()

    def _too_large(self) -> BatchFault:
        limit = f"{MOST_FILES} files" if len(self.found) > MOST_FILES else f"{MOST_BYTES // 1_000_000} MB"
        largest = ", ".join(f"`{name}` ({size / 1e6:.1f} MB)" for name, size in self.sizes.most_common(3))
        return BatchFault(
            Code.TOO_LARGE, f"the workspace `{self.root}` exceeds the limit of --ship ({limit})",
            f"move unrelated files out of the workspace (largest: {largest}), or move the robot to a folder with its own `thingc.toml`",
        )


def _entries(folder: str) -> Iterator[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as entries:
            yield from entries
    except OSError as fault:
        raise _unreadable(folder, fault) from fault


def _unreadable(path: str, fault: OSError) -> BatchFault:
    reason = (fault.strerror or str(fault)).lower()
    return BatchFault(Code.UNREADABLE, f"cannot read `{path}` to ship it: {reason}", "make the file readable, or move the file")


def _put(archive: tarfile.TarFile, workspace: Workspace, name: str, sha256: str | None) -> None:
    """Add a file, folder or link of the workspace to the archive. Raises `BatchFault` if the content of a file differs from `sha256`."""
    path = os.path.join(workspace.root, name)
    try:
        state = os.lstat(path)
        if stat.S_ISLNK(state.st_mode):
            _link(archive, workspace, name, os.readlink(path))
        elif stat.S_ISDIR(state.st_mode):
            archive.addfile(_header(name, tarfile.DIRTYPE, 0o755))
        else:
            with open(path, "rb") as stream:
                data = stream.read(MOST_BYTES + 1)
            if sha256 is not None and hashlib.sha256(data).hexdigest() != sha256:
                raise BatchFault(Code.BATCH_CHANGED, f"`{name}` changed during the planning of the batch", "run the command again")
            _add(archive, name, data, 0o755 if state.st_mode & stat.S_IXUSR else 0o644)
    except OSError as fault:
        raise _unreadable(path, fault) from fault


def _link(archive: tarfile.TarFile, workspace: Workspace, name: str, target: str) -> None:
    """Add a symbolic link with a relative target to the archive."""
    place = os.path.realpath(os.path.dirname(os.path.join(workspace.root, name)))
    path = os.path.join(place, target)
    first = os.path.join(os.path.realpath(os.path.dirname(path)), os.path.basename(path))  # the first link of a chain of links
    if not workspace.contains(path) or not os.path.join(first, "").startswith(os.path.join(os.path.realpath(workspace.root), "")):
        raise BatchFault(
            Code.OUTSIDE_WORKSPACE, f"the symbolic link `{name}` leads outside the workspace (`{target}`)",
            "copy the target into the workspace, or remove the link",
        )
    header = _header(name, tarfile.SYMTYPE, 0o777)
    header.linkname = os.path.relpath(first, place)
    archive.addfile(header)


def _add(archive: tarfile.TarFile, name: str, data: bytes, mode: int) -> None:
    header = _header(name, tarfile.REGTYPE, mode)
    header.size = len(data)
    archive.addfile(header, io.BytesIO(data))


def _header(name: str, kind: bytes, mode: int) -> tarfile.TarInfo:
    header = tarfile.TarInfo(name)
    header.type, header.mode, header.mtime = kind, mode, MODIFIED
    return header
