"""Find documents in folders, by file extension and the first bytes of each file, and in packages.

The documents of a Python package are in the same folders as its modules, and have dotted names such as `thingc_stock.materials`. The code
of a package is neither run nor imported.
"""

from __future__ import annotations

import os
import re
from collections import deque
from typing import TYPE_CHECKING

from thingc.base.diagnostics import Code, Report
from thingc.base.filesystem import beginning, listing, without_suffix
from thingc.base.installed_packages import package_folder
from thingc.base.source import Span
from thingc.base.suggestions import did_you_mean, near_hint
from thingc.base.units import shorten
from thingc.documents.load.paths import DOCUMENT_SUFFIXES, OWN_SUFFIXES

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace

HEAD = 65536
"""Number of bytes at the start of a file that are searched for the key `thingc`."""

_HEADER = re.compile(rb"""^(?:\xef\xbb\xbf)?["']?thingc["']?[ \t]*[:=](?![ \t]*["']?workspace/)""", re.MULTILINE)
_TABLE = re.compile(rb"^[ \t]*\[", re.MULTILINE)
"""Regular expression of the first table header of a TOML file. Keys after the header belong to a table such as `[project.scripts]`, not to
the document itself.
"""
_SKIPPED_FOLDERS = frozenset({"node_modules", "__pycache__"})


def documents_in(folder: str, workspace: Workspace | None = None) -> list[str]:
    """Return the absolute paths of assembly, materials and variants documents below a folder, sorted.

    Every file with the key `thingc` is a document, even if the value of the key is invalid.

    If `workspace` is given, its build folder and nested workspaces are skipped. Without a workspace file, the number of examined files is
    limited as in `documents_near`. Hidden folders and virtual environments are always skipped. Symbolic links to folders are not followed.
    Files that cannot be read are skipped without an error.
    """
    return _documents(folder, workspace, bounded=workspace is not None and workspace.origin is None)


def _documents(folder: str, workspace: Workspace | None, *, bounded: bool) -> list[str]:
    """Return the absolute paths of all documents below a folder, sorted.

    With `bounded`, only the nearest `MOST_FOLDERS` folders and at most `MOST_FILES` files are examined.
    """
    paths: list[str] = []
    build = os.path.realpath(workspace.build) if workspace is not None else None
    queue = deque([os.path.abspath(folder)])
    visited = read = 0
    while queue and not (bounded and (visited == MOST_FOLDERS or read >= MOST_FILES)):
        current = queue.popleft()
        if visited and (os.path.islink(current) or not _is_searched(current, build)):
            continue
        path, folders, files = next(os.walk(current), ("", [], []))
        queue += (os.path.join(path, name) for name in sorted(folders) if not name.startswith(".") and name not in _SKIPPED_FOLDERS)
        candidates = [name for name in sorted(files) if name.lower().endswith(DOCUMENT_SUFFIXES) and not name.startswith(".")]
        candidates = [os.path.join(path, name) for name in (candidates[:MOST_FILES - read] if bounded else candidates)]
        paths += [candidate for candidate in candidates if is_document(candidate)]
        visited, read = visited + 1, read + len(candidates)
    return sorted(paths)


MOST_FOLDERS, MOST_FILES = 200, 2000
"""Limits of a quick search for documents: number of folders, and number of files whose first bytes are read."""


def documents_near(folder: str, workspace: Workspace | None) -> list[str]:
    """Return the absolute paths of all documents below a folder. If `workspace` is given, search the folder of the workspace instead.

    Documents of nested workspaces are included. The numbers of folders and files are limited (`MOST_FOLDERS`, `MOST_FILES`), because the
    folder can be a large home folder.
    """
    return _documents(folder if workspace is None else workspace.root, None, bounded=True)


def assemblies_in(folder: str, workspace: Workspace) -> list[str]:
    """Return the absolute paths of assembly documents below a folder that belong to its workspace.

    The numbers of folders and files are limited.
    """
    return [path for path in _documents(folder, workspace, bounded=True) if is_document(path, "assembly/")]


