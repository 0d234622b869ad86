"""Geometric primitives such as boxes and cylinders, and their volumes, mass properties and bounding boxes, in pure Python."""

from __future__ import annotations

import math
from typing import Literal

from thingc.base.inertia import MassProperties
from thingc.base.numeric import hypot
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import NO_POSE, Matrix, Pose, Vector, dot, transpose

FARTHEST = 1e6
"""Largest accepted size [m]. The inertia of a much larger shape would overflow."""
PrimitiveShape = Literal["box", "cylinder", "capsule", "sphere", "ellipsoid", "plane"]


class Primitive(OneLineStruct, array_like=True, tag=True):
    """A geometric primitive, such as a box or a cylinder.

    `size` [m] has the same meaning as in MuJoCo. A box has three half sizes. A cylinder or capsule has a radius and the half length of its
    straight part along z. A sphere has a radius, and an ellipsoid three half axes. A plane has half sizes along x and y, which are 0 for an
    infinite plane.

    `pose` is the pose of the primitive in the frame of the part. The z axis of a plane points away from its solid side. A plane has neither
    volume nor area.
    """

    shape: PrimitiveShape
    size: tuple[float, ...]
    pose: Pose = NO_POSE

    @property
    def volume(self) -> float:
        """The volume of the primitive [m^3]."""
        if self.shape == "plane":
            return 0.0
        if self.shape == "box":
            return 8.0 * math.prod(self.size)
        if self.shape == "ellipsoid":
            return 4.0 / 3.0 * math.pi * math.prod(self.size)
        radius, half = (*self.size, 0.0)[:2]
        ball = 0.0 if self.shape == "cylinder" else 4.0 / 3.0 * radius
        return math.pi * radius**2 * (2.0 * half + ball)

    @property
    def area(self) -> float:
        """The surface area of the primitive [m^2].

        Raises `ValueError` for an ellipsoid, because there is no closed formula for its area.
        """
        if self.shape == "ellipsoid":
            raise ValueError("the area of an ellipsoid is an elliptic integral")
        if self.shape == "plane":
            return 0.0
        if self.shape == "box":
            a, b, c = self.size
            return 8.0 * (a * b + b * c + c * a)
        radius, half = (*self.size, 0.0)[:2]
        ends = 1.0 if self.shape == "cylinder" else 2.0
        return 2.0 * math.pi * radius * (2.0 * half + ends * radius)

    @property
    def matter(self) -> MassProperties:
        """The mass properties of the primitive at a density of 1 kg/m^3, in the frame of the part.

        The mass is equal to the volume [m^3]. The inertia [m^5] is about the centre of mass [m].
        """
        volume = self.volume
        a, b, c = (*self.size, 0.0, 0.0)[:3]
        match self.shape:
            case "box":
                moments = (volume * (b * b + c * c) / 3.0, volume * (a * a + c * c) / 3.0, volume * (a * a + b * b) / 3.0)
            case "sphere":
                moments = (0.4 * volume * a * a,) * 3
            case "ellipsoid":
                moments = (volume * (b * b + c * c) / 5.0, volume * (a * a + c * c) / 5.0, volume * (a * a + b * b) / 5.0)
            case "cylinder":
                across = volume * (a * a / 4.0 + b * b / 3.0)
                moments = (across, across, volume * a * a / 2.0)
            case "capsule":
                middle, ends = math.pi * a * a * 2.0 * b, 4.0 / 3.0 * math.pi * a**3
                across = middle * (a * a / 4.0 + b * b / 3.0) + ends * (0.4 * a * a + b * b + 0.75 * a * b)
                moments = (across, across, (middle / 2.0 + 0.4 * ends) * a * a)
            case "plane":
                moments = (0.0, 0.0, 0.0)
        x, y, z = moments
        inertia: Matrix = ((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z))
        return MassProperties(mass=volume, inertia=inertia).seen_from(self.pose)

    def lowest(self, down: Vector) -> float:
        """Return the minimum [m] of the dot product of `down` and a point of the primitive, over all points of the primitive.

        `down` is a unit vector in the frame of the part.
        """
        x, y, z = (dot(down, column) for column in transpose(self.pose.rotation))
        middle, size = dot(down, self.pose.translation), self.size
        match self.shape:
            case "box":
                return middle - abs(x) * size[0] - abs(y) * size[1] - abs(z) * size[2]
            case "sphere":
                return middle - size[0]
            case "ellipsoid":
                return middle - hypot(x * size[0], y * size[1], z * size[2])
            case "plane":
                return middle - (abs(x) * size[0] + abs(y) * size[1] if all(size[:2]) else math.inf)
            case "cylinder" | "capsule":
                along = abs(z) * size[1]
                return middle - along - (size[0] if self.shape == "capsule" else size[0] * hypot(x, y))

    @property
    def box(self) -> tuple[Vector, Vector]:
        """The axis-aligned bounding box of the primitive in the frame of the part: its lowest and its highest corner [m]."""
        low, high = ([sign * self.lowest((sign * (k == 0), sign * (k == 1), sign * (k == 2))) for k in range(3)] for sign in (1.0, -1.0))
        return (low[0], low[1], low[2]), (high[0], high[1], high[2])
