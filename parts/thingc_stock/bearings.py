"""Deep groove ball bearings, identified by their designation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from build123d import Axis, Location, Solid

from thingc import MATE, Bore, MountPoint, Thing
from thingc_stock.shapes import turned


@dataclass(frozen=True, slots=True)
class Sizes:
    """The bore, outer diameter and width [mm] of a bearing, its mass [kg], and the source of the mass."""

    bore: float
    diameter: float
    width: float
    mass: float
    source: str = "vendor"


BEARINGS = {
    # Sizes and masses are from the tables of bd_warehouse (single_row_capped_deep_groove_ball_bearing_parameters.csv, designations with
    # -2Z). 688 is 628/8-2Z there. 61800 and 6000 are from the table of open bearings, single_row_deep_groove_... The tables do not contain
    # MR105 and 6001.
    "MR105": Sizes(5.0, 10.0, 4.0, 0.0013, "estimated"),
    "623": Sizes(3.0, 10.0, 4.0, 0.0015),
    "624": Sizes(4.0, 13.0, 5.0, 0.0031),
    "625": Sizes(5.0, 16.0, 5.0, 0.0050),
    "626": Sizes(6.0, 19.0, 6.0, 0.0084),
    "688": Sizes(8.0, 16.0, 5.0, 0.0036),
    "608": Sizes(8.0, 22.0, 7.0, 0.0120),
    "61800": Sizes(10.0, 19.0, 5.0, 0.0053),
    "6000": Sizes(10.0, 26.0, 8.0, 0.0190),
    "6001": Sizes(12.0, 28.0, 8.0, 0.0220, "estimated"),
}
Designation = Literal["MR105", "623", "624", "625", "626", "688", "608", "61800", "6000", "6001"]


class Bearing(Thing):
    """A deep groove ball bearing with shields. Both rings are one rigid part, so the bearing does not act as a joint.

    The origin is in the middle of the bearing; z is along its axis.

    Mounts: `front` (at +z) and `back` are at the centres of the two faces.

    Args:
        designation: ISO designation: 608, 623 ...
    """

    bom = {"make": "buy"}

    def __init__(self, designation: Designation = "608"):
        super().__init__(material="steel", color="#a9adb2")
        sizes = BEARINGS[designation]
        self.bore, self.diameter, self.width = sizes.bore, sizes.diameter, sizes.width
        self.front = MountPoint(Location((0, 0, self.width / 2)), [f"bearing-{designation}", Bore(self.bore)])
        self.back = MountPoint(Location((0, 0, -self.width / 2)) * MATE, [f"bearing-{designation}", Bore(self.bore)])

    def mass(self) -> tuple[float, str]:
        """Return the mass [kg] of this bearing in the table of the module, and its source."""
        sizes = BEARINGS[self.p.designation]
        return (sizes.mass, sizes.source)

    def seat(self, depth: float) -> Solid:
        """Return the bore of a housing: a cylinder of the outer diameter that extends `depth` [mm] up from the middle of the bearing."""
        return turned([(0, -self.width / 2), (self.diameter / 2, -self.width / 2), (self.diameter / 2, depth), (0, depth)])

    def result(self) -> Solid:
        """Return the solid of the two rings, with the shields recessed between them."""
        inner, outer, z = self.bore / 2, self.diameter / 2, self.width / 2
        ring = 0.28 * (outer - inner)
        back = 0.1 * self.width
        edge = 0.08 * (outer - inner)
        upper = [
            (inner + edge, z), (inner + ring, z), (inner + ring, z - back), (outer - ring, z - back), (outer - ring, z), (outer - edge, z),
            (outer, z - edge),
        ]
        lower = [(r, -h) for r, h in reversed(upper)]
        return turned([(inner, z - edge), *upper, *lower, (inner, edge - z)])

    def collision(self) -> list[Solid]:
        """Return the collision shape: the enclosing cylinder."""
        return [Solid.make_cylinder(self.diameter / 2, self.width).translate(-Axis.Z.direction * self.width / 2)]
