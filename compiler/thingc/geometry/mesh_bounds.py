"""Limits for mesh files, checked before memory is allocated for their contents."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Callable, Iterable
from typing import TypeVar
from xml.etree import ElementTree

LARGEST = 200_000_000
"""Maximum size of a mesh file, and of the uncompressed model in a 3MF file [bytes]."""
MOST = 5_000_000
"""Maximum number of triangles in a mesh file."""
INSTANCES = 10_000
"""Maximum number of placed objects in a mesh file. An object that is placed several times counts several times."""
LEVELS = 100
"""Maximum nesting depth of objects in a mesh file."""

_HEAD, _TRIANGLE = 84, 50
"""Size of the header of a binary STL file, and size of each triangle in the file [bytes]."""
_FACET, _FACE = re.compile(rb"endfacet", re.IGNORECASE), re.compile(rb"^[ \t]*f[ \t]", re.MULTILINE)
"""Patterns that match once per facet of an STL text file, and once per face of an OBJ file."""

_NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Number of components of an element of a glTF accessor, by its type."""

_T = TypeVar("_T")


class BadMesh(Exception):
    """Raised if a file is not a valid mesh. The message is the reason, which diagnostics append to the name of the file."""


def damaged_file_error(suffix: str, fault: Exception) -> BadMesh:
    """Create the error for a mesh file whose reader raised the exception `fault`.

    Messages that Python itself creates are omitted, because they only describe internal values.
    """
    message = " ".join(str(fault).removeprefix(f"{type(fault).__name__}: ").split())
    is_internal = isinstance(fault, (LookupError, TypeError, AttributeError, NameError, OSError)) or not message
    return BadMesh(f"is not a valid {suffix[1:].upper()} file" + ("" if is_internal else f" ({message})"))


def read_bounded(path: str, suffix: str, limit: int = MOST) -> bytes:
    """Read the bytes of a mesh file, and check its size and the number of triangles that it declares.

    Raises `OSError` if the file cannot be read, and `BadMesh` if the file is not a valid mesh.
    """
    with open(path, "rb") as stream:
        data = stream.read(LARGEST + 1)
    check_mesh_file(suffix, data, limit)
    return data


def check_mesh_file(suffix: str, data: bytes, limit: int = MOST) -> None:
    """Check the content of a mesh file before it is parsed.

    Raises `BadMesh` if the file is empty, too large or truncated. Also raises `BadMesh` if the file declares more than `limit` triangles or
    too many objects.
    """
    declared: int | None = None
    if not data:
        raise BadMesh("is empty")
    if len(data) > LARGEST:
        raise BadMesh(f"is larger than {LARGEST // 1_000_000} MB")
    if suffix == ".stl" and is_text(data):
        declared = sum(1 for _ in _FACET.finditer(data))
        if b"facet" in data and b"endsolid" not in data.lower():
            raise BadMesh("is truncated (no `endsolid`)")
    elif suffix == ".stl":
        if len(data) < _HEAD:
            raise BadMesh(f"is truncated: expected at least {_HEAD} bytes, found {len(data)}")
        declared, present = int.from_bytes(data[80:84], "little"), (len(data) - _HEAD) / _TRIANGLE
        if declared != present:
            what = "is truncated" if declared > present else "has data after its end"
            raise BadMesh(f"{what}: expected {declared} triangles, found bytes for {present:.6g}")
    elif suffix == ".ply" and (match := re.search(rb"^element face (\d+)", data[:10_000], re.MULTILINE)):
        declared = int(match[1])
    elif suffix == ".obj":
        declared = sum(1 for _ in _FACE.finditer(data))
    elif suffix == ".dae":
        with contextlib.suppress(ElementTree.ParseError, ValueError, LookupError):  # the reader of the file reports these errors
            _unfold_collada(ElementTree.fromstring(data))
    elif suffix in (".glb", ".gltf"):
        declared = _declared_by_gltf(data if suffix == ".gltf" else data[20 : 20 + int.from_bytes(data[12:16], "little")])
    refuse_beyond(declared or 0, limit)


def refuse_beyond(count: int, limit: int = MOST, what: str = "triangles") -> None:
    """Raise `BadMesh` if a mesh has more than `limit` elements, such as triangles."""
    if count > limit:
        raise BadMesh(f"has {count} {what} (at most {limit} are supported)")


def is_text(stl: bytes) -> bool:
    """Return whether an STL file is in text form."""
    return b"\0" not in stl[:_HEAD] and stl.lstrip()[:5].lower() == b"solid"


def unfold(root: _T, parts: Callable[[_T], Iterable[_T]]) -> None:
    """Raise `BadMesh` if the objects below `root` are placed more than `INSTANCES` times, or if an object contains itself.

    The function `parts` returns the objects that an object contains.
    """
    counts: dict[_T, int] = {}

    def count(one: _T, level: int) -> int:
        if level > LEVELS:
            raise BadMesh(f"has more than {LEVELS} levels of nested objects")
        if one not in counts:
            counts[one] = 1 + sum(count(part, level + 1) for part in parts(one))
        return counts[one]

    refuse_beyond(count(root, 0), INSTANCES, "placed objects")


def _unfold_collada(root: ElementTree.Element) -> None:
    named = {f"#{node.get('id')}": node for node in root.iter() if node.tag.endswith("}node")}

    def parts(node: ElementTree.Element) -> Iterable[ElementTree.Element]:
        placed = (named.get(one.get("url", ""), one) for one in node)
        yield from (one for one in placed if one.tag.endswith(("}node", "}instance_geometry")))

    for scene in root.iter():
        if scene.tag.endswith("}visual_scene"):
            unfold(scene, parts)


def _declared_by_gltf(text: bytes) -> int:
    """Return a lower bound of the number of triangles that the accessors of a glTF file declare.

    Sparse accessors do not need bytes for their elements, and several accessors may share the same bytes. Raises `BadMesh` if the file
    is not a valid mesh.
    """
    try:
        document = json.loads(text)
        pieces = [len(mesh["primitives"]) for mesh in document.get("meshes", ())]
        placed = (1 + (pieces[node["mesh"]] if "mesh" in node else 0) for node in document.get("nodes", ()))
        refuse_beyond(max(sum(placed), sum(pieces)), INSTANCES, "nodes and placed objects")
        sizes = [(abs(int(one["count"])), _NUMBERS[one["type"]]) for one in document.get("accessors", ())]
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError, OverflowError) as fault:
        raise damaged_file_error(".glb", fault) from fault
    refuse_beyond(sum(count * numbers for count, numbers in sizes), LARGEST, "numbers")
    return max((count for count, _ in sizes), default=0) // 3
