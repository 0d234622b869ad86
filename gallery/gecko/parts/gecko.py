"""Parts of the gecko: two plates connected by a servo as a spine, shells, and legs with a pad of five toes. All lengths are in mm."""

from __future__ import annotations

from math import cos, radians, sin
from typing import Annotated

from build123d import Location, Plane, Solid

from thingc import MATE, Length, MountPoint, Range, Thing
from thingc_stock.bus_servos import XL330
from thingc_stock.shapes import bar, block, disc, prism, softened

CASE = XL330.drawing
BACK = CASE.axis_to_top - CASE.height / 2
"""Distance from the axis of a servo to the middle of its case."""

THICKNESS = 4.0
"""Thickness of the plates."""

HORN = CASE.depth / 2 + CASE.horn[1]
"""Distance from the middle of a servo to the face of its horn."""


def seat_below(x: float, y: float, angle: float) -> MountPoint:
    """Return the mount for the back of a servo on the underside of a plate, with its axis at (x, y) and its end pointing to `angle` [deg].
    """
    out = (cos(radians(angle)), sin(radians(angle)))
    return MountPoint(
        Location(Plane((x + BACK * out[0], y + BACK * out[1], 0), x_dir=(-out[0], -out[1], 0), z_dir=(0, 0, -1))), "xl330-back",
    )


def shell(outline: list[tuple[float, float]], height: float) -> Solid:
    """Return a hollow cover with bevelled upper edges over an outline. Its lower edge is at z = 0."""
    whole = prism(outline, 0, height)
    top = whole.faces().sort_by(lambda face: face.center().Z)[-1]
    whole = whole.chamfer(0.45 * height, None, top.outer_wire().edges())
    (cx, cy), inner = (sum(x for x, _ in outline) / len(outline), sum(y for _, y in outline) / len(outline)), []
    for x, y in outline:
        inner.append((cx + 0.9 * (x - cx), cy + 0.9 * (y - cy)))
    room = prism(inner, -1, height - 1.2)
    top = room.faces().sort_by(lambda face: face.center().Z)[-1]
    room = room.chamfer(0.45 * height, None, top.outer_wire().edges())
    return whole.cut(room).solid()


FRONT = [(-20.0, -24.0), (6.0, -36.0), (46.0, -36.0), (66.0, -25.0), (66.0, 25.0), (46.0, 36.0), (6.0, 36.0), (-20.0, 24.0)]
REAR = [(-24.0, 8.0), (24.0, 8.0), (36.0, 30.0), (36.0, 72.0), (22.0, 92.0), (-22.0, 92.0), (-36.0, 72.0), (-36.0, 30.0)]


class Chest(Thing):
    """The front plate, with a rear wall that carries the servo of the spine.

    The origin is on the underside of the plate; x points forwards, and z up. Mounts: `hip_0` (left), `hip_1` and `belly` are on the
    underside. `spine` is behind, `top` on the upper side, and `neck` in front.
    """

    def __init__(self) -> None:
        super().__init__(material="pla_black")
        self.hip = [seat_below(30, 26, 70), seat_below(30, -26, -70)]
        self.spine = MountPoint(Location(Plane((-20, 0, -HORN), x_dir=(0, 0, -1), z_dir=(-1, 0, 0))))
        self.top = MountPoint(Location((0, 0, THICKNESS)))
        self.belly = MountPoint(MATE)
        self.neck = MountPoint(Location((68, 0, 0)))

    def result(self) -> Solid:
        """The plate and its wall."""
        wall = block((4, 30, HORN + 12), (-18, 0, -(HORN + 12) / 2), corner=0.8)
        return softened(prism(FRONT, 0, THICKNESS), 0.8).fuse(wall).solid()

    def collision(self) -> list[Solid]:
        """The plate."""
        return [block((80, 56, THICKNESS), (22, 0, THICKNESS / 2))]


