"""Parts of the hand: a forearm with servos, a palm, and bones with forks and tongues. All lengths are in mm."""

from __future__ import annotations

from math import cos, radians, sin
from typing import Annotated

from build123d import Location, Plane, Solid

from thingc import MATE, Length, MountPoint, Range, Ratio, Thing
from thingc_stock.servos import SG90
from thingc_stock.shapes import bar, bevelled, block, prism, softened

KNUCKLES = ((-31.5, 84.0), (-10.5, 91.0), (10.5, 90.0), (31.5, 80.0))
"""Positions of the fingers on the palm: index, middle, ring and little finger (a right hand, seen from its back)."""

PULLS = -46.0
"""Position along y of the shafts of the servos that pull the fingers."""

THUMB = 43.0
"""Angle between the thumb and the x axis of the palm [deg]."""

SIDE = Plane((0, 0, 0), x_dir=(0, 1, 0), z_dir=(-1, 0, 0))
"""A plane for joints that curl. Its axis points to the left, so that positive angles turn from the bone's y to the palm."""

EDGE = 6.0
"""Height of the plate of the forearm, which carries the ears of the servos."""


def curling(y: float) -> Location:
    """Return the frame of a joint at a position along a bone."""
    return Location((0, y, 0)) * Location(SIDE)


def forked(body: Solid, y: float, radius: float) -> Solid:
    """Return a body with a slot about the axis at y, for a tongue."""
    return body.cut(block((8.8, 2 * radius + 3, 60), (0, y + 0.4, 0))).solid()


def tongued(body: Solid, radius: float) -> Solid:
    """Return a body whose end at the origin is a tongue that fits into a slot."""
    sides = [block((20, 2 * radius + 1.6, 60), (x, 0, 0)) for x in (14.2, -14.2)]
    return body.cut(*sides).solid()


def across(solid: Solid) -> Solid:
    """Return a solid after rotating its z axis to x."""
    return (Location(Plane((0, 0, 0), x_dir=(0, 0, -1), z_dir=(1, 0, 0))) * solid).solid()


class Forearm(Thing):
    """A tray with six servos. The origin is at the wrist; y points to the palm, and z out of the back.

    Mounts: `palm` is at the wrist. `thumb_0` and `thumb_1` are for the servos of the thumb, and `elbow` is at the other end.
    """

    def __init__(self) -> None:
        super().__init__(material="pla_white")
        self.palm = MountPoint(Location(Plane((0, 0, 0), x_dir=(1, 0, 0), z_dir=(0, 1, 0))))
        middle = -92 + SG90.drawing.axis_to_end - SG90.drawing.length / 2
        self.thumb = [MountPoint(Location(Plane((x, middle, EDGE), x_dir=(0, -1, 0), z_dir=(0, 0, 1)))) for x in (-14, 14)]
        self.elbow = MountPoint(Location(Plane((0, -118, 0), x_dir=(1, 0, 0), z_dir=(0, -1, 0))))

    def result(self) -> Solid:
        """A plate with walls, and with a pocket and holes for each servo."""
        outline = [(-42, -20), (-36, 0), (36, 0), (42, -20), (42, -80), (32, -118), (-32, -118), (-42, -80)]
        tray = softened(prism(outline, -19, 19 + EDGE), 2.5)
        room = prism([(0.88 * x, -4 + 0.93 * y) for x, y in outline], -30, 30)
        servo = SG90()
        places = [*((x, PULLS) for x, _ in KNUCKLES), (-14, -92), (14, -92)]
        cuts = [Location((x, y, EDGE)) * cut for x, y in places for cut in (servo.pocket(30), *servo.screws(1.6, 9))]
        return tray.cut(room, *cuts).solid()

    def collision(self) -> list[Solid]:
        """The bounding box."""
        return [block((80, 118, 25), (0, -59, -6.5))]


class Stand(Thing):
    """A heavy base. Its mounts are `top` and `floor`."""

    def __init__(self) -> None:
        super().__init__(material="steel", color="#4a4e55")
        self.top = MountPoint(Location((0, 0, 10)))
        self.floor = MountPoint(MATE)

    def result(self) -> Solid:
        """A bevelled disc."""
        return bevelled(120, 10, 2.5)

    def collision(self) -> list[Solid]:
        """The disc."""
        return [bevelled(120, 10, 2.5)]


