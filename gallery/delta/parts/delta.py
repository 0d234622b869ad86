"""Parts of the delta robot: a plywood top, three arms, six rods with ball joints at their ends, and a platform. All lengths are in mm."""

from __future__ import annotations

from math import cos, radians, sin
from typing import Annotated

from build123d import Location, Plane, Solid

from thingc import MATE, Length, MountPoint, Range, Thing
from thingc_stock.bus_servos import STS3215
from thingc_stock.shapes import bar, bevelled, block, disc, softened, turned

BASE = 62.0
"""Distance from the middle to the axes of the servos."""

PLATFORM = 30.0
"""Distance from the middle of the platform to the balls of a pair of rods."""

SPACING = 64.0
"""Distance between the two rods of an arm."""

HORN = STS3215.drawing.depth / 2 + STS3215.drawing.horn[1]
"""Distance from the middle of a servo to the face of its horn."""


def around(angle: float, radius: float) -> tuple[float, float]:
    """Return the position (x, y) at an angle [deg] around the middle."""
    return radius * cos(radians(angle)), radius * sin(radians(angle))


class Top(Thing):
    """The plate that carries all other parts. The origin is in the middle of its underside; z points up.

    Mounts: `servo_0` to `servo_2` on the underside are for the left sides of the servos. `leg_0` to `leg_2` are between them, and `lid` is
    the upper side.
    """

    def __init__(self, legs: Annotated[Length, Range(120, 300)] = 168.0, thickness: Annotated[Length, Range(4, 20)] = 9.0):
        super().__init__(material="plywood")
        seat = BASE + STS3215.drawing.axis_to_top - STS3215.drawing.height / 2
        self.servo = [self._below(angle, seat) for angle in (0, 120, 240)]
        self.leg = [self._below(angle, legs) for angle in (60, 180, 300)]
        self.lid = MountPoint(Location((0, 0, thickness)))

    def _below(self, angle: float, radius: float) -> MountPoint:
        x, y = around(angle, 1)
        return MountPoint(Location(Plane((x * radius, y * radius, 0), x_dir=(-x, -y, 0), z_dir=(0, 0, -1))))

    def result(self) -> Solid:
        """A disc with three arms for the legs, a window in the middle, and a window for the cable of each servo."""
        legs, t = self.p.legs, self.p.thickness
        arms = [Location((0, 0, 0), (0, 0, angle - 90)) * bar(legs, 52, 22, t) for angle in (60, 180, 300)]
        windows = [disc(64, 3 * t, -t), *(disc(16, 3 * t, -t, *around(angle, 0.66 * legs)) for angle in (60, 180, 300))]
        return softened(disc(196, t).fuse(*arms).cut(*windows).solid(), 1)

    def collision(self) -> list[Solid]:
        """The disc."""
        return [disc(196, self.p.thickness)]


class Arm(Thing):
    """An arm on the horn of a servo, with an axle across its end that carries two balls.

    The origin is on the axis of the servo, on the horn; y points along the arm, and z out of the horn. Mounts: `horn` is the rear face.
    `ball_0` and `ball_1` are the centres of the balls, with z down when the arm points outwards.

    Args:
        length: distance between the axes
    """

    def __init__(self, length: Annotated[Length, Range(50, 200)] = 90.0):
        super().__init__(material="pla_teal")
        self.horn = MountPoint(MATE, "sts3215-horn")
        self.ball = [
            MountPoint(Location(Plane((0, length, -HORN + side * SPACING / 2), x_dir=(0, 0, 1), z_dir=(-1, 0, 0)))) for side in (1, -1)
        ]

    def result(self) -> Solid:
        """The bar, the hub, the axle and the balls."""
        length = self.p.length
        body = softened(bar(length, 12, 7, 6), 1)
        holes = [disc(3.2, 20, -5, x, y) for x, y in ((4.95, 4.95), (-4.95, 4.95), (4.95, -4.95), (-4.95, -4.95))]
        window = bar(length - 48, 6, 3.5, 20, -5).translate((0, 26, 0))
        axle = disc(8, SPACING - 14, -HORN - SPACING / 2 + 7, y=length)
        balls = [Solid.make_sphere(5, Plane(mount.location.position)) for mount in self.ball]
        pins = [disc(4, 8, mount.location.position.Z - (7.5 if k == 0 else 0.5), y=length) for k, mount in enumerate(self.ball)]
        return body.cut(*holes, window).fuse(axle, *balls, *pins).solid()

    def collision(self) -> list[Solid]:
        """The bar and the axle."""
        return [block((14, self.p.length, 6), (0, self.p.length / 2, 3)), disc(8, SPACING, -HORN - SPACING / 2, y=self.p.length)]


