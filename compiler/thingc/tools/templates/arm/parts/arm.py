"""The printed parts of the arm. Each part that contains a servo derives its faces and holes from the geometry of the servo."""

from typing import Annotated

from build123d import Align, Axis, Box, Cone, Cylinder, Location, Plane, Pos, Rot, SlotCenterToCenter, Sphere, chamfer, extrude, fillet

from thingc import MATE, Length, MountPoint, Range, Thing
from thingc_stock.dynamixel import XM430
from thingc_stock.fasteners import Screw

STANDING = (Align.CENTER, Align.CENTER, Align.MIN)
"""Alignment that places a solid on top of the plane z = 0."""
PLAY = 0.1
"""Clearance [mm] on each side of a component that is inserted in a printed part."""


class Base(Thing):
    """A round foot that contains the yaw servo, with the horn at the top.

    The origin is on the yaw axis, in the plane of the underside. The z axis points up, and the x axis points forwards.

    Args:
        diameter: diameter of the foot
        wall: thickness of the walls beside the servo
    """

    def __init__(self, diameter: Annotated[Length, Range(100, 200)] = 116, wall: Annotated[Length, Range(3, 8)] = 4):
        super().__init__(material="pla_blue")
        floor, servo = 7, XM430()
        stand = Location(Plane((0, 0, floor - servo.back.location.position.Z), x_dir=(0, -1, 0), z_dir=(0, 0, 1)))
        self.ground = MountPoint(MATE)
        self.servo_seat = MountPoint(stand * servo.back.location * MATE, interface="x430-back")
        self.servo = self.servo_seat.align(servo.back)
        self.screws = [hole(PLAY + wall) for hole in (*self.servo.screws_left, *self.servo.screws_right)]
        spot = 0.33 * diameter
        self.table = [MountPoint(Location((x, y, floor)), "m4-head") for x in (spot, -spot) for y in (spot, -spot)]

        height = self.servo.front.location.position.Z
        rim = Cylinder(diameter / 2, floor, align=STANDING)
        tower = Pos(-8, 0, 0) * Cone(0.4 * diameter, 34, height, align=STANDING)
        self.pieces = [rim, tower]
        body = chamfer(rim.edges().group_by(Axis.Z)[-1], 2) + fillet(tower.edges().group_by(Axis.Z)[-1], 3)

        roomy = servo.adjust(width__add=2 * PLAY, height__add=2 * PLAY).move(stand)
        beside = [side.location * Pos(0, 0, wall) * Box(80, 30, diameter, align=STANDING) for side in (roomy.left, roomy.right)]
        self.body = body - [
            roomy.case_hull(),
            roomy.idler_hull(2 * floor),
            *(Pos(0, 0, floor) * (cut & Pos(0, 0, 30) * Box(300, 300, 60)) for cut in beside),
            *(mount.location * Screw("M4", 2 * floor).clearance_hull for mount in self.table),
            *(screw.clearance_hull for screw in self.screws),
            Pos(-50, 0, floor + 8) * Box(60, 14, 8),
        ]

    def result(self):
        """Return the foot with a pocket for the servo, windows and holes."""
        return self.body

    def collision(self):
        """Return the foot without holes."""
        return self.pieces


class Turret(Thing):
    """A turntable on the horn of the yaw servo, with a cradle for the shoulder servo.

    The origin is on the yaw axis, in the plane of the horn's face. The z axis points up. The shoulder axis is along y, and positive angles
    lower the arm.

    Args:
        diameter: diameter of the turntable
        wall: thickness of the walls of the cradle
    """

    def __init__(self, diameter: Annotated[Length, Range(70, 120)] = 76, wall: Annotated[Length, Range(3, 8)] = 5):
        super().__init__(material="pla_blue")
        thickness, servo = 6, XM430()
        below = Location(Plane((0, 0, -servo.horn_z), x_dir=(0, -1, 0), z_dir=(0, 0, 1)))
        self.yaw_seat = MountPoint(below * servo.rotor.location * MATE, interface="x430-horn")
        self.yaw_servo = self.yaw_seat.align(servo.rotor)
        above = Location(Plane((0, 0, thickness - servo.bottom.location.position.Y), x_dir=(-1, 0, 0), z_dir=(0, 1, 0)))
        self.servo_seat = MountPoint(above * servo.bottom.location * MATE, interface="x430-bottom")
        self.servo = self.servo_seat.align(servo.bottom)
        # the heads of the horn screws must not extend into the shoulder servo
        self.horn_screws = [hole(thickness - hole(1).head_height - 4 * PLAY) for hole in self.yaw_servo.screws_horn[::2]]
        held = (self.servo.screws_left[2:], self.servo.screws_right[2:])
        self.screws = [hole(PLAY + wall) for side in held for hole in side]

        table = Cylinder(diameter / 2, thickness, align=STANDING)
        table = chamfer(table.edges().group_by(Axis.Z)[-1], 1.5)
        top = self.screws[0].seat.location.position.Z + 8
        side = servo.p.width / 2 + PLAY + wall / 2
        wall_shape = fillet(Box(wall, servo.p.depth, top, align=STANDING).edges().group_by(Axis.Z)[-1].filter_by(Axis.X), 8)
        self.walls = [Pos(x, 0, 0) * wall_shape for x in (side, -side)]
        roomy = servo.adjust(boss_diameter__add=6 * PLAY).move(below)
        holes = [screw.clearance_hull for screw in (*self.horn_screws, *self.screws)]
        self.body = table + self.walls - [roomy.boss_hull(2 * thickness), *holes]

    def result(self):
        """Return the turntable with the cradle and the holes."""
        return self.body

    def collision(self):
        """Return the turntable and both walls of the cradle."""
        return [Cylinder(self.p.diameter / 2, 6, align=STANDING), *self.walls]


