"""Write the files of a git revision to a temporary folder. The checkout and the index of the repository do not change.

Only the files that a document needs are written: the settings of its workspace, the folders of parts, and recursively the documents and
files that it refers to. If a part reads other files, call the method `everything`, which writes all files of the revision.
"""

from __future__ import annotations

import json
import os
import posixpath
import re
import tempfile
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager

from thingc.base.filesystem import BadPath, check_tree, write_tree
from thingc.base.one_line_repr import OneLineStruct
from thingc.documents.load.paths import DOCUMENT_SUFFIXES
from thingc.documents.workspace import DEFAULT_PARTS, OWN_FILE, SHARED_FILE
from thingc.geometry.lock.lock import LOCK_FILE
from thingc.tools.affected.dependents import NotARepository, git, run_git
from thingc.tools.importing.import_request import ENDINGS

_NAMED = re.compile(rb"[^\s\"'\[\]{},:]+\.(?:ya?ml|toml|step|stp|brep|brp|stl|3mf|obj)\b", re.IGNORECASE)
"""Regular expression that finds all file names in a document. The expression can also match other text."""
_LINK = "120000"


class Repository(OneLineStruct):
    """A git repository with a checkout. `top` is the absolute path of the checkout.

    If `trusted` is false, git does not run the filters that the configuration of the repository defines.
    """

    top: str
    trusted: bool = False

    @staticmethod
    def of(folder: str, *, trusted: bool = False) -> Repository:
        """Return the git repository that contains `folder`. Raises `NotARepository`."""
        return Repository(top=os.path.realpath(git(folder, "rev-parse", "--show-toplevel").rstrip("\n")), trusted=trusted)

    def commit(self, name: str) -> str | None:
        """Return the hash of the commit to which a branch, a tag or another git revision refers, or None for an unknown revision."""
        try:
            return git(self.top, "rev-parse", "--verify", "--quiet", "--end-of-options", f"{name}^{{commit}}").strip()
        except NotARepository:
            return None

    def names(self) -> list[str]:
        """Return the names of all branches and tags."""
        return git(self.top, "for-each-ref", "--format=%(refname:short)", "refs/heads", "refs/remotes", "refs/tags").split()

    def common(self, old: str, new: str) -> str:
        """Return the merge base of two commits, given by their hashes. Raises `NotARepository` if they have no merge base."""
        return git(self.top, "merge-base", old, new).strip()

    def path(self, file: str) -> str:
        """Convert the path of a file in the checkout to a path relative to the repository, with `/` as separator.

        The file does not have to exist.
        """
        folder, name = os.path.split(os.path.abspath(file))
        return os.path.relpath(os.path.join(os.path.realpath(folder), name), self.top).replace(os.sep, "/")


