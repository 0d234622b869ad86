"""What is known of a mesh file that was read."""

from __future__ import annotations

from thingc.base.frozen import dataclass
from thingc.base.inertia import MassProperties
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.pose import Vector
from thingc.geometry.record import Mesh


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshPiece(OneLineRepr):
    """The triangles of one colour (`#rrggbb`, `#rrggbbaa`; None: the file says none)."""

    mesh: Mesh
    color: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshRecord(OneLineRepr):
    """A mesh file [m], mirrored and turned as its scale, unit and up axis say. `mesh` is all of it, in the store as OBJ; `pieces` what is
    drawn, by colour. `matter` is what it holds at density 1: volume [m^3], centre, inertia [m^5]; None of a surface that is open. `box` are
    two corners. `own` are the bytes of the file, in the store, where MuJoCo reads them as they are."""

    mesh: Mesh
    pieces: tuple[MeshPiece, ...]
    matter: MassProperties | None
    box: tuple[Vector, Vector]
    own: tuple[str, int] | None
