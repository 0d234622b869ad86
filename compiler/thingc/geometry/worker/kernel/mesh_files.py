"""Read parts from mesh files. Files in the formats STL, OBJ, PLY, OFF and glTF are read with trimesh, and 3MF files are read by this
module.

The 3MF reader of trimesh is not used, because it needs lxml and silently drops references to missing objects.
"""

from __future__ import annotations

import io
import math
import zipfile
from array import array
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any
from xml.parsers import expat

import numpy as np

from thingc.geometry.mesh_bounds import LARGEST, BadMesh, damaged_file_error, read_bounded, refuse_beyond, unfold
from thingc.geometry.worker.kernel.meshing import Triangles, from_trimesh, together, without_slivers

if TYPE_CHECKING:
    from numpy.typing import NDArray

PLAIN = (".stl", ".obj", ".ply", ".off")
"""The suffixes of file formats that do not specify a unit."""
GLTF = (".glb", ".gltf")
"""The suffixes of file formats that use metres and in which the y axis points up."""
SUFFIXES = (*PLAIN, *GLTF, ".3mf")

NEAR = 1e-6
"""Corners are merged if this closes an open surface and their distance, relative to the size of the mesh, is at most this value."""

MOST = 1_000_000
"""Maximum number of triangles of a part. The limit exists because the CAD kernel needs about 3.5 kB of memory for each triangle."""

FARTHEST = 1e9
"""Largest allowed coordinate [mm]. Larger coordinates are probably errors, and the kernel would create shapes with gaps between faces."""

_UNITS_3MF = {"micron": 1e-3, "millimeter": 1.0, "centimeter": 10.0, "inch": 25.4, "foot": 304.8, "meter": 1000.0}
_CORE_3MF = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
_BUILD = "what is built"


class BadPartFile(ValueError):
    """Raised if a file cannot be used as a part. The message is the reason."""


def read_mesh(path: str, suffix: str, unit: float) -> tuple[Triangles, tuple[str, ...]]:
    """Read a mesh file of a part. Return its closed surface as a mesh [mm], and descriptions of the repairs that were made.

    `unit` [mm] is the unit of files that do not specify a unit. In the result, the z axis points up, also for glTF files. Raises
    `BadPartFile` if the file is not valid, or if the surface cannot be closed.
    """
    try:
        data = read_bounded(path, suffix, MOST)
        if suffix == ".3mf":
            mesh = _from_3mf(data)
        elif suffix in GLTF:
            surface = _from_trimesh(path, suffix, data)
            x, y, z = surface.vertices.T
            mesh = Triangles(1000.0 * np.column_stack([x, -z, y]) + 0.0, surface.faces)
        else:
            mesh = _from_trimesh(path, suffix, data).scale(unit)
    except BadMesh as fault:
        raise BadPartFile(f"the file {fault}") from fault.__cause__
    except (BadPartFile, MemoryError):
        raise
    except Exception as fault:
        raise BadPartFile(f"the file {damaged_file_error(suffix, fault)}") from fault
    if len(mesh.faces) == 0:
        raise BadPartFile("the file contains no triangles")
    farthest = float(np.abs(mesh.vertices).max())
    if farthest > FARTHEST:
        raise BadPartFile(f"a coordinate is too large ({farthest:.3g} mm)")
    unique, removed = _remove_duplicates(mesh)
    closed, repairs = _close(unique)
    return closed, (*removed, *repairs)


def reads_with_trimesh(path: str) -> bool:
    """Return whether trimesh reads files of this type, without importing trimesh, which is slow."""
    return path.lower().endswith((*PLAIN, *GLTF))


def _from_trimesh(path: str, suffix: str, data: bytes) -> Triangles:
    import trimesh

    resolver = trimesh.resolvers.FilePathResolver(path) if suffix == ".gltf" else None
    scene: Any = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], resolver=resolver, process=False)
    refuse_beyond(sum(len(getattr(scene.geometry[scene.graph[node][1]], "faces", ())) for node in scene.graph.nodes_geometry), MOST)
    corners = np.asarray(scene.triangles if scene.geometry else (), dtype=np.float64)
    return _weld(_finite(corners.reshape(-1, 3)))


