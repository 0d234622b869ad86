"""The workspace of a document: the folder that contains all its files, and its settings.

The workspace is the nearest folder above the document that contains a `thingc.toml`, or a `pyproject.toml` with `[tool.thingc]`. If there
is no such folder, the workspace is the folder of the document.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from thingc.base.diagnostics import Code, Report
from thingc.base.filesystem import NotARegularFile, beginning
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.installed_packages import dotted_name
from thingc.base.package_info import KEYS, MEMORY, PackageInfo
from thingc.base.safe_text import is_text
from thingc.base.source import Document, MappingNode, Path, Span, line_of
from thingc.base.suggestions import did_you_mean
from thingc.base.units import ANGLE, LENGTH, TIME, Dimension, Quantity, checked, parse_quantity, shortened

MAX_BYTES = 500_000
"""Maximum size [bytes] of a workspace file. A larger `pyproject.toml` is accepted if it does not contain the word `thingc`."""
OWN_FILE = "thingc.toml"
SHARED_FILE = "pyproject.toml"
DEFAULT_PARTS = ("parts",)
DEFAULT_PACKAGES = ("thingc_stock", "bd_warehouse")
DEFAULT_BUILD = "build"
DEFAULT_TIMEOUT = 120.0
LONGEST = 1e6
"""Largest accepted timeout [s], which is more than ten days. The timeouts of operating systems are limited."""
MESH_URIS = ("relative", "package", "absolute")
"""Styles of mesh paths in URDF files: relative to the file, in the robot's ROS package, or absolute. The first style is the default."""

CONSUMERS = ("mjx", "warp", "drake", "pymjcf")
"""Programs besides MuJoCo for which MuJoCo models can be written."""


class Tessellation(FrozenStruct):
    """Tolerances for approximating curved surfaces by triangles.

    Each triangle is at most `linear` [m] away from the surface, and the angle between neighbouring facets is at most `angular` [rad].
    """

    linear: float
    angular: float

    def coarser(self, other: Tessellation) -> Tessellation:
        """Combine two tessellations: return the larger value of each tolerance."""
        return Tessellation(linear=max(self.linear, other.linear), angular=max(self.angular, other.angular))


DEFAULT_MESH = Tessellation(linear=1e-4, angular=0.17453292519943295)
"""Tessellation for printing and clearance checks: 0.1 mm and 10 deg."""
DEFAULT_SIMULATION = Tessellation(linear=1e-4, angular=0.5235987755982988)
"""Tessellation for simulators: 0.1 mm and 30 deg.

The linear tolerance is the same as in `DEFAULT_MESH`. The larger angle reduces the number of facets of surfaces with a radius below 2.9 mm
to a third. In a typical robot, most facets belong to such surfaces (holes, screws, fillets).
"""


DEFAULT_BED = (0.25, 0.21, 0.21)
"""Default size of the print bed [m], with the largest height of a print."""

DEFAULT_MEMORY = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2 if hasattr(os, "sysconf") else 8_000_000_000
"""Default limit [bytes] of the memory used for building one part: half of the machine's memory."""

