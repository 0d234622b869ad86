"""Compute volume, area, centre of mass and inertia as exact integrals over a B-rep, without a mesh. All lengths are in mm."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, TypeAlias

from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Builder
from OCP.BRepAdaptor import BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
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
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Face, TopoDS_Shape

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Matrix, Vector

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

ACCURACY = 1e-12
"""Relative error of the volume that the kernel's adaptive integration must reach."""
AGREEMENT = 1e-9
"""Largest relative difference between fixed-order and adaptive integration for which the fixed-order result is accepted."""
_ROUND = frozenset({GeomAbs_Cylinder, GeomAbs_Cone, GeomAbs_Sphere, GeomAbs_Torus})
_ALONG = 1e-12
"""A direction counts as parallel to a surface parameter if its component across the parameter is at most this value."""


class Measures(FrozenStruct):
    """The measurements of a part: `volume` [mm^3], `area` [mm^2], `centre` of mass [mm], `inertia` and bounding `box` [mm].

    The inertia [mm^5] is at density 1, about the centre of mass.
    """

    volume: float
    area: float
    centre: Vector
    inertia: Matrix
    box: tuple[Vector, Vector]


def subshapes(shape: TopoDS_Shape, kind: object) -> Iterator[TopoDS_Shape]:
    """Yield the subshapes of one kind, such as `TopAbs_FACE`, in the order in which the shape contains them.

    A subshape that several faces share is yielded several times.
    """
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def solids_of(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    """Return the solids that a shape contains, in the order in which the CAD kernel lists them."""
    return list(subshapes(shape, TopAbs_SOLID))


def at_origin(solid: TopoDS_Shape) -> TopoDS_Shape:
    """Apply the location of a solid to the coordinates of its geometry. The returned solid has no location of its own."""
    location = solid.Location()
    if location.IsIdentity():
        return solid
    return BRepBuilderAPI_Transform(solid.Located(TopLoc_Location()), location.Transformation(), True).Shape()


def compound_of(solids: Sequence[TopoDS_Shape]) -> TopoDS_Shape:
    """Return a compound of several solids. A single solid is returned unchanged."""
    return solids[0] if len(solids) == 1 else make_compound(solids)


def make_compound(shapes: Iterable[TopoDS_Shape]) -> TopoDS_Compound:
    """Return a compound that contains the given shapes."""
    builder, compound = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(compound)
    for shape in shapes:
        builder.Add(compound, shape)
    return compound


TOUCHING = 1e-6
"""Largest distance [mm] at which two solids count as touching."""


def bodies_of(solids: Sequence[TopoDS_Shape]) -> list[list[TopoDS_Shape]]:
    """Group solids into bodies. Two solids are in the same body if they touch, either directly or through other solids."""
    boxes = [bounding_box(solid) for solid in solids]
    remaining = list(range(len(solids)))
    bodies: list[list[TopoDS_Shape]] = []
    while remaining:
        body = [remaining.pop(0)]
        for member in body:
            candidates = [other for other in remaining if _boxes_touch(boxes[member], boxes[other])]
            touching = [other for other in candidates if BRepExtrema_DistShapeShape(solids[member], solids[other]).Value() <= TOUCHING]
            body += touching
            remaining = [other for other in remaining if other not in touching]
        bodies.append([solids[member] for member in sorted(body)])
    return bodies


def _boxes_touch(one: tuple[Vector, Vector], other: tuple[Vector, Vector]) -> bool:
    return all(one[0][k] <= other[1][k] + TOUCHING and other[0][k] <= one[1][k] + TOUCHING for k in range(3))


def measure(shape: TopoDS_Shape) -> Measures:
    """Compute the volume, area, centre of mass, inertia and bounding box of the solids in a shape.

    The integrals are computed with GProp of OCCT, which applies Gauss quadrature to the faces. On whole faces of simple surfaces,
    fixed-order integration is exact except for rounding errors. On a cylinder with a cross hole, however, its error is 1e-5. Adaptive
    integration stops when the volume is accurate. The error of adaptive integration in the inertia of a plain cylinder is 1e-11. Therefore,
    both methods are used, and the fixed-order result is returned if the results agree. Fixed-order integration is always exact on planes
    bounded by lines and circles, and on round surfaces bounded by parameter lines (u or v constant). On these faces, adaptive integration
    is skipped, because it takes fifty times as long.
    """
    box = bounding_box(shape)
    apex = gp_Pnt(*((low + high) / 2.0 for low, high in zip(*box, strict=True)))
    volume = GProp_GProps(apex)
    surface = GProp_GProps(apex)
    for solid in solids_of(shape):
        matter, skin = integrals(solid, apex)
        volume.Add(matter)
        surface.Add(skin)
    x, y, z = volume.CentreOfMass().Coord()
    inertia = volume.MatrixOfInertia()
    rows = [[inertia.Value(i, j) for j in (1, 2, 3)] for i in (1, 2, 3)]
    largest = max(rows[0][0], rows[1][1], rows[2][2])
    xy, xz, yz = (_clean((rows[i][j] + rows[j][i]) / 2.0, largest) for i, j in ((0, 1), (0, 2), (1, 2)))
    size = max(high - low for low, high in zip(*box, strict=True))
    return Measures(
        volume=volume.Mass(),
        area=surface.Mass(),
        centre=(_clean(x, size), _clean(y, size), _clean(z, size)),
        inertia=((rows[0][0], xy, xz), (xy, rows[1][1], yz), (xz, yz, rows[2][2])),
        box=box,
    )


def integrals(solid: TopoDS_Shape, apex: gp_Pnt) -> tuple[GProp_GProps, GProp_GProps]:
    """Compute integrals over the volume and over the surface of a solid. The faces of the solid can point inwards or outwards.

    `apex` can be any point near the solid. Moments are computed about this point, because moments about a distant origin would lose digits.
    """
    skin = _skin(solid)
    matter = _integrate(BRepGProp_Vinert, skin.flat, skin.extruded + skin.rest, apex)
    if matter.Mass() < 0.0:
        skin = _skin(solid.Reversed())
        matter = _integrate(BRepGProp_Vinert, skin.flat, skin.extruded + skin.rest, apex)
    return matter, _integrate(BRepGProp_Sinert, skin.flat + skin.extruded, skin.rest, apex)


_Faces: TypeAlias = "list[tuple[TopoDS_Face, bool]]"
"""Faces, each with a flag that is True if fixed-order integration is exact on the face."""


class _Skin(FrozenStruct):
    """The faces of a solid, grouped by the integration method that they require.

    `flat` contains planes bounded by lines and circles. `extruded` contains extruded curves, for which the kernel's adaptive area is wrong:
    by 0.4 % for an ellipse of 8 by 4. The fixed-order area is only wrong by 3e-5. `rest` contains all other faces.
    """

    flat: _Faces
    extruded: _Faces
    rest: _Faces


def _skin(solid: TopoDS_Shape) -> _Skin:
    skin = _Skin(flat=[], extruded=[], rest=[])
    for subshape in subshapes(solid, TopAbs_FACE):
        face = TopoDS.Face(subshape)
        kind = BRepAdaptor_Surface(face, False).GetType()
        if kind == GeomAbs_SurfaceOfExtrusion:
            skin.extruded.append((face, False))
        elif kind == GeomAbs_Plane and _within_lines_and_circles(face):
            skin.flat.append((face, True))
        else:
            skin.rest.append((face, kind in _ROUND and _within_own_lines(face)))
    return skin


def _within_lines_and_circles(face: TopoDS_Face) -> bool:
    simple = (GeomAbs_Line, GeomAbs_Circle)  # types of the curve on the face, along which the kernel integrates
    return all(BRepAdaptor_Curve2d(TopoDS.Edge(edge), face).GetType() in simple for edge in subshapes(face, TopAbs_EDGE))


def _within_own_lines(face: TopoDS_Face) -> bool:
    """Return whether each edge of a face is a parameter line of the surface. On a parameter line, one of the parameters u and v is
    constant.
    """
    curves = [BRepAdaptor_Curve2d(TopoDS.Edge(edge), face) for edge in subshapes(face, TopAbs_EDGE)]
    if any(curve.GetType() != GeomAbs_Line for curve in curves):
        return False
    directions = [curve.Line().Direction() for curve in curves]
    return all(min(abs(direction.X()), abs(direction.Y())) <= _ALONG for direction in directions)


def _integral(kind: Any, faces: _Faces, apex: gp_Pnt, *accuracy: float) -> GProp_GProps:
    """Compute an integral over faces in the same way as `BRepGProp` computes it for a shape.

    `accuracy` applies to the faces on which fixed-order integration is not exact. `kind` is the class of the CAD kernel that integrates
    over one face. For volumes, each face contributes the volume between the face and the point `apex`.
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


def _integrate(kind: Any, simple: _Faces, others: _Faces, apex: gp_Pnt) -> GProp_GProps:
    """Compute an integral over the faces `simple` and `others`. On the faces `others`, fixed-order and adaptive integration are both used.

    If both results agree, return the fixed-order result. If the results differ, return the adaptive result.
    """
    common = _integral(kind, simple, apex)
    fixed_order = GProp_GProps(apex)
    fixed_order.Add(common)
    fixed_order.Add(_integral(kind, others, apex))
    if all(exact for _, exact in others):
        return fixed_order
    adaptive = GProp_GProps(apex)
    adaptive.Add(common)
    adaptive.Add(_integral(kind, others, apex, ACCURACY))
    one, other = mass_and_inertia(fixed_order), mass_and_inertia(adaptive)
    scale = (abs(other[0]), *([max(map(abs, other[1:]))] * 6))
    return fixed_order if all(abs(a - b) <= AGREEMENT * size for a, b, size in zip(one, other, scale, strict=True)) else adaptive


def mass_and_inertia(properties: GProp_GProps) -> list[float]:
    """Return the mass, the three moments and the three products (xy, xz, yz) of inertia as the kernel computes them."""
    about = properties.MatrixOfInertia()
    return [properties.Mass(), *(about.Value(i, j) for i, j in ((1, 1), (2, 2), (3, 3), (1, 2), (1, 3), (2, 3)))]


def _clean(value: float, size: float) -> float:
    """Return 0 if a number is only a rounding error (up to 1e-14 of the part's size). Return any other number unchanged."""
    return 0.0 if abs(value) <= 1e-14 * size else value


def extent(shape: TopoDS_Shape) -> float:
    """Return an approximate size [mm] of a shape: the diagonal of a loose bounding box. The tight bounding box is not used, because
    computing it takes far longer.
    """
    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    return math.sqrt(box.SquareExtent())


def bounding_box(shape: TopoDS_Shape) -> tuple[Vector, Vector]:
    """Return the corners of the tight axis-aligned bounding box of a shape [mm]."""
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    return box.CornerMin().Coord(), box.CornerMax().Coord()