def is_document(path: str, kind: str = "") -> bool:
    """Return whether the first bytes of a file contain the key `thingc`, and the file is not a workspace file.

    With `kind`, the document must also be of this kind.
    """
    try:
        return has_header(beginning(path, HEAD), path, kind)
    except (OSError, ValueError):
        return False


def has_header(head: bytes, path: str, kind: str = "") -> bool:
    """Return whether the first bytes `head` of a file contain the key `thingc`, and the file is not a workspace file.

    With `kind`, the document must also be of this kind. Without `kind`, a name that ends with `.thingc.yaml` is sufficient, so that a
    missing key is reported.

    The file type (YAML or TOML) is determined from the extension of `path`.
    """
    head = head[:HEAD]
    table = _TABLE.search(head) if path.lower().endswith(".toml") else None
    header = _HEADER.search(head, 0, table.start() if table is not None else len(head))
    if not kind and path.lower().endswith(OWN_SUFFIXES):
        return True
    return header is not None and head[header.end():].lstrip(b" \t\"'").startswith(kind.encode())


def _is_searched(path: str, build: str | None) -> bool:
    if os.path.exists(os.path.join(path, "pyvenv.cfg")):
        return False
    return build is None or (os.path.realpath(path) != build and not os.path.exists(os.path.join(path, "thingc.toml")))


_DOTTED = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+")


def is_packaged(text: str) -> bool:
    """Return whether a string is the dotted name of a document in a package, and not a file name."""
    return _DOTTED.fullmatch(text) is not None and not text.lower().endswith(DOCUMENT_SUFFIXES)


def find_packaged(text: str, *, where: Span | None, workspace: Workspace, examined: set[str], report: Report) -> str | None:
    """Find a document by its dotted name, and return its absolute path.

    The part folders of the workspace are searched before the allowed packages.

    If the document does not exist, report an error at `where` and return None. All examined paths, existing or not, are added to
    `examined`.
    """
    package, *modules = text.split(".")
    installed = package_folder(package) if package in workspace.packages else None
    package_folders = [os.path.join(folder, package) for folder in workspace.parts] + ([installed] if installed is not None else [])
    for package_path in package_folders:
        for suffix in (*DOCUMENT_SUFFIXES, *OWN_SUFFIXES):
            path = os.path.join(package_path, *modules) + suffix
            examined.add(path)
            if os.path.isfile(path) and _in_package(path, package_path, workspace):
                return path
    name, available = shorten(text), packaged_documents(workspace)
    if any(os.path.isdir(package_path) for package_path in package_folders):
        report.add(
            Code.MISSING_FILE, f"there is no document `{name}` in the package `{package}`", where,
            help=did_you_mean(text, available, what="documents of packages"),
        )
    elif package in workspace.packages:
        report.add(Code.MISSING_FILE, f"the package `{package}` is not installed", where, help=f"install the package `{package}`")
    else:  # possibly a file of another type
        report.add(
            Code.FILE_TYPE, f"expected a materials document ({', '.join(DOCUMENT_SUFFIXES)}), found `{name}`", where,
            help=near_hint(text, available),
        )
    return None


def packaged_documents(workspace: Workspace) -> dict[str, str]:
    """Return the materials documents in the top folder of each available package: absolute paths by dotted name, sorted."""
    documents: dict[str, str] = {}
    folders = [os.path.join(parts, name) for parts in workspace.parts for name in listing(parts) if name.isidentifier()]
    packages = [folder for name in workspace.packages if (folder := package_folder(name)) is not None]
    for top in (*folders, *packages):
        for name in listing(top):
            stem, path = without_suffix(name), os.path.join(top, name)
            named = stem.isidentifier() and name.endswith(DOCUMENT_SUFFIXES)
            if named and _in_package(path, top, workspace) and is_document(path, "materials"):
                documents.setdefault(f"{os.path.basename(top)}.{stem}", path)
    return dict(sorted(documents.items()))


def _in_package(path: str, top: str, workspace: Workspace) -> bool:
    """Return whether a file is in its package after symbolic links are resolved.

    If the package is in the workspace, the file must also be in the workspace.
    """
    return os.path.realpath(path).startswith(os.path.join(os.path.realpath(top), "")) and (
        workspace.contains(path) or not os.path.abspath(path).startswith(os.path.join(workspace.root, ""))
    )
