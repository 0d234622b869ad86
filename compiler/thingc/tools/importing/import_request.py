"""The request for importing a robot from a file of another format. This module is fast to import."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Literal

from thingc.base.diagnostics import Code, Report
from thingc.base.filesystem import listing
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import file_meant

if TYPE_CHECKING:
    from thingc.tools.importing.update_import import PreviousImport

ENDINGS = (".urdf", ".xml", ".sdf", ".xacro")
"""Suffixes of robot files."""
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


PLAIN = ImportRequest()
"""A request without options."""


def refuse_unreadable(path: str, fault: OSError, suffixes: tuple[str, ...], report: Report) -> None:
    """Report an error for a file that cannot be read. If the file does not exist, suggest a file with one of the suffixes."""
    folder = os.path.dirname(path)
    known = [os.path.join(folder, name) for name in listing(folder or os.curdir) if name.lower().endswith(suffixes)]
    help = file_meant(path, known, what="robot files") if isinstance(fault, FileNotFoundError) else None
    report.add(Code.COMMAND_LINE, f"cannot read `{path}`: {(fault.strerror or str(fault)).lower()}", None, help=help)
