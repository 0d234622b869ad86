"""Replace build folders atomically, and create the folders of new workspaces.

A build is first written to a hidden folder beside the build folder. Then a single system call (`renameat2(RENAME_EXCHANGE)`) exchanges both
folders. If this system call is not available, the folders are renamed one after the other. A build completes the renames that a killed
build left incomplete. If the process is killed at any time, the build folder contains either the old build or the new build. The next build
deletes leftover files.

    <parent>/<name>/              the build
    <parent>/.<name>.thingc-lock  locked while a build is written: one at a time
    <parent>/.<name>.thingc-new   being written; after the exchange the old build, being deleted
    <parent>/.<name>.thingc-old   the old build between two renames
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import stat
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any, NoReturn, Protocol

from thingc.base.diagnostics import Code, UserError, shown_path
from thingc.base.filesystem import NO_ROOM, check_tree, exchange, lock
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import quote_names
from thingc.geometry.store.file_digests import Digests, digest_of
from thingc.geometry.store.local import Store
from thingc.targets.artifact import MANIFEST, Content, StoredArtifact
from thingc.targets.registry import written_pattern

Waiting = Callable[[str], None]
"""Callback that is called once, with the path of the build folder, if another build of the same folder is in progress. The callback can
raise an exception to stop waiting.
"""


class Blobs(Protocol):
    """The interface of a store that contains files of a build, identified by the SHA-256 of their contents."""

    def read(self, sha256: str) -> bytes:
        """Return the content with the given SHA-256. Raises an exception if the content is missing or damaged."""
        ...


class OutputError(UserError):
    """Raised if a build folder cannot be written."""

    code = Code.OUTPUT


class UnexpectedFilesError(OutputError):
    """Raised if a build folder contains files that thingc did not write, or files that were changed after the build.

    thingc does not delete such files. `names` contains the paths of the files relative to `folder`, sorted.
    """

    code = Code.UNEXPECTED

    def __init__(self, folder: str, names: tuple[str, ...], message: str, *, ours: bool) -> None:
        more = ", or use --force" if ours else ""
        super().__init__(message, f"move the files, or build into another folder with -o{more}")
        self.folder = folder
        self.names = names


NOTHING = hashlib.sha256(b"").hexdigest()
"""SHA-256 of an empty file. After a power failure, files of a build can be empty. Empty files can be deleted without loss."""


class UnexpectedFiles(FrozenStruct, kw_only=False):
    """The files in a build folder that a build must not delete. Paths are relative to the folder and sorted.

    `others` contains the files that thingc did not write. `changed` contains the files that thingc wrote, and that were later edited or
    replaced by a link. `owner` is the path of the document whose build is in the folder, or None.
    """

    owner: str | None
    others: tuple[str, ...]
    changed: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The paths of all files in `others` and `changed`, sorted."""
        return tuple(sorted((*self.others, *self.changed)))


def write_build(
    parent: str, name: str, files: Mapping[str, Content], store: Blobs, document: str, *, force: bool = False,
    on_wait: Waiting | None = None,
) -> str:
    """Replace the content of the build folder `<parent>/<name>` by exactly `files`, and return the absolute path of the folder.

    `files` maps paths in the build folder to contents. One of the files is `manifest.json`, which lists all other files and contains the
    path of `document` in the workspace. The contents of stored files are read from `store`. Exceptions of the store are not caught. The
    folder `parent` is created if necessary. If the build folder is a symbolic link, the target of the link is replaced. The callback
    `on_wait` is called before waiting for another build of the same folder. With `force`, files in a build of the same document are
    overwritten even if thingc did not write them or if they have changed.

    Raises `UnexpectedFilesError` if the folder contains anything other than an unchanged build of the same document. Raises `OutputError`
    for errors of the operating system, and `ValueError` for a path outside the folder. If an exception is raised, the folder is unchanged.
    """
    _check_paths(name, files)
    folder = build_folder(parent, name)
    try:
        os.makedirs(os.path.dirname(folder), exist_ok=True)
        with lock_folder(folder, on_wait):
            _complete_renames(folder)
            digests: Digests = {}
            unexpected = _refuse_unexpected(folder, document, files, digests, force=force)
            new_folder = _sibling_path(folder, "new")
            try:
                _write_files(new_folder, files, store)
                _swap_folders(new_folder, folder, document, files, digests, overwritable=unexpected.names)
            finally:
                _delete(new_folder)
    except OSError as fault:
        raise OutputError(_fault_text(folder, fault), f"{_fault_help(fault)} build into another folder with -o") from fault
    return folder


