"""A leg of MInchW: the fork on the yaw servo, the braces of the thigh, and the foot on its magnet."""

from __future__ import annotations

from typing import Annotated

from build123d import Location, Plane, Pos, Solid

from minchw import GAP, PLAY
from minchw.shapes import cut_away, placed, slab, stadium, sunk, swing, tongue, turned
from thingc import MATE, Bolts, Length, MountPoint, Range, Thing
from thingc_stock.dynamixel import XM430, XM540, XSeries, mated
from thingc_stock.fasteners import Screw
from thingc_stock.magnets import HoldingMagnet

OTHER_SIDE = Location((0, 0, 0), (0, 180, 0))
"""The pose of the second brace of a thigh relative to the first brace: a rotation by 180 deg about y."""


def horn_bolts(servo: XSeries) -> Bolts:
    """Return the clearance holes for every second screw of the horn of a servo."""
    d = servo.drawing
    return Bolts(d.horn_screw, d.horn_holes // 2, d.horn_circle)


def bottom_bolts(servo: XSeries) -> Bolts:
    """Return the clearance holes for the screws into the bottom of a servo."""
    return Bolts(servo.drawing.body_screw, at=mated(servo.drawing.bottom_bolts))


class HipBracket(Thing):
    """A fork on the horn and the idler of the yaw servo, whose back carries the knee servo.

    The origin is on the yaw axis at half the depth of the servo; z points out of the horn, x outwards along the leg, and y to its left. The
    knee axis is along y, and the bottom of the knee servo is on the back of the fork. The screws into the bottom of the knee servo are
    countersunk, so the corners of the yaw servo can move over the screw heads.

    Args:
        thickness: thickness of the arms and the back
    """

    def __init__(self, thickness: Annotated[Length, Range(4.5, 8)] = 5):
        super().__init__(material="petg")
        xm430, xm540 = XM430(), XM540()
        stand = placed(0, z_dir=(0, 0, 1), x_dir=(0, -1, 0))
        self.yaw_seat = MountPoint(stand * xm430.rotor.location * MATE, interface=["x430-horn", horn_bolts(xm430)])
        self.yaw_servo: XM430 = self.yaw_seat.align(xm430.rotor)
        inner = swing(xm430) + GAP
        self.knee = inner + thickness - xm540.bottom.location.position.Y
        lying = placed(self.knee, z_dir=(0, 1, 0), x_dir=(0, 0, 1))
        self.knee_seat = MountPoint(lying * xm540.bottom.location * MATE, interface=["x540-bottom", bottom_bolts(xm540)])
        self.knee_servo: XM540 = self.knee_seat.align(xm540.bottom)

        self.low, self.high = xm430.idler_z - thickness, xm430.horn_z + thickness
        arm = xm430.p.horn_diameter + 2 * thickness
        width = xm540.p.depth - 2 * xm540.drawing.corner
        back = Location(Plane((inner, 0, (self.low + self.high) / 2), x_dir=(0, 1, 0), z_dir=(1, 0, 0)))
        plate = back * slab(width, self.high - self.low, thickness, 2 * thickness)
        arms = [Pos(0, 0, z) * tongue(inner + thickness, arm, thickness) for z in (self.low, self.high - thickness)]
        self.pieces = [plate, *arms]

        ends = (*self.yaw_servo.screws_horn[::2], *self.yaw_servo.screws_idler[::2])
        held = [sunk(hole, thickness, 4 * PLAY) for hole in self.knee_servo.screws_bottom]
        boss = xm430.adjust(boss_diameter__add=6 * PLAY).move(stand).boss_hull(2 * thickness)
        axle = Solid.make_cylinder(xm430.p.boss_diameter / 2, 3 * thickness, Plane((0, 0, self.low - thickness)))
        holes = [boss, axle, *cut_away([hole(thickness) for hole in ends]), *cut_away(held)]
        self.body = plate.fuse(*arms).cut(*holes).solid()

    def result(self) -> Solid:
        """Return the solid of the fork with its holes."""
        return self.body

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the back and both arms, without holes."""
        return self.pieces


class ThighBrace(Thing):
    """One of the two sides of a thigh: a plate from the horn of the knee servo to the horn of the ankle servo, with half of the web.

    The origin is on the knee axis at half the depth of the servo; y points to the ankle, and z out of the horns. A thigh consists of two
    equal braces. The second brace is attached to the idlers, rotated by 180 deg about y. The web has two screws, one in each brace.

    Args:
        length: distance between the axes
        thickness: thickness of the plate
    """

    def __init__(
        self,
        length: Annotated[Length, Range(50, 140)] = 64,
        thickness: Annotated[Length, Range(2.4, 6)] = 4,
    ):
        super().__init__(material="petg")
        xm540, screw = XM540(), Screw("M2.5", 12)
        self.knee_seat = MountPoint(xm540.rotor.location * MATE, interface=["x540-horn", horn_bolts(xm540)])
        self.knee_servo: XM540 = self.knee_seat.align(xm540.rotor)
        # at angle 0, the thigh is horizontal and the ankle servo stands on its bottom, with its top on the left of the knee servo
        standing = Location(Plane((0, length, 0), x_dir=(0, -1, 0), z_dir=(0, 0, 1)))
        self.ankle_seat = MountPoint(standing * xm540.rotor.location * MATE, interface=["x540-horn", horn_bolts(xm540)])
        self.ankle_servo: XM540 = self.ankle_seat.align(xm540.rotor)

        # the web is as close to the knee servo as possible, to leave space for the long end of the ankle servo
        deep, high = screw.head_diameter + 4, 4 * screw.head_diameter
        middle = swing(xm540) + GAP + deep / 2
        room = length - middle - deep / 2 - swing(xm540) - GAP
        assert room >= 0, (
            f"a thigh of {length:g} mm leaves no room for its web between two servos: make it {-room:.2f} mm longer"
        )
        web = Location(Plane((0, middle, 0), x_dir=(0, 1, 0), z_dir=(0, 0, -1)))
        side, half = screw.head_diameter, screw.p.length / 2
        through, tapped = Bolts("M2.5", at=[(0, side)]), Bolts("M2.5", at=[(0, -side)], depth=half)
        self.web = MountPoint(web, interface=["thigh-web", through, tapped])
        seat = Location((side, middle, half))
        self.screw = [MountPoint(seat, interface="m2.5-head")]
        mine, theirs = screw.move(seat), screw.move(OTHER_SIDE * seat)
        inner = self.knee_seat.location.position.Z
        access = Solid.make_cylinder(screw.head_diameter / 2 + 2 * PLAY, inner + thickness, Plane(seat))
        ends = [self.knee_servo.screws_horn[::2], self.ankle_servo.screws_horn[::2]]
        roomy = xm540.adjust(boss_diameter__add=6 * PLAY)
        bosses = [roomy.move(place).boss_hull(2 * thickness) for place in (Location(), standing)]
        holes = [*bosses, mine.clearance_hull, access, theirs.tapped_hull]
        holes += cut_away([hole(thickness) for end in ends for hole in end])

        plate = Pos(0, 0, inner) * stadium(length, xm540.p.horn_diameter + 2 * thickness, thickness)
        web = Pos(0, middle, 0) * slab(high, deep, inner, deep / 3)
        self.pieces = [plate, web]
        self.body = plate.fuse(web).cut(*holes).solid()

    def result(self) -> Solid:
        """Return the solid of the plate with its web and holes."""
        return self.body

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the plate and the web, without holes."""
        return self.pieces


class Foot(Thing):
    """A disc on top of the magnet that carries the ankle servo, with a rim around the magnet.

    The origin is on the ankle axis at half the depth of the servo; z points up, x outwards along the leg, and y to its left. The screws
    into the servo are countersunk from below, and the magnet covers their heads. The screws into the magnet are in front of the servo and
    behind the servo.

    Args:
        thickness: thickness of the disc
        rim: thickness of the rim
    """

    def __init__(
        self,
        thickness: Annotated[Length, Range(4.5, 12)] = 5,
        rim: Annotated[Length, Range(1.6, 6)] = 2.4,
    ):
        super().__init__(material="petg")
        xm540, magnet = XM540(), HoldingMagnet()
        standing = placed(0, z_dir=(0, 1, 0), x_dir=(-1, 0, 0))
        self.servo_seat = MountPoint(standing * xm540.bottom.location * MATE, interface=["x540-bottom", bottom_bolts(xm540)])
        self.ankle_servo: XM540 = self.servo_seat.align(xm540.bottom)
        high = self.servo_seat.location.position.Z
        low = high - thickness
        magnet_bolts = Bolts("M3", 2, 0.8 * magnet.p.diameter, 90)  # the mate swaps the axes x and y
        self.magnet_seat = MountPoint(Pos(0, 0, low) * MATE, interface=[f"magnet-{magnet.p.diameter:g}", magnet_bolts])
        self.magnet: HoldingMagnet = self.magnet_seat.align(magnet.back)
        self.sole = self.magnet.sole.location.position.Z

        inner = magnet.p.diameter / 2 + PLAY
        outer, edge = inner + rim, low - magnet.p.height / 3
        fixings = [hole(thickness) for hole in self.magnet.screws_back]
        self.magnet_screw = [MountPoint(screw.seat.location * MATE, interface="m3-head") for screw in fixings]
        held = [sunk(hole, thickness, 4 * PLAY) for hole in self.ankle_servo.screws_bottom]
        self.pieces = [Pos(0, 0, edge) * Solid.make_cylinder(outer, high - edge)]
        disc = turned([(0, low), (inner, low), (inner, edge), (outer, edge), (outer, high - 1), (outer - 1, high), (0, high)])
        self.body = disc.cut(*cut_away([*held, *fixings])).solid()

    def result(self) -> Solid:
        """Return the solid of the disc with its rim and holes."""
        return self.body

    def collision(self) -> list[Solid]:
        """Return the collision shape: one cylinder, which includes the upper part of the magnet."""
        return self.pieces
