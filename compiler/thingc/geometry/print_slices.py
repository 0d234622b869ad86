"""Print settings of a part, and the integrals that result from slicing the part, in SI units.

The integrals do not depend on the infill: the mass at any percentage is a sum of three terms (`SliceResult.mass_properties`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import MassProperties
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import Matrix, Vector, add_scaled

UPRIGHT: Vector = (0.0, 0.0, 1.0)
"""Default print direction of a part: the z axis of the part is up."""

PrintDirection = Vector | Literal["auto"]
"""A direction away from the bed, a unit vector, or `auto` for the direction with the least support."""

OVERLAP = 0.25
"""Default overlap of infill and walls, as a fraction of the line width: PrusaSlicer's `infill_overlap`."""

BRIDGE_FLOW = 1.0
"""Default flow ratio of bridges: PrusaSlicer's `bridge_flow_ratio`."""


class Slicing(FrozenStruct):
    """Settings for slicing a part into layers and filling the layers.

    `up` is the direction away from the bed in the part's frame. `layer` is the height of a layer [m], and `line_width` is
    the width of an extruded line [m]. `walls` is the number of lines in a wall. `top` and `bottom` are the numbers of solid layers.
    `overlap` is a fraction of the line width, and `bridge_flow` is a ratio.
    """

    up: PrintDirection
    layer: float
    line_width: float
    walls: int
    top: int
    bottom: int
    overlap: float = OVERLAP
    bridge_flow: float = BRIDGE_FLOW


LikelySlicing = tuple[Slicing, bool]
"""The expected slicing of a part that is not built yet. The flag is True if the part's own `up` takes precedence over the `up` of the
slicing.
"""


class Moments(OneLineStruct):
    """Moments of a body about the origin of the part's frame.

    `volume` is in [m^3]. `first` contains the integrals of x, y, z [m^4], and `second` the integrals of their products [m^5].
    """

    volume: float = 0.0
    first: Vector = (0.0, 0.0, 0.0)
    second: Matrix = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    @classmethod
    def of(cls, numbers: Sequence[float]) -> Moments:
        """Create moments from ten numbers. This method is the inverse of `numbers`."""
        volume, x, y, z, xx, yy, zz, xy, xz, yz = numbers
        return cls(volume=volume, first=(x, y, z), second=((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))

    @property
    def numbers(self) -> list[float]:
        """The moments as ten numbers: the integrals of 1, x, y, z, xx, yy, zz, xy, xz and yz over the body."""
        s = self.second
        return [self.volume, *self.first, s[0][0], s[1][1], s[2][2], s[0][1], s[0][2], s[1][2]]

    def plus(self, other: Moments, share: float = 1.0) -> Moments:
        """Add the moments of another body, multiplied by `share`. Return the sum."""
        a, b, c = (add_scaled(*rows, share) for rows in zip(self.second, other.second, strict=True))
        return Moments(volume=self.volume + share * other.volume, first=add_scaled(self.first, other.first, share), second=(a, b, c))

    @property
    def properties(self) -> MassProperties:
        """Convert the moments to mass properties at density 1.

        At this density, the mass equals the volume [m^3]. The inertia [m^5] is about the centre of mass.
        """
        if self.volume <= 0.0:
            return MassProperties(mass=0.0)
        v = self.volume
        c = x, y, z = (self.first[0] / v, self.first[1] / v, self.first[2] / v)
        s = self.second
        xx, yy, zz = (s[k][k] - v * c[k] * c[k] for k in range(3))
        xy, xz, yz = s[0][1] - v * x * y, s[0][2] - v * x * z, s[1][2] - v * y * z
        return MassProperties(mass=v, centre=c, inertia=((yy + zz, -xy, -xz), (-xy, xx + zz, -yz), (-xz, -yz, xx + yy)))


class SliceResult(OneLineStruct, tag=True):
    """The moments of the printed material of a part, separately for solid regions and infill lines.

    `solid` contains the moments of the solid regions, which do not depend on the infill. `joins` contains the pieces along the walls that
    connect infill lines. The moments of these pieces do not depend on the infill. `sparse` contains the moments of the infill lines at an
    infill of 100 %.
    """

    solid: Moments
    joins: Moments
    sparse: Moments

    def mass_properties(self, infill: float) -> MassProperties:
        """Compute the mass properties of the printed part at density 1, for an infill from 0 to 1.

        The volume is in [m^3], the centre of mass in [m] and the inertia in [m^5], in the frame of the part.
        """
        if infill <= 0.0:
            return self.solid.properties
        return self.solid.plus(self.joins).plus(self.sparse, infill).properties


class SliceFailure(FrozenStruct, tag=True):
    """The reason why a part cannot be sliced. Messages append this text to the name of the part."""

    reason: str
