"""The workspace of a document: the folder that contains all its files, and its settings.

The workspace is the nearest folder above the document that contains a `thingc.toml`, or a `pyproject.toml` with `[tool.thingc]`. If there
is no such folder, the workspace is the folder of the document.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report
from thingc.base.filesystem import NotARegularFile, beginning
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.installed_packages import dotted_name
from thingc.base.package_info import KEYS, MEMORY, PackageInfo
from thingc.base.safe_text import is_text
from thingc.base.source import MappingNode, Path, Span, line_of
from thingc.base.suggestions import Hint, did_you_mean
from thingc.base.units import ANGLE, LENGTH, TIME, Dimension, Quantity, check_dimension, parse_quantity, shorten

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
    packages: tuple[str, ...] = DEFAULT_PACKAGES
    build: str
    part_timeout: float = DEFAULT_TIMEOUT
    mesh: Tessellation = DEFAULT_MESH
    simulation: Tessellation = DEFAULT_SIMULATION
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
        start = os.path.dirname(os.path.abspath(document))
        if not is_text(start):
            report.add(
                Code.FILE_NAME, f"the folder `{start}` has bytes in its name that are not UTF-8", None,
                help="rename the folder, or move the workspace: paths must be UTF-8",
            )
            return None
        inputs: dict[str, str | None] = {}
        for path in settings_files(document):
            folder, name = os.path.split(path)
            try:
                data = texts[path] if texts and path in texts else _read_workspace_file(path)
            except OSError as error:
                report.add(Code.UNREADABLE, f"cannot read `{name}`: {(error.strerror or 'an error').lower()}", None)
                return None
            inputs[path] = None if data is None else hashlib.sha256(data).hexdigest()
            if data is not None and (name == OWN_FILE or _has_table(data)):
                return _parse_workspace(path, data, folder, inputs, report)
        return _workspace({}, start, None, inputs)

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
        tree = read_tree(self.origin.file, _read_workspace_file(self.origin.file) or b"", Report())
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


def _existing_folders(root: str, names: tuple[str, ...], inputs: dict[str, str | None]) -> tuple[str, ...]:
    """Return the absolute paths of the folders in `names` that exist in the workspace.

    Missing folders are recorded in `inputs`, because the workspace changes if such a folder is created.
    """
    folders = [os.path.normpath(os.path.join(root, name)) for name in names]
    inputs.update({folder: None for folder in folders if not os.path.isdir(folder) or not _inside(folder, root)})
    return tuple(folder for folder in folders if folder not in inputs)


def _read_workspace_file(path: str) -> bytes | None:
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

    A fast parser without source positions reads the file. If a setting is invalid, the slower document model validates the file and reports
    errors.
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
        settings, faults = _read_settings(table, root)
        if not faults:
            return _workspace(settings, root, line_of(path), inputs)
    except (ValueError, RecursionError, KeyError, TypeError, OverflowError):
        pass
    return _validate_located(path, data, root, prefix, inputs, report)


class _Fault(FrozenStruct, kw_only=False):
    """An invalid number or folder in a workspace file, which the document model accepts. `path` is the path of the value."""

    path: Path
    code: Code
    message: str
    help: Hint | None = None


_ReadFunction = Callable[[Any, Path, list[_Fault]], Any]
"""A function that converts the value at a path of a workspace file. Invalid numbers are added to the list.

