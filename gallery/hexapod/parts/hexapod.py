"""Parts of the hexapod: two plates with six servos between them, and the three segments of a leg. All lengths are in mm."""

from __future__ import annotations

from math import cos, radians, sin
from typing import Annotated

from build123d import Location, Plane, Solid

from thingc import MATE, Length, MountPoint, Range, Thing
from thingc_stock.bus_servos import XL330
from thingc_stock.shapes import bar, block, disc, prism, softened

HIPS = ((74.0, 38.0, 40.0), (0.0, 52.0, 90.0), (-74.0, 38.0, 140.0), (-74.0, -38.0, 220.0), (0.0, -52.0, 270.0), (74.0, -38.0, 320.0))
"""Axes of the hips (x forwards, y to the left), and directions of the legs [deg]: left front, middle, rear, right rear, middle, front."""

OUTLINE = ((95.0, 26.0), (84.0, 50.0), (62.0, 54.0), (20.0, 66.0))
"""A quarter of the outline of the plates."""

SERVO = 23.0
"""Depth of the case of a hip servo, which is the distance between the plates."""


class Plate(Thing):
    """A plate of the body. The lower plate carries the servos of the hips. The upper plate (`deck`) is on the servos, with openings for
    their horns.

    The origin is in the middle of the underside. Mounts: `hip_0`, `hip_1` ... are for the backs of the servos. `lid` is the middle of the
    upper side, `belly` the underside, and `nose` the front edge. `pack` is for the battery, and `screw_0`, `screw_1` ... are for screws.

    Args:
        thickness: thickness of the plate
        deck: whether it is the upper plate
    """

    def __init__(self, thickness: Annotated[Length, Range(2, 6)] = 3.0, deck: bool = False):
        super().__init__(material="carbon")
        self.hip = [self._seat(x, y, angle) for x, y, angle in HIPS]
        self.top = MountPoint(Location((0, 0, thickness)))
        self.belly = MountPoint(MATE)
        self.nose = MountPoint(Location((88, 0, thickness)))
        self.post = [MountPoint(Location((x, y, thickness))) for x, y in ((29, 11.5), (-29, 11.5), (-29, -11.5), (29, -11.5))]

    def _seat(self, x: float, y: float, angle: float) -> MountPoint:
        out = (cos(radians(angle)), sin(radians(angle)), 0)
        back = XL330.drawing.axis_to_top - XL330.drawing.height / 2
        origin = (x + back * out[0], y + back * out[1], self.p.thickness)
        return MountPoint(Location(Plane(origin, x_dir=(-out[0], -out[1], 0), z_dir=(0, 0, 1))), "xl330-back")

    def result(self) -> Solid:
        """The outline with round windows. The deck also has holes for the horns."""
        half = [*OUTLINE, *((-x, y) for x, y in reversed(OUTLINE))]
        plate = prism([*half, *((x, -y) for x, y in reversed(half))], 0, self.p.thickness)
        windows = [disc(d, 10, -1, x, y) for x, y, d in ((52, 0, 26), (-52, 0, 26), (82, 0, 9), (-82, 0, 9))]
        if self.p.deck:
            windows = [*windows[2:], *(disc(19, 10, -1, x, y) for x, y, _ in HIPS)]
        return softened(plate.cut(*windows).solid(), 0.5)

    def collision(self) -> list[Solid]:
        """A box around the middle, out of reach of the legs."""
        return [block((150, 70, self.p.thickness), (0, 0, self.p.thickness / 2))]


class Head(Thing):
    """An ultrasonic ranger with two eyes on a slanted foot. Mounts: `foot` is the underside, and `gaze` is between the eyes, with z
    forwards.
    """

    bom = {"make": "buy", "number": "HC-SR04"}

    def __init__(self) -> None:
        super().__init__(material="pla_orange")
        self.foot = MountPoint(MATE)
        self.gaze = MountPoint(Location(Plane((10, 0, 14), x_dir=(0, -1, 0), z_dir=(1, 0, 0))))

    def mass(self) -> tuple[float, str]:
        """8.5 g for an HC-SR04, as given by shops, and 5 g for its foot."""
        return (0.0135, "estimated")

    def result(self) -> Solid:
        """A box with two tubes."""
        box = softened(block((9, 46, 22), (0, 0, 11), corner=1.5), 0.8)
        tubes = [Solid.make_cylinder(8, 12.5, Plane((4, y, 12), z_dir=(1, 0, 0))) for y in (13, -13)]
        pupils = [Solid.make_cylinder(6.3, 3, Plane((14.5, y, 12), z_dir=(1, 0, 0))) for y in (13, -13)]
        return box.fuse(*tubes).cut(*pupils).solid()

    def collision(self) -> list[Solid]:
        """The box."""
        return [block((20, 46, 22), (4, 0, 11))]


