"""Exact integrals over a B-rep, never over a mesh: volume, area, centre of mass and inertia. All lengths are in mm."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, TypeAlias

from OCP.Bnd import Bnd_Box
from OCP.BRepAdaptor import BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp_Domain, BRepGProp_Face, BRepGProp_Sinert, BRepGProp_Vinert
from OCP.GeomAbs import (
    GeomAbs_Circle,
    GeomAbs_Cone,
    GeomAbs_Cylinder,
    GeomAbs_Line,
    GeomAbs_Plane,
    GeomAbs_Sphere,
    GeomAbs_SurfaceOfExtrusion,
    GeomAbs_Torus,
)
from OCP.gp import gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Matrix, Vector

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

ACCURACY = 1e-12
"""Relative error of the volume that the kernel's adaptive integration must reach."""
AGREEMENT = 1e-9
"""Largest relative difference of plain and adaptive integration for which the plain result is accepted."""
_ROUND = frozenset({GeomAbs_Cylinder, GeomAbs_Cone, GeomAbs_Sphere, GeomAbs_Torus})
_ALONG = 1e-12
"""Largest component across a surface parameter of a direction that counts as parallel to the parameter."""


class Measures(FrozenStruct):
    """The measurements of a part: `volume` [mm^3], `area` [mm^2], `centre` of mass [mm], `inertia` and bounding `box` [mm].

    The inertia [mm^5] is at density 1, about the centre of mass.
    """

    volume: float
    area: float
    centre: Vector
    inertia: Matrix
    box: tuple[Vector, Vector]


