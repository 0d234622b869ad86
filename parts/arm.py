"""The printed parts of the pen-drawing arm: the links between its Dynamixel XM430 servos, and the hand that holds the pen.

The dimensions of a servo are not repeated in this module: a part that carries a servo derives its faces, holes and clearances from the
placed servo. A single boolean operation cuts all holes of a part.
"""

from __future__ import annotations

from math import hypot
from typing import Annotated

from build123d import Axis, Circle, Cone, Cylinder, Edge, Face, Location, Plane, Pos, Solid, Wire, fillet

from thingc import MATE, Bolts, Bore, Length, MountPoint, Range, Thing
from thingc_stock.dynamixel import XM430, mated
from thingc_stock.fasteners import Screw

PLAY = 0.1
"""Clearance on each side of a component that is inserted into a printed part [mm]."""


class BasePlate(Thing):
    """A square plate with two walls that hold the yaw servo by its sides, horn up.

    The origin is on the yaw axis, in the underside of the plate; z is up, and x is the forward direction of the arm at yaw 0.

    Args:
        size: edge of the plate
        thickness: thickness of the plate
        wall: thickness of the walls
    """

    def __init__(
        self,
        size: Annotated[Length, Range(90, 300)] = 100,
        thickness: Annotated[Length, Range(3, 15)] = 5,
        wall: Annotated[Length, Range(3, 10)] = 5,
    ):
        super().__init__(material="petg")
        xm430 = XM430()
        stand = Location(Plane((0, 0, thickness - xm430.back.location.position.Z), x_dir=(0, -1, 0), z_dir=(0, 0, 1)))
        self.servo_seat = MountPoint(stand * xm430.back.location * MATE, interface="x430-back")
        self.servo: XM430 = self.servo_seat.align(xm430.back)
        screws = [hole(PLAY + wall) for hole in (*self.servo.screws_left, *self.servo.screws_right)]

        corner = size / 2 - 8
        self.bottom = MountPoint(Location((0, 0, 0), (0, 180, 0)))
        self.table = [MountPoint(Location((x, y, thickness)), "m4-head") for x in (corner, -corner) for y in (corner, -corner)]
        self.servo_screw = [MountPoint(screw.seat.location * MATE, "m2.5-head") for screw in screws]

        roomy = xm430.adjust(width__add=2 * PLAY, horn_diameter__add=10 * PLAY).move(stand)
        square = _block(size, size, thickness)
        self.plate = square.fillet(6, square.edges().filter_by(Axis.Z)).solid()
        length = xm430.p.height - 2 * xm430.drawing.corner
        self.walls = [side.location * _block(xm430.p.depth, length, wall) for side in (roomy.left, roomy.right)]
        table = [mount.location * Screw("M4", 2 * thickness).clearance_hull for mount in self.table]
        holes = [roomy.idler_hull(2 * thickness), *table, *(screw.clearance_hull for screw in screws)]
        self.body = self.plate.fuse(*self.walls).cut(*holes).solid()

    def result(self) -> Solid:
        """Return the solid of the plate with its walls and holes."""
        return self.body

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the plate and each wall, without holes."""
        return [self.plate, *self.walls]


class YawPitchBracket(Thing):
    """A cradle that is mounted on the horn of the yaw servo.

    The cradle holds the shoulder servo, whose axis is perpendicular to the yaw axis. The origin is on the yaw axis in the horn's face; z is
    up, and x is the forward direction of the arm. The shoulder axis is along +y, so a positive angle lowers the arm. The screws that attach
    the platform to the horn are countersunk, under the shoulder servo. The screws that hold the shoulder servo are inserted from the sides.

    Args:
        thickness: thickness of the platform
        wall: thickness of the walls
    """

    def __init__(
        self,
        thickness: Annotated[Length, Range(4.5, 12)] = 5,
        wall: Annotated[Length, Range(3, 10)] = 5,
    ):
        super().__init__(material="petg")
        xm430 = XM430()
        below = Location(Plane((0, 0, -xm430.horn_z), x_dir=(0, -1, 0), z_dir=(0, 0, 1)))
        self.yaw_seat = MountPoint(below * xm430.rotor.location * MATE, interface=_horn(xm430))
        self.yaw_servo: XM430 = self.yaw_seat.align(xm430.rotor)
        above = Location(Plane((0, 0, thickness - xm430.bottom.location.position.Y), x_dir=(-1, 0, 0), z_dir=(0, 1, 0)))
        self.shoulder_seat = MountPoint(above * xm430.bottom.location * MATE, interface="x430-bottom")
        self.shoulder_servo: XM430 = self.shoulder_seat.align(xm430.bottom)

        servo = self.shoulder_servo
        held = (
            servo.screw_left_bottom_front, servo.screw_left_bottom_rear,
            servo.screw_right_bottom_front, servo.screw_right_bottom_rear,
        )
        sides = [hole(PLAY + wall) for hole in held]
        # the screw heads end below the servo for any thickness of the platform
        sunk = [hole(thickness - hole(1).head_height - 4 * PLAY) for hole in self.yaw_servo.screws_horn]
        self.servo_screw = [MountPoint(screw.seat.location * MATE, "m2.5-head") for screw in sides]

        roomy = xm430.adjust(width__add=2 * PLAY, boss_diameter__add=6 * PLAY)
        depth, length = xm430.p.depth, roomy.p.width + 2 * wall
        top = max(screw.seat.location.position.Z for screw in sides) + sides[0].head_diameter
        self.platform = _block(length, depth, thickness)
        self.walls = [Pos(x, 0, 0) * _block(wall, depth, top) for x in ((wall - length) / 2, (length - wall) / 2)]
        self.board = MountPoint(Location(Plane((-length / 2, 0, top / 2), x_dir=(0, -1, 0), z_dir=(-1, 0, 0))))
        holes = [roomy.move(below).boss_hull(2 * thickness), *(screw.clearance_hull for screw in (*sunk, *sides))]
        self.body = self.platform.fuse(*self.walls).cut(*holes).solid()

    def result(self) -> Solid:
        """Return the solid of the platform with its walls and holes."""
        return self.body

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the platform and each wall, without holes."""
        return [self.platform, *self.walls]