class Pelvis(Thing):
    """The rear plate, on the horn of the spine. The origin is on the axis of the spine; y points to the tail, x to the left, and z up.

    Mounts: `spine` is on the horn. `hip_0` (left) and `hip_1` are on the underside, `top` is on the upper side, and `tail` behind.
    """

    def __init__(self) -> None:
        super().__init__(material="pla_black")
        self.spine = MountPoint(MATE, "xl330-horn")
        self.hip = [seat_below(26, 50, 20), seat_below(-26, 50, 160)]
        self.top = MountPoint(Location((0, 0, THICKNESS)))
        self.tail = MountPoint(Location((0, 90, 0)))

    def result(self) -> Solid:
        """The plate, with a round end at the spine."""
        tongue = disc(26, THICKNESS).fuse(block((26, 20, THICKNESS), (0, 10, THICKNESS / 2)))
        holes = [disc(2.2, 20, -5, x, y) for x, y in ((6, 0), (-6, 0), (0, 6), (0, -6))]
        return prism(REAR, 0, THICKNESS).fuse(tongue).cut(*holes).solid()

    def collision(self) -> list[Solid]:
        """The plate."""
        return [block((56, 80, THICKNESS), (0, 50, THICKNESS / 2))]


class ChestShell(Thing):
    """The cover of the chest. Its mount `seat` is the underside."""

    def __init__(self) -> None:
        super().__init__(material="pla_green")
        self.seat = MountPoint(MATE)

    def result(self) -> Solid:
        """A hollow, bevelled block."""
        return shell(FRONT, 21)

    def collision(self) -> list[Solid]:
        """A box."""
        return [block((76, 60, 20), (22, 0, 10))]


class PelvisShell(Thing):
    """The cover of the pelvis. Its mount `seat` is the underside."""

    def __init__(self) -> None:
        super().__init__(material="pla_green")
        self.seat = MountPoint(MATE)

    def result(self) -> Solid:
        """A hollow, bevelled block."""
        return shell(REAR, 21)

    def collision(self) -> list[Solid]:
        """A box."""
        return [block((60, 76, 20), (0, 50, 10))]


class Head(Thing):
    """A flat head. The origin is at the neck; x points forwards. Its mounts are `neck`, `eye_0` (left), `eye_1` and `snout`."""

    def __init__(self) -> None:
        super().__init__(material="pla_green")
        self.neck = MountPoint(MATE)
        self.eye = [MountPoint(Location(Plane((26, y, 15), z_dir=(0.25, 0.75 if y > 0 else -0.75, 0.61)))) for y in (17, -17)]
        self.snout = MountPoint(Location(Plane((66, 0, 6), x_dir=(0, -1, 0), z_dir=(1, 0, 0))))

    def result(self) -> Solid:
        """A bevelled wedge, wide at the eyes, with a mouth."""
        outline = [(-2, -16), (12, -23), (30, -25), (50, -17), (66, -8), (66, 8), (50, 17), (30, 25), (12, 23), (-2, 16)]
        whole = softened(prism(outline, -6, 22), 5.5)
        brow = Plane((66, 0, 6), x_dir=(0, 1, 0), z_dir=(0.33, 0, 1))
        slant = Location(brow) * block((90, 90, 30), (0, 0, 17))
        mouth = block((60, 70, 1.6), (54, 0, -0.4)).cut(block((60, 32, 4), (34, 0, 0)))
        sockets = [Solid.make_sphere(7.2, Plane(mount.location.position)) for mount in self.eye]
        return whole.cut(slant, mouth, *sockets).solid()

    def collision(self) -> list[Solid]:
        """A box."""
        return [block((60, 40, 18), (30, 0, 3))]


class Eye(Thing):
    """An eye: a ball with a slit. Its mount `socket` is the centre."""

    def __init__(self) -> None:
        super().__init__(material="pla_yellow")
        self.socket = MountPoint(MATE)

    def result(self) -> Solid:
        """The ball."""
        return Solid.make_sphere(7).cut(block((2.2, 9, 4), (0, 0, 7))).solid()

    def collision(self) -> list[Solid]:
        """The ball, as a sphere."""
        return [Solid.make_sphere(7)]


class Tail(Thing):
    """A segmented tail with decreasing size. The origin is at its root; y points to the tip. Its mounts are `base` and `tip`."""

    def __init__(self, length: Annotated[Length, Range(60, 240)] = 150.0):
        super().__init__(material="pla_green")
        self.base = MountPoint(MATE)
        self.tip = MountPoint(Location(Plane((0, length, 0), x_dir=(1, 0, 0), z_dir=(0, 1, 0))))

    def result(self) -> Solid:
        """Segments in an arc to the left. Each segment is a bevelled bar."""
        pieces, place, turn = [], Location((0, -4, 2)), 9.0
        for k in range(6):
            reach = self.p.length / 7.2 * (1 - 0.06 * k)
            wide = 15.0 - 2.2 * k
            pieces.append(place * softened(bar(reach, wide, wide - 2.4, 12 - 1.3 * k, -6 + 0.65 * k), 1.5))
            place = place * Location((0, reach, 0), (0, 0, turn))
        return pieces[0].fuse(*pieces[1:]).solid()

    def collision(self) -> list[Solid]:
        """The first half."""
        return [block((22, 0.5 * self.p.length, 10), (0, 0.25 * self.p.length, 2))]