ALLOWED_ENTRY = ".git"
"""The only entry that may exist in the folder of a new workspace. thingc does not change this entry."""


def write_new(folder: str, files: Mapping[str, bytes]) -> str:
    """Create the folder of a new workspace with `files`, and return its absolute path.

    The folder may already exist if it contains only `.git`. `files` maps relative paths (with `/`) to contents. Missing parent folders are
    created. If the folder does not exist, it is created with all files in one atomic step. If the folder exists, another program may use
    it, so the files are moved into the folder one by one. Existing files with the same content are accepted, so that a second run can
    complete an interrupted run. Raises `OutputError` if the folder contains other files, if another run is in progress, or for an error of
    the operating system.
    """
    folder = os.path.realpath(folder)
    display_path, exists = shown_path(folder), os.path.isdir(folder)

    def refuse(_: str) -> NoReturn:
        raise OutputError(f"another command is creating `{display_path}`", "wait until the command has finished, or choose another name")

    try:
        os.makedirs(os.path.dirname(folder), exist_ok=True)
        base = os.path.join(folder, os.path.basename(folder)) if exists else folder
        with lock_folder(base, refuse):
            new_folder = _sibling_path(base, "new")
            if not exists and os.path.lexists(folder):
                raise OutputError(f"the file `{display_path}` already exists", "choose another name, or move the file")
            _delete(new_folder)
            try:
                _write_files(new_folder, files, None)
                if exists:
                    temporary = {ALLOWED_ENTRY, *(os.path.basename(_sibling_path(base, suffix)) for suffix in ("lock", "new"))}
                    before = sorted(set(os.listdir(folder)) - temporary)
                    conflicts = [name for name in before if not _equal(os.path.join(folder, name), os.path.join(new_folder, name))]
                    if conflicts:
                        message = f"the folder `{display_path}` is not empty: {quote_names(conflicts, 8)}"
                        raise OutputError(message, "choose another name, or move the content of the folder")
                    _move_into(folder, new_folder, sorted(set(os.listdir(new_folder)) - set(before)))
                else:
                    os.rename(new_folder, folder)
            finally:
                _delete(new_folder)
    except OSError as fault:
        location = f" (`{shown_path(fault.filename)}`)" if isinstance(fault.filename, str) and ".thingc-" not in fault.filename else ""
        reason = (fault.strerror or str(fault)).lower()
        help = "choose a shorter name" if fault.errno == errno.ENAMETOOLONG else f"{_fault_help(fault)} choose another name or place"
        raise OutputError(f"cannot create `{display_path}`: {reason}{location}", help) from fault
    return folder


def _move_into(folder: str, source: str, names: Sequence[str]) -> None:
    """Move the files and folders `names` from `source` to `folder`. If an exception is raised, delete all moved files from `folder`."""
    try:
        for name in names:
            os.rename(os.path.join(source, name), os.path.join(folder, name))
    except BaseException:
        for name in names:
            if not os.path.lexists(os.path.join(source, name)):
                _delete(os.path.join(folder, name))
        raise


def _equal(first: str, second: str) -> bool:
    """Return whether two paths are files with the same content, or folders with the same files. Return False for symbolic links."""
    if os.path.isdir(first) and os.path.isdir(second) and not os.path.islink(first):
        names = set(os.listdir(first))
        return names == set(os.listdir(second)) and all(_equal(os.path.join(first, name), os.path.join(second, name)) for name in names)
    import filecmp  # lazy import: only `thingc new` compares

    return os.path.isfile(second) and _is_plain(first) and filecmp.cmp(first, second, shallow=False)


