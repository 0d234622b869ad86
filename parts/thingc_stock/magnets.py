"""Holding magnets: permanent magnets with a coil that switches them off."""

from __future__ import annotations

from math import pi
from typing import Annotated

from build123d import Axis, Face, Location, Solid, Wire

from thingc import MATE, Bolts, Length, MountPoint, Range, Thing
from thingc_stock.fasteners import Hole, threaded_hole

SATURATION = 1.6
"""Typical maximum flux density [T] of a pole of mild steel."""

MU_0 = 4e-7 * pi
"""Permeability of vacuum [N/A^2]."""


class HoldingMagnet(Thing):
    """A round permanent magnet with a coil: the magnet holds without current, and a current through the coil releases it.

    The magnet is a steel pot around a core, with the coil in the ring between pot and core. The face with both poles points down. The
    origin is in the middle of the face with the poles; z points up to the back. The shape is not based on a manufacturer's drawing; the
    proportions are typical of permanent electro-holding magnets with this pull. The densities of magnet and winding are similar to the
    density of steel, so the mass is computed as for a steel body of this shape.

    Mounts: `sole` is on the face with the poles, and `back` is on the opposite face. `screws_back` lists the threaded holes in the back,
    which are on the x axis.

    Args:
        diameter: diameter of the pot
        height: height of the pot
        pole: width of the outer pole, a ring at the rim
    """

    bom = {"make": "buy", "number": "electro-permanent holding magnet, 300 N"}

    def __init__(
        self,
        diameter: Annotated[Length, Range(40, 80)] = 50,
        height: Annotated[Length, Range(15, 50)] = 20,
        pole: Annotated[Length, Range(2, 10)] = 3.5,
    ):
        super().__init__(material="steel", color="#b9bec4")
        self.core = diameter * 0.27
        self.groove = (self.core, diameter / 2 - pole)
        assert self.groove[1] - self.groove[0] >= 3, (
            f"poles of {pole:g} mm leave no room for a coil in a pot of {diameter:g} mm: make them thinner"
        )
        # x is to the right of the attached part and y backwards, so on the world frame the part faces along the world's x
        self.sole = MountPoint(MATE, interface="steel")
        bolts = Bolts("M3", 2, 0.8 * diameter, depth=6.0)
        self.back = MountPoint(Location((0, 0, height)), interface=[f"magnet-{diameter:g}", bolts])
        self.screws_back: list[Hole] = [
            threaded_hole(Location((x, 0, height)), "M3", 6.0) for x in (0.4 * diameter, -0.4 * diameter)
        ]

    def pull(self, flux_density: float = SATURATION) -> float:
        """Return the maximum pull [N] on thick steel without an air gap, for the flux density [T] in both poles.

        Each pole with area A has the pull B^2 A / (2 mu_0). The specified pull of a magnet must be smaller than its maximum pull.
        """
        inner, outer = self.groove
        area = min(inner**2, (self.p.diameter / 2) ** 2 - outer**2) * pi * 1e-6
        return 2 * flux_density**2 * area / (2 * MU_0)

    def hull(self) -> Solid:
        """Return the cylinder of the pot without the groove and the holes."""
        return Solid.make_cylinder(self.p.diameter / 2, self.p.height)

    def result(self) -> Solid:
        """Return the solid of the pot with its threaded holes, and the ring of the coil, which is recessed by 0.5 mm."""
        radius, height, (inner, outer) = self.p.diameter / 2, self.p.height, self.groove
        outline = [
            (0, 0), (inner, 0), (inner, 0.5), (outer, 0.5), (outer, 0), (radius, 0),
            (radius, height - 1), (radius - 1, height), (0, height),
        ]
        pot = Solid.revolve(Face(Wire.make_polygon([(x, 0, z) for x, z in outline])), 360, Axis.Z)
        return pot.cut(*(hole(0.0).thread_hull for hole in self.screws_back)).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shape: the cylinder of the pot."""
        return [self.hull()]