class Shoulder(Thing):
    """The tray on the horn of a hip that carries the servo of the arm. Its mounts are `hip` and `seat`.

    The origin is on the hip axis, on the horn; y points outwards, and z out of the horn.

    Args:
        length: distance between the axes of the hip and of the arm
    """

    def __init__(self, length: Annotated[Length, Range(28, 60)] = 31.0):
        super().__init__(material="pla_black")
        self.hip = MountPoint(MATE, "xl330-horn")
        self.seat = MountPoint(Location(Plane((0, length + BACK, 3), x_dir=(0, -1, 0), z_dir=(0, 0, 1))))

    def result(self) -> Solid:
        """A plate with a round end at the hip."""
        reach = self.p.length + CASE.axis_to_top
        tongue = block((23, reach, 3), (0, reach / 2, 1.5), corner=2.5)
        holes = [disc(2.2, 20, -5, x, y) for x, y in ((6, 0), (-6, 0), (0, 6), (0, -6))]
        return disc(23, 3).fuse(tongue).cut(*holes, disc(5, 20, -5)).solid()

    def collision(self) -> list[Solid]:
        """The plate."""
        reach = self.p.length + CASE.axis_to_top
        return [block((23, reach, 3), (0, reach / 2, 1.5))]


class Arm(Thing):
    """The arm with the palm at its end.

    The origin is on its axis, on the horn; y points outwards, z out of the horn, and -x to the floor. Mounts: `hip` is on the horn. `palm`
    is for the toes, with z to the floor.

    Args:
        length: distance from the axis to the middle of the paw
        drop: distance from the axis down to the palm
    """

    def __init__(self, length: Annotated[Length, Range(40, 120)] = 56.0, drop: Annotated[Length, Range(12, 60)] = 17.0):
        super().__init__(material="pla_green")
        self.hip = MountPoint(MATE, "xl330-horn")
        self.palm = MountPoint(Location(Plane((-drop, length, -HORN), x_dir=(0, 1, 0), z_dir=(-1, 0, 0))))

    def result(self) -> Solid:
        """A bar with a palm below its end."""
        length, drop = self.p.length, self.p.drop
        upper = softened(bar(length - 16, 10, 8, 4.5), 0.8)
        holes = [disc(2.2, 20, -5, x, y) for x, y in ((6, 0), (-6, 0), (0, 6), (0, -6))]
        palm = Solid.make_cylinder(15, 4.5, Plane((-drop, length, -HORN), z_dir=(1, 0, 0)))
        outline = [
            (-drop, length - 15), (-drop + 4.5, length - 15), (7, length - 24), (7.5, length - 15), (0, length - 8),
            (-drop + 4.5, length + 8), (-drop, length + 8),
        ]
        wrist = prism(outline, -HORN - 6, HORN + 10.5)
        return upper.fuse(wrist, palm).cut(*holes).solid()

    def collision(self) -> list[Solid]:
        """The palm."""
        length, drop = self.p.length, self.p.drop
        return [Solid.make_cylinder(15, 4.5, Plane((-drop, length, -HORN), z_dir=(1, 0, 0)))]


class Toes(Thing):
    """An adhesive pad of five toes. The origin is on its back; z points out of the sole, and x outwards. Its mounts are `back` and `sole`.
    """

    def __init__(self) -> None:
        super().__init__(material="tpu", color="#e8a23c")
        self.back = MountPoint(MATE)
        self.sole = MountPoint(Location((0, 0, 3)))

    def result(self) -> Solid:
        """Five round toes around a pad."""
        toes = []
        for angle in (-80, -40, 0, 40, 80):
            toes.append(Location((0, 0, 0), (0, 0, angle - 90)) * bar(20, 3.6, 5.2, 3))
        return disc(22, 3).fuse(*toes).solid()

    def collision(self) -> list[Solid]:
        """The disc around the toes."""
        return [disc(40, 3)]