class RotorBrace(Thing):
    """One of the two sides of an arm link: an L from the horn or idler of a servo to the bottom of the next servo.

    The origin is on the axis of the servo that turns the brace, at half the depth of the servo. The y axis points to the next servo axis,
    and z out of the horn. An arm link consists of two equal braces. The second brace is attached to the idler, rotated by 180 deg about y.

    Args:
        length: distance between the axes
        thickness: thickness of both legs
    """

    def __init__(
        self,
        length: Annotated[Length, Range(60, 200)] = 100,
        thickness: Annotated[Length, Range(2.4, 5)] = 3,
    ):
        super().__init__(material="petg")
        xm430 = XM430()
        self.rotor_seat = MountPoint(xm430.rotor.location * MATE, interface=_horn(xm430))
        self.turning_servo: XM430 = self.rotor_seat.align(xm430.rotor)
        bottom = ["x430-bottom", Bolts(xm430.drawing.body_screw, at=mated(xm430.drawing.bottom_bolts[::2]))]
        self.servo_seat = MountPoint(Pos(0, length, 0) * xm430.bottom.location * MATE, interface=bottom)
        self.next_servo: XM430 = self.servo_seat.align(xm430.bottom)

        inner = self.rotor_seat.location.position.Z
        end = self.servo_seat.location.position.Y
        width = xm430.p.horn_diameter + 1.5 * thickness
        room = end - thickness - _swing(xm430) - PLAY
        assert room >= 0.5, (
            f"a brace of {length:g} mm with legs of {thickness:g} mm runs into the servo that turns it: "
            f"make it {0.5 - room:.2f} mm longer or thinner"
        )
        nearer = (self.next_servo.screw_bottom_left_front, self.next_servo.screw_bottom_right_front)
        screws = [hole(thickness) for hole in (*self.turning_servo.screws_horn, *nearer)]
        plug = xm430.adjust(boss_diameter__add=6 * PLAY).boss_hull(2 * thickness)
        along = _tongue(width, end, inner, thickness)
        across = Pos(0, end - thickness / 2, PLAY) * _block(width, thickness, inner + thickness - PLAY)
        self.legs = [along, across, _gusset(width, end - thickness, inner, min(room, 7.0))]
        self.body = along.fuse(*self.legs[1:]).cut(plug, *(screw.clearance_hull for screw in screws)).solid()

    def result(self) -> Solid:
        """Return the solid of both legs and the gusset between them, with their holes."""
        return self.body

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the leg along the servo, the leg across and the gusset, without holes."""
        return self.legs


class OmegaCap(Thing):
    """The clamp that holds the pen against the hand: an arch over the pen between two flanges, in the shape of an omega.

    The origin is in the face on the hand, under the arch; z points away from the hand, and y along the pen to the tip.

    Args:
        pen_diameter: diameter of the pen
        thickness: thickness of the arch and the flanges
        width: width along the pen
    """

    def __init__(
        self,
        pen_diameter: Annotated[Length, Range(6, 30)] = 15,
        thickness: Annotated[Length, Range(2, 6)] = 3,
        width: Annotated[Length, Range(8, 30)] = 12,
    ):
        super().__init__(material="petg")
        screw = Screw("M3")
        radius = pen_diameter / 2 + PLAY
        outer = radius + thickness
        spot = outer + screw.head_diameter / 2 + 4 * PLAY
        self.half_width = spot + screw.head_diameter / 2 + 4 * PLAY
        axis = pen_diameter / 2 + PLAY / 2
        places = ((spot, 0.0), (-spot, 0.0))
        self.seat = MountPoint(Location((0, 0, 0), (0, 180, 0)), interface=["omega", Bolts("M3", at=places)])
        self.pen = MountPoint(Location((0, 0, axis), (0, 0, -90)), interface=f"pen-{pen_diameter:g}")
        self.screw = [MountPoint(Location((x, 0, thickness)), "m3-head") for x in (spot, -spot)]

        self.outer, self.axis = outer, axis
        flange = _block(2 * self.half_width, width, thickness)
        body = flange.fuse(self._arch(outer))
        self.body = body.cut(self._arch(radius), *(self.fixing(k, thickness).clearance_hull for k in (0, 1))).solid()

    def fixing(self, number: int, depth: float) -> Screw:
        """Return the screw through flange 0 (at +x) or flange 1, which extends `depth` [mm] into the hand."""
        return Screw("M3", self.p.thickness + depth).move(self.screw[number].location)

    def result(self) -> Solid:
        """Return the solid of the arch and the flanges, with the holes for the screws."""
        return self.body

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the arch without the space for the pen, and the flanges."""
        return [self._arch(self.outer), _block(2 * self.half_width, self.p.width, self.p.thickness)]

    def _arch(self, radius: float) -> Solid:
        """Return a half cylinder of this radius [mm] around the axis of the pen, extended by straight sides to the hand."""
        y, width, axis = -self.p.width / 2, self.p.width, self.axis
        left, right = (-radius, y, axis), (radius, y, axis)
        over = Edge.make_three_point_arc(left, (0, y, axis + radius), right)
        under = Wire.make_polygon([right, (radius, y, 0), (-radius, y, 0), left], close=False)
        return Solid.extrude(Face(Wire([over, *under.edges()])), (0, width, 0))


