"""The printed parts of the walker. Each part that contains a servo derives its faces and holes from the geometry of the servo."""

from typing import Annotated

from build123d import (
    Align,
    Axis,
    Box,
    Circle,
    Cylinder,
    Location,
    Plane,
    Polygon,
    Pos,
    SlotCenterToCenter,
    Sphere,
    chamfer,
    extrude,
    fillet,
    scale,
)

from thingc import MATE, Length, MountPoint, Range, Thing
from thingc_stock.dynamixel import XM430

STANDING = (Align.CENTER, Align.CENTER, Align.MIN)
"""Alignment that places a solid on top of the plane z = 0."""
HANGING = (Align.CENTER, Align.CENTER, Align.MAX)
"""Alignment that places a solid below the plane z = 0."""
PLAY = 0.1
"""Clearance [mm] on each side of a component that is inserted in a printed part."""
CORNER = 14
"""Radius of the rounded vertical edges of the body [mm]."""


def ahead(x: float, y: float, z: float) -> Location:
    """Return a frame at the given position [mm]. The z axis points forwards, and the x axis points to the left."""
    return Location(Plane((x, y, z), x_dir=(0, 1, 0), z_dir=(1, 0, 0)))


class Body(Thing):
    """A head with two eyes, which is open at the top and contains both hip servos. The horns of the servos are at the bottom.

    The origin is halfway between the hips, in the plane of the underside. The x axis points forwards, and the z axis points up.

    Args:
        hips: distance between the axes of the hips
        floor: thickness of the floor
    """

    def __init__(self, hips: Annotated[Length, Range(80, 140)] = 86, floor: Annotated[Length, Range(3, 6)] = 4):
        super().__init__(material="pla_white")
        servo, wall = XM430(), 3
        depth, width, height = 66, hips + servo.p.width + 4 * wall, 56
        self.middle = servo.front.location.position.Y
        axes = [Plane((0, y, floor + servo.p.depth / 2), x_dir=(0, 1, 0), z_dir=(0, 0, -1)) for y in (hips / 2, -hips / 2)]
        self.hip = [MountPoint(Location(axis) * servo.front.location * MATE, interface="x430-front") for axis in axes]
        self.servos = [hip.align(servo.front) for hip in self.hip]
        self.screws = [hole(floor) for one in self.servos for hole in one.screws_front]
        self.rim = MountPoint(Location((self.middle, 0, height)), interface=f"rim-{width:g}")

        outside = Box(depth, width, height, align=STANDING)
        outside = fillet(outside.edges().filter_by(Axis.Z), CORNER)
        self.block = Pos(self.middle, 0, 0) * chamfer(outside.edges().group_by(Axis.Z)[0], 2)
        inside = Box(depth - 2 * wall, width - 2 * wall, height, align=STANDING)
        inside = Pos(self.middle, 0, floor) * fillet(inside.edges().filter_by(Axis.Z), CORNER - wall)
        horns = [Pos(0, y, 0) * Cylinder(servo.p.horn_diameter / 2 + 1, 3 * floor) for y in (hips / 2, -hips / 2)]
        face = self.middle + depth / 2
        self.eye = [MountPoint(ahead(face, y, 0.64 * height), interface="eye") for y in (17, -17)]
        rims = [eye.location * Cylinder(11.5, 5) for eye in self.eye]
        sockets = [eye.location * Cylinder(Eye().p.diameter / 2 + PLAY, 6 * wall) for eye in self.eye]
        mouth = ahead(face, 0, 0.26 * height) * extrude(SlotCenterToCenter(26, 4), 2 * wall, both=True)
        self.body = self.block + rims - [inside, *horns, *sockets, mouth, *(screw.clearance_hull for screw in self.screws)]

    def result(self):
        """Return the head with eyes, mouth and holes."""
        return self.body

    def collision(self):
        """Return the head without cavities."""
        return [self.block]


class Eye(Thing):
    """A dome that is pressed into the body.

    The origin is at the centre of the dome, in the face of the body. The z axis points outwards.

    Args:
        diameter: diameter of the dome
    """

    def __init__(self, diameter: Annotated[Length, Range(8, 20)] = 17):
        super().__init__(material="pla_black")
        self.socket = MountPoint(MATE, interface="eye")
        self.body = Pos(0, 0, -3) * Cylinder(diameter / 2, 5, align=STANDING) + Pos(0, 0, 2) * scale(Sphere(diameter / 2), (1, 1, 0.35))

    def result(self):
        """Return the dome."""
        return self.body


class Lid(Thing):
    """A lid for the body, with an antenna.

    The origin is in the plane of the underside. The x axis points forwards, and the z axis points up.

    Args:
        width: width of the body
    """

    def __init__(self, width: Annotated[Length, Range(100, 200)] = 126.5):
        super().__init__(material="pla_teal")
        self.seat = MountPoint(MATE, interface=f"rim-{width:g}")
        self.top = MountPoint(Pos(0, 0, 4))
        plate = Box(66, width, 4, align=STANDING)
        plate = fillet(plate.edges().filter_by(Axis.Z), CORNER)
        self.plate = chamfer(plate.edges().group_by(Axis.Z)[-1], 2)
        lip = Box(66 - 2 * 3 - 2 * PLAY, width - 2 * 3 - 2 * PLAY, 3, align=HANGING)
        lip = fillet(lip.edges().filter_by(Axis.Z), CORNER - 3)
        rod = Pos(-18, 0.32 * width, 0) * Cylinder(1.6, 34, align=STANDING)
        ball = Pos(-18, 0.32 * width, 34) * Sphere(4.5)
        self.body = self.plate + [lip, rod, ball]

    def result(self):
        """Return the plate with a lip and the antenna."""
        return self.body

    def collision(self):
        """Return the plate."""
        return [self.plate]


