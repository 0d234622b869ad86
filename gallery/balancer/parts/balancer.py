"""Parts of the balancer: three decks on posts, brackets for the motors, and a face. All lengths are in mm."""

from __future__ import annotations

from math import cos, radians, sin
from typing import Annotated

from build123d import Location, Plane, Solid

from thingc import MATE, Length, MountPoint, Range, Thing
from thingc_stock.motors import FLANGE, HOLES, PILOT
from thingc_stock.shapes import bevelled, block, disc, prism, softened

POSTS = ((42.0, 46.0), (-42.0, 46.0), (-42.0, -46.0), (42.0, -46.0))
"""Positions of the posts (x, y)."""

AXLE = FLANGE / 2 + 4.0
"""Distance from the underside of the lowest deck down to the axle."""

TRACK = 55.0
"""Distance from the middle to the flange of a motor."""


class Deck(Thing):
    """A plywood plate. The origin is in the middle of its underside; x points forwards, and z up.

    Mounts: `post_0`, `post_1` ... are on the upper side. `below_0`, `below_1` ... are for the posts below. `bracket_0` (left) and
    `bracket_1` are on the underside. `top` and `bottom` are the faces, and `front` is the upper front edge.
    """

    def __init__(self, thickness: Annotated[Length, Range(3, 12)] = 5.0):
        super().__init__(material="plywood")
        self.post = [MountPoint(Location((x, y, thickness))) for x, y in POSTS]
        self.below = [MountPoint(Location((x, y, 0)) * MATE) for x, y in POSTS]
        self.bracket = [
            MountPoint(Location(Plane((0, side * TRACK, 0), x_dir=(0, -side, 0), z_dir=(0, 0, -1)))) for side in (1, -1)
        ]
        self.top = MountPoint(Location((0, 0, thickness)))
        self.bottom = MountPoint(MATE)
        self.front = MountPoint(Location((50, 0, thickness)))

    def result(self) -> Solid:
        """A plate with cut corners, a window, and the holes for the posts."""
        t = self.p.thickness
        plate = softened(block((108, 122, t), (0, 0, t / 2), corner=14), 0.6)
        window = block((34, 52, 3 * t), corner=8)
        return plate.cut(window, *(disc(3.2, 3 * t, -t, x, y) for x, y in POSTS)).solid()

    def collision(self) -> list[Solid]:
        """The plate as a box."""
        t = self.p.thickness
        return [block((108, 122, t), (0, 0, t / 2))]


class Post(Thing):
    """A hexagonal standoff. Its mounts are `foot` and `head`.

    Args:
        length: length of the post
    """

    bom = {"make": "buy"}

    def __init__(self, length: Annotated[Length, Range(8, 150)] = 48.0):
        super().__init__(material="brass")
        self.foot = MountPoint(MATE)
        self.head = MountPoint(Location((0, 0, length)))

    def result(self) -> Solid:
        """A hexagonal prism with 5.5 mm across flats."""
        r = 5.5 / 2 / cos(radians(30))
        return prism([(r * cos(radians(60 * k)), r * sin(radians(60 * k))) for k in range(6)], 0, self.p.length)

    def collision(self) -> list[Solid]:
        """The enclosing cylinder."""
        return [disc(6.3, self.p.length)]


class Bracket(Thing):
    """An aluminium angle bracket for a NEMA 17. The origin is on top; the motor is below it, with its shaft along y.

    Mounts: `top` is the face on the deck, and `motor` is the inner face of the vertical side.
    """

    bom = {"make": "buy"}

    def __init__(self) -> None:
        super().__init__(material="aluminium")
        self.top = MountPoint(Location((0, 0, 0)))
        self.motor = MountPoint(Location(Plane((0, 0, -AXLE), x_dir=(1, 0, 0), z_dir=(0, -1, 0))), "nema17")

    def result(self) -> Solid:
        """Two plates of 3 mm, with the holes for the flange of the motor."""
        lying = block((46, 45, 3), (0, -19.5, -1.5), corner=2)
        standing = block((46, 3, AXLE + FLANGE / 2 + 1), (0, 1.5, -(AXLE + FLANGE / 2 + 1) / 2))
        spots = [(0, 0, PILOT + 0.5), *((x * HOLES / 2, z * HOLES / 2, 3.2) for x in (1, -1) for z in (1, -1))]
        holes = [Solid.make_cylinder(d / 2, 20, Plane((x, -10, z - AXLE), z_dir=(0, 1, 0))) for x, z, d in spots]
        return lying.fuse(standing).cut(*holes).solid()

    def collision(self) -> list[Solid]:
        """The vertical plate."""
        return [block((46, 3, AXLE + FLANGE / 2), (0, 1.5, -(AXLE + FLANGE / 2) / 2))]


class Face(Thing):
    """A face: a plate between two decks with eyes and a smile. The origin is in the middle of its lower rear edge; x points forwards.

    Mounts: `foot` is the lower face, and `gaze` is between the eyes.

    Args:
        height: distance between the decks
    """

    def __init__(self, height: Annotated[Length, Range(30, 120)] = 60.0):
        super().__init__(material="pla_white")
        self.foot = MountPoint(MATE)
        self.gaze = MountPoint(Location(Plane((4, 0, 0.62 * height), x_dir=(0, -1, 0), z_dir=(1, 0, 0))))

    def result(self) -> Solid:
        """A plate with two rings around the eyes, and a slot in the shape of a smile."""
        h = self.p.height
        upright = Plane((0, 0, 0), x_dir=(0, 1, 0), z_dir=(1, 0, 0))
        plate = softened(block((86, h, 4), (0, h / 2, 2), corner=8), 0.8)
        eyes = [(x, 0.62 * h) for x in (20, -20)]
        rings = [bevelled(25, 7, 1.5, 0).translate((x, y, 0)) for x, y in eyes]
        pupils = [disc(16, 30, -10, x, y) for x, y in eyes]
        smile = disc(52, 30, -10, 0, 0.56 * h).cut(disc(46, 40, -15, 0, 0.56 * h), block((60, 60, 60), (0, 0.30 * h + 30, 0)))
        return (Location(upright) * plate.fuse(*rings).cut(*pupils, smile)).solid()

    def collision(self) -> list[Solid]:
        """The plate."""
        return [block((7, 86, self.p.height), (3.5, 0, self.p.height / 2))]
