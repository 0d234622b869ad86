"""Parts that are files: STEP and BREP as they are, STL, OBJ and 3MF as solids of flat facets. Lengths in mm."""

from __future__ import annotations

import os
import zipfile
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from thingc.realize.meshing import Triangles, read_stl, together, without_slivers

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from OCP.TopoDS import TopoDS_Shape

SUFFIXES = (".step", ".stp", ".brep", ".brp", ".stl", ".3mf", ".obj")
_UNITS_3MF = {"micron": 1e-3, "millimeter": 1.0, "centimeter": 10.0, "inch": 25.4, "foot": 304.8, "meter": 1000.0}
_CORE_3MF = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"


class BadPartFile(ValueError):
    """A file that makes no part, in words."""


def read_part(path: str, unit: float) -> tuple[list[TopoDS_Shape], str | None]:
    """The shapes in a file and their colour (`#rrggbb`) where they have one in common; `unit` [mm] is that of the numbers in a file
    that does not say its own. Raises `BadPartFile`."""
    suffix = os.path.splitext(path)[1].lower()
    if suffix in (".step", ".stp"):
        return _from_step(path)
    if suffix in (".brep", ".brp"):
        return [_scaled(_from_brep(path), unit)], None
    if suffix == ".stl":
        return solids_from(_from_stl(path).scaled(unit)), None
    if suffix == ".obj":
        return solids_from(_from_obj(path).scaled(unit)), None
    if suffix == ".3mf":
        return solids_from(_from_3mf(path)), None
    raise BadPartFile(f"`{suffix or path}` is no format of parts: use {', '.join(SUFFIXES)}")


def kernel_shape(shape: Any) -> TopoDS_Shape | None:
    """The kernel's shape in a build123d shape, or None where it is empty."""
    try:
        wrapped: TopoDS_Shape | None = shape.wrapped
    except (AssertionError, AttributeError, ValueError):  # what build123d does of an empty shape
        return None
    return None if wrapped is None or wrapped.IsNull() else wrapped


def _from_step(path: str) -> tuple[list[TopoDS_Shape], str | None]:
    from build123d import import_step

    from thingc.realize.colors import hexadecimal

    try:
        whole = import_step(path)
    except Exception as fault:
        raise BadPartFile(f"not a STEP file that the kernel can read ({fault})") from fault
    shape = kernel_shape(whole)
    if shape is None:
        raise BadPartFile("the STEP file holds no shape")
    colors = {hexadecimal(node.color) for node in (whole, *whole.descendants) if getattr(node, "color", None) is not None}
    return [shape], colors.pop() if len(colors) == 1 else None


def _from_brep(path: str) -> TopoDS_Shape:
    from build123d import import_brep

    try:
        shape = kernel_shape(import_brep(path))
    except Exception as fault:
        raise BadPartFile(f"not a BREP file that the kernel can read ({fault})") from fault
    if shape is None:
        raise BadPartFile("the BREP file holds no shape")
    return shape


def _scaled(shape: TopoDS_Shape, factor: float) -> TopoDS_Shape:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Pnt, gp_Trsf

    if factor == 1.0:
        return shape
    larger = gp_Trsf()
    larger.SetScale(gp_Pnt(0.0, 0.0, 0.0), factor)
    return BRepBuilderAPI_Transform(shape, larger, True).Shape()


def _from_stl(path: str) -> Triangles:
    with open(path, "rb") as stream:
        data = stream.read()
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return read_stl(data)
    words = data.decode("utf-8", "replace").split()
    corners = [
        (words[i + 1], words[i + 2], words[i + 3]) for i, word in enumerate(words[:-3]) if word.lower() == "vertex"
    ]
    if not corners or len(corners) % 3:
        raise BadPartFile("neither a binary nor a text STL file")
    return _welded(_numbers(corners))


def _welded(corners: NDArray[np.float64]) -> Triangles:
    unique, inverse = np.unique(corners + 0.0, axis=0, return_inverse=True)
    return without_slivers(unique, np.asarray(inverse).reshape(-1, 3).astype(np.int64))


def _numbers(rows: list[Any]) -> NDArray[np.float64]:
    try:
        found = np.array(rows, dtype=np.float64).reshape(-1, 3)
    except ValueError as fault:
        raise BadPartFile(f"a coordinate is no number ({fault})") from None
    if not np.isfinite(found).all():
        raise BadPartFile("a coordinate is not finite")
    return found


