"""Parts of the differential wrist: a forearm for two motors, a yoke and a hand. All lengths are in mm."""

from __future__ import annotations

from typing import Annotated

from build123d import Location, Plane, Solid

from thingc import MATE, Length, MountPoint, Range, Thing
from thingc_stock.motors import PILOT
from thingc_stock.shapes import block, disc, softened

MOTORS = (30.0, 80.0)
"""Heights of the motor shafts above the lower end of the forearm."""


class Forearm(Thing):
    """A plate with two motors at the back. The origin is at its lower end; z points to the wrist, and y to the front.

    Mounts: `motor_0` and `motor_1` are on the back, `axle` is on the front at the upper end, and `foot` is the lower end.

    Args:
        length: distance from the lower end to the axle of the wrist
    """

    def __init__(self, length: Annotated[Length, Range(130, 400)] = 180.0):
        super().__init__(material="aluminium")
        self.motor = [MountPoint(Location(Plane((0, 0, z), x_dir=(1, 0, 0), z_dir=(0, -1, 0))), "nema17") for z in MOTORS]
        self.axle = MountPoint(Location(Plane((0, 6, length), x_dir=(0, 0, 1), z_dir=(0, 1, 0))))
        self.foot = MountPoint(Location((0, 3, 0)) * MATE)

    def result(self) -> Solid:
        """A plate with rounded edges, and holes for the pilots of the motors."""
        height = self.p.length + 20
        plate = softened(block((48, 6, height), (0, 3, height / 2)), 1)
        turned = Location(Plane((0, 0, 0), x_dir=(1, 0, 0), z_dir=(0, 1, 0)))
        return plate.cut(*(disc(PILOT + 1, 20, -5, 0, -z).moved(turned) for z in MOTORS)).solid()

    def collision(self) -> list[Solid]:
        """The plate as a box."""
        height = self.p.length + 20
        return [block((48, 6, height), (0, 3, height / 2))]


class Yoke(Thing):
    """The part of the wrist that pitches. The origin is on its axle, at the forearm; z points to the hand.

    Mounts: `axle` faces the forearm, and `nose` faces the hand.
    """

    def __init__(self) -> None:
        super().__init__(material="petg")
        self.axle = MountPoint(Location(Plane((0, 0, 0), x_dir=(0, 0, 1), z_dir=(0, -1, 0))))
        self.nose = MountPoint(Location((0, 11, 45)))

    def result(self) -> Solid:
        """A hub with a nose."""
        return softened(block((36, 20, 65), (0, 11, 12.5)), 2)

    def collision(self) -> list[Solid]:
        """The enclosing box."""
        return [block((36, 20, 65), (0, 11, 12.5))]


class Hand(Thing):
    """The part of the wrist that rolls. Its mounts are `back` and `tip`."""

    def __init__(self) -> None:
        super().__init__(material="petg")
        self.back = MountPoint(MATE)
        self.tip = MountPoint(Location((0, 0, 60)))

    def result(self) -> Solid:
        """A disc with a blade."""
        return disc(36, 8).fuse(block((30, 8, 54), (0, 0, 33))).solid()

    def collision(self) -> list[Solid]:
        """A box."""
        return [block((36, 36, 60), (0, 0, 30))]
