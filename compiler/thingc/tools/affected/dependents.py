"""Find the files that have changed in a git repository, and the documents that depend on these files.

This module finds dependencies in the text of the documents, and in the syntax trees of the Python files that define parts.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Collection, Iterable, Iterator

from thingc.base.diagnostics import Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document, MappingNode, Node, ScalarNode, SequenceNode
from thingc.documents.load.discovery import documents_in
from thingc.documents.load.documents import Documents, load
from thingc.documents.load.paths import resolve_path
from thingc.documents.workspace import Workspace
from thingc.geometry.key.module_key import CodeIngredients
from thingc.geometry.key.part_code import PartCode
from thingc.geometry.lock.lock import LOCK_FILE
from thingc.geometry.store.local import Store

KINDS = ("assembly", "materials", "variants", "calibration")


class AffectedDocuments(FrozenStruct):
    """The documents that depend on a changed file. The function `affected_documents` returns this object. All paths are absolute and
    sorted.

    `roots` are the documents to build: assemblies that have modes or are not nested in another of these documents.
    """

    documents: tuple[str, ...]
    roots: tuple[str, ...]


class _Needs(FrozenStruct, kw_only=False):
    """The files and parts on which a document depends. Symbolic links in the paths are resolved. The files do not have to exist.

    Attributes:
        files: The files that the document depends on.
        folders: The folders in which every non-Python file is a dependency.
        assembly: Whether the document is an assembly.
        modes: Whether the document has modes.
        nested: The documents that this document nests.
        varies: The assemblies that a variants document lists.
    """

    files: frozenset[str]
    folders: tuple[str, ...]
    assembly: bool
    modes: bool
    nested: frozenset[str]
    varies: frozenset[str]


def affected_documents(changed: Collection[str] | None, folder: str, store: Store | None) -> AffectedDocuments:
    """Return the documents below `folder` that depend on at least one path in `changed`. If `changed` is None, return all documents.

    The paths in `changed` do not have to exist. A document depends on the documents that it refers to, on the code of its parts (including
    modules imported from the workspace), on part files, and on the settings and the lock of the workspace. A part may read any file while
    it is built, so a document depends on every non-Python file in its part folders. If `store` is None, the workspace is untrusted, and
    this function reads no file outside the workspace.
    """
    real = None if changed is None else frozenset(os.path.realpath(path) for path in changed)
    if real is not None and not real:
        return AffectedDocuments(documents=(), roots=())
    needs = {path: _needs_of(path, store) for path in documents_in(folder)}
    affected = sorted(path for path, need in needs.items() if real is None or _is_affected(path, need, real))
    # compiling a variants document does not read the assemblies that the document lists, so the assemblies are added here
    varied = {os.path.realpath(path) for path in affected}
    affected = sorted({*affected, *(path for path, need in needs.items() if need.varies & varied)})
    inside = {inner for path in affected for inner in needs[path].nested}
    roots = [path for path in affected if needs[path].modes or (needs[path].assembly and os.path.realpath(path) not in inside)]
    return AffectedDocuments(documents=tuple(affected), roots=tuple(roots))


def _is_affected(path: str, need: _Needs, changed: frozenset[str]) -> bool:
    if os.path.realpath(path) in changed or need.files & changed:
        return True
    return any(not file.endswith(".py") and file.startswith(folder + os.sep) for file in changed for folder in need.folders)


def _needs_of(path: str, store: Store | None) -> _Needs:
    report = Report()
    workspace = Workspace.find(path, report)
    documents = load(path, workspace, report, kinds=KINDS) if workspace is not None else None
    if workspace is None or documents is None:  # errors in the document are reported elsewhere
        return _Needs(frozenset(), (), False, False, frozenset(), frozenset())
    references = sorted({text for document in documents.by_path.values() for text in _texts(document, "part")})
    files, folders = part_inputs(references, workspace, store)
    return _Needs(
        files=frozenset(os.path.realpath(file) for file in (*workspace.inputs, *_files(documents), *files)),
        folders=tuple(os.path.realpath(folder) for folder in folders),
        assembly=documents.root.kind == "assembly",
        modes=documents.root.kind == "assembly" and "modes" in documents.root.tree.entries,
        nested=frozenset(os.path.realpath(one.path) for one in documents.by_path.values() if one is not documents.root),
        varies=frozenset(
            os.path.realpath(varied) for text in _texts(documents.root, "assembly") if (varied := resolve_path(text, path)) is not None
        ) if documents.root.kind == "variants" else frozenset(),
    )


def part_inputs(references: Iterable[str], workspace: Workspace, store: Store | None) -> tuple[frozenset[str], tuple[str, ...]]:
    """Return the files on which the part classes `module:Class` depend, and the folders from which a part can read files while it is built.

    The paths are absolute, and the files do not have to exist. The files are the Python files of the parts, the workspace modules that they
    import, the paths at which Python would search for these modules first, and the lock file. Without a store, the workspace is untrusted,
    and files outside the workspace are not read.
    """
    code = PartCode(workspace, store)
    files = {os.path.join(workspace.root, LOCK_FILE)}
    uses_workspace = False
    for reference in references:
        ingredients = code.code(reference)
        if isinstance(ingredients, CodeIngredients):
            files.update(ingredients.files)
        uses_workspace = uses_workspace or code.sources.finder.find(reference.partition(":")[0]).workspace
    return frozenset(files | code.probed), tuple(workspace.parts) if uses_workspace else ()


def _files(documents: Documents) -> Iterator[str]:
    """Yield the paths of documents, and of the files to which the documents refer. The files do not have to exist."""
    yield from documents.files
    for document in documents.by_path.values():
        yield document.path
        for key in ("assembly", "materials", "file"):
            paths = (resolve_path(text, document.path) for text in _texts(document, key))
            yield from (path for path in paths if path is not None)


def _texts(document: Document, key: str) -> Iterator[str]:
    """Yield each string in a document that is the value of the given key, or an item of a list under this key, at any nesting depth.

    In a variants document, a key can also be a dotted path that ends with the given key.
    """
    waiting: list[Node] = [document.tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, MappingNode):
            waiting += node.entries.values()
            values = [value for name, value in node.entries.items() if name == key or name.endswith(f".{key}")]
            for value in values:
                for item in value.items if isinstance(value, SequenceNode) else [value]:
                    if isinstance(item, ScalarNode) and isinstance(item.value, str):
                        yield item.value
        elif isinstance(node, SequenceNode):
            waiting += node.items


class NotARepository(Exception):
    """Raised if git is not installed, or if a git command fails, for example because a revision is unknown. The message is one line."""


def changed_since(revision: str, folder: str) -> list[str]:
    """Return the sorted absolute paths of the files below a folder that differ from the merge base of `revision` and HEAD.

    The result includes committed, uncommitted, untracked and deleted files, but not files that git ignores. Raises `NotARepository`.
    """
    base = git(folder, "merge-base", "--end-of-options", revision, "HEAD").strip()
    top = git(folder, "rev-parse", "--show-toplevel").rstrip("\n")
    return sorted(os.path.join(top, name) for name in changed_paths(folder, base))


def changed_paths(folder: str, *commits: str, trusted: bool = False) -> list[str]:
    """Return the sorted paths of the files below a folder that differ between two git commits, or between a commit and the checkout.

    The paths are relative to the root folder of the repository. A comparison with the checkout includes uncommitted and untracked files.
    Changes inside a submodule are not included, because git would run commands from the configuration of the submodule to find them. Raises
    `NotARepository`.
    """
    options = ("--name-only", "--no-renames", "--ignore-submodules=dirty", "-z")
    names = git(folder, "diff", *options, *commits, "--", ".", trusted=trusted).split("\0")
    if len(commits) == 1:
        names += git(folder, "ls-files", "--others", "--exclude-standard", "--full-name", "-z", "--", ".", trusted=trusted).split("\0")
    return sorted({*names} - {""})


def git(folder: str, *arguments: str, trusted: bool = False) -> str:
    """Run a git command, and return its output as a string. See `run_git` for the arguments and exceptions."""
    return os.fsdecode(run_git(folder, *arguments, trusted=trusted))  # without newline translation: a name can contain a carriage return


def run_git(folder: str, *arguments: str, stdin: bytes = b"", trusted: bool = False) -> bytes:
    """Run a git command in a folder, and return its output as bytes. `stdin` is the standard input of the command.

    Git does not run commands from the configuration of the repository: file system monitors, hooks, filters and transports. If `trusted` is
    true, git can run filters and transports. Git always reads the configuration files of the user and of the system. Raises
    `NotARepository`.
    """
    if any("\0" in word for word in arguments):
        raise NotARepository("a revision cannot contain NUL")
    options = ["-c", "core.fsmonitor=false", "-c", "core.hooksPath=/dev/null"]
    environment = {**os.environ, "GIT_OPTIONAL_LOCKS": "0"}
    try:
        if not trusted:
            environment |= {"GIT_NO_LAZY_FETCH": "1", "GIT_ALLOW_PROTOCOL": "", "THINGC_EMPTY": ""}
            listed = subprocess.run(["git", "config", "--list", "--show-scope", "--name-only", "-z"], cwd=folder, capture_output=True)
            fields = os.fsdecode(listed.stdout).split("\0")
            filters = {key for scope, key in zip(fields[::2], fields[1::2]) if scope in ("local", "worktree") and key.startswith("filter.")}
            options += [f"--config-env={key}=THINGC_EMPTY" for key in sorted(filters)]  # `-c` cannot set a name that contains `=`
        process = subprocess.run(["git", *options, *arguments], cwd=folder, capture_output=True, input=stdin, env=environment)
    except FileNotFoundError as fault:
        raise NotARepository("git is not installed") from fault
    if process.returncode != 0:
        messages = os.fsdecode(process.stderr).strip().splitlines()
        raise NotARepository(messages[0] if messages else f"git {arguments[0]} failed without a message")
    return process.stdout