Raises `ValueError` or `TypeError` for values that the document model does not accept.
"""


def _text(choices: Collection[str] = ()) -> _ReadFunction:
    """Return a function that reads a string. If `choices` is not empty, the string must be one of the choices."""
    def read(value: Any, path: Path, faults: list[_Fault]) -> str:
        if not isinstance(value, str) or (choices and value not in choices):
            raise TypeError
        return value

    return read


def _list(item: _ReadFunction, count: int | None = None) -> _ReadFunction:
    """Return a function that reads a list, whose items the function `item` reads. If `count` is given, the list must have this length."""
    def read(value: Any, path: Path, faults: list[_Fault]) -> tuple[Any, ...]:
        if not isinstance(value, list) or count not in (None, len(value)):
            raise TypeError
        return tuple(item(entry, (*path, index), faults) for index, entry in enumerate(value))

    return read


def _number(dimension: Dimension, maximum: float = math.inf) -> _ReadFunction:
    """Return a function that reads a quantity above 0 and converts it to SI units."""
    def read(value: Any, path: Path, faults: list[_Fault]) -> float:
        if isinstance(value, str) and value.lstrip().startswith("="):
            faults.append(_Fault(path, Code.BAD_EXPRESSION, "a workspace has no parameters: write a plain value"))
            return math.nan
        quantity = check_dimension(parse_quantity(value) if isinstance(value, str) else Quantity(value + 0.0), (dimension,), str(value))
        if quantity.value <= 0.0:
            faults.append(_Fault(path, Code.BAD_QUANTITY, f"expected a value above 0, found `{quantity}`"))
        elif quantity.value > maximum:
            faults.append(_Fault(path, Code.BAD_QUANTITY, f"expected a time of at most {maximum:.0f} s, found `{quantity}`"))
        return quantity.value

    return read


def _memory(value: Any, path: Path, faults: list[_Fault]) -> int:
    """Convert an amount of memory such as `4 GB` to a number of bytes. Raises `ValueError` or `TypeError` for other values."""
    if (match := re.fullmatch(MEMORY, value)) is None:
        raise ValueError
    return int(match[1], 10) * {"MB": 1_000_000, "GB": 1_000_000_000}[match[2]]


def _mapping(value: Any, keys: Collection[str]) -> dict[str, Any]:
    if not isinstance(value, dict) or not value.keys() <= set(keys):
        raise TypeError
    return value


def _tessellations(value: Any, path: Path, faults: list[_Fault]) -> tuple[Tessellation, Tessellation]:
    """Read the tessellations for printing and for simulators. By default, the tolerances for simulators are at least as large."""
    fine = {key: tolerance for key, tolerance in _mapping(value, (*_TOLERANCES, "simulation")).items() if key in _TOLERANCES}
    coarse = _mapping(value.get("simulation", {}), _TOLERANCES)
    mesh = replace(DEFAULT_MESH, **{key: _TOLERANCES[key](tolerance, (*path, key), faults) for key, tolerance in fine.items()})
    coarse_settings = {key: _TOLERANCES[key](tolerance, (*path, "simulation", key), faults) for key, tolerance in coarse.items()}
    return mesh, replace(DEFAULT_SIMULATION.coarser(mesh), **coarse_settings)


_TOLERANCES: Mapping[str, _ReadFunction] = {"linear": _number(LENGTH), "angular": _number(ANGLE)}
_KEYS: Mapping[str, _ReadFunction] = {
    "parts": _list(_text()), "packages": _list(_text()), "build": _text(), "emit": _list(_text()), "mesh_uri": _text(MESH_URIS),
    "about": lambda value, path, faults: PackageInfo.of(_mapping(value, KEYS)), "compat": _list(_text(CONSUMERS)),
    "part_timeout": _number(TIME, LONGEST), "part_memory": _memory, "bed": _list(_number(LENGTH), 3), "mesh": _tessellations,
}
"""The keys of a workspace file. Each value becomes the field of `Workspace` with the same name, except for `mesh`, which contains two."""


def _read_settings(table: Any, root: str) -> tuple[dict[str, Any], list[_Fault]]:
    """Return the values of a workspace file by key, and the faults of these values.

    Raises `ValueError`, `KeyError` or `TypeError` for a file that the document model does not accept.
    """
    faults: list[_Fault] = []
    if _mapping(table, ("thingc", "$schema", *_KEYS))["thingc"] != "workspace/1":
        raise ValueError
    settings = {key: _KEYS[key](value, (key,), faults) for key, value in table.items() if key in _KEYS}
    return settings, [*faults, *_folder_faults(settings, root)]


def _workspace(settings: Mapping[str, Any], root: str, span: Span | None, inputs: dict[str, str | None]) -> Workspace:
    """Create a workspace from the valid settings of its file."""
    mesh, simulation = settings.get("mesh", (DEFAULT_MESH, DEFAULT_SIMULATION))
    return Workspace(**{
        **settings, "root": root, "parts": _existing_folders(root, settings.get("parts", DEFAULT_PARTS), inputs), "mesh": mesh,
        "simulation": simulation, "build": os.path.normpath(os.path.join(root, settings.get("build", DEFAULT_BUILD))), "origin": span,
        "inputs": inputs,
    })


MAX_FOLDERS = 100


def _folder_fault(text: str, root: str) -> tuple[str, str] | None:
    """Return an error and a hint for an invalid path in the workspace file, or None if the path is inside the workspace."""
    name = shorten(text)
    if not text.strip() or "\0" in text:
        return f"expected a folder, found `{name}`", "write the name of a folder, or `.` for the folder of `thingc.toml`"
    if os.path.isabs(text) or text.startswith("~"):
        return f"`{name}` is an absolute path", "write a path relative to `thingc.toml`"
    if not _inside(os.path.join(root, text), root):
        return f"`{name}` is outside the workspace", "use a folder inside the folder of `thingc.toml`"
    return None


def _folder_faults(settings: Mapping[str, Any], root: str) -> Iterator[_Fault]:
    for key in ("parts", "packages"):
        if len(settings.get(key, ())) > MAX_FOLDERS:
            yield _Fault((key,), Code.TOO_LARGE, f"the workspace lists more than {MAX_FOLDERS} {key}")
            return
    paths: list[tuple[str, Path]] = [(text, ("parts", index)) for index, text in enumerate(settings.get("parts", DEFAULT_PARTS))]
    for text, path in [*paths, (settings.get("build", DEFAULT_BUILD), ("build",))]:
        fault = _folder_fault(text, root)
        if fault is not None:
            yield _Fault(path, Code.OUTSIDE_WORKSPACE, *fault)
        elif path != ("build",) and "parts" in settings and not os.path.isdir(os.path.join(root, text)):
            folders = [entry.name for entry in os.scandir(root) if entry.is_dir() and not entry.name.startswith(".")]
            help = did_you_mean(text, folders, what="folders")
            yield _Fault(path, Code.WORKSPACE_FOLDER, f"the workspace has no folder `{shorten(text)}`", help)


def _validate_located(path: str, data: bytes, root: str, prefix: Path, inputs: dict[str, str | None], report: Report) -> Workspace | None:
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
    if validate_one(document, report) is None or len(report.diagnostics) > before:
        return None
    settings, faults = _read_settings(table.plain(), root)
    for fault in faults:
        report.add(fault.code, fault.message, document.span(fault.path), help=fault.help)
    return None if faults else _workspace(settings, root, table.span, inputs)
