"""The files that git says have changed, and which documents depend on them: read from documents and from the syntax trees of part files."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Collection, Iterator

from thingc.base.diagnostics import Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document, MappingNode, Node, ScalarNode, SequenceNode
from thingc.documents.load.discovery import documents_in
from thingc.documents.load.documents import Documents, load
from thingc.documents.load.paths import named
from thingc.documents.workspace import Workspace
from thingc.geometry.part_inputs import part_inputs
from thingc.geometry.store.local import Store

KINDS = ("assembly", "materials", "variants")


class AffectedDocuments(FrozenStruct):
    """`documents` (absolute paths, sorted) depend on a file that changed; `roots` are what there is to build: the assemblies
    among them that have modes of their own, or that no other of them nests."""

    documents: tuple[str, ...]
    roots: tuple[str, ...]


class _Needs(FrozenStruct, kw_only=False):
    """What a document depends on: real paths of files, there or not, and `folders` of which any file that is no Python counts.
    `assembly`: is it one; `modes`: has it any; `nested`: real paths of the documents that it uses; `varies`: of the assemblies
    that variants are made of."""

    files: frozenset[str]
    folders: tuple[str, ...]
    assembly: bool
    modes: bool
    nested: frozenset[str]
    varies: frozenset[str]


def touched(changed: Collection[str] | None, folder: str, store: Store | None) -> AffectedDocuments:
    """The documents below a folder that depend on one of the files `changed` (paths, there or not; None: all documents).

    A document depends on the documents that it names, on the files of the code of its parts (and what that imports in the
    workspace), on files that are parts, on the workspace's file and its lock. What a part reads while it is made is known only when
    it runs, so a document depends on every file in its part folders that is no Python. Without a store nobody trusts the
    workspace: what lies outside of it is not read.
    """
    real = None if changed is None else frozenset(os.path.realpath(path) for path in changed)
    if real is not None and not real:
        return AffectedDocuments(documents=(), roots=())
    needs = {path: _needs(path, store) for path in documents_in(folder)}
    met = sorted(path for path, need in needs.items() if real is None or _meets(path, need, real))
    # variants are touched with the assemblies that they vary, which the document itself does not read
    varied = {os.path.realpath(path) for path in met}
    met = sorted({*met, *(path for path, need in needs.items() if need.varies & varied)})
    inside = {inner for path in met for inner in needs[path].nested}
    roots = [path for path in met if needs[path].modes or (needs[path].assembly and os.path.realpath(path) not in inside)]
    return AffectedDocuments(documents=tuple(met), roots=tuple(roots))


def _meets(path: str, need: _Needs, changed: frozenset[str]) -> bool:
    if os.path.realpath(path) in changed or need.files & changed:
        return True
    return any(not file.endswith(".py") and file.startswith(folder + os.sep) for file in changed for folder in need.folders)


def _needs(path: str, store: Store | None) -> _Needs:
    report = Report()
    workspace = Workspace.find(path, report)
    documents = load(path, workspace, report, kinds=KINDS) if workspace is not None else None
    if workspace is None or documents is None:  # it cannot be read, so it names nothing
        return _Needs(frozenset(), (), False, False, frozenset(), frozenset())
    references = sorted({text for document in documents.by_path.values() for text in _texts(document, "part")})
    parts = part_inputs(references, workspace, store)
    return _Needs(
        files=frozenset(os.path.realpath(file) for file in (*workspace.inputs, *_files(documents), *parts.files)),
        folders=tuple(os.path.realpath(folder) for folder in parts.folders),
        assembly=documents.root.kind == "assembly",
        modes=documents.root.kind == "assembly" and "modes" in documents.root.tree.entries,
        nested=frozenset(
            os.path.realpath(document.path) for document in documents.by_path.values() if document is not documents.root
        ),
        varies=frozenset(
            os.path.realpath(varied) for text in _texts(documents.root, "assembly") if (varied := named(text, path)) is not None
        ) if documents.root.kind == "variants" else frozenset(),
    )


def _files(documents: Documents) -> Iterator[str]:
    """The documents, and every file that one of them names, there or not."""
    yield from documents.files
    for document in documents.by_path.values():
        yield document.path
        for key in ("assembly", "materials", "file"):
            for text in _texts(document, key):
                path = named(text, document.path)
                if path is not None:
                    yield path


def _texts(document: Document, key: str) -> Iterator[str]:
    """Every text under a key, however deep: a choice of a variant names parts, too."""
    waiting: list[Node] = [document.tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, MappingNode):
            waiting += node.entries.values()
            values = [value for name, value in node.entries.items() if name == key or name.endswith(f".{key}")]
            for value in values:
                for one in value.items if isinstance(value, SequenceNode) else [value]:
                    if isinstance(one, ScalarNode) and isinstance(one.value, str):
                        yield one.value
        elif isinstance(node, SequenceNode):
            waiting += node.items


class NotARepository(Exception):
    """git cannot say: there is no repository here, no such revision, or no git. The message is git's own, in one line."""


