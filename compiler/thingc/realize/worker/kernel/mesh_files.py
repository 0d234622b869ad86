"""Parts that are files of triangles: STL, OBJ, PLY, OFF and glTF as trimesh reads them, 3MF as its specification has it.

3MF is read here because trimesh leaves out, without a word, objects that are named and not there, and needs lxml for it.
"""

from __future__ import annotations

import math
import os
import zipfile
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from thingc.realize.worker.kernel.meshing import Triangles, together, without_slivers

if TYPE_CHECKING:
    from numpy.typing import NDArray

PLAIN = (".stl", ".obj", ".ply", ".off")
"""Numbers without a unit."""
GLTF = (".glb", ".gltf")
"""Metres, y up."""
SUFFIXES = (*PLAIN, *GLTF, ".3mf")

NEAR = 1e-6
"""Corners that are this part of the whole size apart are one, where the surface is not closed otherwise."""

_STL_HEAD, _STL_TRIANGLE = 84, 50
"""Bytes of a binary STL file: a text of 80 and the number of triangles, then the triangles."""

FARTHEST = 1e9
"""Coordinates [mm] beyond are a slip: the kernel leaves gaps between faces of that size."""

_UNITS_3MF = {"micron": 1e-3, "millimeter": 1.0, "centimeter": 10.0, "inch": 25.4, "foot": 304.8, "meter": 1000.0}
_CORE_3MF = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"


class BadPartFile(ValueError):
    """A file that makes no part, in words."""


def read_mesh(path: str, suffix: str, unit: float) -> tuple[Triangles, tuple[str, ...]]:
    """The surface in a file [mm], closed, and in words what had to be mended; `unit` [mm] is that of the numbers in a file that
    does not say its own. z is up: what a glTF file calls y. Raises `BadPartFile`, also where the surface stays open."""
    if suffix == ".3mf":
        mesh = _from_3mf(path)
    elif suffix in GLTF:
        surface = _from_trimesh(path, suffix)
        x, y, z = surface.vertices.T
        mesh = Triangles(1000.0 * np.column_stack([x, -z, y]) + 0.0, surface.faces)
    else:
        mesh = _from_trimesh(path, suffix).scaled(unit)
    if len(mesh.faces) == 0:
        raise BadPartFile("the file holds no triangles")
    farthest = float(np.abs(mesh.vertices).max())
    if farthest > FARTHEST:
        raise BadPartFile(f"a coordinate is {farthest:.3g} mm: no part is so large")
    once, again = _once(mesh)
    closed, mended = _closed(once)
    return closed, (*again, *mended)


def reads_with_trimesh(path: str) -> bool:
    """Whether a file is one of those that trimesh reads, which takes long to import."""
    return path.lower().endswith((*PLAIN, *GLTF))


def _from_trimesh(path: str, suffix: str) -> Triangles:
    import trimesh

    if suffix == ".stl":
        _whole_stl(path)
    try:
        scene = trimesh.load_scene(path, file_type=suffix[1:], process=False)
        corners = np.asarray(scene.triangles if scene.geometry else (), dtype=np.float64)
    except Exception as fault:
        said = f"{type(fault).__name__}: {fault}".replace(path, os.path.basename(path))
        raise BadPartFile(f"not {suffix[1:].upper()} that trimesh can read ({said})") from fault
    return _welded(_finite(corners.reshape(-1, 3)))


def _whole_stl(path: str) -> None:
    """Raises `BadPartFile` for an STL file that is cut off, of which trimesh says that it holds no triangles."""
    with open(path, "rb") as stream:
        head = stream.read(_STL_HEAD)
        text = (head + stream.read()).lower() if b"\0" not in head else None
        size = stream.seek(0, os.SEEK_END)
    if text is not None:
        if b"facet" in text and b"endsolid" not in text:
            raise BadPartFile("the file is cut off: it has no `endsolid`")
    elif size < _STL_HEAD:
        raise BadPartFile(f"the file is cut off: it has {size} bytes, and a binary STL file begins with {_STL_HEAD}")
    else:
        told, there = int.from_bytes(head[-4:], "little"), (size - _STL_HEAD) / _STL_TRIANGLE
        if told != there:
            what = "is cut off" if told > there else "goes on behind its end"
            raise BadPartFile(f"the file {what}: it says that it has {told} triangles, and there are bytes for {there:.6g}")


