"""Exact integrals over a B-rep: volume, area, centre of mass and inertia, never from a mesh. Kernel units: mm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from OCP.Bnd import Bnd_Box
from OCP.BRepAdaptor import BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp_Domain, BRepGProp_Face, BRepGProp_Sinert, BRepGProp_Vinert
from OCP.GeomAbs import GeomAbs_Circle, GeomAbs_Line, GeomAbs_Plane, GeomAbs_SurfaceOfExtrusion
from OCP.gp import gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

from thingc.frozen import dataclass
from thingc.pose import Matrix, Vector

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

ACCURACY = 1e-12
"""Relative error of the volume at which the kernel's adaptive integration stops."""
AGREEMENT = 1e-9
"""How close plain and adaptive integration must be for the plain one to count."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measures:
    """`volume` [mm^3], `area` [mm^2], `centre` [mm], `inertia` [mm^5] at density 1 about the centre, `box` [mm]."""

    volume: float
    area: float
    centre: Vector
    inertia: Matrix
    box: tuple[Vector, Vector]


def explored(shape: TopoDS_Shape, kind: object) -> Iterator[TopoDS_Shape]:
    """What a shape is made of, of one kind (`TopAbs_FACE`), in its own order; what two share comes twice."""
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def solids_of(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    """The solids in a shape, in its own order."""
    return list(explored(shape, TopAbs_SOLID))


TOUCHING = 1e-6
"""A distance [mm] at which two solids still touch."""


def bodies_of(solids: Sequence[TopoDS_Shape]) -> list[list[TopoDS_Shape]]:
    """Solids by what hangs together: two are of one body where they touch, or are of one with a third."""
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
    """Integrals over the solids of a shape (GProp of OCCT: Gauss quadrature on the faces).

    Of fixed order it is exact to rounding on whole faces of simple surfaces, but errs by 1e-5 on a cylinder with a cross
    hole; adaptive it stops when the volume is good, and leaves 1e-11 in the inertia of a plain cylinder. So both are
    computed, and the first counts where they agree. On planes within lines and circles the first is always exact, and the second
    takes fifty times as long: it is left out.
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
    """Of the matter of a solid, whichever way its faces look, and of its surface. `apex` is any point near it: moments are summed
    about it, because about an origin that is far away they would lose their digits."""
    faces = _faces(solid)
    matter = _better(BRepGProp_Vinert, faces.exact, faces.extruded + faces.rest, apex)
    if matter.Mass() < 0.0:
        faces = _faces(solid.Reversed())
        matter = _better(BRepGProp_Vinert, faces.exact, faces.extruded + faces.rest, apex)
    return matter, _better(BRepGProp_Sinert, faces.exact + faces.extruded, faces.rest, apex)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Faces:
    """The faces of a solid: planes bounded by lines and circles, where plain integration is `exact`; `extruded` curves, whose
    adaptive area the kernel gets wrong (by 0.4 % for an ellipse of 8 by 4; the plain one by 3e-5); and the `rest`."""

    exact: tuple[TopoDS_Face, ...]
    extruded: tuple[TopoDS_Face, ...]
    rest: tuple[TopoDS_Face, ...]


def _faces(solid: TopoDS_Shape) -> _Faces:
    exact: list[TopoDS_Face] = []
    extruded: list[TopoDS_Face] = []
    rest: list[TopoDS_Face] = []
    for subshape in explored(solid, TopAbs_FACE):
        face = TopoDS.Face(subshape)
        kind = BRepAdaptor_Surface(face, False).GetType()
        if kind == GeomAbs_SurfaceOfExtrusion:
            extruded.append(face)
        else:
            (exact if kind == GeomAbs_Plane and _within_lines_and_circles(face) else rest).append(face)
    return _Faces(exact=tuple(exact), extruded=tuple(extruded), rest=tuple(rest))


def _within_lines_and_circles(face: TopoDS_Face) -> bool:
    simple = (GeomAbs_Line, GeomAbs_Circle)  # of the curve on the face: it is what is integrated along
    return all(BRepAdaptor_Curve2d(TopoDS.Edge(edge), face).GetType() in simple for edge in explored(face, TopAbs_EDGE))


def _integral(kind: Any, faces: tuple[TopoDS_Face, ...], apex: gp_Pnt, *accuracy: float) -> GProp_GProps:
    """Over faces, as `BRepGProp` goes through those of a shape. `kind` is its class for one face: of a volume or of a surface. What
    lies between a face and the `apex` is its part of a volume."""
    total = GProp_GProps(apex)
    for face in faces:
        part = kind()
        part.SetLocation(apex)
        if face.NbChildren() == 0:  # a whole closed surface has no boundary
            part.Perform(BRepGProp_Face(face), *accuracy)
        else:
            part.Perform(BRepGProp_Face(face), BRepGProp_Domain(face), *accuracy)
        total.Add(part)
    return total


def _better(kind: Any, once: tuple[TopoDS_Face, ...], twice: tuple[TopoDS_Face, ...], apex: gp_Pnt) -> GProp_GProps:
    """The plain integral where it agrees with the one that is adaptive on the faces of `twice`, else the latter."""
    exact = _integral(kind, once, apex)
    plain, adaptive = GProp_GProps(apex), GProp_GProps(apex)
    for whole, rest in (
        (plain, _integral(kind, twice, apex)), (adaptive, _integral(kind, twice, apex, ACCURACY)),
    ):
        whole.Add(exact)
        whole.Add(rest)
    one, other = _numbers(plain), _numbers(adaptive)
    scale = (abs(other[0]), *([max(map(abs, other[1:]))] * 6))
    return plain if all(abs(a - b) <= AGREEMENT * size for a, b, size in zip(one, other, scale, strict=True)) else adaptive


def _numbers(properties: GProp_GProps) -> list[float]:
    about = properties.MatrixOfInertia()
    return [properties.Mass(), *(about.Value(i, j) for i, j in ((1, 1), (2, 2), (3, 3), (1, 2), (1, 3), (2, 3)))]


def _clean(value: float, size: float) -> float:
    """Zero for what is rounding: 1e-14 of the part's size."""
    return 0.0 if abs(value) <= 1e-14 * size else value


def bounding_box(shape: TopoDS_Shape) -> tuple[Vector, Vector]:
    """The tight axis-aligned box of a shape [mm]."""
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    low, high = box.CornerMin(), box.CornerMax()
    return (low.X(), low.Y(), low.Z()), (high.X(), high.Y(), high.Z())
