"""Documents that lie in a package, beside its modules: named with dots as modules are (`thingc_stock.materials`), found by the package's
name, and read as data. Nothing of the package is run or imported."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

from thingc.base.diagnostics import Code, Report
from thingc.base.filesystem import listing
from thingc.base.installed_packages import package_folder
from thingc.base.source import Span
from thingc.base.suggestions import did_you_mean, near_hint
from thingc.base.units import shortened
from thingc.documents.load.paths import DOCUMENT_SUFFIXES

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace

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
    from thingc.documents.load.discovery import is_document

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