def _from_obj(path: str) -> Triangles:
    vertices: list[list[str]] = []
    corners: list[int] = []
    with open(path, encoding="utf-8", errors="replace") as stream:
        for line in stream:
            words = line.split()
            if words[:1] == ["v"] and len(words) >= 4:
                vertices.append(words[1:4])
            elif words[:1] == ["f"]:
                try:
                    polygon = [int(word.partition("/")[0]) for word in words[1:]]
                except ValueError:
                    raise BadPartFile(f"`{line.strip()}` is no face") from None
                polygon = [index - 1 if index > 0 else len(vertices) + index for index in polygon]
                for second, third in zip(polygon[1:], polygon[2:], strict=False):
                    corners.extend((polygon[0], second, third))
    if not corners:
        raise BadPartFile("the OBJ file holds no faces")
    points = _numbers(vertices)
    if min(corners) < 0 or max(corners) >= len(points):
        raise BadPartFile("a face of the OBJ file names a vertex that is not there")
    return _welded(points[np.array(corners)])


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
    found: list[Triangles] = []
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
        found.append(_welded(moved[faces.ravel()]))
    for component in item.iter(_CORE_3MF + "component"):
        own = _affine(component.get("transform"))
        combined = np.vstack([own[:3] @ transform[:3], own[3] @ transform[:3] + transform[3]])
        found.extend(_object_3mf(objects, component.get("objectid"), combined, depth + 1))
    return found


def _affine(text: str | None) -> NDArray[np.float64]:
    """A 3MF transform: 4 x 3, points are rows on its left."""
    if text is None:
        return np.vstack([np.eye(3), np.zeros(3)])
    rows = _numbers([text.split()])
    if rows.shape != (4, 3):
        raise BadPartFile(f"`{text}` is no transform of 3MF")
    return rows


# --- from triangles to solids -----------------------------------------------------------------------------------------


def solids_from(mesh: Triangles) -> list[TopoDS_Shape]:
    """Solids with a flat face per triangle. Each closed surface is a body, or a void in the body around it.

    Raises `BadPartFile` where the surface is not closed.
    """
    if len(mesh.faces) == 0:
        raise BadPartFile("the file holds no triangles")
    pieces = [Triangles(mesh.vertices, mesh.faces[members]) for members in surfaces(mesh)]
    pieces = [without_slivers(piece.vertices, piece.faces) for piece in pieces]
    open_edges = sum(_open_edges(piece) for piece in pieces)
    if open_edges:
        raise BadPartFile(f"its surface is not closed: {open_edges} edges have no neighbour, so that it has no volume")
    pieces.sort(key=lambda piece: -abs(piece.volume))
    bodies: list[tuple[Triangles, list[Triangles]]] = []
    for piece in pieces:
        around = [body for body in bodies if _contains(body[0], piece)] if piece.volume < 0.0 else []
        if around:
            around[-1][1].append(piece)
        else:
            bodies.append((piece.outward(), []))
    return [_solid(body, voids) for body, voids in bodies]


def surfaces(mesh: Triangles) -> list[NDArray[np.int64]]:
    """The faces of each connected surface."""
    parent = list(range(len(mesh.vertices)))

    def root(index: int) -> int:
        while parent[index] != index:
            parent[index] = parent[parent[index]]
            index = parent[index]
        return index

    for a, b, c in mesh.faces.tolist():
        first = root(a)
        for other in (root(b), root(c)):
            parent[other] = first
            first = root(first)
    roots = np.array([root(index) for index in range(len(parent))])[mesh.faces[:, 0]]
    return [np.flatnonzero(roots == one) for one in np.unique(roots)]


def _open_edges(mesh: Triangles) -> int:
    count = len(mesh.vertices)
    a, b = mesh.faces.ravel(), mesh.faces[:, (1, 2, 0)].ravel()
    one_way, counts = np.unique(a * count + b, return_counts=True)
    other_way, other_counts = np.unique(b * count + a, return_counts=True)
    _, mine, theirs = np.intersect1d(one_way, other_way, return_indices=True)
    return int(counts.sum() - np.minimum(counts[mine], other_counts[theirs]).sum())


def _contains(outer: Triangles, inner: Triangles) -> bool:
    return bool(
        (outer.vertices.min(axis=0) <= inner.vertices.min(axis=0)).all()
        and (outer.vertices.max(axis=0) >= inner.vertices.max(axis=0)).all()
    )


def _solid(body: Triangles, voids: list[Triangles]) -> TopoDS_Shape:
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Solid

    builder = BRep_Builder()
    solid = TopoDS_Solid()
    builder.MakeSolid(solid)
    for surface in (body, *voids):
        builder.Add(solid, _shell(surface))
    return solid


def _shell(mesh: Triangles) -> TopoDS_Shape:
    from OCP.BRep import BRep_Builder
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeShapeOnMesh
    from OCP.gp import gp_Pnt
    from OCP.Poly import Poly_Triangle, Poly_Triangulation
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopoDS import TopoDS_Shell

    from thingc.realize.measure import explored

    triangulation = Poly_Triangulation(len(mesh.vertices), len(mesh.faces), False)
    for index, (x, y, z) in enumerate(mesh.vertices.tolist(), 1):
        triangulation.SetNode(index, gp_Pnt(x, y, z))
    for index, (a, b, c) in enumerate(mesh.faces.tolist(), 1):
        triangulation.SetTriangle(index, Poly_Triangle(a + 1, b + 1, c + 1))
    maker = BRepBuilderAPI_MakeShapeOnMesh(triangulation)
    maker.Build()
    builder = BRep_Builder()
    shell = TopoDS_Shell()
    builder.MakeShell(shell)
    for face in explored(maker.Shape(), TopAbs_FACE):
        builder.Add(shell, face)
    shell.Closed(True)
    return shell
