"""Read mesh files with trimesh: merged vertices and triangles in metres, by colour."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from thingc.base.inertia import MassProperties, symmetric
from thingc.base.primitives import FARTHEST
from thingc.geometry.mesh_bounds import LARGEST, BadMesh, damaged_file_error, is_text, read_bounded, refuse_beyond
from thingc.geometry.meshes.files import MeshFile, MeshPiece, MeshRecord
from thingc.geometry.record import Mesh
from thingc.geometry.store.local import Store
from thingc.geometry.worker.kernel.meshing import Triangles, obj

if TYPE_CHECKING:
    from numpy.typing import NDArray

MUJOCO_MOST = 200_000
"""Maximum number of triangles of an STL file that MuJoCo reads."""

LEAST_SCALE = 1e-4
"""Smallest scale factor with which MuJoCo still finds a volume in a mesh of a few units in size."""

FLAT = 1e-9
"""A mesh counts as flat if its thickness relative to its size is at most this value. The value takes into account that coordinates have
single precision.
"""

_AXES = re.compile(rb"<up_axis>\s*([XYZ])_UP")
_COLLADA = re.compile(rb"<(\w+:)?COLLADA\s[^>]*xmlns")
_METER = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']+)")
_TEXTURE = re.compile(rb"<texture\b[^>]*?(?:/>|>.*?</texture>)", re.DOTALL)
_PARAMETER = re.compile(rb"<newparam\b.*?</newparam>", re.DOTALL)
_MATERIALS = re.compile(rb"<bind_material\b.*?</bind_material>", re.DOTALL)
"""Patterns that match parts of COLLADA files: colours that are images, parameters of images, and materials of geometries."""
_FACE, _NEXT = (re.compile(rb"^[ \t]*%s[ \t]" % word, re.MULTILINE) for word in (b"f", b"[og]"))
"""Patterns that match lines of OBJ files: the line of a face, and the line at which an object or a group begins."""


def _read_beside(file: MeshFile) -> Any:
    """Return a resolver of trimesh that opens only the files that define the colours of the mesh, and whose digests are known.

    Raises `BadMesh` if a file has changed.
    """
    contents: dict[str, bytes] = {}
    for name, digest in file.beside:
        with open(os.path.join(file.folder, name), "rb") as stream:
            contents[name] = stream.read(LARGEST)
        if hashlib.sha256(contents[name]).hexdigest() != digest:
            raise BadMesh(f"refers to `{name}`, which changed during reading")
    return trimesh.resolvers.ZipResolver(contents)


def read_mesh(file: MeshFile, store: Store) -> MeshRecord:
    """Read a mesh file, write its triangles to the store, and return the record of the file.

    If MuJoCo can read the file itself, its bytes are also written to the store. Raises `BadMesh` if the file is not a valid mesh.
    """
    data = read_bounded(os.path.join(file.folder, os.path.basename(file.path)), file.suffix)
    if hashlib.sha256(data).hexdigest() != file.sha256:
        raise BadMesh("changed during reading")
    colored = [(color, _to_metres(file, data, corners)) for color, corners in _triangles(file, data)]
    count = sum(len(corners) for _, corners in colored)
    if count == 0:
        raise BadMesh("contains no triangles")
    corners = _in_order([corners for _, corners in colored])
    if not np.isfinite(corners).all():
        raise BadMesh("has a coordinate that is not finite")
    if float(np.abs(corners).max()) > FARTHEST:
        raise BadMesh(f"has a coordinate of {float(np.abs(corners).max()):.3g} m (at most {FARTHEST:g} m is supported)")
    mesh, matter, flipped = _store_mesh(corners, store)
    by_color: dict[str | None, list[Any]] = {}
    for color, some in colored:
        by_color.setdefault(color, []).append(some)
    pieces = tuple(
        MeshPiece(mesh=mesh if len(by_color) == 1 else _store_mesh(_in_order(some), store)[0], color=color)
        for color, some in sorted(by_color.items(), key=lambda entry: entry[0] or "")
    )
    low, high = (tuple(float(x) for x in side) for side in (corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)))
    original = (store.put(data), len(data)) if len(pieces) == 1 and not flipped and _for_mujoco(file, data, count) else None
    return MeshRecord(mesh=mesh, pieces=pieces, matter=matter, box=(low, high), own=original)  # type: ignore[arg-type]


def _in_order(geometries: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the triangles of several geometries as one array, sorted by coordinates, because trimesh's order is not specified."""
    if len(geometries) == 1:
        return geometries[0]
    together = np.concatenate(geometries)
    order: NDArray[np.int64] = np.lexsort(together.reshape(len(together), 9).T[::-1])
    return together[order]


