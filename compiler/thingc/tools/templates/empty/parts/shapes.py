"""The parts of the robot. Each class is a part."""

from typing import Annotated

from build123d import Axis, Box, Cylinder, Location, Plane, Pos, Rot, chamfer, fillet

from thingc import Length, MountPoint, Range, Thing
from thingc_stock.fasteners import Screw


class Post(Thing):
    """A post on a foot, with a pin at the top that carries another part.

    The origin is in the plane of the underside. The z axis points up, and the x axis points along the pin.

    Args:
        height: height of the pin above the ground
    """

    def __init__(self, height: Annotated[Length, Range(40, 300)] = 90):
        super().__init__(material="pla_blue")
        self.ground = MountPoint(Location((0, 0, 0), (0, 180, 0)))
        self.pin = MountPoint(Plane((10, 0, height), x_dir=(0, 0, -1), z_dir=(1, 0, 0)))
        self.table = [MountPoint(Location((x, y, 6)), interface="m4-head") for x in (24, -24) for y in (24, -24)]

        foot = Pos(0, 0, 3) * Box(64, 64, 6)
        foot = chamfer(foot.edges().filter_by(Axis.Z), 6)
        post = Pos(0, 0, height / 2) * Box(20, 20, height) + Pos(0, 0, height) * Rot(0, 90, 0) * Cylinder(10, 20)
        pin = self.pin.location * Pos(0, 0, 4) * Cylinder(4, 8)
        self.body = foot + post + pin - [mount.location * Screw("M4", 12).clearance_hull for mount in self.table]

    def result(self):
        """Return the foot with holes, and the post with the pin."""
        return self.body


class Boom(Thing):
    """A beam that turns on a pin.

    The origin is on the axis of the pin, in the face that touches the post. The z axis points away from the post, and the x axis points to
    the tip.

    Args:
        length: distance from the pin to the tip
    """

    def __init__(self, length: Annotated[Length, Range(40, 300)] = 120):
        super().__init__(material="pla_orange")
        self.hub = MountPoint(Location((0, 0, 0), (0, 180, 0)))
        self.tip = MountPoint(Plane((length, 0, 4), x_dir=(0, 1, 0), z_dir=(1, 0, 0)))

        beam = Pos(length / 2 - 6, 0, 4) * Box(length + 12, 20, 8)
        beam = fillet(beam.edges().filter_by(Axis.Z), 9.9)
        self.body = beam - Cylinder(4.2, 40)

    def result(self):
        """Return the beam with the hole for the pin."""
        return self.body
