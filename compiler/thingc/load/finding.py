"""Which files of a folder are documents: by their ending and their first words, without reading them whole."""

from __future__ import annotations

import os
import re
from collections import deque
from typing import TYPE_CHECKING

from thingc.files import beginning
from thingc.load.paths import DOCUMENT_SUFFIXES

if TYPE_CHECKING:
    from thingc.workspace import Workspace

HEAD = 65536
"""Bytes in which a document's `thingc:` key is looked for."""

_HEADER = re.compile(rb"""^(?:\xef\xbb\xbf)?["']?thingc["']?[ \t]*[:=](?![ \t]*["']?workspace/)""", re.MULTILINE)
_TABLE = re.compile(rb"^[ \t]*\[", re.MULTILINE)
"""Where the first table of a TOML file begins: a key below is one of the table (`[project.scripts]`)."""
_OTHERS = frozenset({"node_modules", "__pycache__"})


def documents_in(folder: str, workspace: Workspace | None = None) -> list[str]:
    """Absolute paths of the assembly, materials and variants documents below a folder, sorted: the files that have the key `thingc`, also
    where it says something wrong. All others are somebody else's.

    With a workspace only its own: its build folder and workspaces inside of it are passed over. Hidden folders and virtual
    environments always are; links to folders are not followed. A file that cannot be read is no document here: whoever
    names it hears why.
    """
    return _documents(folder, workspace, None)


def _documents(folder: str, workspace: Workspace | None, most: int | None) -> list[str]:
    """Of the first so many folders, those above before those in them."""
    paths: list[str] = []
    build = os.path.realpath(workspace.build) if workspace is not None else None
    waiting = deque([os.path.abspath(folder)])
    while waiting and most != 0:
        path, folders, files = next(os.walk(waiting.popleft()), ("", [], []))
        most = most if most is None else most - 1
        waiting += (
            os.path.join(path, name) for name in sorted(folders)
            if not name.startswith(".") and name not in _OTHERS and not os.path.islink(os.path.join(path, name))
            and _belongs(os.path.join(path, name), build)
        )
        paths += [
            os.path.join(path, name) for name in sorted(files)
            if name.lower().endswith(DOCUMENT_SUFFIXES) and not name.startswith(".") and is_document(os.path.join(path, name))
        ]
    return sorted(paths)


MOST_FOLDERS = 200
"""Folders that are looked into for a document that somebody may have meant."""


def documents_near(folder: str, workspace: Workspace | None) -> list[str]:
    """Absolute paths of the documents below a folder, or below that of its `workspace` where it lies in one, those of other workspaces
    among them; of the `MOST_FOLDERS` nearest folders, so that nobody waits who has mistyped a name at home."""
    return _documents(folder if workspace is None else workspace.root, None, MOST_FOLDERS)


def assemblies_in(folder: str, workspace: Workspace) -> list[str]:
    """Absolute paths of the assembly documents below a folder, of its workspace alone; of the first `MOST_FOLDERS` folders."""
    return [path for path in _documents(folder, workspace, MOST_FOLDERS) if is_document(path, "assembly/")]


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
