"""Exact integrals over a B-rep: volume, area, centre of mass and inertia, never from a mesh. Kernel units: mm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer

from thingc.pose import Matrix, Vector

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape

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


def solids_of(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    """The solids in a shape, in its own order."""
    found: list[TopoDS_Shape] = []
    explorer = TopExp_Explorer(shape, TopAbs_SOLID)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def measure(shape: TopoDS_Shape) -> Measures:
    """Integrals over the solids of a shape (GProp of OCCT: Gauss quadrature on the faces).

    Of fixed order it is exact to rounding on whole faces of simple surfaces, but errs by 1e-5 on a cylinder with a cross
    hole; adaptive it stops when the volume is good, and leaves 1e-11 in the inertia of a plain cylinder. So both are
    computed, and the first counts where they agree.
    """
    whole = GProp_GProps()
    surface = GProp_GProps()
    for solid in solids_of(shape):
        part = _better(solid, BRepGProp.VolumeProperties_s)
        # a solid whose faces look inwards has the same matter
        whole.Add(part, 1.0 if part.Mass() >= 0.0 else -1.0)
        surface.Add(_better(solid, BRepGProp.SurfaceProperties_s))
    box = bounding_box(shape)
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


def _better(solid: TopoDS_Shape, integrate: Any) -> GProp_GProps:
    """The plain integral where it agrees with the adaptive one, else the adaptive one."""
    plain, adaptive = GProp_GProps(), GProp_GProps()
    integrate(solid, plain)
    integrate(solid, adaptive, ACCURACY)
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