class Hand(Thing):
    """An L on the horn of the wrist servo: a leg beside the servo, and a plate across the end of the servo that carries the cap of the pen.

    The origin is on the wrist axis at half the depth of the servo; y points away from the arm, and z out of the horn. The pen is along x,
    and its tip points to -x.

    Args:
        pen_diameter: diameter of the pen
        clearance: distance from the axis to the plate across the end
        thickness: thickness of the leg beside the servo
        front: thickness of the plate across the end, which carries the cap
    """

    def __init__(
        self,
        pen_diameter: Annotated[Length, Range(6, 30)] = 15,
        clearance: Annotated[Length, Range(19, 60)] = 22,
        thickness: Annotated[Length, Range(2.4, 6)] = 3,
        front: Annotated[Length, Range(4, 10)] = 5,
    ):
        super().__init__(material="petg")
        xm430 = XM430()
        self.rotor_seat = MountPoint(xm430.rotor.location * MATE, interface=_horn(xm430))
        self.servo: XM430 = self.rotor_seat.align(xm430.rotor)
        omega = OmegaCap(pen_diameter)
        outside = Location(Plane((0, clearance + front, 0), x_dir=(0, 0, -1), z_dir=(0, 1, 0)))
        tapped = Bolts("M3", at=[(0.0, screw.location.position.X) for screw in omega.screw], depth=front)
        self.cap_seat = MountPoint(outside * omega.seat.location * MATE, interface=["omega", tapped])
        self.cap: OmegaCap = self.cap_seat.align(omega.seat)

        inner = self.rotor_seat.location.position.Z
        end = clearance + front
        width = max(xm430.p.horn_diameter + 1.5 * thickness, omega.p.width)
        low, high = -omega.half_width, max(omega.half_width, inner + thickness)
        room = clearance - _swing(xm430) - PLAY
        assert room >= 0.5, (
            f"a hand with a clearance of {clearance:g} mm runs into the wrist servo: it takes {clearance + 0.5 - room:.2f} mm"
        )
        plug = xm430.adjust(boss_diameter__add=6 * PLAY).boss_hull(2 * thickness)
        holes = [plug, *(hole(thickness).clearance_hull for hole in self.servo.screws_horn)]
        holes += [self.cap.fixing(k, front).tapped_hull for k in (0, 1)]
        along = _tongue(width, end, inner, thickness)
        across = Pos(0, end - front / 2, low) * _block(width, front, high - low)
        self.legs = [along, across, _gusset(width, clearance, inner, min(room, 7.0))]
        self.body = along.fuse(*self.legs[1:]).cut(*holes).solid()

    def result(self) -> Solid:
        """Return the solid of the L with its gusset and holes."""
        return self.body

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the leg beside the servo, the plate across and the gusset, without holes."""
        return self.legs


class PenDummy(Thing):
    """A pen-shaped end effector: a cylinder with a rounded end and a conical tip.

    The origin is halfway along the cylinder; z points to the tip.

    Args:
        length: length of the cylinder
        diameter: diameter of the cylinder
    """

    def __init__(
        self,
        length: Annotated[Length, Range(40, 250)] = 100,
        diameter: Annotated[Length, Range(6, 30)] = 15,
    ):
        super().__init__(material="petg")
        shaft = Cylinder(diameter / 2, length)
        rounded = fillet(shaft.edges().sort_by(Axis.Z)[0], diameter / 2.5)
        self.body = (rounded + Pos(0, 0, length / 2 + length / 20) * Cone(diameter / 2, 0, length / 10)).solid()
        self.groundplane = Circle(diameter / 2)
        self.grip = MountPoint(Location((0, 0, 0), (90, 0, 0)), interface=f"pen-{diameter:g}")
        self.tip = MountPoint(Location((0, 0, length / 2 + length / 10)))

    def result(self) -> Solid:
        """Return the solid of the pen."""
        return self.body


def _horn(servo: XM430) -> list[str | Bolts | Bore]:
    """Return the interface of a part on the horn of a servo: holes for its screws, and a hole for its boss."""
    return ["x430-horn", servo.drawing.horn_bolts(), Bore(servo.p.boss_diameter + 6 * PLAY)]


def _swing(servo: XM430) -> float:
    """Return the distance [mm] from the axis of the servo to the corners of its case next to the output.

    A part that turns around the short end of the servo must stay outside this radius.
    """
    return hypot(servo.p.width / 2, servo.top.location.position.Y)


def _block(length: float, width: float, height: float) -> Solid:
    """Return a box on the plane z = 0, centred in x and y [mm]."""
    return Solid.make_box(length, width, height, Plane((-length / 2, -width / 2, 0)))


def _tongue(width: float, end: float, bottom: float, thickness: float) -> Solid:
    """Return a flat leg on the plane z = `bottom`, from the z axis to y = `end`, with a rounded end at the z axis [mm]."""
    x, y, z = width / 2, end, bottom
    sides = Wire.make_polygon([(x, 0, z), (x, y, z), (-x, y, z), (-x, 0, z)], close=False)
    around = Edge.make_three_point_arc((-x, 0, z), (0, -x, z), (x, 0, z))
    return Solid.extrude(Face(Wire([*sides.edges(), around])), (0, 0, thickness))


def _gusset(width: float, y: float, z: float, leg: float) -> Solid:
    """Return a triangular prism that fills the corner between two legs, one above `z` and one beyond `y`.

    The prism extends by `leg` [mm] along both legs.
    """
    corner = [(-width / 2, y - leg, z), (-width / 2, y, z - leg), (-width / 2, y, z)]
    return Solid.extrude(Face(Wire.make_polygon(corner)), (width, 0, 0))
