"""The printed parts of the gripper.

The servo turns a gear with a lever, which drives a second gear of equal size. Each lever moves a finger. A rod next to the lever keeps the
finger parallel to the other finger.
"""

from math import cos, pi, sin
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
    Rot,
    SlotCenterToCenter,
    chamfer,
    extrude,
    fillet,
    make_hull,
)

from thingc import MATE, Count, Length, MountPoint, Range, Thing
from thingc_stock.dynamixel import XM430
from thingc_stock.fasteners import Screw

STANDING = (Align.CENTER, Align.CENTER, Align.MIN)
"""Alignment that places a solid on top of the plane z = 0."""
HANGING = (Align.CENTER, Align.CENTER, Align.MAX)
"""Alignment that places a solid below the plane z = 0."""
PLAY = 0.1
"""Clearance [mm] on each side of a component that is inserted in a printed part."""
MODULE = 2
"""Module of the gears [mm]: the diameter of the pitch circle, divided by the number of teeth."""
ROD = (15, 30)
"""Distances [mm] from the pins of a lever to the pins of the rod: towards the other finger, and forwards."""
PIN = Screw("M4")
"""The screws that serve as pins of the fingers and rods."""


class Palm(Thing):
    """A plate on the front of the servo, with the axle of the second gear, and a flange at the back.

    The origin is halfway between both gears, in the face that touches the servo. The z axis points to the side of the fingers, and the y
    axis points forwards.

    Args:
        teeth: number of teeth of each gear
        thickness: thickness of the plate and the flange
    """

    def __init__(self, teeth: Annotated[Count, Range(15, 31)] = 23, thickness: Annotated[Length, Range(4, 8)] = 4):
        super().__init__(material="petg")
        servo, lever = XM430(), Lever(teeth=teeth)
        radius = lever.radius
        stand = Pos(-radius, 0, -servo.p.depth / 2)
        self.servo_seat = MountPoint(stand * servo.front.location * MATE, interface="x430-front")
        self.servo = self.servo_seat.align(servo.front)
        self.screws = [hole(thickness) for hole in self.servo.screws_front]
        horn = self.servo.rotor.location.position.Z
        self.axle = MountPoint(Pos(radius, 0, horn))
        self.pivot = [MountPoint(Pos(x, ROD[1], lever.low + horn)) for x in (ROD[0] - radius, radius - ROD[0])]
        behind = self.servo.bottom.location.position.Y - 1
        self.flange = MountPoint(Location(Plane((0, behind - thickness, -16), x_dir=(-1, 0, 0), z_dir=(0, -1, 0))))

        circles = ((radius + 10, behind + 6, 6), (radius + 4, 0, 15), (radius - ROD[0], ROD[1], 9))
        plate = extrude(hull((side * x, y, r) for x, y, r in circles for side in (1, -1)), thickness)
        self.plate = chamfer(plate.edges().group_by(Axis.Z)[-1], 1)
        flange = Box(2 * radius + 32, thickness, 38 + thickness, align=HANGING)
        self.back = Pos(0, behind - thickness / 2, thickness) * fillet(flange.edges().filter_by(Axis.Y), 6)
        bosses = [pivot.location * Cylinder(6, lever.low + horn - 1, align=HANGING) for pivot in self.pivot]
        axle = self.axle.location * Pos(0, 0, -horn) * Cylinder(lever.bore / 2 - PLAY, horn + lever.top, align=STANDING)

        spots = [(x, z) for x in (22, -22) for z in (12, -12)]
        room = servo.p.horn_diameter / 2 + 1
        holes = [
            Pos(-radius, 0, 0) * Cylinder(room, 4 * thickness),
            self.axle.location * Cylinder(room, 2 * thickness, align=STANDING),
            *(self.flange.location * Pos(x, z, 0) * Screw("M4", 2 * thickness).clearance_hull for x, z in spots),
            *(screw.clearance_hull for screw in self.screws),
        ]
        self.body = self.plate + [self.back, *bosses] - holes + axle - [pivot.location * PIN.tapped_hull for pivot in self.pivot]

    def result(self):
        """Return the plate with the flange, the axle and the holes."""
        return self.body

    def collision(self):
        """Return the plate and the flange."""
        return [self.plate, self.back]


