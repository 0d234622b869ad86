"""The middle section of MInchW: a case between the two yaw servos that contains the cells, and its cover."""

from __future__ import annotations

from typing import Annotated

from build123d import Location, Plane, Pos, Solid

from minchw import GAP, PLAY
from minchw.leg import HipBracket, bottom_bolts
from minchw.shapes import block, cut_away, placed, slab
from thingc import MATE, Bolts, Length, MountPoint, Range, Thing
from thingc_stock.cells import CellTray
from thingc_stock.dynamixel import XM430
from thingc_stock.fasteners import Screw

CORNER = 6.0
"""Radius of the rounded vertical edges of the case [mm]."""


class Chassis(Thing):
    """An open case that holds three cells on its floor and a yaw servo at each end; its cover holds three other cells.

    The origin is in the underside of the case, below the middle of the cells; z points up, and x forwards. The rear half of the case is
    longer, because the electronics are behind the cells.

    Args:
        length: length of the case, which is the distance between the bottoms of both yaw servos
        wall: thickness of the floor and the sides; the ends, which carry the servos, are 2 mm thicker
    """

    def __init__(
        self,
        length: Annotated[Length, Range(80, 220)] = 94.7,
        wall: Annotated[Length, Range(2.5, 6)] = 3,
    ):
        super().__init__(material="petg")
        tray, xm430, hip = CellTray(), XM430(), HipBracket(wall + 2)
        end = wall + 2
        head = Screw("M2.5").head_height + GAP
        front = tray.length / 2 + head + end
        bay = length - front - tray.length / 2 - head - end
        assert bay >= 0, f"a case of {length:g} mm is too short for the cells: make it {-bay:.2f} mm longer"
        self.width = tray.width + 2 * (PLAY + wall)
        self.height = wall + 2 * tray.top + GAP
        self.middle = front - length / 2
        axis = max(self.height / 2, GAP - hip.low)

        self.belly = MountPoint(MATE)
        self.tray_seat = MountPoint(Location((0, 0, wall)))
        self.tray: CellTray = self.tray_seat.align(tray.base)
        corners = [(s * (length - end) / 2, t * (self.width / 2 - 2 * CORNER)) for s in (1, -1) for t in (1, -1)]
        tapped = Bolts("M2.5", at=corners, depth=8)
        self.rim = MountPoint(Location((self.middle, 0, self.height)), interface=["case-rim", tapped])
        bottom = -xm430.bottom.location.position.Y
        ahead = placed(front + bottom, z_dir=(0, 0, 1), x_dir=(0, -1, 0), z=axis)
        astern = placed(front - length - bottom, z_dir=(0, 0, 1), x_dir=(0, 1, 0), z=axis)
        self.front_seat = MountPoint(ahead * xm430.bottom.location * MATE, interface=["x430-bottom", bottom_bolts(xm430)])
        self.rear_seat = MountPoint(astern * xm430.bottom.location * MATE, interface=["x430-bottom", bottom_bolts(xm430)])
        self.front_servo: XM430 = self.front_seat.align(xm430.bottom)
        self.rear_servo: XM430 = self.rear_seat.align(xm430.bottom)
        self.board = MountPoint(Location(Plane((front - length + end, 0, self.height / 2), x_dir=(0, 1, 0), z_dir=(1, 0, 0))))
        self.imu = MountPoint(Location((front - end, 0, wall)))

        held = [hole(end) for servo in (self.front_servo, self.rear_servo) for hole in servo.screws_bottom]
        holes = [*cut_away(held), *(self.tray.fixing(k, wall).tapped_hull for k in (0, 1))]
        holes += [screw.tapped_hull for screw in self.cover_screws(0)]
        room = slab(length - 2 * end, self.width - 2 * wall, self.height, max(CORNER - wall, GAP))
        inside = Pos(self.middle, 0, wall) * room
        self.hull = Pos(self.middle, 0, 0) * slab(length, self.width, self.height, CORNER)
        self.body = self.hull.cut(inside, *self._windows(end), *self._cables(axis), *holes).solid()

    def _windows(self, end: float) -> list[Solid]:
        """Return the vertical ventilation slots in both sides of the case, between the ends, whose thickness is `end` [mm]."""
        pitch, height = 2.5 * CORNER, self.height - self.p.wall - 2.5 * CORNER
        count = int((self.p.length - 2 * end - CORNER) / pitch)
        slot = block(CORNER, 2 * self.width, height)
        return [Pos(self.middle + (k - (count - 1) / 2) * pitch, 0, self.p.wall + CORNER) * slot for k in range(count)]

    def _cables(self, z: float) -> list[Solid]:
        """Return the openings for cables through both ends of the case, left and right of the yaw servos, at the height `z` [mm]."""
        y = XM430().p.width / 2 + CORNER
        opening = block(2 * self.p.length, CORNER, 2 * CORNER)
        return [Pos(self.middle, s * y, z - CORNER) * opening for s in (1, -1)]

    def cover_screws(self, thickness: float) -> list[Screw]:
        """Return the four screws of a cover with this thickness [mm], which extend 8 mm into the ends of the case."""
        x, y = (self.p.length - self.p.wall - 2) / 2, self.width / 2 - 2 * CORNER
        screw = Screw("M2.5", thickness + 8)
        corners = [(s * x, t * y) for s in (1, -1) for t in (1, -1)]
        return [screw.move(self.rim.location * Location((x, y, thickness))) for x, y in corners]

    def result(self) -> Solid:
        """Return the solid of the case with its holes and windows."""
        return self.body

    def collision(self) -> list[Solid]:
        """Return the collision shape: the case as a solid block, which includes its contents."""
        return [self.hull]