LIBRARIES = frozenset({"site-packages", "dist-packages"})
"""Names of folders that contain installed packages. A virtual environment inside a workspace folder is not part of the workspace."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Workspace:
    """A workspace folder and its settings.

    `root` is an absolute path. `parts` contains the absolute paths of the folders with part modules, and `packages` the names of installed
    packages with part modules. `build` is the absolute path of the folder for build outputs. `part_timeout` [s] and `part_memory` [bytes]
    are the limits for building one part. `mesh` is the tessellation for printing and checks, `simulation` the tessellation for simulators.
    `emit` contains the default targets of a build. `mesh_uri` is one of `MESH_URIS`. `about` is the metadata of ROS and USD files.
    `compat` contains the programs from `CONSUMERS` that must be able to read the MuJoCo models. `bed` is the size of the print bed
    [m], with the largest height of a print. `origin` is the path of the workspace file,
    or None without a workspace file. `inputs` maps each examined file (an absolute path) to the SHA-256 of its content, or to None if the
    file does not exist.
    """

    root: str
    parts: tuple[str, ...]
    packages: tuple[str, ...]
    build: str
    part_timeout: float
    mesh: Tessellation
    simulation: Tessellation
    part_memory: int = DEFAULT_MEMORY
    emit: tuple[str, ...] = ()
    mesh_uri: str = MESH_URIS[0]
    about: PackageInfo = PackageInfo()
    compat: tuple[str, ...] = ()
    bed: tuple[float, ...] = DEFAULT_BED
    origin: Span | None = None
    inputs: dict[str, str | None] = field(default_factory=dict, compare=False, repr=False)

    @staticmethod
    def find(document: str, report: Report, texts: Mapping[str, bytes] | None = None) -> Workspace | None:
        """Find the workspace of the document at the path `document`, which need not exist.

        If the workspace file is invalid, report the error and return None. `texts` maps absolute paths to file contents that replace the
        contents on disk.
        """
        start = folder = os.path.dirname(os.path.abspath(document))
        if not is_text(start):
            report.add(
                Code.FILE_NAME, f"the folder `{start}` has bytes in its name that are not UTF-8", None,
                help="rename the folder, or move the workspace: paths must be UTF-8",
            )
            return None
        inputs: dict[str, str | None] = {}
        while True:
            for name in (OWN_FILE, SHARED_FILE):
                path = os.path.join(folder, name)
                try:
                    data = texts[path] if texts and path in texts else _bytes(path)
                except OSError as error:
                    report.add(Code.UNREADABLE, f"cannot read `{name}`: {(error.strerror or 'an error').lower()}", None)
                    return None
                inputs[path] = None if data is None else hashlib.sha256(data).hexdigest()
                if data is not None and (name == OWN_FILE or _has_table(data)):
                    return _parse_workspace(path, data, folder, inputs, report)
            above = os.path.dirname(folder)
            if above == folder:
                return _default(start, inputs)
            folder = above

    def relative(self, path: str) -> str:
        """Convert a path to a path relative to the workspace, with `/` as separator and with symbolic links resolved.

        Build outputs contain only such relative paths.

        For a document of an installed package, the result is a dotted name such as `thingc_stock.materials`, because the location of the
        package depends on the machine.
        """
        name = os.path.relpath(os.path.realpath(path), os.path.realpath(self.root)).replace(os.sep, "/")
        elsewhere = name.startswith("../") or not LIBRARIES.isdisjoint(name.split("/"))
        if elsewhere and "." in (dotted := dotted_name(os.path.realpath(path))):
            return dotted
        return name

    def span(self, path: Path) -> Span | None:
        """Return the span of a value in the workspace file, for example at `("emit", 1)`, or None if the value does not exist.

        Each call parses the workspace file.
        """
        if self.origin is None:
            return None
        from thingc.base.source import node_at
        from thingc.documents.load.documents import read_tree

        prefix: Path = () if os.path.basename(self.origin.file) == OWN_FILE else ("tool", "thingc")
        tree = read_tree(self.origin.file, _bytes(self.origin.file) or b"", Report())
        node = node_at(tree, (*prefix, *path)) if tree is not None else None
        return node.span if node is not None else self.origin

    def contains(self, path: str) -> bool:
        """Return whether a path is inside the workspace after symbolic links are resolved. The path need not exist."""
        return _inside(path, self.root)


def settings_files(document: str) -> list[str]:
    """Return the absolute paths of the files that can define the workspace of a document, existing or not.

    The files are `thingc.toml` and `pyproject.toml` in the folder of the document and in all parent folders.
    """
    folder = os.path.dirname(os.path.abspath(document))
    folders = [folder]
    while (above := os.path.dirname(folder)) != folder:
        folders.append(folder := above)
    return [os.path.join(folder, name) for folder in folders for name in (OWN_FILE, SHARED_FILE)]


def _inside(path: str, root: str) -> bool:
    real, top = os.path.realpath(path), os.path.realpath(root)
    return real == top or real.startswith(top.rstrip(os.sep) + os.sep)


def _default(folder: str, inputs: dict[str, str | None]) -> Workspace:
    return Workspace(
        root=folder, parts=_existing(folder, DEFAULT_PARTS, inputs), packages=DEFAULT_PACKAGES,
        build=os.path.join(folder, DEFAULT_BUILD), part_timeout=DEFAULT_TIMEOUT, mesh=DEFAULT_MESH, simulation=DEFAULT_SIMULATION,
        inputs=inputs,
    )


def _existing(root: str, names: tuple[str, ...], inputs: dict[str, str | None]) -> tuple[str, ...]:
    """Return the absolute paths of the folders in `names` that exist in the workspace.

    Missing folders are recorded in `inputs`, because the workspace changes if such a folder is created.
    """
    folders = [os.path.normpath(os.path.join(root, name)) for name in names]
    inputs.update({folder: None for folder in folders if not os.path.isdir(folder) or not _inside(folder, root)})
    return tuple(folder for folder in folders if folder not in inputs)


def _bytes(path: str) -> bytes | None:
    """Return the content of a workspace file, or None if the file does not exist.

    For a file above the maximum size, only one byte more than the maximum is read. Raises OSError if the file cannot be read.

    Special files such as pipes, and symbolic links to targets outside the folder, count as missing.
    """
    if os.path.islink(path) and not _inside(path, os.path.dirname(path)):
        return None
    try:
        return beginning(path, MAX_BYTES + 1)
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError, NotARegularFile):
        return None


def _has_table(data: bytes) -> bool:
    """Return whether a `pyproject.toml` has a `[tool.thingc]` table.

    Most `pyproject.toml` files without this table are recognized by a text search instead of parsing. If the file contains the text of the
    header but cannot be parsed, return True, so that the syntax error is reported.
    """
    if b"thingc" not in data:
        return False
    if len(data) > MAX_BYTES:
        return b"[tool.thingc" in data
    import tomllib

    try:
        tool = tomllib.loads(data.decode("utf-8-sig")).get("tool")
    except (ValueError, RecursionError):
        return b"[tool.thingc" in data
    return isinstance(tool, dict) and isinstance(tool.get("thingc"), dict)


def _parse_workspace(path: str, data: bytes, root: str, inputs: dict[str, str | None], report: Report) -> Workspace | None:
    """Create a workspace from the content `data` of a workspace file.

    A fast parser without source positions reads the usual settings. If a setting is unusual or invalid, the slower document model validates
    the file and reports errors.
    """
    if len(data) > MAX_BYTES:
        report.add(Code.TOO_LARGE, f"the file has more than {MAX_BYTES} bytes", line_of(path), help="remove unused content")
        return None
    import tomllib

    prefix: Path = () if os.path.basename(path) == OWN_FILE else ("tool", "thingc")
    try:
        table: Any = tomllib.loads(data.decode("utf-8-sig"))
        for key in prefix:
            table = table[key]
        settings = _Settings.plain(table)
    except (ValueError, RecursionError, KeyError, TypeError, OverflowError):
        settings = None
    span: Span | None = line_of(path)
    if settings is not None:
        workspace = _workspace(settings, root, span, inputs)
        if workspace is not None:
            return workspace
    return _explained(path, data, root, prefix, inputs, report)


class _Settings(FrozenStruct):
    """The settings of a workspace file, with relative paths and values in SI units."""

    parts: tuple[str, ...] | None
    packages: tuple[str, ...]
    build: str
    part_timeout: float
    part_memory: int
    mesh: Tessellation
    simulation: Tessellation
    emit: tuple[str, ...]
    mesh_uri: str
    about: PackageInfo
    compat: tuple[str, ...]
    bed: tuple[float, ...]

    @staticmethod
    def plain(table: dict[str, Any]) -> _Settings | None:
        """Convert a TOML table to settings, without validation by the document model.

        For unusual or invalid settings, return None or raise ValueError or TypeError.
        """
        known = {"thingc", *(name for name in _Settings.__struct_fields__ if name != "simulation")}
        mesh, about = table.get("mesh", {}), table.get("about", {})
        if table["thingc"] != "workspace/1" or not known.issuperset(table.keys() - {"$schema"}):
            return None
        if not isinstance(mesh, dict) or not isinstance(about, dict):
            return None
        bed = _plain_texts(table.get("bed", []))
        if "bed" in table and len(bed) != 3:
            return None
        if not {"linear", "angular", "simulation"}.issuperset(mesh) or not KEYS.issuperset(about):
            return None
        simulation = mesh.get("simulation", {})
        if not {"linear", "angular"}.issuperset(simulation):
            return None
        fine = _plain_tessellation(mesh, DEFAULT_MESH)
        build, mesh_uri = table.get("build", DEFAULT_BUILD), table.get("mesh_uri", MESH_URIS[0])
        compat = _plain_texts(table.get("compat", []))
        return None if not isinstance(build, str) or mesh_uri not in MESH_URIS or not set(CONSUMERS).issuperset(compat) else _Settings(
            parts=_plain_texts(table["parts"]) if "parts" in table else None,
            packages=_plain_texts(table["packages"]) if "packages" in table else DEFAULT_PACKAGES,
            build=build,
            part_timeout=_plain_value(table, "part_timeout", TIME, DEFAULT_TIMEOUT),
            part_memory=bytes_of(table.get("part_memory")),
            mesh=fine,
            simulation=_plain_tessellation(simulation, DEFAULT_SIMULATION.coarser(fine)),
            emit=_plain_texts(table.get("emit", [])),
            mesh_uri=mesh_uri,
            about=PackageInfo.of(about),
            compat=compat,
            bed=tuple(_plain_value({"bed": text}, "bed", LENGTH, 0.0) for text in bed) or DEFAULT_BED,
        )


def _plain_texts(value: Any) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise TypeError
    return tuple(value)


def _plain_tessellation(table: Any, default: Tessellation) -> Tessellation:
    if not isinstance(table, dict):
        raise TypeError
    return Tessellation(
        linear=_plain_value(table, "linear", LENGTH, default.linear), angular=_plain_value(table, "angular", ANGLE, default.angular),
    )


def _plain_value(table: dict[str, Any], key: str, dimension: Dimension, default: float) -> float:
    if key not in table:
        return default
    text = table[key]
    if not isinstance(text, str):
        raise TypeError
    value = checked(parse_quantity(text), (dimension,), text).value
    if not 0.0 < value <= (LONGEST if dimension == TIME else math.inf):
        raise ValueError
    return value


def bytes_of(memory: Any) -> int:
    """Parse a string such as `4 GB` to a number of bytes.

    For None, return the default memory limit. Raises `ValueError` or `TypeError` for an invalid string.
    """
    if memory is None:
        return DEFAULT_MEMORY
    if (match := re.fullmatch(MEMORY, memory)) is None:
        raise ValueError
    return int(match[1], 10) * {"MB": 1_000_000, "GB": 1_000_000_000}[match[2]]


def _workspace(settings: _Settings, root: str, span: Span | None, inputs: dict[str, str | None]) -> Workspace | None:
    """Create a workspace from its settings. Return None if one of its folders is invalid."""
    folders = DEFAULT_PARTS if settings.parts is None else settings.parts
    if len(folders) > MAX_FOLDERS or len(settings.packages) > MAX_FOLDERS:
        return None
    for text in (*folders, settings.build):
        if _folder_fault(text, root) is not None:
            return None
    parts = _existing(root, folders, inputs)
    if settings.parts is not None and len(parts) != len(folders):
        return None
    return Workspace(
        root=root, parts=parts, packages=settings.packages, build=os.path.normpath(os.path.join(root, settings.build)),
        part_timeout=settings.part_timeout, part_memory=settings.part_memory, mesh=settings.mesh, simulation=settings.simulation,
        emit=settings.emit, mesh_uri=settings.mesh_uri, about=settings.about, compat=settings.compat, bed=settings.bed, origin=span,
        inputs=inputs,
    )


MAX_FOLDERS = 100


def _folder_fault(text: str, root: str) -> tuple[str, str] | None:
    """Return an error and a hint for an invalid path in the workspace file, or None if the path is inside the workspace."""
    shown = shortened(text)
    if not text.strip() or "\0" in text:
        return f"expected a folder, found `{shown}`", "write the name of a folder, or `.` for the folder of `thingc.toml`"
    if os.path.isabs(text) or text.startswith("~"):
        return f"`{shown}` is an absolute path", "write a path relative to `thingc.toml`"
    if not _inside(os.path.join(root, text), root):
        return f"`{shown}` is outside the workspace", "use a folder inside the folder of `thingc.toml`"
    return None


def _explained(path: str, data: bytes, root: str, prefix: Path, inputs: dict[str, str | None], report: Report) -> Workspace | None:
    """Parse the workspace file with source positions, and validate it with the document model.

    If the file has errors, report all errors and return None.
    """
    from thingc.base.source import Document, node_at
    from thingc.documents.load.documents import document_kind, read_tree
    from thingc.documents.spec.validation import validate_one

    before = len(report.diagnostics)
    tree = read_tree(path, data, report)
    table = node_at(tree, prefix) if tree is not None else None
    if not isinstance(table, MappingNode):
        return None
    kind = document_kind(table, report, usual="workspace")
    if kind is None:
        return None
    if kind != "workspace":
        report.add(
            Code.WRONG_KIND, f"expected a document of kind `workspace`, found `{kind}`", table.entries["thingc"].span,
            help="write `thingc = \"workspace/1\"`",
        )
        return None
    document = Document(path=path, relative=os.path.basename(path), kind=kind, tree=table, sha256="", text=data.decode("utf-8-sig"))
    spec = validate_one(document, report)
    if spec is None or len(report.diagnostics) > before:
        return None
    settings = _from_spec(spec, document, report)
    _check_folders(settings, document, root, report)
    return None if len(report.diagnostics) > before else _workspace(settings, root, table.span, inputs)


def _from_spec(spec: Any, document: Document, report: Report) -> _Settings:
    """Convert the validated model of a workspace file to settings.

    Expressions, and numbers that are zero or negative, are reported as errors.
    """

    def value(said: Any, path: Path, default: float) -> float:
        if said is None:
            return default
        if not isinstance(said, Quantity):
            report.add(Code.BAD_EXPRESSION, "a workspace has no parameters: write a plain value", document.span(path))
            return default
        if said.value <= 0.0:
            report.add(Code.BAD_QUANTITY, f"expected a value above 0, found `{said}`", document.span(path))
            return default
        if said.dimension == TIME and said.value > LONGEST:
            report.add(Code.BAD_QUANTITY, f"expected a time of at most {LONGEST:.0f} s, found `{said}`", document.span(path))
            return default
        return said.value

    def tessellation(said: Any, path: Path, default: Tessellation) -> Tessellation:
        if said is None:
            return default
        return Tessellation(
            linear=value(said.linear, (*path, "linear"), default.linear),
            angular=value(said.angular, (*path, "angular"), default.angular),
        )

    mesh = tessellation(spec.mesh, ("mesh",), DEFAULT_MESH)
    return _Settings(
        parts=tuple(spec.parts) if "parts" in document.tree.entries else None, packages=tuple(spec.packages), build=spec.build,
        part_timeout=value(spec.part_timeout, ("part_timeout",), DEFAULT_TIMEOUT), part_memory=bytes_of(spec.part_memory),
        mesh=mesh,
        simulation=tessellation(spec.mesh.simulation if spec.mesh else None, ("mesh", "simulation"), DEFAULT_SIMULATION.coarser(mesh)),
        emit=tuple(spec.emit),
        mesh_uri=spec.mesh_uri,
        about=PackageInfo.of(spec.about.model_dump(exclude_none=True) if spec.about is not None else {}),
        compat=tuple(spec.compat),
        bed=DEFAULT_BED if spec.bed is None else tuple(value(said, ("bed", k), DEFAULT_BED[k]) for k, said in enumerate(spec.bed)),
    )


def _check_folders(settings: _Settings, document: Document, root: str, report: Report) -> None:
    for key, texts in (("parts", settings.parts or ()), ("packages", settings.packages)):
        if len(texts) > MAX_FOLDERS:
            report.add(Code.TOO_LARGE, f"the workspace lists more than {MAX_FOLDERS} {key}", document.span((key,)))
            return
    parts = DEFAULT_PARTS if settings.parts is None else settings.parts
    named: list[tuple[str, Path]] = [(text, ("parts", index)) for index, text in enumerate(parts)]
    for text, path in [*named, (settings.build, ("build",))]:
        where = document.span(path)
        fault = _folder_fault(text, root)
        if fault is not None:
            report.add(Code.OUTSIDE_WORKSPACE, fault[0], where, help=fault[1])
        elif path != ("build",) and settings.parts is not None and not os.path.isdir(os.path.join(root, text)):
            here = [entry.name for entry in os.scandir(root) if entry.is_dir() and not entry.name.startswith(".")]
            help = did_you_mean(text, here, what="folders")
            report.add(Code.WORKSPACE_FOLDER, f"the workspace has no folder `{shortened(text)}`", where, help=help)
