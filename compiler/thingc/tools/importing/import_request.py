"""Files of other formats that contain robots, and the request for importing such a file. This module is fast to import."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Literal

from thingc.base.diagnostics import Code, Report
from thingc.base.filesystem import beginning, listing
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import file_meant

if TYPE_CHECKING:
    from thingc.tools.importing.update_import import PreviousImport

ENDINGS = (".urdf", ".xml", ".sdf", ".xacro")
"""Suffixes of robot files."""
_HIDDEN = re.compile(rb"<!--.*?-->|<\?.*?\?>|<!DOCTYPE[^>]*>", re.DOTALL)
_ROOT = re.compile(rb"<([\w:.-]+)([^>]*)>")
Repair = Literal["nearest", "shapes"]
"""Methods for repairing invalid inertias."""


class ImportRequest(FrozenStruct):
    """How to read a robot file, and which document to generate.

    `packages` maps the names of ROS packages to folders. `arguments` are the arguments for a xacro file. Meshes are also searched in the
    folders `mesh_roots`. If `meshes` is false, meshes are not imported. For each link in `roots`, the generated document has an additional
    mode whose root is this link. If `keep` is true, links that are fixed to another link have the key `keep` in the document. `repair` is
    the method for repairing invalid inertias. The function `earlier` returns the previous import of the robot with the given name, and
    `update` requires a previous import.
    """

    packages: Mapping[str, str] = {}
    arguments: Mapping[str, str] = {}
    mesh_roots: Sequence[str] = ()
    meshes: bool = True
    roots: Sequence[str] = ()
    keep: bool = False
    repair: Repair | None = None
    earlier: Callable[[str], PreviousImport | None] = lambda _: None
    update: bool = False

    def keeps(self, robot: str) -> bool:
        """Return whether links of a robot that are fixed to another link have the key `keep`. An update preserves this option."""
        previous = self.earlier(robot) if self.update else None
        return self.keep or previous is not None and previous.keep


PLAIN = ImportRequest()
"""A request without options."""


def select_robot_files(files: Iterable[str]) -> list[str]:
    """Return the paths that have the suffix of a robot file of another format, without folders."""
    return [file for file in files if file.lower().endswith(ENDINGS) and not os.path.isdir(file)]


def changed_robots(files: Iterable[str]) -> list[str]:
    """Return the robot files among changed files.

    Deleted files, XML files of other kinds, and files that only other robot files include are omitted.
    """
    return [file for file in select_robot_files(files) if os.path.isfile(file) and _is_whole(file)]


def _is_whole(path: str) -> bool:
    """Return whether a file contains a robot: a named URDF or xacro robot, an SDF file, or a MuJoCo model with bodies.

    A `.urdf` or `.sdf` file that cannot be read also counts, because the check reports the error.
    """
    from thingc.tools.importing.xml_source import MOST_BYTES

    try:
        data = _HIDDEN.sub(b"", beginning(path, MOST_BYTES))
    except OSError:
        return True
    root = _ROOT.search(data)
    tag, attributes = (root[1], root[2]) if root is not None else (b"", b"")
    if tag == b"robot":
        return re.search(rb"\sname\s*=", attributes) is not None
    is_model = tag == b"mujoco" and b"<worldbody" in data and re.search(rb"<(?:body|include)\b", data) is not None
    return is_model or path.lower().endswith((".urdf", ".sdf"))


def refuse_unreadable(path: str, fault: OSError, suffixes: tuple[str, ...], report: Report) -> None:
    """Report an error for a file that cannot be read. If the file does not exist, suggest a file with one of the suffixes."""
    folder = os.path.dirname(path)
    known = [os.path.join(folder, name) for name in listing(folder or os.curdir) if name.lower().endswith(suffixes)]
    help = file_meant(path, known, what="robot files") if isinstance(fault, FileNotFoundError) else None
    report.add(Code.COMMAND_LINE, f"cannot read `{path}`: {(fault.strerror or str(fault)).lower()}", None, help=help)
