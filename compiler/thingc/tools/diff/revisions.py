"""Write revisions of a git repository to temporary folders, without changing the checkout and its index.

Only the files that a document needs are written: the settings of its workspace, the folders of parts, and recursively the documents and
files that it refers to. If a part reads other files, call `everything`, which writes all files.
"""

from __future__ import annotations

import json
import os
import posixpath
import re
import tempfile
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping

from thingc.base.filesystem import BadPath, check_tree, write_tree
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.documents.workspace import DEFAULT_PARTS, OWN_FILE, SHARED_FILE
from thingc.tools.affected.dependents import NotARepository, git, run_git

LOCK_FILE = "parts.lock.json"
DOCUMENTS = (".yaml", ".yml", ".toml")
_NAMED = re.compile(rb"[^\s\"'\[\]{},:]+\.(?:ya?ml|toml|step|stp|brep|brp|stl|3mf|obj)\b", re.IGNORECASE)
"""Regular expression of possible file names in a document. It may match other text, but it finds all file names."""
_LINK = "120000"


class UnknownRevision(Exception):
    """Raised if a revision does not exist. `names` are the existing branches and tags."""

    def __init__(self, name: str, names: tuple[str, ...]) -> None:
        super().__init__(name)
        self.names = names


class Repository(OneLineRepr, FrozenStruct):
    """A git repository. `top` is the absolute path of its checkout.

    If `trusted` is false, git does not run the filters that the configuration of the repository defines.
    """

    top: str
    trusted: bool = False

    @staticmethod
    def of(folder: str, *, trusted: bool = False) -> Repository:
        """Return the repository that contains a folder. Raises `NotARepository`."""
        return Repository(top=os.path.realpath(git(folder, "rev-parse", "--show-toplevel").rstrip("\n")), trusted=trusted)

    def commit(self, name: str) -> str:
        """Return the hash of the commit of a revision. Raises `UnknownRevision`."""
        try:
            return git(self.top, "rev-parse", "--verify", "--quiet", "--end-of-options", f"{name}^{{commit}}").strip()
        except NotARepository:
            names = git(self.top, "for-each-ref", "--format=%(refname:short)", "refs/heads", "refs/remotes", "refs/tags").split("\n")
            raise UnknownRevision(name, tuple(one for one in names if one)) from None

    def common(self, old: str, new: str) -> str:
        """Return the merge base of two revisions. Raises `UnknownRevision`, and `NotARepository` if there is none."""
        return git(self.top, "merge-base", self.commit(old), self.commit(new)).strip()

    def path(self, file: str) -> str:
        """Return the path in the repository, with `/`, of an existing or deleted file of the checkout."""
        folder, name = os.path.split(os.path.abspath(file))
        return os.path.relpath(os.path.join(os.path.realpath(folder), name), self.top).replace(os.sep, "/")


class Revision:
    """A commit whose files are written to a temporary folder on demand. On exit, this context manager removes the folder."""

    def __init__(self, repository: Repository, name: str, commit: str) -> None:
        self.repository, self.name, self.commit = repository, name, commit
        self._files = _listed(repository.top, commit)
        self._there: set[str] = set()
        self._folder = tempfile.TemporaryDirectory(prefix="thingc-diff-")
        self.root = os.path.realpath(self._folder.name)

    def __enter__(self) -> Revision:
        return self

    def __exit__(self, *exception: object) -> None:
        self._folder.cleanup()

    def has(self, path: str) -> bool:
        """Return whether the revision has a file with this path in the repository."""
        return path in self._files

    def documents(self, folder: str) -> list[str]:
        """Return the paths of possible documents below a folder. All paths are relative to the repository."""
        above = "" if folder == "." else f"{folder}/"
        return [path for path in self._files if path.startswith(above) and path.lower().endswith(DOCUMENTS)]

    def file(self, path: str) -> str:
        """Return the absolute path in the temporary folder of a file of the repository."""
        return os.path.join(self.root, *path.split("/"))

    def lay_out(self, documents: Collection[str]) -> None:
        """Write the files that documents need. The documents are paths in the repository."""
        waiting = [path for path in documents if path in self._files]
        settings = {
            posixpath.join(folder, name) for path in documents for folder in _above(path) for name in (OWN_FILE, SHARED_FILE, LOCK_FILE)
        }
        contents = self._bring(settings)
        self._bring(read for path, data in contents.items() if path.endswith(LOCK_FILE) for read in _reads(path, data))
        folders = {folder for path, data in contents.items() for folder in _parts(path, data)}
        folders |= {posixpath.join(folder, name) for path in documents for folder in _above(path) for name in DEFAULT_PARTS}
        self._bring(path for path in self._files if any(path.startswith(f"{folder}/") for folder in folders))
        while waiting:
            contents = self._bring(waiting)
            waiting = [
                named for path, data in contents.items() if path.lower().endswith(DOCUMENTS) for named in _names(path, data)
                if named in self._files and named not in self._there
            ]

    def everything(self) -> bool:
        """Write all files of the revision. Return False if all files had been written before."""
        return bool(self._bring(self._files))

    def _bring(self, paths: Iterable[str]) -> dict[str, bytes]:
        """Write the files that do not exist yet, and return the contents of all files."""
        wanted = [path for path in dict.fromkeys(paths) if path in self._files and path not in self._there]
        self._there.update(wanted)
        contents = dict(self._contents(wanted))
        links = {path: data for path, data in contents.items() if self._files[path][0] == _LINK}
        targets = {path: os.fsdecode(data) for path, data in links.items() if data and b"\0" not in data}
        write_tree(self.root, {path: data for path, data in contents.items() if path not in links}, targets)
        return contents

    def _contents(self, paths: list[str]) -> Iterator[tuple[str, bytes]]:
        """Yield paths and contents as in a checkout: git converts line endings and runs filters, for example to fetch large files."""
        if not paths:
            return
        asked = b"".join(self._files[path][1].encode() + b" " + os.fsencode(path) + b"\n" for path in paths)
        data, at = run_git(self.repository.top, "cat-file", "--batch", "--filters", given=asked, trusted=self.repository.trusted), 0
        for path in paths:
            end = data.find(b"\n", at)
            words = data[at:end].split()
            if end < 0 or len(words) != 3 or not words[2].isdigit():
                raise NotARepository(f"git cannot read `{path}` of {self.name}")
            size = int(words[2])
            yield path, data[end + 1 : end + 1 + size]
            at = end + 2 + size


def _listed(top: str, commit: str) -> Mapping[str, tuple[str, str]]:
    """Return the mode and hash of each file in a commit by path, except submodules and files with invalid names.

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
    """Yield the folders that contain a file, the nearest first. The last folder is the repository, whose path is empty."""
    folder = posixpath.dirname(path)
    while folder:
        yield folder
        folder = posixpath.dirname(folder)
    yield ""


def _parts(path: str, data: bytes) -> Iterator[str]:
    """Yield the part folders that a `thingc.toml` or `pyproject.toml` specifies."""
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
    """Yield the files that the parts in a lock have read. thingc checks them to decide whether the locked parts are up to date."""
    try:
        for thing in json.loads(data)["things"].values():
            for read in thing["reads"]:
                yield posixpath.normpath(posixpath.join(posixpath.dirname(path), read))
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        return  # the reader of the lock reports errors


def _names(path: str, data: bytes) -> Iterator[str]:
    """Yield the paths in the repository of the files that a document may refer to."""
    for match in _NAMED.finditer(data):
        yield posixpath.normpath(posixpath.join(posixpath.dirname(path), os.fsdecode(match[0])))
