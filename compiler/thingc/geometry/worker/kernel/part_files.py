"""Read parts that are CAD files or mesh files, and convert colours of parts. STEP and BREP shapes are not changed. Meshes are converted to
solids with flat facets.

Lengths are in mm.
"""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Any

import numpy as np
from build123d import Color
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeShapeOnMesh, BRepBuilderAPI_Transform
from OCP.gp import gp_Pnt, gp_Trsf
from OCP.Poly import Poly_Triangle, Poly_Triangulation
from OCP.TopAbs import TopAbs_FACE
from OCP.TopoDS import TopoDS_Shape, TopoDS_Shell, TopoDS_Solid

from thingc.geometry.worker.kernel.integrals import subshapes
from thingc.geometry.worker.kernel.mesh_files import SUFFIXES, BadPartFile, read_mesh
from thingc.geometry.worker.kernel.meshing import Triangles, without_slivers

if TYPE_CHECKING:
    from numpy.typing import NDArray


def read_part(path: str, unit: float) -> tuple[list[TopoDS_Shape], set[str], tuple[str, ...]]:
    """Read a part from a CAD file or a mesh file. Return the shapes of the part, the colours of the shapes (`#rrggbb`), and descriptions of
    the repairs.

    `unit` [mm] is the unit of a file that does not specify a unit. Raises `BadPartFile` if the file cannot be used as a part.
    """
    suffix = os.path.splitext(path)[1].lower()
    if suffix in (".step", ".stp"):
        return (*_from_step(path), ())
    if suffix in (".brep", ".brp"):
        return [_scale(_from_brep(path), unit)], set(), ()
    if suffix in SUFFIXES:
        mesh, repairs = read_mesh(path, suffix, unit)
        return solids_from(mesh), set(), repairs
    raise BadPartFile(f"`{suffix or path}` is not a supported part format")


def unusable(fault: BaseException) -> BadPartFile:
    """Create the error for a part file that the CAD kernel cannot process, although it could read the file."""
    reason = BadPartFile("the file contains an invalid shape")
    reason.__cause__ = fault
    return reason


def kernel_shape(shape: Any) -> TopoDS_Shape | None:
    """Return the OCP shape that a build123d object wraps, or None if the object is empty."""
    try:
        wrapped: TopoDS_Shape | None = shape.wrapped
    except (AssertionError, AttributeError, ValueError):  # raised by build123d for an empty shape
        return None
    return None if wrapped is None or wrapped.IsNull() else wrapped


def _from_step(path: str) -> tuple[list[TopoDS_Shape], set[str]]:
    from build123d import import_step  # here, because the worker wraps the function after it has loaded this module

    try:
        imported = import_step(path)
    except Exception as fault:
        raise BadPartFile("the file is not a valid STEP file") from fault
    shape = kernel_shape(imported)
    if shape is None:
        raise BadPartFile("the STEP file contains no shape")
    return [shape], {hexadecimal(node.color) for node in (imported, *imported.descendants) if getattr(node, "color", None) is not None}


def _from_brep(path: str) -> TopoDS_Shape:
    from build123d import import_brep  # as for `import_step`

    with open(path, "rb") as stream:
        stream.seek(max(0, os.path.getsize(path) - 100))
        if re.search(rb"[+-]\d+ \d+\s*$", stream.read(100)) is None:  # the last line; the kernel hangs if it is missing
            raise BadPartFile("the file is not a complete BREP file")
    try:
        shape = kernel_shape(import_brep(path))
    except Exception as fault:
        raise BadPartFile("the file is not a valid BREP file") from fault
    if shape is None:
        raise BadPartFile("the BREP file contains no shape")
    return shape


def _scale(shape: TopoDS_Shape, factor: float) -> TopoDS_Shape:
    if factor == 1.0:
        return shape
    larger = gp_Trsf()
    larger.SetScale(gp_Pnt(0.0, 0.0, 0.0), factor)
    return BRepBuilderAPI_Transform(shape, larger, True).Shape()


# --- from triangles to solids -----------------------------------------------------------------------------------------


def solids_from(mesh: Triangles) -> list[TopoDS_Shape]:
    """Convert a closed triangle mesh to solids with one plane face per triangle.

    Each connected surface of the mesh bounds a body, or a void inside a body.
    """
    pieces = [Triangles(mesh.vertices, mesh.faces[members]) for members in surfaces(mesh)]
    pieces = [without_slivers(piece.vertices, piece.faces) for piece in pieces]
    pieces.sort(key=lambda piece: -abs(piece.volume))
    bodies: list[tuple[Triangles, list[Triangles]]] = []
    for piece in pieces:
        containing = [body for body in bodies if _contains(body[0], piece)] if piece.volume < 0.0 else []
        if containing:
            containing[-1][1].append(piece)
        else:
            bodies.append((piece.outward(), []))
    return [_solid(body, voids) for body, voids in bodies]


def surfaces(mesh: Triangles) -> list[NDArray[np.int64]]:
    """Split a mesh into connected surfaces. Return an array of triangle indices for each connected surface."""
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


def _contains(outer: Triangles, inner: Triangles) -> bool:
    return bool(
        (outer.vertices.min(axis=0) <= inner.vertices.min(axis=0)).all()
        and (outer.vertices.max(axis=0) >= inner.vertices.max(axis=0)).all()
    )


def _solid(body: Triangles, voids: list[Triangles]) -> TopoDS_Shape:
    builder, solid = BRep_Builder(), TopoDS_Solid()
    builder.MakeSolid(solid)
    for surface in (body, *voids):
        builder.Add(solid, _shell(surface))
    return solid


def _shell(mesh: Triangles) -> TopoDS_Shape:
    triangulation = Poly_Triangulation(len(mesh.vertices), len(mesh.faces), False)
    for index, (x, y, z) in enumerate(mesh.vertices.tolist(), 1):
        triangulation.SetNode(index, gp_Pnt(x, y, z))
    for index, (a, b, c) in enumerate(mesh.faces.tolist(), 1):
        triangulation.SetTriangle(index, Poly_Triangle(a + 1, b + 1, c + 1))
    maker = BRepBuilderAPI_MakeShapeOnMesh(triangulation)
    maker.Build()
    builder, shell = BRep_Builder(), TopoDS_Shell()
    builder.MakeShell(shell)
    for face in subshapes(maker.Shape(), TopAbs_FACE):
        builder.Add(shell, face)
    shell.Closed(True)
    return shell


def hexadecimal(color: Any) -> str:
    """Return a build123d `Color` as `#rrggbb` (sRGB), without its transparency."""
    red, green, blue, *_ = tuple(color)
    return "#" + "".join(f"{min(255, max(0, round(255 * channel))):02x}" for channel in (red, green, blue))


def hex_colour(text: str) -> str:
    """Convert a CSS colour name or `#rrggbb` to `#rrggbb`. Raises `ValueError` if the text is not a colour."""
    return hexadecimal(Color(text))