class Rod(Thing):
    """A carbon tube with a socket at each end. The origin is in the centre of the upper ball; z is along the rod.

    Mounts: `upper` and `lower` are the centres of both balls.

    Args:
        length: distance between the centres of the balls
    """

    def __init__(self, length: Annotated[Length, Range(80, 500)] = 196.0):
        super().__init__(material="carbon")
        self.upper = MountPoint(MATE)
        self.lower = MountPoint(Location((0, 0, length)))

    def result(self) -> Solid:
        """The tube and the sockets, with space for the balls."""
        end = self.p.length
        sockets = [turned([(0, -6), (4.5, -6), (6.8, -3.5), (6.8, 4), (3.6, 14), (3.6, 22), (0, 22)])]
        sockets.append(Location((0, 0, end), (180, 0, 0)) * sockets[0])
        balls = [Solid.make_sphere(5.2, Plane((0, 0, z))) for z in (0, end)]
        slots = [block((16, 10.6, 11), (0, 0, z)) for z in (-3, end + 3)]
        return disc(5, end - 30, 15).fuse(*sockets).cut(*balls, *slots).solid()

    def collision(self) -> list[Solid]:
        """The tube."""
        return [disc(5, self.p.length - 20, 10)]


class Platform(Thing):
    """The moving platform: a plate with three pairs of balls. The origin is in the middle of its underside; z points up.

    Mounts: `ball_0` to `ball_5` are the balls, two for each arm. `tool` is the underside.
    """

    def __init__(self) -> None:
        super().__init__(material="pla_teal")
        self.ball = []
        for angle in (0, 120, 240):
            (x, y), (u, v) = around(angle, 1), around(angle + 90, SPACING / 2)
            for side in (1, -1):
                centre = (PLATFORM * x + side * u, PLATFORM * y + side * v, 6)
                self.ball.append(MountPoint(Location(Plane(centre, x_dir=(-x, -y, 0), z_dir=(0, 0, 1)))))
        self.tool = MountPoint(MATE)

    def result(self) -> Solid:
        """A plate, with an axle and two balls for each arm."""
        plate = softened(disc(52, 7).cut(disc(20, 20, -5)).solid(), 1)
        sides = []
        for k, angle in enumerate((0, 120, 240)):
            x, y = around(angle, PLATFORM)
            direction = (*around(angle + 90, 1), 0)
            start = (x - direction[0] * SPACING / 2, y - direction[1] * SPACING / 2, 6)
            sides.append(Solid.make_cylinder(2.4, SPACING, Plane(start, z_dir=direction)))
            inner = (x - direction[0] * 19, y - direction[1] * 19, 6)
            sides.append(Solid.make_cylinder(4.5, 38, Plane(inner, z_dir=direction)))
            sides.append(Location((0.5 * x, 0.5 * y, 3.5), (0, 0, angle)) * block((PLATFORM + 4, 22, 7)))
            sides += [Solid.make_sphere(5, Plane(mount.location.position)) for mount in self.ball[2 * k: 2 * k + 2]]
        return plate.fuse(*sides).cut(disc(20, 30, -5)).solid()

    def collision(self) -> list[Solid]:
        """The disc."""
        return [disc(70, 9)]


class Cup(Thing):
    """A suction cup with bellows on a nozzle. Mounts: `seat` is the upper end, and `lip` the lower end, with z down."""

    def __init__(self) -> None:
        super().__init__(material="silicone", color="#d9542c")
        self.seat = MountPoint(Location((0, 0, 0)))
        self.lip = MountPoint(Location((0, 0, -34)) * MATE)

    def result(self) -> Solid:
        """The nozzle and three bellows."""
        outline = [(0, 8), (9.8, 8), (9.8, 0), (12, 0), (12, -3), (6, -6), (6, -10)]
        for k in range(3):
            outline += [(12.5, -13.5 - 7 * k), (7.5, -17 - 7 * k)]
        return turned([*outline[:-1], (14, -33), (13, -34), (0, -30)])

    def collision(self) -> list[Solid]:
        """The enclosing cylinder."""
        return [disc(24, 34, -34)]


class LegFoot(Thing):
    """A rubber foot below a profile. Mounts: `seat` is the upper side, and `sole` the underside."""

    def __init__(self) -> None:
        super().__init__(material="rubber")
        self.seat = MountPoint(Location((0, 0, 0)))
        self.sole = MountPoint(Location((0, 0, -10)) * MATE)

    def result(self) -> Solid:
        """A bevelled disc."""
        return bevelled(30, 10, 2, -10)

    def collision(self) -> list[Solid]:
        """The disc."""
        return [disc(30, 10, -10)]
