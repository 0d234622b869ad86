"""Which files of a folder are documents: by their ending and their first words, without reading them whole."""

from __future__ import annotations

import os
import re
from collections import deque
from typing import TYPE_CHECKING

from thingc.base.filesystem import beginning
from thingc.documents.load.paths import DOCUMENT_SUFFIXES

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace

HEAD = 65536
"""Bytes in which a document's `thingc:` key is looked for."""

_HEADER = re.compile(rb"""^(?:\xef\xbb\xbf)?["']?thingc["']?[ \t]*[:=](?![ \t]*["']?workspace/)""", re.MULTILINE)
_TABLE = re.compile(rb"^[ \t]*\[", re.MULTILINE)
"""Where the first table of a TOML file begins: a key below is one of the table (`[project.scripts]`)."""
_OTHERS = frozenset({"node_modules", "__pycache__"})


def documents_in(folder: str, workspace: Workspace | None = None) -> list[str]:
    """Absolute paths of the assembly, materials and variants documents below a folder, sorted: the files that have the key `thingc`, also
    where it says something wrong. All others are somebody else's.

    With a workspace only its own: its build folder and workspaces inside of it are skipped. Without a workspace file nothing says where the
    workspace ends, so the search is bounded as in `documents_near`. Hidden folders and virtual environments are always skipped; links to
    folders are not followed. A file that cannot be read is not a document here: the command that names it reports the reason.
    """
    return _documents(folder, workspace, bounded=workspace is not None and workspace.origin is None)


def _documents(folder: str, workspace: Workspace | None, *, bounded: bool) -> list[str]:
    """All documents below a folder, or those among the nearest `MOST_FOLDERS` folders and `MOST_FILES` files that could be one."""
    paths: list[str] = []
    build = os.path.realpath(workspace.build) if workspace is not None else None
    waiting = deque([os.path.abspath(folder)])
    looked = read = 0
    while waiting and not (bounded and (looked == MOST_FOLDERS or read >= MOST_FILES)):
        place = waiting.popleft()
        if looked and (os.path.islink(place) or not _belongs(place, build)):
            continue
        path, folders, files = next(os.walk(place), ("", [], []))
        waiting += (os.path.join(path, name) for name in sorted(folders) if not name.startswith(".") and name not in _OTHERS)
        named = [name for name in sorted(files) if name.lower().endswith(DOCUMENT_SUFFIXES) and not name.startswith(".")]
        paths += [
            os.path.join(path, name) for name in (named[:MOST_FILES - read] if bounded else named) if is_document(os.path.join(path, name))
        ]
        looked, read = looked + 1, read + len(named)
    return sorted(paths)


MOST_FOLDERS, MOST_FILES = 200, 2000
"""The bounds of a search that nobody should have to wait for: folders, and files whose first bytes are read."""


def documents_near(folder: str, workspace: Workspace | None) -> list[str]:
    """Absolute paths of the documents below a folder, or below that of its `workspace` where it lies in one, those of other workspaces
    among them. The search is bounded (`MOST_FOLDERS`, `MOST_FILES`): it also runs after a mistyped name in a home folder."""
    return _documents(folder if workspace is None else workspace.root, None, bounded=True)


def assemblies_in(folder: str, workspace: Workspace) -> list[str]:
    """Absolute paths of the assembly documents below a folder, of its workspace alone; the search is bounded."""
    return [path for path in _documents(folder, workspace, bounded=True) if is_document(path, "assembly/")]


def is_document(path: str, kind: str = "") -> bool:
    """Whether a file has the key `thingc` at its beginning, and is no workspace; with a `kind`, of that kind alone."""
    try:
        return has_header(beginning(path, HEAD), path, kind)
    except (OSError, ValueError):
        return False


def has_header(head: bytes, path: str, kind: str = "") -> bool:
    """Whether a file that begins so has the key `thingc`, and is no workspace; with a `kind`, of that kind alone. (The path says whether
    it is TOML.)"""
    head = head[:HEAD]
    table = _TABLE.search(head) if path.lower().endswith(".toml") else None
    header = _HEADER.search(head, 0, table.start() if table is not None else len(head))
    return header is not None and head[header.end():].lstrip(b" \t\"'").startswith(kind.encode())


def _belongs(path: str, build: str | None) -> bool:
    if os.path.exists(os.path.join(path, "pyvenv.cfg")):
        return False
    return build is None or (os.path.realpath(path) != build and not os.path.exists(os.path.join(path, "thingc.toml")))
