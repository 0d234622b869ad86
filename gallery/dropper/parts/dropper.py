"""Parts of the gripper that drops a ball: a palm, two jaws with racks, and a ball. All lengths are in mm."""

from __future__ import annotations

from typing import Annotated

from build123d import Location, Plane, Solid

from thingc import MATE, Length, MountPoint, Range, Thing
from thingc_stock.motors import PILOT
from thingc_stock.shapes import block, disc, softened


class Palm(Thing):
    """A plate with a motor on top and two jaws below. The origin is in the middle of the underside; the jaws slide along x.

    Mounts: `motor` is on the top, `left` and `right` are where the closed jaws begin, and `grasp` is the centre of a grasped ball.

    Args:
        gap: distance of the closed jaws
    """

    def __init__(self, gap: Annotated[Length, Range(10, 40)] = 24.0):
        super().__init__(material="aluminium")
        self.motor = MountPoint(Location((0, 0, 6)), "nema17")
        self.left = MountPoint(Location(Plane((-gap / 2, 0, 0), x_dir=(0, 0, 1), z_dir=(-1, 0, 0))))
        self.right = MountPoint(Location(Plane((gap / 2, 0, 0), x_dir=(0, 0, 1), z_dir=(1, 0, 0))))
        self.grasp = MountPoint(Location((0, 0, -45)))

    def result(self) -> Solid:
        """A plate with a hole for the pilot of the motor."""
        return softened(block((84, 46, 6), (0, 0, 3), corner=4), 1).cut(disc(PILOT + 1, 20, -5)).solid()

    def collision(self) -> list[Solid]:
        """The plate as a box."""
        return [block((84, 46, 6), (0, 0, 3))]


class Jaw(Thing):
    """A jaw with a rack. The origin is in the plane of the pad, at the palm; x points to the other jaw. Its mount is `slide`."""

    def __init__(self) -> None:
        super().__init__(material="tpu")
        self.slide = MountPoint(Location(Plane((0, 0, 0), x_dir=(0, -1, 0), z_dir=(1, 0, 0))))

    def result(self) -> Solid:
        """A pad, and a rack beside the pinion."""
        return block((8, 14, 62), (-4, 0, -32.5)).fuse(block((36, 12, 6), (10, 7, -5)).cut(block((60, 8, 20), (30, 4, -5)))).solid()

    def collision(self) -> list[Solid]:
        """The pad."""
        return [block((8, 14, 62), (-4, 0, -32.5))]


class Ball(Thing):
    """A rubber ball. Its mount is `middle`.

    Args:
        radius: radius of the ball
    """

    def __init__(self, radius: Annotated[Length, Range(5, 60)] = 20.0):
        super().__init__(material="tpu", color="orangered")
        self.middle = MountPoint(MATE)

    def result(self) -> Solid:
        """A sphere."""
        return Solid.make_sphere(self.p.radius)
