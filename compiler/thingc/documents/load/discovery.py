"""Which files are documents: those of a folder, by their ending and their first words, without reading them whole; and those of a package.

A document of a package lies beside its modules and is named with dots as modules are (`thingc_stock.materials`). It is read as data:
nothing of the package is run or imported."""

from __future__ import annotations

import os
import re
from collections import deque
from typing import TYPE_CHECKING

from thingc.base.diagnostics import Code, Report
from thingc.base.filesystem import beginning, listing
from thingc.base.installed_packages import package_folder
from thingc.base.source import Span
from thingc.base.suggestions import did_you_mean, near_hint
from thingc.base.units import shortened
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


_DOTTED = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+")


def is_packaged(text: str) -> bool:
    """Whether a text names a document of a package: words with dots between them, and no file of a document's type."""
    return _DOTTED.fullmatch(text) is not None and not text.lower().endswith(DOCUMENT_SUFFIXES)


def find_packaged(text: str, *, where: Span | None, workspace: Workspace, looked_at: set[str], report: Report) -> str | None:
    """The absolute path of the document that a text with dots names: in a part folder of the workspace, else in a package that the
    workspace allows. None when it has been reported at `where` that there is none. `looked_at` takes every path that was looked at,
    there or not."""
    package, *words = text.split(".")
    installed = package_folder(package) if package in workspace.packages else None
    tops = [os.path.join(folder, package) for folder in workspace.parts] + ([installed] if installed is not None else [])
    for top in tops:
        for suffix in DOCUMENT_SUFFIXES:
            path = os.path.join(top, *words) + suffix
            looked_at.add(path)
            if os.path.isfile(path) and _stays(path, top, workspace):
                return path
    shown, known = shortened(text), packaged_documents(workspace)
    if any(os.path.isdir(top) for top in tops):
        report.add(
            Code.MISSING_FILE, f"there is no document `{shown}`: `{package}` has none of that name", where,
            help=did_you_mean(text, known, what="documents of packages"),
        )
    elif package in workspace.packages:
        report.add(Code.MISSING_FILE, f"there is no document `{shown}`: the package `{package}` is not installed", where, help="install it")
    else:  # a file of another type, as likely as not
        report.add(
            Code.FILE_TYPE, f"expected a materials document ({', '.join(DOCUMENT_SUFFIXES)}), found `{shown}`", where,
            help=near_hint(text, known),
        )
    return None


def packaged_documents(workspace: Workspace) -> dict[str, str]:
    """The documents of materials at the top of every package in reach: absolute paths by what documents call them, sorted."""
    documents: dict[str, str] = {}
    folders = [os.path.join(parts, name) for parts in workspace.parts for name in listing(parts) if name.isidentifier()]
    packages = [folder for name in workspace.packages if (folder := package_folder(name)) is not None]
    for top in (*folders, *packages):
        for name in listing(top):
            stem, suffix = os.path.splitext(name)
            path = os.path.join(top, name)
            if stem.isidentifier() and suffix in DOCUMENT_SUFFIXES and _stays(path, top, workspace) and is_document(path, "materials"):
                documents.setdefault(f"{os.path.basename(top)}.{stem}", path)
    return dict(sorted(documents.items()))


def _stays(path: str, top: str, workspace: Workspace) -> bool:
    """Whether a file of a package is, links resolved, in the package, and one that lies in the workspace in there."""
    return os.path.realpath(path).startswith(os.path.join(os.path.realpath(top), "")) and (
        workspace.contains(path) or not os.path.abspath(path).startswith(os.path.join(workspace.root, ""))
    )