class Link(Thing):
    """A fork that is screwed to the horn and the idler of one servo, and carries the next servo.

    The origin is on the axis of the first servo. The y axis points to the axis of the next servo, and the z axis points out of the horn.

    Args:
        length: distance between the axes
        thickness: thickness of the fork
    """

    def __init__(self, length: Annotated[Length, Range(70, 250)] = 120, thickness: Annotated[Length, Range(3, 8)] = 4):
        super().__init__(material="pla_white")
        servo = XM430()
        self.rotor_seat = MountPoint(servo.rotor.location * MATE, interface="x430-horn")
        self.turning = self.rotor_seat.align(servo.rotor)
        self.servo_seat = MountPoint(Pos(0, length, 0) * servo.bottom.location * MATE, interface="x430-bottom")
        self.servo = self.servo_seat.align(servo.bottom)
        end = self.servo_seat.location.position.Y
        holes = [screw.clearance_hull for screw in (hole(thickness) for hole in self.servo.screws_bottom)]
        self.body = fork(self.turning, end, thickness) - holes
        self.pieces = fork_pieces(self.turning, end, thickness)

    def result(self):
        """Return the fork with the holes."""
        return self.body

    def collision(self):
        """Return both sides of the fork, and the web between the sides."""
        return self.pieces


class Beak(Thing):
    """The last link: a fork with a pointed end.

    The origin is on the axis of the servo that turns the link. The y axis points to the tip.

    Args:
        length: distance from the axis to the tip
        thickness: thickness of the fork
    """

    def __init__(self, length: Annotated[Length, Range(80, 250)] = 120, thickness: Annotated[Length, Range(3, 8)] = 4):
        super().__init__(material="pla_orange")
        servo = XM430()
        self.rotor_seat = MountPoint(servo.rotor.location * MATE, interface="x430-horn")
        self.turning = self.rotor_seat.align(servo.rotor)
        self.tip = MountPoint(Location(Plane((0, length, 0), x_dir=(1, 0, 0), z_dir=(0, 1, 0))))

        end, radius = 36, 4
        forward = Location(Plane((0, end, 0), x_dir=(1, 0, 0), z_dir=(0, 1, 0)))
        cone = forward * Cone(11, radius, length - radius - end, align=STANDING)
        self.point = cone + Pos(0, length - radius, 0) * Sphere(radius)
        self.body = fork(self.turning, end, thickness) + self.point
        self.pieces = [*fork_pieces(self.turning, end, thickness), cone]

    def result(self):
        """Return the fork with the pointed end."""
        return self.body

    def collision(self):
        """Return both sides of the fork, the web between the sides, and the pointed end."""
        return self.pieces


def fork(servo: XM430, end: float, thickness: float):
    """Return a fork with holes for the horn, which extends from the horn and the idler of `servo` to y = `end` [mm]."""
    inner, width = servo.horn_z, 26
    outer = inner + thickness
    plan = extrude(Pos(0, end / 2, 0) * Rot(0, 0, 90) * SlotCenterToCenter(end, width), outer, both=True)
    plan -= Pos(0, end + 50, 0) * Box(100, 100, 100)
    u = Pos(0, end, 0) * fillet(Box(100, 4 * end, 2 * outer).edges().filter_by(Axis.X), 8)
    u = Pos(0, -2 * end, 0) * u
    gap = Box(100, 4 * end, 2 * inner)
    gap = Pos(0, -end - thickness, 0) * fillet(gap.edges().filter_by(Axis.X), 4)
    window = Pos(0, end / 2 + 6, 0) * Rot(0, 0, 90) * extrude(SlotCenterToCenter(max(end - 38, 1), 10), outer, both=True)
    screws = [hole(thickness) for hole in servo.screws_horn[::2]] + [hole(thickness) for hole in servo.screws_idler[::2]]
    boss = servo.boss_hull(2 * thickness)
    return (plan & u) - [gap, window, boss, *(screw.clearance_hull for screw in screws)]


def fork_pieces(servo: XM430, end: float, thickness: float):
    """Return three boxes that approximate the fork [mm]."""
    inner = servo.horn_z
    cheek = Box(26, end + 13, thickness)
    z = inner + thickness / 2
    y, across = (end - 13) / 2, Pos(0, end - thickness / 2, 0) * Box(26, thickness, 2 * inner)
    return [Pos(0, y, z) * cheek, Pos(0, y, -z) * cheek, across]