def changed_since(revision: str, folder: str) -> list[str]:
    """Absolute paths of the files below a folder that differ from where this branch left `revision`, sorted.

    Committed, uncommitted and untracked changes count, deleted files, too; ignored files do not. Raises `NotARepository`.
    """
    base = git(folder, "merge-base", "--end-of-options", revision, "HEAD").strip()
    top = git(folder, "rev-parse", "--show-toplevel").rstrip("\n")
    return sorted(os.path.join(top, name) for name in changed_paths(folder, base))


def changed_paths(folder: str, *commits: str, trusted: bool = False) -> list[str]:
    """Sorted paths in the repository of the files below a folder that differ between two commits, or between one and the checkout.

    In the checkout, uncommitted and untracked changes count, but not those inside a submodule: to find them, git runs what the
    configuration of the submodule names. Raises `NotARepository`.
    """
    options = ("--name-only", "--no-renames", "--ignore-submodules=dirty", "-z")
    names = git(folder, "diff", *options, *commits, "--", ".", trusted=trusted).split("\0")
    if len(commits) == 1:
        names += git(folder, "ls-files", "--others", "--exclude-standard", "--full-name", "-z", "--", ".", trusted=trusted).split("\0")
    return sorted({*names} - {""})


def git(folder: str, *words: str, trusted: bool = False) -> str:
    """The output of a git command, as text. Arguments and errors as for `run_git`."""
    return os.fsdecode(run_git(folder, *words, trusted=trusted))  # as it is: a name may hold a carriage return


def run_git(folder: str, *words: str, given: bytes = b"", trusted: bool = False) -> bytes:
    """Run a git command in a folder and return its output; `given` is its standard input.

    Nothing runs that the configuration of the repository names: no file system monitor, hook, filter or transport. The configuration
    of the user and of the system holds. If the repository is `trusted`, its filters and transports may run. Raises `NotARepository`.
    """
    if any("\0" in word for word in words):
        raise NotARepository("a revision cannot contain NUL")
    options = ["-c", "core.fsmonitor=false", "-c", "core.hooksPath=/dev/null"]
    environment = {**os.environ, "GIT_OPTIONAL_LOCKS": "0"}
    try:
        if not trusted:
            environment |= {"GIT_NO_LAZY_FETCH": "1", "GIT_ALLOW_PROTOCOL": "", "THINGC_EMPTY": ""}
            listed = subprocess.run(["git", "config", "--list", "--show-scope", "--name-only", "-z"], cwd=folder, capture_output=True)
            fields = os.fsdecode(listed.stdout).split("\0")
            own = {key for scope, key in zip(fields[::2], fields[1::2]) if scope in ("local", "worktree") and key.startswith("filter.")}
            options += [f"--config-env={key}=THINGC_EMPTY" for key in sorted(own)]  # `-c` cannot set a name that contains `=`
        done = subprocess.run(["git", *options, *words], cwd=folder, capture_output=True, input=given, env=environment)
    except FileNotFoundError as fault:
        raise NotARepository("git is not installed here") from fault
    if done.returncode != 0:
        said = os.fsdecode(done.stderr).strip().splitlines()
        raise NotARepository(said[0] if said else f"git {words[0]} found nothing in common with it")
    return done.stdout