class Revision(AbstractContextManager["Revision"]):
    """A context manager that writes files of a git commit to a temporary folder on demand.

    On exit, the context manager removes the folder.
    """

    def __init__(self, repository: Repository, name: str, commit: str) -> None:
        self.repository, self.name, self.commit = repository, name, commit
        self._files = _list_files(repository.top, commit)
        self._there: set[str] = set()
        self._folder = tempfile.TemporaryDirectory(prefix="thingc-diff-")
        self.root = os.path.realpath(self._folder.name)

    def __exit__(self, *exception: object) -> None:
        self._folder.cleanup()

    def has(self, path: str) -> bool:
        """Return whether the revision contains a file. The path is relative to the root folder of the repository."""
        return path in self._files

    def documents(self, folder: str) -> list[str]:
        """Return the paths of the files below a folder that may be documents.

        The paths are relative to the root folder of the repository.
        """
        above = "" if folder == "." else f"{folder}/"
        return [path for path in self._files if path.startswith(above) and path.lower().endswith(DOCUMENT_SUFFIXES)]

    def file(self, path: str) -> str:
        """Convert the path of a file in the repository to its absolute path in the temporary folder."""
        return os.path.join(self.root, *path.split("/"))

    def lay_out(self, documents: Collection[str]) -> None:
        """Write all files that the given documents need to the temporary folder.

        The paths of the documents are relative to the repository.
        """
        waiting = [path for path in documents if path in self._files]
        for robot in (path for path in waiting if path.lower().endswith(ENDINGS)):  # with the files of its ROS package or folder
            package = next((one for one in _above(robot) if posixpath.join(one, "package.xml") in self._files), posixpath.dirname(robot))
            self.write(path for path in self._files if path.startswith(f"{package}/" if package else ""))
        settings = {
            posixpath.join(folder, name) for path in documents for folder in _above(path) for name in (OWN_FILE, SHARED_FILE, LOCK_FILE)
        }
        contents = self.write(settings)
        self.write(read for path, data in contents.items() if path.endswith(LOCK_FILE) for read in _reads(path, data))
        folders = {folder for path, data in contents.items() for folder in _parts(path, data)}
        folders |= {posixpath.join(folder, name) for path in documents for folder in _above(path) for name in DEFAULT_PARTS}
        self.write(path for path in self._files if any(path.startswith(f"{folder}/") for folder in folders))
        while waiting:
            contents = self.write(waiting)
            waiting = [
                named for path, data in contents.items() if path.lower().endswith(DOCUMENT_SUFFIXES) for named in _names(path, data)
                if named in self._files and named not in self._there
            ]

    def everything(self) -> bool:
        """Write all files of the revision to the temporary folder. Return False if an earlier call already wrote all files."""
        return bool(self.write(self._files))

    def write(self, paths: Iterable[str]) -> dict[str, bytes]:
        """Write the given files to the temporary folder, except files that already exist.

        Return the contents of the files that were written.
        """
        new_paths = [path for path in dict.fromkeys(paths) if path in self._files and path not in self._there]
        self._there.update(new_paths)
        contents = dict(self._contents(new_paths))
        links = {path: data for path, data in contents.items() if self._files[path][0] == _LINK}
        targets = {path: os.fsdecode(data) for path, data in links.items() if data and b"\0" not in data}
        write_tree(self.root, {path: data for path, data in contents.items() if path not in links}, targets)
        return contents

    def _contents(self, paths: list[str]) -> Iterator[tuple[str, bytes]]:
        """Yield the path and the content of each given file.

        As in a checkout, git converts line endings and runs filters, for example to fetch large files.
        """
        if not paths:
            return
        queries = b"".join(self._files[path][1].encode() + b" " + os.fsencode(path) + b"\n" for path in paths)
        data, at = run_git(self.repository.top, "cat-file", "--batch", "--filters", stdin=queries, trusted=self.repository.trusted), 0
        for path in paths:
            end = data.find(b"\n", at)
            words = data[at:end].split()
            if end < 0 or len(words) != 3 or not words[2].isdigit():
                raise NotARepository(f"git cannot read `{path}` of {self.name}")
            size = int(words[2])
            yield path, data[end + 1 : end + 1 + size]
            at = end + 2 + size


def _list_files(top: str, commit: str) -> Mapping[str, tuple[str, str]]:
    """Return the mode and the hash of each file in a commit, keyed by path. Submodules and files with invalid names are omitted.

    Raises `NotARepository` if a path is both a file and a folder.
    """
    files: dict[str, tuple[str, str]] = {}
    for line in git(top, "ls-tree", "-r", "-z", "--full-tree", commit).split("\0"):
        about, tab, path = line.partition("\t")
        if tab and "\n" not in path and not {"", ".", "..", ".git"} & set(path.lower().split("/")):
            mode, kind, sha = about.split()
            if kind == "blob":
                files[path] = (mode, sha)
    try:
        check_tree(files)
    except BadPath as fault:
        raise NotARepository(f"cannot write the tree of {commit[:12]} to a folder: {fault}") from fault
    return files


def _above(path: str) -> Iterator[str]:
    """Yield the folder of a file and all parent folders, the nearest first.

    The last folder is the root folder of the repository, whose path is empty.
    """
    folder = posixpath.dirname(path)
    while folder:
        yield folder
        folder = posixpath.dirname(folder)
    yield ""


def _parts(path: str, data: bytes) -> Iterator[str]:
    """Yield the folders of parts that a settings file (`thingc.toml` or `pyproject.toml`) specifies."""
    try:
        table = tomllib.loads(data.decode("utf-8-sig")) if path.endswith(".toml") else {}
    except (ValueError, RecursionError):
        return
    if posixpath.basename(path) == SHARED_FILE:
        table = table.get("tool", {}).get("thingc", {}) if isinstance(table.get("tool"), dict) else {}
    named = table.get("parts", []) if isinstance(table, dict) else []
    for folder in named if isinstance(named, list) else []:
        if isinstance(folder, str):
            yield posixpath.normpath(posixpath.join(posixpath.dirname(path), folder))


def _reads(path: str, data: bytes) -> Iterator[str]:
    """Yield the files that part code had read when the lock file was written. These files determine whether the lock file is up to date."""
    try:
        for thing in json.loads(data)["things"].values():
            for read in thing["reads"]:
                yield posixpath.normpath(posixpath.join(posixpath.dirname(path), read))
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        return  # errors in the lock file are reported when the lock file is read


def _names(path: str, data: bytes) -> Iterator[str]:
    """Yield the paths of the files to which a document may refer. The paths are relative to the root folder of the repository."""
    for match in _NAMED.finditer(data):
        yield posixpath.normpath(posixpath.join(posixpath.dirname(path), os.fsdecode(match[0])))
