"""Holding magnets: permanent magnets that a coil can release."""

from __future__ import annotations

from math import pi
from typing import Annotated

from build123d import Axis, Face, Location, Solid, Wire

from thingc import MATE, Length, MountPoint, Range, Thing
from thingc_stock.fasteners import Hole, threaded_hole

SATURATION = 1.6
"""Flux density [T] that mild steel carries in a pole without much loss."""

MU_0 = 4e-7 * pi
"""Permeability of vacuum [N/A^2]."""


class HoldingMagnet(Thing):
    """A round coil-regulated permanent magnet: it holds without current, and current through its coil releases it.

    A steel pot around a core, with the coil cast into the ring between them; the face with both poles is down. The origin
    is in the middle of that face, z points up to the back. No vendor's drawing: the proportions are those that permanent
    electro-holding magnets of this pull are sold in. The densities of magnet and winding are close to that of
    steel, so the mass is that of a steel body with this outline.

    Mounts: `sole`, the face; `back`, opposite; `screws_back` are the threaded holes there, on x.

    Args:
        diameter: of the pot
        height: of the pot
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
        # x is to the right of the part that stands on it, y backwards: on the world frame it looks along the world's x.
        self.sole = MountPoint(MATE, interface="steel")
        self.back = MountPoint(Location((0, 0, height)), interface=f"magnet-{diameter:g}")
        self.screws_back: list[Hole] = [
            threaded_hole(Location((x, 0, height)), "M3", 6.0) for x in (0.4 * diameter, -0.4 * diameter)
        ]

    def pull(self, flux_density: float = SATURATION) -> float:
        """Return the largest pull [N] with this flux density [T] in both poles on thick steel without a gap.

        It is B^2 A / (2 mu_0) for each pole. The nominal pull must be less.
        """
        inner, outer = self.groove
        area = min(inner**2, (self.p.diameter / 2) ** 2 - outer**2) * pi * 1e-6
        return 2 * flux_density**2 * area / (2 * MU_0)

    def hull(self) -> Solid:
        """The pot without groove and holes."""
        return Solid.make_cylinder(self.p.diameter / 2, self.p.height)

    def result(self) -> Solid:
        """The pot, the coil's ring set back from the face by half a millimetre, and the threaded holes."""
        radius, height, (inner, outer) = self.p.diameter / 2, self.p.height, self.groove
        outline = [
            (0, 0), (inner, 0), (inner, 0.5), (outer, 0.5), (outer, 0), (radius, 0),
            (radius, height - 1), (radius - 1, height), (0, height),
        ]
        pot = Solid.revolve(Face(Wire.make_polygon([(x, 0, z) for x, z in outline])), 360, Axis.Z)
        return pot.cut(*(hole(0.0).thread_hull for hole in self.screws_back)).solid()

    def collision(self) -> list[Solid]:
        """The pot."""
        return [self.hull()]