def _triangles(file: MeshFile, data: bytes) -> Iterator[tuple[str | None, NDArray[np.float64]]]:
    """Yield the triangles of a mesh file by colour, as arrays of corners `(n, 3, 3)` in the unit of the file."""
    try:
        scene: Any = _scene(file, data)
        count = 0
        for node in scene.graph.nodes_geometry:
            transform, name = scene.graph[node]
            geometry = scene.geometry[name]
            if not hasattr(geometry, "triangles") or len(geometry.faces) == 0:
                continue
            refuse_beyond(count := count + len(geometry.faces))
            corners = np.asarray(geometry.triangles, dtype=np.float64)
            mirrored = np.linalg.det(transform[:3, :3]) < 0.0
            moved = corners @ transform[:3, :3].T + transform[:3, 3]
            yield _color(geometry, file), moved[:, ::-1] if mirrored else moved
    except MemoryError:
        raise BadMesh("needs more memory than is available") from None
    except BadMesh:
        raise
    except Exception as fault:
        raise BadMesh(_unreadable(file, data, fault)) from fault


def _unreadable(file: MeshFile, data: bytes, fault: Exception) -> str:
    """Return the reason why a mesh file cannot be read, for an error message.

    The message of trimesh is replaced for XML files other than COLLADA, such as the error page of a server.
    """
    if file.suffix == ".dae" and isinstance(fault, AttributeError):
        return "contains no `<scene>`" if _COLLADA.search(data) else "contains no `<COLLADA xmlns=...>`"
    return str(damaged_file_error(file.suffix, fault))


def _scene(file: MeshFile, data: bytes) -> Any:
    """Read a mesh file as a scene of trimesh.

    If a COLLADA material has missing references, trimesh silently drops every geometry with this material. Such a file is therefore read
    again without images, which are not needed, and if this fails, without materials.
    """

    def load(text: bytes, **options: Any) -> Any:
        return trimesh.load_scene(io.BytesIO(text), file_type=file.suffix[1:], resolver=_read_beside(file), process=False, **options)

    if file.suffix != ".dae":
        return load(data)
    from collada.common import DaeError

    for text in _readings(data):
        with contextlib.suppress(DaeError):
            return load(text, ignore_broken=False)
    return load(_MATERIALS.sub(b"", data))


def _readings(dae: bytes) -> Iterator[bytes]:
    """Yield three variants of a COLLADA file: the original, a variant with white in place of images, and a variant without materials."""
    yield dae
    yield _PARAMETER.sub(b"", _TEXTURE.sub(b"<color>1 1 1 1</color>", dae))
    yield _MATERIALS.sub(b"", dae)


def _color(geometry: Any, file: MeshFile) -> str | None:
    """Return the colour of a geometry of trimesh, or None if the mesh file does not define its colour.

    The default colour that trimesh sets for an OBJ file without a material library is ignored.
    """
    visual = geometry.visual
    if not visual.defined or file.suffix in (".stl", ".obj") and not file.beside:
        return None
    try:
        red, green, blue, alpha = (int(channel) for channel in (visual.material if visual.kind == "texture" else visual).main_color)
    except (AttributeError, TypeError, ValueError):
        return None
    return f"#{red:02x}{green:02x}{blue:02x}" + (f"{alpha:02x}" if alpha < 255 else "")


