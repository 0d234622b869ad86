"""Resolve the paths in documents. Paths are relative to the document and must be inside the workspace."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

from thingc.base.diagnostics import Code, Report
from thingc.base.filesystem import beginning
from thingc.base.safe_text import escape_control, find_invisible, is_text
from thingc.base.source import Span
from thingc.base.suggestions import Hint, file_meant
from thingc.base.units import shorten

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace

DOCUMENT_SUFFIXES = (".yaml", ".yml", ".toml")
OWN_SUFFIXES = (".thingc.yaml", ".thingc.yml", ".thingc.toml")
"""Extensions of files that are documents even without the key `thingc`."""
PART_SUFFIXES = (".step", ".stp", ".brep", ".stl", ".3mf", ".obj", ".ply", ".off", ".glb", ".gltf")
CATALOG_SUFFIXES = (".csv",)
MESH_SUFFIXES = (".stl", ".obj", ".dae", ".ply", ".glb")
"""Extensions of mesh files of links."""
SUFFIXES_WITH_UNIT = (".step", ".stp", ".3mf", ".glb", ".gltf", ".dae")
"""Extensions of file formats that specify the unit of length."""

_HEAD = 1 << 16
_LIBRARY = re.compile(rb"^mtllib[ \t]+([^\r\n]+?)[ \t]*\r?$", re.MULTILINE)

_DRIVE = re.compile(r"[A-Za-z]:|\\\\")


def find_file(
    text: str, *, relative_to: str, where: Span | None, workspace: Workspace, suffixes: tuple[str, ...], what: str, report: Report,
) -> str | None:
    """Return the absolute path of a file that the document at the path `relative_to` references by the relative path `text`.

    Report an error at `where` and return None if `text` is an absolute path, or if the file is outside the workspace, does not exist, or
    has none of the `suffixes`. `what` is a description of the file for messages, such as `an assembly document`.
    """
    name = shorten(text)
    if not text.strip():
        report.add(Code.MISSING_FILE, f"expected the path of {what}, found an empty string", where)
        return None
    if os.path.isabs(text) or text.startswith(("/", "~")) or _DRIVE.match(text):
        report.add(Code.OUTSIDE_WORKSPACE, f"`{name}` is an absolute path", where, help="write a path relative to this document")
        return None
    path = resolve_path(text, relative_to)
    if path is None:
        refuse_name(text, where, report)
        return None
    if not workspace.contains(path):
        report.add(
            Code.OUTSIDE_WORKSPACE, f"`{name}` is outside the workspace", where,
            help="move the file into the folder of `thingc.toml`",
        )
        return None
    if not path.lower().endswith(suffixes):
        report.add(Code.FILE_TYPE, f"expected {what} ({', '.join(suffixes)}), found `{name}`", where)
        return None
    if not os.path.isfile(path):
        if os.path.isdir(path):
            report.add(Code.MISSING_FILE, f"`{name}` is a folder, not a file", where, help=f"write the path of a file in `{name}`")
        else:
            report.add(Code.MISSING_FILE, f"there is no file `{name}`", where, help=_missing_file_hint(path, text, relative_to, suffixes))
        return None
    relative = workspace.relative(path)
    if find_invisible(relative):  # the target of a link
        refuse_name(relative, where, report)
        return None
    return path


def find_assembly(text: str, *, relative_to: str, where: Span | None, workspace: Workspace, report: Report) -> str | None:
    """Return the absolute path of a referenced assembly document, or report an error and return None, as `find_file` does."""
    suffixes, what = DOCUMENT_SUFFIXES, "an assembly document"
    return find_file(text, relative_to=relative_to, where=where, workspace=workspace, suffixes=suffixes, what=what, report=report)


def resolve_path(text: str, relative_to: str) -> str | None:
    """Convert the path `text` in the document at the path `relative_to` to an absolute path. The file need not exist.

    Return None for an invalid path.
    """
    return None if find_invisible(text) else os.path.normpath(os.path.join(os.path.dirname(relative_to), text))


def libraries(path: str) -> tuple[str, ...]:
    """Return the names of the material libraries (`.mtl`) that the first lines of an OBJ file reference, if they are in the same folder.

    Return an empty tuple for files of other formats.
    """
    if not path.lower().endswith(".obj"):
        return ()
    try:
        head = beginning(path, _HEAD)
    except OSError:
        return ()
    names = {name.decode("utf-8", "replace") for name in _LIBRARY.findall(head)}
    return tuple(
        sorted(name for name in names if name.lower().endswith(".mtl") and os.path.basename(name) == name and not find_invisible(name))
    )


def refuse_name(name: str, where: Span | None, report: Report) -> None:
    """Report a file name that contains invisible characters or is not valid UTF-8."""
    problem = "invisible characters" if is_text(name) else "bytes that are not UTF-8"
    report.add(
        Code.FILE_NAME, f"the file name `{escape_control(name)}` has {problem}: `{escape_control(find_invisible(name))}`", where,
        help="remove the invisible characters from the file name",
    )


def _missing_file_hint(path: str, text: str, relative_to: str, suffixes: tuple[str, ...]) -> Hint:
    """Return a hint for a missing file: a file with a similar name in the same folder, or the names of all files in this folder."""
    folder = os.path.dirname(path)
    prefix = text[: len(text) - len(os.path.basename(text))]
    try:
        files = [entry.name for entry in os.scandir(folder) if entry.is_file() and entry.name.lower().endswith(suffixes)]
    except OSError:
        return f"the folder `{shorten(prefix)}` does not exist" if prefix else "use a path relative to this document"
    names = [prefix + name for name in files if os.path.join(folder, name) != os.path.normpath(relative_to)]
    if not names:
        return "write the path relative to this document"
    return file_meant(text, names)