def build_folder(parent: str, name: str) -> str:
    """Return the absolute path of the build folder `<parent>/<name>`.

    If the path is a symbolic link, return the absolute path of its target.
    """
    folder = os.path.abspath(os.path.join(parent, name))
    return os.path.realpath(folder) if os.path.islink(folder) else folder


def verify(folder: str, store: Store | None = None) -> dict[str, Any] | None:
    """Return the manifest of a build folder, or None if the folder has changed since the build.

    An unchanged folder contains exactly the files that the manifest lists, with the same SHA-256. `store` caches the SHA-256 of large
    files. The function never raises an exception, and never writes to the folder.
    """
    try:
        manifest = _manifest(folder)
        if manifest is None or set(_listing(folder)) != {*manifest["files"], MANIFEST}:
            return None
        files = {os.path.join(folder, path): sha256 for path, sha256 in manifest["files"].items()}
        return manifest if all(_is_plain(file) and digest_of(file, store) == sha256 for file, sha256 in files.items()) else None
    except OSError:
        return None


def manifest_paths(folder: str) -> frozenset[str]:
    """Return the paths of all files in the manifest of a build folder, and the path of the manifest itself.

    If the folder does not contain a manifest, return an empty set.
    """
    manifest = _manifest(folder)
    return frozenset() if manifest is None else frozenset((*manifest["files"], MANIFEST))


def has_leftovers(folder: str) -> bool:
    """Return whether temporary files of a killed or unfinished build exist next to a build folder. The next build deletes these files."""
    return any(os.path.lexists(_sibling_path(folder, suffix)) for suffix in ("lock", "new", "old"))


def unexpected_files(folder: str, document: str, *, also: Collection[str] = (), known: Digests | None = None) -> UnexpectedFiles:
    """Find the files in a build folder that a build of `document` must not delete: files that thingc did not write or that have changed.

    The manifest of the build folder lists all files that thingc wrote, with their SHA-256.

    If the manifest is missing, damaged or belongs to another document, the result contains all files. Symbolic links count as files, and
    empty folders are ignored. Because a damaged manifest could list any files, an entry is trusted only if a target can write a file with
    this name or if `also` contains the name. `known` caches the SHA-256 of contents for later calls. Raises `OSError` if the folder cannot
    be read.
    """
    names = _listing(folder)
    manifest = _manifest(folder)
    if manifest is None or manifest["document"] != document:
        return UnexpectedFiles(None if manifest is None else manifest["document"], tuple(sorted(names)))
    listed: dict[str, str] = manifest["files"]
    our_names = written_pattern()
    unknown = [name for name in names if name != MANIFEST and not (name in listed and (name in also or our_names.fullmatch(name)))]
    written = sorted(set(names) - {MANIFEST, *unknown})
    known = {} if known is None else known
    changed = [name for name in written if _digest_of_plain(os.path.join(folder, name), known) not in (listed[name], NOTHING)]
    return UnexpectedFiles(document, tuple(sorted(unknown)), tuple(changed))


def _digest_of_plain(path: str, digests: Digests) -> str | None:
    """Return the SHA-256 of a regular file. Return None for symbolic links and special files such as pipes."""
    return digest_of(path, known=digests) if _is_plain(path) else None


def _check_paths(name: str, files: Mapping[str, Content]) -> None:
    """Check that the name of a build folder and the paths of its files are valid. Raises `ValueError` for an invalid name or path."""
    check_tree(files)
    check_tree([name])
    if "/" in name or any("\\" in path for path in (name, *files)):
        raise ValueError(f"{name!r} must not contain `/`, and paths of a build must not contain a backslash")
    if MANIFEST not in files:
        raise ValueError(f"a build needs a {MANIFEST}")