def _to_metres(file: MeshFile, data: bytes, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert the corners of triangles from the unit and axes of the file to metres with the z axis up.

    The y axis of a glTF file points up. A COLLADA file specifies its up axis. Faces are flipped if an odd number of axes is mirrored.
    """
    up, unit = b"Z", 1.0
    if file.suffix == ".glb":
        up = b"Y"
    elif file.suffix == ".dae":
        axis, meter = _AXES.search(data), _METER.search(data)
        up = b"Y" if axis is None else axis[1]
        try:
            unit = 1.0 if meter is None else float(meter[1])
        except ValueError:
            raise BadMesh("has an invalid `meter` attribute of `<unit>`") from None
    x, y, z = (corners[..., k] for k in range(3))
    if up == b"Y":
        corners = np.stack([x, -z, y], axis=-1)
    elif up == b"X":
        corners = np.stack([-y, -z, x], axis=-1)
    corners = corners * unit * np.array(file.scale) + 0.0
    return corners[:, ::-1] if np.prod(file.scale) < 0.0 else corners


def _store_mesh(corners: NDArray[np.float64], store: Store) -> tuple[Mesh, MassProperties | None, bool]:
    """Write triangles to the store as one mesh.

    Return the mesh, its mass properties (None for an open or flat mesh), and whether its faces were flipped because they pointed inwards.
    """
    points = np.ascontiguousarray(corners.reshape(-1, 3))
    first, inverse = _equal_rows(points)
    order = np.argsort(np.argsort(first))  # number vertices in the order of their first use
    vertices, faces = points[np.sort(first)], order[inverse].reshape(-1, 3)
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    if len(faces) == 0:
        raise BadMesh("contains no triangle with an area")
    closed, matter, flipped = Triangles(vertices, faces).closed, None, False
    flat = _is_flat(vertices)
    if closed and not flat:
        properties: Any = trimesh.triangles.mass_properties(vertices[faces], density=1.0, skip_inertia=False)
        flipped = bool(properties.volume < 0.0)
        if flipped:
            faces = faces[:, ::-1]
            properties = trimesh.triangles.mass_properties(vertices[faces], density=1.0, skip_inertia=False)
        inertia = tuple(tuple(float(x) for x in row) for row in properties.inertia)
        x, y, z = (float(one) for one in properties.center_mass)
        matter = MassProperties(mass=float(properties.volume), centre=(x, y, z), inertia=symmetric(inertia))  # type: ignore[arg-type]
    data = obj(Triangles(vertices, faces))
    mesh = Mesh(sha256=store.put(data), size=len(data), vertices=len(vertices), faces=len(faces), closed=closed, flat=flat)
    return mesh, matter, flipped


def _equal_rows(points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find equal rows of an array. Return the index of the first row of each group of equal rows, and the number of the group of each row.

    The function compares hashes of the bits of rows, which is three times as fast as a direct comparison. If different rows have the same
    hash, the function compares the rows directly.
    """
    bits = points.view(np.uint64)
    with np.errstate(over="ignore"):
        x, y, z = (bits * np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)).T
    mixed = x ^ (y >> np.uint64(5)) ^ (z >> np.uint64(9))
    _, first, inverse = np.unique(mixed, return_index=True, return_inverse=True)
    if not np.array_equal(points[first][inverse], points):
        _, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    return first, np.asarray(inverse).reshape(-1)


def _is_flat(vertices: NDArray[np.float64]) -> bool:
    centred = vertices - vertices.mean(axis=0)
    spread = np.linalg.eigvalsh(centred.T @ centred)
    return bool(spread[0] <= (FLAT**2) * spread[-1])


def _for_mujoco(file: MeshFile, data: bytes, count: int) -> bool:
    """Return whether MuJoCo can read a mesh file unchanged.

    MuJoCo reads binary STL files up to a maximum size, and OBJ files with one object. The scale must be large enough that MuJoCo finds a
    volume.
    """
    if min(map(abs, file.scale)) < LEAST_SCALE:
        return False
    if file.suffix == ".obj":
        return _has_one_object(data)
    return file.suffix == ".stl" and not is_text(data) and count <= MUJOCO_MOST


def _has_one_object(obj: bytes) -> bool:
    """Return False if an object or group begins after the first face of an OBJ file. MuJoCo would read the vertices of such an object or
    group, but not its faces.
    """
    face = _FACE.search(obj)
    return face is None or _NEXT.search(obj, face.end()) is None