class Lever(Thing):
    """A gear with a lever, on the horn of a servo or on an axle of the same size.

    The origin is on the axis, in the face that touches the horn. The z axis points away from the horn, and the y axis points to the pin.

    Args:
        teeth: number of teeth, which must be odd, so that two equal gears mesh when their levers are parallel
        length: distance from the axis to the pin
    """

    low, top = 3, 9
    bore = XM430().p.boss_diameter + 6 * PLAY

    def __init__(self, teeth: Annotated[Count, Range(15, 31)] = 23, length: Annotated[Length, Range(38, 80)] = 46):
        super().__init__(material="pla_orange")
        assert teeth % 2, f"{teeth} teeth: expected an odd number, so that two equal gears mesh"
        servo = XM430()
        self.radius = MODULE * teeth / 2
        self.seat = MountPoint(MATE, interface="x430-horn")
        self.servo = self.seat.align(servo.rotor)
        self.pin = MountPoint(Pos(0, length, self.top))
        screws = [hole(self.top) for hole in self.servo.screws_horn[::2]]

        step = 2 * pi / teeth
        root, tip = self.radius - 1.25 * MODULE, self.radius + MODULE
        tooth = [(root, -0.34), (tip, -0.11), (tip, 0.11), (root, 0.34)]
        points = [(r * cos((k + a) * step), r * sin((k + a) * step)) for k in range(teeth) for r, a in tooth]
        thickness = self.top - self.low
        gear = extrude(Polygon(*points, align=None), thickness)
        self.arm = Pos(0, length / 2, self.low) * Rot(0, 0, 90) * extrude(SlotCenterToCenter(length, 13), thickness)
        self.disc = Pos(0, 0, self.low) * Cylinder(self.radius - 2 * PLAY, thickness, align=STANDING)
        hub = Cylinder(servo.p.horn_diameter / 2, self.low, align=STANDING)
        holes = [Cylinder(self.bore / 2, 99), self.pin.location * PIN.clearance_hull]
        self.body = hub + [Pos(0, 0, self.low) * gear, self.arm] - [*holes, *(screw.clearance_hull for screw in screws)]

    def result(self):
        """Return the gear and the lever with their holes."""
        return self.body

    def collision(self):
        """Return a disc with the diameter of the pitch circle, and the lever."""
        return [self.disc, self.arm]


class Rod(Thing):
    """A rod from the palm to the finger, parallel to a lever.

    The origin is at the centre of one pin, in the plane of the underside. The z axis points to the side of the fingers, and the y axis
    points to the other pin.

    Args:
        length: distance between the pins
    """

    def __init__(self, length: Annotated[Length, Range(38, 80)] = 46):
        super().__init__(material="petg")
        thickness = Lever.top - Lever.low
        self.near = MountPoint(MATE)
        self.far = MountPoint(Pos(0, length, thickness))
        self.screw = MountPoint(Pos(0, 0, thickness), interface="m4-head")
        self.bar = Pos(0, length / 2, 0) * Rot(0, 0, 90) * extrude(SlotCenterToCenter(length, 11), thickness)
        self.body = self.bar - [mount.location * PIN.clearance_hull for mount in (self.screw, self.far)]

    def result(self):
        """Return the rod with the holes."""
        return self.body

    def collision(self):
        """Return the rod without holes."""
        return [self.bar]


class Finger(Thing):
    """The left finger, with a flat inner face. The right finger is the mirror image of the left finger.

    The origin is on the lever's pin, in the plane of the underside. The y axis points forwards, and the x axis points to the other finger.

    Args:
        length: distance from the lever's pin to the tip
        inside: distance from the lever's pin to the inner face
    """

    def __init__(self, length: Annotated[Length, Range(60, 160)] = 92, inside: Annotated[Length, Range(20, 40)] = 22.5):
        super().__init__(material="pla_white")
        thickness = 6
        self.pin, self.rod = MountPoint(MATE), MountPoint(Pos(*ROD, 0) * MATE)
        self.screw = [MountPoint(Pos(x, y, thickness), interface="m4-head") for x, y in ((0, 0), ROD)]
        tip = length - 8
        self.pad = MountPoint(Location(Plane((inside, tip - 14, thickness / 2), x_dir=(0, 1, 0), z_dir=(1, 0, 0))))
        self.strap = extrude(hull([(0, 0, 7), (*ROD, 7.5)]), thickness)
        blade = Polygon((ROD[0] - 7.5, ROD[1]), (inside, ROD[1] + 4), (inside, length), (inside - 6, length), align=None)
        self.blade = extrude(blade, thickness)
        first = ROD[1] + 16
        grip = Pos(inside - 3, (first + length) / 2, -thickness) * Box(6, length - first, 3 * thickness, align=STANDING)
        self.grip = chamfer(grip.edges().filter_by(Axis.X), 2)
        grooves = [Pos(inside, y, 0) * Box(1, 1.6, 99) for y in range(round(first) + 5, round(length) - 3, 5)]
        self.body = self.strap + [self.blade, self.grip] - [*grooves, *(mount.location * PIN.clearance_hull for mount in self.screw)]

    def result(self):
        """Return the finger with grooves and holes."""
        return self.body

    def collision(self):
        """Return the web between both pins, the blade, and the grip."""
        return [self.strap, self.blade, self.grip]


def hull(circles):
    """Return the convex hull of circles as a face. Each circle is given by x, y and radius [mm]."""
    return make_hull([edge for x, y, radius in circles for edge in (Pos(x, y, 0) * Circle(radius)).edges()])