def _welded(corners: NDArray[np.float64]) -> Triangles:
    """Three corners (rows) for each triangle; equal ones are one vertex."""
    unique, inverse = np.unique(corners + 0.0, axis=0, return_inverse=True)
    return without_slivers(unique, np.asarray(inverse).reshape(-1, 3).astype(np.int64))


def _finite(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    if not np.isfinite(rows).all():
        raise BadPartFile("a coordinate is not finite")
    return rows


# --- surfaces that are not closed, or stand there twice --------------------------------------------------------------


def _once(mesh: Triangles) -> tuple[Triangles, tuple[str, ...]]:
    """The mesh with every triangle once, and what was left out: a surface that stands there twice is closed, and has twice the volume.
    Two that look opposite ways are where two bodies touch, and stay, unless all do: then it is one surface with two sides."""
    mended: list[str] = []
    turns = (np.argmin(mesh.faces, axis=1)[:, None] + np.arange(3)) % 3
    _, first = np.unique(np.take_along_axis(mesh.faces, turns, axis=1), axis=0, return_index=True)
    if more := len(mesh.faces) - len(first):
        mesh = Triangles(mesh.vertices, mesh.faces[np.sort(first)])
        mended.append(f"triangles that stand in it more than once, left out: {more}")
    _, first = np.unique(np.sort(mesh.faces, axis=1), axis=0, return_index=True)
    if 2 * len(first) == len(mesh.faces):
        mesh = Triangles(mesh.vertices, mesh.faces[np.sort(first)])
        mended.append(f"triangles that are the other side of one that it has, left out: {len(first)}")
    return mesh, tuple(mended)


def _closed(mesh: Triangles) -> tuple[Triangles, tuple[str, ...]]:
    """The mesh, and what was mended until its surface was closed: by trimesh, one thing after the other."""
    import trimesh

    first = open_edges(mesh)
    if not first:
        return mesh, ()
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    mended: list[str] = []
    digits = -math.floor(math.log10(NEAR * size)) if size > 0.0 else 9
    _, first_of, inverse = np.unique(np.round(mesh.vertices, digits) + 0.0, axis=0, return_index=True, return_inverse=True)
    lost = len(mesh.vertices) - len(first_of)
    if lost:
        mesh = without_slivers(mesh.vertices[first_of], np.asarray(inverse).reshape(-1)[mesh.faces])
        mended.append(f"corners joined within {10.0**-digits:.1g} mm: {lost}")
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    if open_edges(mesh):
        trimesh.repair.fix_winding(whole)  # type: ignore[no-untyped-call]
        turned = int((np.asarray(whole.faces) != mesh.faces).any(axis=1).sum())
        mesh = _of(whole)
        mended += [f"triangles turned round: {turned}"] if turned else []
    if open_edges(mesh):
        count = len(whole.faces)
        trimesh.repair.fill_holes(whole)
        filled = len(whole.faces) - count
        mesh = _of(whole)
        mended += [f"triangles put into holes: {filled}"] if filled else []
    if left := open_edges(mesh):
        rest = "" if left == first else f" ({left} after trimesh has mended what it can)"
        raise BadPartFile(f"its surface is not closed: {first} edges have no neighbour{rest}, so that it has no volume")
    return mesh, (f"its surface was not closed, and was mended ({', '.join(mended)})",)


def _of(mesh: Any) -> Triangles:
    return without_slivers(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))