class Leg(Thing):
    """A cage that is screwed to the horn of the hip servo, and carries the ankle servo.

    The origin is on the hip axis, in the plane of the horn's face. The z axis points up. With the hip at 0, the x axis points to the toes.

    Args:
        length: distance from the horn down to the axis of the ankle
        wall: thickness of the walls of the cage
    """

    def __init__(self, length: Annotated[Length, Range(47, 120)] = 58, wall: Annotated[Length, Range(3, 6)] = 4):
        super().__init__(material="pla_white")
        servo, hub, plate = XM430(), 3, 6
        above = Location(Plane((0, 0, servo.horn_z), x_dir=(0, 1, 0), z_dir=(0, 0, -1)))
        self.hip_seat = MountPoint(above * servo.rotor.location * MATE, interface="x430-horn")
        self.hip_servo = self.hip_seat.align(servo.rotor)
        hung = Location(Plane((0, 0, -length), x_dir=(0, -1, 0), z_dir=(1, 0, 0)))
        self.servo_seat = MountPoint(hung * servo.left.location * MATE, interface="x430-left")
        self.servo = self.servo_seat.align(servo.left)
        # the heads of the horn screws must not extend below the plate, because in a short leg the ankle servo is directly below
        sunk = [hole(hub + plate - hole(1).head_height - 4 * PLAY) for hole in self.hip_servo.screws_horn[::2]]
        self.screws = [hole(PLAY + wall) for hole in (*self.servo.screws_left, *self.servo.screws_right)]

        disc = Cylinder(servo.p.horn_diameter / 2, hub + plate, align=HANGING)
        depth, width = servo.p.depth, servo.p.width + 2 * (PLAY + wall)
        top = Pos(0, 0, -hub) * Box(depth, width, plate, align=HANGING)
        top = fillet(top.edges().filter_by(Axis.X).group_by(Axis.Z)[-1], 5)
        low = hub + 1 - length
        cheek = Box(depth, wall, -low, align=HANGING)
        cheek = Pos(0, 0, -hub - 2) * fillet(cheek.edges().filter_by(Axis.Y).group_by(Axis.Z)[0], 9)
        y = (width - wall) / 2
        self.pieces = [disc, top, Pos(0, y, 0) * cheek, Pos(0, -y, 0) * cheek]
        roomy = servo.adjust(boss_diameter__add=6 * PLAY).move(above)
        holes = [roomy.boss_hull(2 * (hub + plate)), *(screw.clearance_hull for screw in (*sunk, *self.screws))]
        self.body = disc + self.pieces[1:] - holes

    def result(self):
        """Return the cage with the holes."""
        return self.body

    def collision(self):
        """Return the disc, the plate, and both sides of the cage."""
        return self.pieces


class Foot(Thing):
    """A sole that is screwed to the horn and the idler of the ankle servo.

    The origin is on the ankle axis, at half the depth of the servo. The x axis points to the toes, and the z axis points up.

    Args:
        length: length of the sole
        width: width of the sole
        height: height of the axis above the ground
    """

    def __init__(
        self,
        length: Annotated[Length, Range(80, 160)] = 108,
        width: Annotated[Length, Range(50, 100)] = 68,
        height: Annotated[Length, Range(26, 50)] = 27,
    ):
        super().__init__(material="pla_teal")
        servo, thickness, sole = XM430(), 4, 5
        turned = Location(Plane((0, 0, 0), x_dir=(0, -1, 0), z_dir=(1, 0, 0)))
        self.ankle_seat = MountPoint(turned * servo.rotor.location * MATE, interface="x430-horn")
        self.servo = self.ankle_seat.align(servo.rotor)
        middle = -6
        self.sole = MountPoint(Location(Plane((middle, 0, -height), x_dir=(0, -1, 0), z_dir=(0, 0, -1))))
        self.screws = [hole(thickness) for hole in (*self.servo.screws_horn[::2], *self.servo.screws_idler[::2])]

        plate = Box(length, width, sole, align=STANDING)
        plate = fillet(plate.edges().filter_by(Axis.Z), 16)
        self.plate = Pos(middle, 0, -height) * chamfer(plate.edges().group_by(Axis.Z)[-1], 2)
        half = servo.p.horn_diameter / 2 + 2
        low, wide = 1 - height, 0.36 * width
        outline = Polygon((-wide, low), (wide, low), (half, 0), (-half, 0), align=None) + Circle(half)
        self.uprights = [ahead(x, 0, 0) * extrude(outline, thickness) for x in (servo.horn_z, servo.idler_z - thickness)]
        holes = [self.servo.adjust(boss_diameter__add=6 * PLAY).boss_hull(2 * thickness), *(one.clearance_hull for one in self.screws)]
        self.body = self.plate + self.uprights - holes

    def result(self):
        """Return the sole with the uprights and the holes."""
        return self.body

    def collision(self):
        """Return the sole and both uprights, without holes."""
        return [self.plate, *self.uprights]