class Coxa(Thing):
    """The tray on the horn of a hip that carries the servo of the femur.

    The origin is on the hip axis, on the horn; y points outwards, and z up. Mounts: `hip` is on the horn, and `seat` is for the left side
    of the servo.

    Args:
        length: distance between the axes of the hip and of the femur
    """

    def __init__(self, length: Annotated[Length, Range(28, 60)] = 31.0):
        super().__init__(material="pla_orange")
        self.hip = MountPoint(MATE, "xl330-horn")
        back = XL330.drawing.axis_to_top - XL330.drawing.height / 2
        self.seat = MountPoint(Location(Plane((0, length + back, 3), x_dir=(0, -1, 0), z_dir=(0, 0, 1))))

    def result(self) -> Solid:
        """A plate with a round end at the hip, and a wall behind the servo."""
        reach = self.p.length + XL330.drawing.axis_to_top
        tongue = prism([(11.5, 0), (11.5, reach - 3), (8.5, reach), (-15, reach), (-15, 9), (-11.5, 0)], 0, 3)
        wall = prism([(-11.6, 8.5), (-11.6, reach), (-15, reach), (-15, 10)], 0, 18)
        plate = disc(23, 3).fuse(tongue, wall)
        holes = [disc(2.2, 8, -1, x, y) for x, y in ((6, 0), (-6, 0), (0, 6), (0, -6))]
        return plate.cut(*holes, disc(5, 8, -1)).solid()

    def collision(self) -> list[Solid]:
        """The plate."""
        reach = self.p.length + XL330.drawing.axis_to_top
        return [block((24, reach, 3), (0, reach / 2, 1.5))]


class Femur(Thing):
    """The bar between the horns of the femur and of the knee.

    The origin is on the axis of the femur, on the horn; z points out of the horn, and y along the bar. The mounts `hip` and `knee` are on
    the back.

    Args:
        length: distance between the axes
    """

    def __init__(self, length: Annotated[Length, Range(36, 120)] = 54.0):
        super().__init__(material="pla_orange")
        self.hip = MountPoint(MATE, "xl330-horn")
        self.knee = MountPoint(Location(Plane((0, length, 0), x_dir=(1, 0, 0), z_dir=(0, 0, -1))), "xl330-horn")

    def result(self) -> Solid:
        """A bar with a long window, and the holes for both horns."""
        length = self.p.length
        whole = softened(bar(length, 10.5, 9.5, 4.5), 0.9)
        window = prism([(3.2, 14), (3.0, length - 13), (-3.0, length - 13), (-3.2, 14)], -1, 7)
        holes = [disc(2.2, 8, -1, x, y + k) for k in (0, length) for x, y in ((6, 0), (-6, 0), (0, 6), (0, -6))]
        return whole.cut(window, *holes).solid()

    def collision(self) -> list[Solid]:
        """The bounding box of the bar."""
        return [block((19, self.p.length + 18, 4.5), (0, self.p.length / 2, 2.25))]


class Tibia(Thing):
    """A curved blade below the servo of the knee.

    The origin is in the middle of the end of the servo; z points down to the foot, and x outwards. Mounts: `seat` is on the servo, and
    `tip` at the foot.

    Args:
        length: distance from the end of the servo to the foot
    """

    def __init__(self, length: Annotated[Length, Range(40, 160)] = 62.0):
        super().__init__(material="pla_black")
        self.seat = MountPoint(MATE)
        self.tip = MountPoint(Location((0, 0, length)))

    def result(self) -> Solid:
        """A flange and a blade that becomes thinner towards the foot."""
        end = self.p.length
        outline = [
            (-10, 0), (10, 0), (12.5, 0.3 * end), (11, 0.55 * end), (4.5, end - 4), (3, end), (-3, end), (-3.5, end - 5),
            (0.5, 0.55 * end), (-1, 0.3 * end), (-7.5, 0.12 * end),
        ]
        blade = softened(prism(outline, -5.5, 11), 1.4)
        blade = Location(Plane((0, 0, 0), x_dir=(1, 0, 0), z_dir=(0, -1, 0))) * blade
        flange = block((20, 23, 3.5), (0, 0, 1.75), corner=1.5)
        return blade.fuse(flange).solid()

    def collision(self) -> list[Solid]:
        """A slim box along the blade."""
        return [block((9, 9, self.p.length - 4), (3, 0, self.p.length / 2 - 2))]


class Foot(Thing):
    """A rubber ball on the tip. The origin is at the contact with the tip. Mounts: `seat` is at the origin, and `sole` at the end."""

    def __init__(self, diameter: Annotated[Length, Range(6, 30)] = 13.0):
        super().__init__(material="rubber")
        self.seat = MountPoint(MATE)
        self.sole = MountPoint(Location((0, 0, 0.72 * diameter)))

    def result(self) -> Solid:
        """The ball, cut at the contact with the tip."""
        d = self.p.diameter
        return Solid.make_sphere(d / 2, Plane((0, 0, 0.22 * d))).cut(block((d, d, d), (0, 0, -d / 2 - 0.1 * d))).solid()

    def collision(self) -> list[Solid]:
        """The whole ball as a sphere."""
        return [Solid.make_sphere(self.p.diameter / 2, Plane((0, 0, 0.22 * self.p.diameter)))]