def _weld(corners: NDArray[np.float64]) -> Triangles:
    """Create a triangle mesh from the corners of its triangles by merging equal corners into vertices.

    `corners` contains three rows for each triangle.
    """
    unique, inverse = np.unique(corners + 0.0, axis=0, return_inverse=True)
    return without_slivers(unique, np.asarray(inverse).reshape(-1, 3).astype(np.int64))


def _finite(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    if not np.isfinite(rows).all():
        raise BadPartFile("a coordinate is not finite")
    return rows


# --- surfaces that are open or duplicated ----------------------------------------------------------------------------


def _remove_duplicates(mesh: Triangles) -> tuple[Triangles, tuple[str, ...]]:
    """Remove duplicate triangles of a mesh. Return the mesh, and descriptions of the removed triangles.

    If all triangles occurred twice, the surface would be closed, but its volume would be doubled. Two equal triangles with opposite
    orientation are not duplicates, because such pairs occur between bodies that touch. A mesh that consists only of such pairs is one
    surface with two sides, so one triangle of each pair is removed.
    """
    repairs: list[str] = []
    turns = (np.argmin(mesh.faces, axis=1)[:, None] + np.arange(3)) % 3
    _, first = np.unique(np.take_along_axis(mesh.faces, turns, axis=1), axis=0, return_index=True)
    if duplicates := len(mesh.faces) - len(first):
        mesh = Triangles(mesh.vertices, mesh.faces[np.sort(first)])
        repairs.append(f"duplicate triangles removed: {duplicates}")
    _, first = np.unique(np.sort(mesh.faces, axis=1), axis=0, return_index=True)
    if 2 * len(first) == len(mesh.faces):
        mesh = Triangles(mesh.vertices, mesh.faces[np.sort(first)])
        repairs.append(f"opposite triangles removed: {len(first)}")
    return mesh, tuple(repairs)


def _close(mesh: Triangles) -> tuple[Triangles, tuple[str, ...]]:
    """Repair the open surface of a mesh with trimesh. Return the closed mesh and descriptions of the repairs.

    Raises `BadPartFile` if the surface is still open after the repair.
    """
    import trimesh

    first = open_edges(mesh)
    if not first:
        return mesh, ()
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    repairs: list[str] = []
    digits = -math.floor(math.log10(NEAR * size)) if size > 0.0 else 9
    _, first_of, inverse = np.unique(np.round(mesh.vertices, digits) + 0.0, axis=0, return_index=True, return_inverse=True)
    merged = len(mesh.vertices) - len(first_of)
    if merged:
        mesh = without_slivers(mesh.vertices[first_of], np.asarray(inverse).reshape(-1)[mesh.faces])
        repairs.append(f"vertices merged within {10.0**-digits:.1g} mm: {merged}")
    copy = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    if open_edges(mesh):
        trimesh.repair.fix_winding(copy)  # type: ignore[no-untyped-call]
        flipped = int((np.asarray(copy.faces) != mesh.faces).any(axis=1).sum())
        mesh = from_trimesh(copy)
        repairs += [f"triangles flipped: {flipped}"] if flipped else []
    if open_edges(mesh):
        count = len(copy.faces)
        trimesh.repair.fill_holes(copy)
        added = len(copy.faces) - count
        mesh = from_trimesh(copy)
        repairs += [f"triangles added to fill holes: {added}"] if added else []
    if remaining := open_edges(mesh):
        after_repair = "" if remaining == first else f", {remaining} after repair by trimesh"
        raise BadPartFile(f"the surface is not closed ({first} edges belong to only one triangle{after_repair})")
    return mesh, (f"repaired the open surface ({', '.join(repairs)})",)


def open_edges(mesh: Triangles) -> int:
    """Count the edges of a mesh that have no second triangle with the opposite direction."""
    count = len(mesh.vertices)
    a, b = mesh.faces.ravel(), mesh.faces[:, (1, 2, 0)].ravel()
    one_way, counts = np.unique(a * count + b, return_counts=True)
    other_way, other_counts = np.unique(b * count + a, return_counts=True)
    _, mine, theirs = np.intersect1d(one_way, other_way, return_indices=True)
    return int(counts.sum() - np.minimum(counts[mine], other_counts[theirs]).sum())


# --- 3MF --------------------------------------------------------------------------------------------------------------


class _Object3mf:
    """An object of a 3MF file.

    The object contains vertex coordinates, triangles as vertex indices, and references to component objects with their transforms.
    """

    def __init__(self) -> None:
        self.points, self.faces = array("d"), array("q")
        self.components: list[tuple[str, str | None]] = []


def _from_3mf(data: bytes) -> Triangles:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        name = next((entry for entry in sorted(archive.namelist()) if entry.lower().endswith(".model")), None)
        if name is None:
            raise BadMesh("contains no model")
        refuse_beyond(archive.getinfo(name).file_size, LARGEST, "bytes of XML")
        unit, objects = _read_3mf(archive.read(name))
    if unit not in _UNITS_3MF:
        raise BadMesh(f"has the unknown unit `{unit}`")

    def parts(name: str) -> list[str]:
        if name not in objects:
            raise BadMesh(f"refers to a missing object `{name}`")
        return [one for one, _ in objects[name].components]

    unfold(_BUILD, parts)
    meshes = _placed_3mf(objects, _BUILD, _affine(None))
    if not meshes:
        raise BadMesh("has an empty `build`")
    return together(meshes).scale(_UNITS_3MF[unit])


def _read_3mf(model: bytes) -> tuple[str, dict[str, _Object3mf]]:
    """Parse the XML of a 3MF model. Return the unit of the model, and its objects by id.

    The additional object `_BUILD` refers to the objects that the file lists for printing.
    """
    unit, last = "millimeter", _Object3mf()
    objects: dict[str, _Object3mf] = {_BUILD: last}

    def start(tag: str, values: Mapping[str, str]) -> None:
        nonlocal unit, last
        match tag.removeprefix(_CORE_3MF):
            case "model":
                unit = values.get("unit", unit)
            case "object":
                last = objects[values.get("id", "")] = _Object3mf()
            case "vertex":
                last.points.extend(float(values[key]) for key in ("x", "y", "z"))
            case "triangle":
                last.faces.extend(int(values[key]) for key in ("v1", "v2", "v3"))
            case "component" | "item" as kind:
                (last if kind == "component" else objects[_BUILD]).components.append((values.get("objectid", ""), values.get("transform")))
            case _:
                pass

    parser = expat.ParserCreate(namespace_separator="}")
    parser.StartElementHandler = start
    parser.Parse(model, True)
    return unit, objects


def _placed_3mf(objects: Mapping[str, _Object3mf], name: str, transform: NDArray[np.float64]) -> list[Triangles]:
    """Return the transformed surfaces of a 3MF object and of its components."""
    item, surfaces = objects[name], list[Triangles]()
    points, faces = np.array(item.points).reshape(-1, 3), np.array(item.faces, dtype=np.int64).reshape(-1, 3)
    if faces.size and (faces.min() < 0 or faces.max() >= len(points)):
        raise BadMesh("refers to a missing vertex")
    if faces.size:
        moved = _finite(points) @ transform[:3] + transform[3]
        surfaces.append(_weld(moved[(faces[:, ::-1] if np.linalg.det(transform[:3]) < 0.0 else faces).ravel()]))
    for inner, text in item.components:
        component_transform = _affine(text)
        combined = np.vstack([component_transform[:3] @ transform[:3], component_transform[3] @ transform[:3] + transform[3]])
        surfaces.extend(_placed_3mf(objects, inner, combined))
        refuse_beyond(sum(len(one.faces) for one in surfaces), MOST)
    return surfaces


def _affine(text: str | None) -> NDArray[np.float64]:
    """Parse a transform of a 3MF file into a 4 x 3 matrix.

    To transform a point, multiply the row vector (x, y, z, 1) by this matrix.
    """
    return _finite(np.array((text or "1 0 0 0 1 0 0 0 1 0 0 0").split(), dtype=np.float64).reshape(4, 3))
