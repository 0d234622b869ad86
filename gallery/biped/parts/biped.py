"""Parts of the biped: a torso, thighs and shanks with feet. All lengths are in mm."""

from __future__ import annotations

from build123d import Location, Plane, Solid

from thingc import MATE, MountPoint, Thing
from thingc_stock.motors import PILOT
from thingc_stock.shapes import block, disc

HALF, HIP, KNEE, ANKLE = 50.0, 50.0, 140.0, 120.0
"""Half of the width of the torso, height of its motors above the hips, and lengths of thigh and shank."""


PULLEY = 37.0
"""Diameter of the pulleys at hips and knees."""


def along_y(diameter: float, length: float, start: float, z: float = 0.0) -> Solid:
    """Return a cylinder along y."""
    return disc(diameter, length, start).moved(Location(Plane((0, 0, z), x_dir=(1, 0, 0), z_dir=(0, 1, 0))))


class Torso(Thing):
    """A frame with a motor and a hip on each side. The origin is between the hips; x points forwards, and z up.

    Mounts: `motor_0` and `hip_0` are on the left, `motor_1` and `hip_1` on the right.
    """

    def __init__(self) -> None:
        super().__init__(material="petg")
        sides = (1.0, -1.0)
        self.motor = [MountPoint(Location(Plane((0, s * (HALF - 6), HIP), x_dir=(1, 0, 0), z_dir=(0, -s, 0))), "nema17") for s in sides]
        self.hip = [MountPoint(Location(Plane((0, s * HALF, 0), x_dir=(0, 0, 1), z_dir=(0, s, 0)))) for s in sides]

    def result(self) -> Solid:
        """Two sides and a top, with holes for the motors."""
        top, *sides = self.collision()
        return top.fuse(*sides).cut(along_y(PILOT + 1, 400, -200, HIP)).solid()

    def collision(self) -> list[Solid]:
        """The top and the sides."""
        return [block((50, 2 * HALF, 6), (0, 0, 80)), *(block((50, 6, 98), (0, y, 34)) for y in (HALF - 3, 3 - HALF))]


class Thigh(Thing):
    """A plate with the motor of the knee on its inner side. The origin is on the axle of the hip, at the torso; y points outwards.

    Its mounts are `hip`, `motor` and `knee`.
    """

    def __init__(self) -> None:
        super().__init__(material="pla_white")
        self.hip = MountPoint(Location(Plane((0, 0, 0), x_dir=(-1, 0, 0), z_dir=(0, -1, 0))))
        self.motor = MountPoint(Location(Plane((0, 1, -75), x_dir=(1, 0, 0), z_dir=(0, -1, 0))), "nema17")
        self.knee = MountPoint(Location(Plane((0, 7, -KNEE), x_dir=(0, 0, 1), z_dir=(0, 1, 0))))

    def result(self) -> Solid:
        """A plate with a hole for the motor, and the pulley of the hip."""
        return self.collision()[0].fuse(along_y(PULLEY, 8, 6)).cut(along_y(PILOT + 1, 400, -200, -75)).solid()

    def collision(self) -> list[Solid]:
        """The plate."""
        return [block((44, 6, KNEE + 24), (0, 4, -KNEE / 2))]


class Shank(Thing):
    """A plate with a foot. The origin is on the axle of the knee, at the thigh; y points outwards. Its mounts are `knee` and `sole`."""

    def __init__(self) -> None:
        super().__init__(material="pla_orange")
        self.knee = MountPoint(Location(Plane((0, 0, 0), x_dir=(-1, 0, 0), z_dir=(0, -1, 0))))
        self.sole = MountPoint(Location((0, -20, -ANKLE)) * MATE)

    def result(self) -> Solid:
        """A plate on a wide foot, and the pulley of the knee."""
        plate, foot = self.collision()
        return plate.fuse(foot, along_y(PULLEY, 8, 6)).solid()

    def collision(self) -> list[Solid]:
        """The plate and the foot."""
        return [block((24, 6, ANKLE + 10), (0, 4, 10 - (ANKLE + 10) / 2)), block((110, 60, 6), (0, -20, 3 - ANKLE))]