class Palm(Thing):
    """The palm with four forks. The origin is at the wrist; y points to the fingers, and z out of the back.

    Mounts: `wrist` is at the origin. `finger_0` (index) to `finger_3` and `thumb` are the axes of the first joints.
    """

    def __init__(self) -> None:
        super().__init__(material="pla_white")
        self.wrist = MountPoint(Location(Plane((0, 0, 0), x_dir=(1, 0, 0), z_dir=(0, 1, 0))) * MATE)
        self.finger = [MountPoint(Location((x, y, 0))) for x, y in KNUCKLES]
        self.thumb = MountPoint(Location(Plane((-44, 30, -4), x_dir=(0, 0, 1), z_dir=(0, -1, 0))))

    def result(self) -> Solid:
        """A bevelled block with forks at its end and a post for the thumb."""
        outline = [(-26, 0), (26, 0), (41, 26), (42, 66), (22, 74), (0, 77), (-21, 75), (-41, 70), (-42, 40), (-36, 16)]
        body = softened(prism(outline, -11, 22), 3.5)
        forks = []
        for x, y in KNUCKLES:
            reach = y - 52
            fork = across(softened(bar(reach, 8.5, 8.5, 17, -8.5), 1.2))
            forks.append(Location((x, 52, 0)) * forked(fork, reach, 8.5))
        post = Solid.make_cylinder(8, 20, Plane((-42, 40, -4), z_dir=(0, -1, 0)))
        hinge = block((8, 20, 16), (-38, 30, -4))
        gap = block((31, 9, 40), (-48.5, 30, -4))
        slots = [block((8.8, 24, 40), (x, y - 3, 0)) for x, y in KNUCKLES]
        return body.fuse(*forks, post, hinge).cut(gap, *slots).solid()

    def collision(self) -> list[Solid]:
        """The block."""
        return [block((82, 68, 22), (0, 35, 0))]


class Bone(Thing):
    """A bone of a finger: a tongue at its beginning, and at its end a fork for the next bone or a rounded end.

    The origin is on its own axis, which is along -x; y points along the bone, and -z to the palm. Mounts: `knuckle` is its axis, and `next`
    the axis of the next bone. `tip` is the end, and `pad` is near the end on the side of the palm.

    Args:
        length: distance between the axes, or from the axis to the end
        thickness: thickness at its beginning
        taper: thickness at its end, relative to the beginning
        last: whether it is the last bone of the finger
    """

    def __init__(
        self,
        length: Annotated[Length, Range(14, 80)] = 42.0,
        thickness: Annotated[Length, Range(10, 24)] = 16.0,
        taper: Annotated[Ratio, Range(0.6, 1)] = 0.9,
        last: bool = False,
    ):
        super().__init__(material="pla_teal" if last else "pla_white")
        self.radius = thickness / 2
        self.end = taper * thickness / 2
        self.knuckle = MountPoint(curling(0) * MATE)
        self.next = MountPoint(curling(length))
        self.tip = MountPoint(Location(Plane((0, length, 0), x_dir=(1, 0, 0), z_dir=(0, 1, 0))))
        self.pad = MountPoint(Location(Plane((0, length - self.end, -self.end), x_dir=(0, 1, 0), z_dir=(0, 0, -1))))

    def result(self) -> Solid:
        """The bone with bevelled edges."""
        reach = self.p.length - (self.end if self.p.last else 0)
        body = tongued(across(softened(bar(reach, self.radius, self.end, 16.4, -8.2), 2.6 if self.p.last else 1.6)), self.radius)
        return body if self.p.last else forked(body, reach, self.end)

    def collision(self) -> list[Solid]:
        """A box along the bone."""
        length = self.p.length
        return [block((14, length - 4, 2 * self.end), (0, length / 2, 0))]


class Metacarpal(Thing):
    """The first bone of the thumb, which turns on the palm. The origin is on its axis; y points along the bone.

    Mounts: `axis` is along the palm, and `next` is the axis of the next bone.

    Args:
        length: distance between the axes
    """

    def __init__(self, length: Annotated[Length, Range(25, 70)] = 38.0):
        super().__init__(material="pla_white")
        lean = (0, -sin(radians(THUMB)), cos(radians(THUMB)))
        self.axis = MountPoint(Location(Plane((0, 0, 0), x_dir=(1, 0, 0), z_dir=lean)) * MATE)
        self.next = MountPoint(curling(length))

    def result(self) -> Solid:
        """A bar with a fork, and a sleeve around the axis."""
        body = forked(across(softened(bar(self.p.length, 8.5, 8, 17, -8.5), 1.6)), self.p.length, 8)
        lean = (0, -sin(radians(THUMB)), cos(radians(THUMB)))
        start = Plane((0, 4.2 * sin(radians(THUMB)), -4.2 * cos(radians(THUMB))), z_dir=lean)
        sleeve = Solid.make_cylinder(8.5, 8.4, start)
        turn = Location(Plane((0, 0, 0), x_dir=(1, 0, 0), z_dir=lean))
        web = turn * block((14, 24, 8.4), (0, 12, 0))
        room = [turn * block((60, 60, 60), (0, 0, 34.2)), turn * block((26, 24, 24), (0, 0, -16.2))]
        return body.cut(*room).fuse(sleeve, web).solid()

    def collision(self) -> list[Solid]:
        """A box along the bone."""
        return [block((14, self.p.length - 14, 14), (0, self.p.length / 2 + 6, 0))]