def _sibling_path(folder: str, suffix: str) -> str:
    parent, name = os.path.split(folder)
    return os.path.join(parent, f".{name}.thingc-{suffix}")


@contextlib.contextmanager
def lock_folder(folder: str, on_wait: Waiting | None) -> Iterator[None]:
    """Lock a folder of outputs until the context ends. Only one build or batch at a time can write the folder.

    The callback `on_wait` is called before waiting for the lock, and can raise an exception instead of waiting. A build deletes the lock
    file when it releases the lock. After waiting, the function therefore checks whether the path of the lock file still refers to the
    locked file.
    """
    path = _sibling_path(folder, "lock")
    notified = False
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            try:
                lock(descriptor)
            except BlockingIOError:
                if on_wait is not None and not notified:
                    on_wait(folder)
                notified = True
                lock(descriptor, wait=True)
            if _same_file(descriptor, path):
                break
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            os.unlink(path)
        os.close(descriptor)


def _same_file(descriptor: int, path: str) -> bool:
    """Return whether an open file and a path refer to the same file on disk."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except FileNotFoundError:
        return False


def _complete_renames(folder: str) -> None:
    """Complete or undo the renames of a build that was killed while it replaced the build folder."""
    old = _sibling_path(folder, "old")
    if os.path.lexists(old):
        if os.path.lexists(folder):
            _delete(old)
        else:
            os.rename(old, folder)
    _delete(_sibling_path(folder, "new"))


def _refuse_unexpected(folder: str, document: str, also: Collection[str], digests: Digests, *, force: bool) -> UnexpectedFiles:
    """Return the unexpected files in a build folder, all of which `force` allows to overwrite.

    Raises `UnexpectedFilesError` if there are unexpected files that `force` does not allow to overwrite.
    """
    if not os.path.lexists(folder):
        return UnexpectedFiles(None, ())
    if not os.path.isdir(folder):
        raise OutputError(f"the build folder `{shown_path(folder)}` is a file", "move the file, or build into another folder with -o")
    unexpected = unexpected_files(folder, document, also=also, known=digests)
    if unexpected.names and not (force and unexpected.owner == document):
        raise _unexpected_error(folder, unexpected, document)
    return unexpected


def _unexpected_error(folder: str, unexpected: UnexpectedFiles, document: str) -> UnexpectedFilesError:
    display_path = f"`{shown_path(folder)}`"
    ours = unexpected.owner == document
    if unexpected.owner is not None and not ours:
        message = f"{display_path} contains the build of another document (`{unexpected.owner}`)"
    else:
        groups = [
            f"{description} ({quote_names(names, 8)})"
            for description, names in (("unknown files", unexpected.others), ("modified files", unexpected.changed)) if names
        ]
        message = f"{display_path} contains {' and '.join(groups)}"
    return UnexpectedFilesError(folder, unexpected.names, message, ours=ours)


def _write_files(folder: str, files: Mapping[str, Content], store: Blobs | None) -> None:
    """Create the folder `folder`, and write all files of a build to this folder.

    The manifest is written last, and is synchronized to disk. If a power failure interrupts the build, the checksums in the manifest show
    which files are incomplete. `store` is required if `files` contains stored files.
    """
    os.mkdir(folder)
    folders = {""}
    for path in sorted(files, key=lambda path: (path == MANIFEST, path)):
        parent = os.path.dirname(path)
        if parent not in folders:
            os.makedirs(os.path.join(folder, parent), exist_ok=True)
            folders.add(parent)
        content = files[path]
        if isinstance(content, StoredArtifact):
            assert store is not None
            content = store.read(content.sha256)
        with open(os.path.join(folder, path), "xb") as stream:
            stream.write(content)
            if path == MANIFEST:
                stream.flush()
                os.fsync(stream.fileno())


def _swap_folders(new: str, folder: str, document: str, also: Collection[str], digests: Digests, *, overwritable: Collection[str]) -> None:
    """Replace the build folder `folder` by the folder `new`, and delete the old build.

    If the old build contains unexpected files that are not in `overwritable`, because they were changed in the meantime, restore the old
    build and raise `UnexpectedFilesError`.
    """
    if not os.path.lexists(folder):
        os.rename(new, folder)
        return
    old_folder = new
    try:
        exchange(new, folder)
    except NotImplementedError:
        old_folder = _sibling_path(folder, "old")
        os.rename(folder, old_folder)
        os.rename(new, folder)
    unexpected = unexpected_files(old_folder, document, also=also, known=digests)
    if set(unexpected.names) - set(overwritable):
        if old_folder != new:
            os.rename(folder, new)
            os.rename(old_folder, folder)
        else:
            exchange(new, folder)
        raise _unexpected_error(folder, unexpected, document)
    _delete(old_folder)


def _delete(path: str) -> None:
    """Delete a folder that thingc created. If some files cannot be deleted, the next build deletes them."""
    if os.path.islink(path) or os.path.isfile(path):
        os.unlink(path)
        return
    if not os.path.lexists(path):
        return
    import shutil  # lazy import: slow, and not needed if nothing has changed

    shutil.rmtree(path, ignore_errors=True)
    if os.path.lexists(path):  # a folder may not be writable
        with contextlib.suppress(OSError):
            _make_deletable(path)
        shutil.rmtree(path, ignore_errors=True)


def _make_deletable(folder: str) -> None:
    """Set the permissions of a folder and all its subfolders so that their contents can be deleted. Symbolic links are not followed."""
    os.chmod(folder, 0o700)
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                _make_deletable(entry.path)


def _manifest(folder: str) -> dict[str, Any] | None:
    """Read the file `manifest.json` in a build folder. Return None if the file is missing or invalid."""
    path = os.path.join(folder, MANIFEST)
    try:
        if not _is_plain(path):
            return None
        with open(path, "rb") as stream:
            manifest = json.load(stream)
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(manifest, dict) or not isinstance(manifest.get("document"), str) or not isinstance(manifest.get("name"), str):
        return None
    files = manifest.get("files")
    if not isinstance(files, dict) or not all(isinstance(sha256, str) for sha256 in files.values()):
        return None
    return manifest


def _is_plain(path: str) -> bool:
    """Return whether a path is a regular file, and not a symbolic link or a pipe. Raises `OSError` if the path does not exist."""
    return stat.S_ISREG(os.lstat(path).st_mode)


def _listing(folder: str) -> list[str]:
    """Return the relative paths of all files in a folder, with `/` as separator. Symbolic links are listed but not followed."""
    files: list[str] = []
    prefixes = [""]
    while prefixes:
        prefix = prefixes.pop()
        with os.scandir(os.path.join(folder, prefix)) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    prefixes.append(f"{prefix}{entry.name}/")
                else:
                    files.append(f"{prefix}{entry.name}")
    return files


FAULT_HELP = {
    **dict.fromkeys(NO_ROOM, "free some space, or"), errno.ENAMETOOLONG: "use shorter names in the document, or",
    **dict.fromkeys((errno.EACCES, errno.EPERM, errno.EROFS), "make the folder writable, or"),
    **dict.fromkeys((errno.EEXIST, errno.ENOTDIR), "move the existing file, or"),
}
"""The beginning of a help text for an error of the operating system. Another option follows ("or ...")."""


def _fault_text(folder: str, fault: OSError) -> str:
    """Format an error of the operating system as a message that explains why the build folder cannot be written."""
    display_path = shown_path(folder)
    if fault.errno in NO_ROOM:
        return f"not enough disk space for the build in `{display_path}`: {os.strerror(fault.errno)}"
    reason = fault.strerror or str(fault)
    return f"cannot write the build to `{display_path}`: {reason}"


def _fault_help(fault: OSError) -> str:
    """Return the beginning of a help text for an error of the operating system, as in `FAULT_HELP`."""
    return FAULT_HELP.get(fault.errno or 0, "fix the problem, or")