def open_edges(mesh: Triangles) -> int:
    """How many edges no triangle runs through the other way."""
    count = len(mesh.vertices)
    a, b = mesh.faces.ravel(), mesh.faces[:, (1, 2, 0)].ravel()
    one_way, counts = np.unique(a * count + b, return_counts=True)
    other_way, other_counts = np.unique(b * count + a, return_counts=True)
    _, mine, theirs = np.intersect1d(one_way, other_way, return_indices=True)
    return int(counts.sum() - np.minimum(counts[mine], other_counts[theirs]).sum())


# --- 3MF --------------------------------------------------------------------------------------------------------------


def _from_3mf(path: str) -> Triangles:
    try:
        with zipfile.ZipFile(path) as archive:
            name = next((entry for entry in sorted(archive.namelist()) if entry.lower().endswith(".model")), None)
            if name is None:
                raise BadPartFile("the 3MF file holds no model")
            root = ElementTree.fromstring(archive.read(name))
    except (zipfile.BadZipFile, ElementTree.ParseError, OSError) as fault:
        raise BadPartFile(f"not a 3MF file ({fault})") from None
    scale = _UNITS_3MF.get(root.get("unit", "millimeter"))
    if scale is None:
        raise BadPartFile(f"unknown unit `{root.get('unit')}` in the 3MF file")
    objects = {item.get("id"): item for item in root.iter(_CORE_3MF + "object")}
    meshes = [
        mesh
        for item in root.iter(_CORE_3MF + "item")
        for mesh in _object_3mf(objects, item.get("objectid"), _affine(item.get("transform")), 0)
    ]
    if not meshes:
        raise BadPartFile("the 3MF file builds nothing")
    return together(meshes).scaled(scale)


def _object_3mf(objects: dict[Any, Any], name: str | None, transform: NDArray[np.float64], depth: int) -> list[Triangles]:
    item = objects.get(name)
    if item is None or depth > 50:
        raise BadPartFile(f"the 3MF file names an object `{name}` that is not there")
    surfaces: list[Triangles] = []
    mesh = item.find(_CORE_3MF + "mesh")
    if mesh is not None:
        points = _numbers([[v.get("x"), v.get("y"), v.get("z")] for v in mesh.iter(_CORE_3MF + "vertex")])
        faces = np.array(
            [[int(t.get("v1")), int(t.get("v2")), int(t.get("v3"))] for t in mesh.iter(_CORE_3MF + "triangle")], dtype=np.int64
        ).reshape(-1, 3)
        if faces.size and (faces.min() < 0 or faces.max() >= len(points)):
            raise BadPartFile("a triangle of the 3MF file names a vertex that is not there")
        moved = points @ transform[:3] + transform[3]
        if np.linalg.det(transform[:3]) < 0.0:
            faces = faces[:, ::-1]
        surfaces.append(_welded(moved[faces.ravel()]))
    for component in item.iter(_CORE_3MF + "component"):
        own = _affine(component.get("transform"))
        combined = np.vstack([own[:3] @ transform[:3], own[3] @ transform[:3] + transform[3]])
        surfaces.extend(_object_3mf(objects, component.get("objectid"), combined, depth + 1))
    return surfaces


def _affine(text: str | None) -> NDArray[np.float64]:
    """A 3MF transform: 4 x 3, points are rows on its left."""
    if text is None:
        return np.vstack([np.eye(3), np.zeros(3)])
    rows = _numbers([text.split()])
    if rows.shape != (4, 3):
        raise BadPartFile(f"`{text}` is no transform of 3MF")
    return rows


def _numbers(rows: list[Any]) -> NDArray[np.float64]:
    try:
        coordinates = np.array(rows, dtype=np.float64).reshape(-1, 3)
    except (TypeError, ValueError) as fault:
        raise BadPartFile(f"a coordinate is no number ({fault})") from None
    return _finite(coordinates)