class Cover(Thing):
    """The lid of the case, with three cells attached below it and a hood for a camera at its front edge.

    The origin is in the underside of the cover, above the middle of the case; z points up, and x forwards.

    Args:
        length: length of the case
        wall: thickness of the cover and of the walls of the case
    """

    def __init__(
        self,
        length: Annotated[Length, Range(80, 220)] = 94.7,
        wall: Annotated[Length, Range(2.5, 6)] = 3,
    ):
        super().__init__(material="petg")
        case, tray = Chassis(length, wall), CellTray()
        self.seat = MountPoint(MATE, interface="case-rim")
        self.case: Chassis = self.seat.align(case.rim)
        cells = self.case.tray_seat.location.position.X
        self.tray_seat = MountPoint(Location((cells, 0, 0), (180, 0, 0)))
        self.tray: CellTray = self.tray_seat.align(tray.base)
        screws = self.case.cover_screws(wall)
        self.screw = [MountPoint(screw.seat.location * MATE, interface="m2.5-head") for screw in screws]

        hood, eye = 3 * CORNER, 1.2 * CORNER
        x = length / 2 - hood / 2
        self.lens = MountPoint(Location(Plane((length / 2, 0, wall + hood / 3), x_dir=(0, 1, 0), z_dir=(1, 0, 0))))
        plate = slab(length, case.width, wall, CORNER)
        housing = Pos(x, 0, 0) * slab(hood, 1.5 * hood, wall + 2 * hood / 3, CORNER / 2)
        pupil = Solid.make_cylinder(eye / 2, hood, Plane((x, 0, wall + hood / 3), z_dir=(1, 0, 0)))
        bevel = Solid.make_cylinder(0.8 * eye, 2, Plane((length / 2 - 1, 0, wall + hood / 3), z_dir=(1, 0, 0)))
        groove = block(CORNER / 2, case.width - 4 * CORNER, wall)
        grooves = [Pos(x - hood - k * 2 * CORNER, 0, 2 * wall / 3) * groove for k in range(5)]
        holes = [*cut_away(screws), *(self.tray.fixing(k, wall).tapped_hull for k in (0, 1)), pupil, bevel, *grooves]
        self.pieces = [plate, housing]
        self.body = plate.fuse(housing).cut(*holes).solid()

    def result(self) -> Solid:
        """Return the solid of the lid with its hood, grooves and holes."""
        return self.body

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the lid and the hood, without holes."""
        return self.pieces