def explored(shape: TopoDS_Shape, kind: object) -> Iterator[TopoDS_Shape]:
    """Yield the subshapes of one kind, such as `TopAbs_FACE`, in the order in which the shape contains them.

    A shared subshape is yielded twice.
    """
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def solids_of(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    """Return the solids that a shape contains, in the order of the shape."""
    return list(explored(shape, TopAbs_SOLID))


TOUCHING = 1e-6
"""Largest distance [mm] of solids that touch."""


def bodies_of(solids: Sequence[TopoDS_Shape]) -> list[list[TopoDS_Shape]]:
    """Group solids into bodies: two solids that touch, directly or through others, are in the same body."""
    boxes = [bounding_box(solid) for solid in solids]
    waiting = list(range(len(solids)))
    bodies: list[list[TopoDS_Shape]] = []
    while waiting:
        body = [waiting.pop(0)]
        for member in body:
            near = [other for other in waiting if _boxes_touch(boxes[member], boxes[other])]
            joined = [other for other in near if BRepExtrema_DistShapeShape(solids[member], solids[other]).Value() <= TOUCHING]
            body += joined
            waiting = [other for other in waiting if other not in joined]
        bodies.append([solids[member] for member in sorted(body)])
    return bodies


def _boxes_touch(one: tuple[Vector, Vector], other: tuple[Vector, Vector]) -> bool:
    return all(one[0][k] <= other[1][k] + TOUCHING and other[0][k] <= one[1][k] + TOUCHING for k in range(3))


def measure(shape: TopoDS_Shape) -> Measures:
    """Compute the volume, area, centre of mass, inertia and bounding box of the solids in a shape.

    The integrals use GProp of OCCT, which is Gauss quadrature on the faces. Fixed-order integration is exact to rounding on whole faces
    of simple surfaces, but errs by 1e-5 on a cylinder with a cross hole. Adaptive integration stops when the volume is accurate, and
    leaves 1e-11 in the inertia of a plain cylinder. Therefore both are computed, and the fixed-order result is used if they agree. On
    planes bounded by lines and circles, and on round surfaces bounded by parameter lines (u or v constant), fixed-order integration is
    always exact. Adaptive integration takes fifty times as long, and is skipped on these faces.
    """
    box = bounding_box(shape)
    apex = gp_Pnt(*((low + high) / 2.0 for low, high in zip(*box, strict=True)))
    whole = GProp_GProps(apex)
    surface = GProp_GProps(apex)
    for solid in solids_of(shape):
        matter, skin = integrals(solid, apex)
        whole.Add(matter)
        surface.Add(skin)
    centre = whole.CentreOfMass()
    about = whole.MatrixOfInertia()
    rows = [[about.Value(i, j) for j in (1, 2, 3)] for i in (1, 2, 3)]
    largest = max(rows[0][0], rows[1][1], rows[2][2])
    xy, xz, yz = (_clean((rows[i][j] + rows[j][i]) / 2.0, largest) for i, j in ((0, 1), (0, 2), (1, 2)))
    size = max(high - low for low, high in zip(*box, strict=True))
    return Measures(
        volume=whole.Mass(),
        area=surface.Mass(),
        centre=(_clean(centre.X(), size), _clean(centre.Y(), size), _clean(centre.Z(), size)),
        inertia=((rows[0][0], xy, xz), (xy, rows[1][1], yz), (xz, yz, rows[2][2])),
        box=box,
    )


def integrals(solid: TopoDS_Shape, apex: gp_Pnt) -> tuple[GProp_GProps, GProp_GProps]:
    """Compute integrals over the volume and over the surface of a solid. The faces of the solid may point inwards or outwards.

    `apex` is any point near the solid. Moments are summed about this point, because moments about a distant origin would lose digits.
    """
    skin = _skin(solid)
    matter = _better(BRepGProp_Vinert, skin.flat, skin.extruded + skin.rest, apex)
    if matter.Mass() < 0.0:
        skin = _skin(solid.Reversed())
        matter = _better(BRepGProp_Vinert, skin.flat, skin.extruded + skin.rest, apex)
    return matter, _better(BRepGProp_Sinert, skin.flat + skin.extruded, skin.rest, apex)


_Faces: TypeAlias = "tuple[tuple[TopoDS_Face, bool], ...]"
"""Faces, each with a flag that is True if plain integration is exact on the face."""


class _Skin(FrozenStruct):
    """The faces of a solid, grouped by the method that computes the integrals over a face.

    `flat` contains planes bounded by lines and circles. `extruded` contains extruded curves, on which the kernel's adaptive area is wrong
    (by 0.4 % for an ellipse of 8 by 4; the plain area is wrong by 3e-5). `rest` contains all other faces.
    """

    flat: _Faces
    extruded: _Faces
    rest: _Faces


def _skin(solid: TopoDS_Shape) -> _Skin:
    flat: list[tuple[TopoDS_Face, bool]] = []
    extruded: list[tuple[TopoDS_Face, bool]] = []
    rest: list[tuple[TopoDS_Face, bool]] = []
    for subshape in explored(solid, TopAbs_FACE):
        face = TopoDS.Face(subshape)
        kind = BRepAdaptor_Surface(face, False).GetType()
        if kind == GeomAbs_SurfaceOfExtrusion:
            extruded.append((face, False))
        elif kind == GeomAbs_Plane and _within_lines_and_circles(face):
            flat.append((face, True))
        else:
            rest.append((face, kind in _ROUND and _within_own_lines(face)))
    return _Skin(flat=tuple(flat), extruded=tuple(extruded), rest=tuple(rest))


def _within_lines_and_circles(face: TopoDS_Face) -> bool:
    simple = (GeomAbs_Line, GeomAbs_Circle)  # types of the curve on the face, along which the kernel integrates
    return all(BRepAdaptor_Curve2d(TopoDS.Edge(edge), face).GetType() in simple for edge in explored(face, TopAbs_EDGE))


def _within_own_lines(face: TopoDS_Face) -> bool:
    """Return whether each edge of a face is a parameter line of the surface: one of the parameters u and v is constant along the edge."""
    curves = [BRepAdaptor_Curve2d(TopoDS.Edge(edge), face) for edge in explored(face, TopAbs_EDGE)]
    if any(curve.GetType() != GeomAbs_Line for curve in curves):
        return False
    directions = [curve.Line().Direction() for curve in curves]
    return all(min(abs(direction.X()), abs(direction.Y())) <= _ALONG for direction in directions)


def _integral(kind: Any, faces: _Faces, apex: gp_Pnt, *accuracy: float) -> GProp_GProps:
    """Compute an integral over faces in the same way as `BRepGProp` computes it for a shape.

    `accuracy` applies to faces where plain integration is not exact. `kind` is the class that integrates over one face. The volume of a
    face is the volume between the face and the `apex`.
    """
    total = GProp_GProps(apex)
    for face, exact in faces:
        part = kind()
        part.SetLocation(apex)
        if face.NbChildren() == 0:  # a closed surface has no boundary
            part.Perform(BRepGProp_Face(face), *(() if exact else accuracy))
        else:
            part.Perform(BRepGProp_Face(face), BRepGProp_Domain(face), *(() if exact else accuracy))
        total.Add(part)
    return total


def _better(kind: Any, once: _Faces, twice: _Faces, apex: gp_Pnt) -> GProp_GProps:
    """Compute an integral with and without adaptive integration on the faces of `twice`.

    If the two results agree, return the result without adaptive integration. Otherwise, return the result with adaptive integration.
    """
    sure = _integral(kind, once, apex)
    plain = GProp_GProps(apex)
    plain.Add(sure)
    plain.Add(_integral(kind, twice, apex))
    if all(exact for _, exact in twice):
        return plain
    adaptive = GProp_GProps(apex)
    adaptive.Add(sure)
    adaptive.Add(_integral(kind, twice, apex, ACCURACY))
    one, other = _numbers(plain), _numbers(adaptive)
    scale = (abs(other[0]), *([max(map(abs, other[1:]))] * 6))
    return plain if all(abs(a - b) <= AGREEMENT * size for a, b, size in zip(one, other, scale, strict=True)) else adaptive


def _numbers(properties: GProp_GProps) -> list[float]:
    about = properties.MatrixOfInertia()
    return [properties.Mass(), *(about.Value(i, j) for i, j in ((1, 1), (2, 2), (3, 3), (1, 2), (1, 3), (2, 3)))]


def _clean(value: float, size: float) -> float:
    """Return zero in place of a number that is only a rounding error, up to 1e-14 of the part's size."""
    return 0.0 if abs(value) <= 1e-14 * size else value


def extent(shape: TopoDS_Shape) -> float:
    """Return an approximate size [mm] of a shape: the diagonal of a loose bounding box. Computing the tight box takes far longer."""
    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    return math.sqrt(box.SquareExtent())


def bounding_box(shape: TopoDS_Shape) -> tuple[Vector, Vector]:
    """Return the corners of the tight axis-aligned bounding box of a shape [mm]."""
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    low, high = box.CornerMin(), box.CornerMax()
    return (low.X(), low.Y(), low.Z()), (high.X(), high.Y(), high.Z())
