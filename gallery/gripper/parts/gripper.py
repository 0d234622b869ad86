"""Parts of the gripper: a base on a robot's flange, two geared cranks, two followers, and two fingers with pads. All lengths are in mm."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Annotated, Literal

from build123d import Location, Plane, Solid

from thingc import MATE, Length, MountPoint, Range, Thing
from thingc_stock.bus_servos import STS3215
from thingc_stock.shapes import bar, bevelled, block, disc, prism, softened

PITCH = 11.5
"""Pitch radius of the gears, which is half the distance of the cranks."""

FOLLOWER = (-19.0, -7.0)
"""Offset from the axis of the left crank to the axis of its follower, on the base and on the finger."""

LENGTH = 42.0
"""Distance between the axes of cranks and followers."""

LAYER = 5.0
"""Thickness of cranks and followers, which are 0.5 mm above the base."""

PLATE = STS3215.drawing.horn[1]
"""Thickness of the base, which is flush with the horn of the servo."""


class Base(Thing):
    """The plate with the servo below it and a flange behind.

    The origin is on the plate between the cranks; y points to the fingers, and z out of the plate. Mounts: `servo_seat` is the underside.
    `right_crank`, `left_follower` and `right_follower` are the pivots. `flange` is behind, with the bolt circle of ISO 9409-1-50-4-M6.
    """

    def __init__(self) -> None:
        super().__init__(material="pla_blue")
        self.axis_z = -18.0
        back = STS3215.drawing.axis_to_top - STS3215.drawing.height / 2
        self.servo_seat = MountPoint(Location((-PITCH, back, -PLATE)) * MATE, "sts3215-front")
        self.right_crank = MountPoint(Location((PITCH, 0, 0)))
        self.left_follower = MountPoint(Location((FOLLOWER[0] - PITCH, FOLLOWER[1], 0)))
        self.right_follower = MountPoint(Location((PITCH - FOLLOWER[0], FOLLOWER[1], 0)))
        self.flange = MountPoint(Location(Plane((0, -52, self.axis_z), x_dir=(1, 0, 0), z_dir=(0, -1, 0))), "iso-9409-50")
        self.bolt = [
            MountPoint(Location(Plane((25 * cos(a), -46, self.axis_z + 25 * sin(a)), z_dir=(0, 1, 0))), "m6-head")
            for a in (pi / 4, 3 * pi / 4, 5 * pi / 4, 7 * pi / 4)
        ]

    def result(self) -> Solid:
        """The plate, the flange, and two ribs between them."""
        wide = PITCH - FOLLOWER[0] + 8
        outline = [(wide, -13), (wide, 1), (PITCH + 6, 14), (-PITCH - 6, 14), (-wide, 1), (-wide, -13), (-25, -46), (25, -46)]
        plate = softened(prism(outline, -PLATE, PLATE), 0.6)
        flange = Location(Plane((0, -52, self.axis_z), x_dir=(1, 0, 0), z_dir=(0, 1, 0))) * bevelled(63, 7, 1)
        rib = prism([(-46, self.axis_z - 4), (-46, -1), (-16, -1)], -2, 4)
        ribs = [Location(Plane((x, 0, 0), x_dir=(0, 1, 0), z_dir=(1, 0, 0))) * rib for x in (16, -27)]
        holes = [disc(STS3215.drawing.horn[0] + 1, 10, -5, -PITCH), disc(4, 10, -5, PITCH)]
        holes += [disc(4, 10, -5, x * (PITCH - FOLLOWER[0]), FOLLOWER[1]) for x in (1, -1)]
        bolts = [Solid.make_cylinder(3.3, 20, Plane(m.location.position - (0, 10, 0), z_dir=(0, 1, 0))) for m in self.bolt]
        return plate.fuse(flange, *ribs).cut(*holes, *bolts).solid()

    def collision(self) -> list[Solid]:
        """The flange and the plate."""
        flange = Solid.make_cylinder(31.5, 7, Plane((0, -52, self.axis_z), z_dir=(0, 1, 0)))
        return [flange, block((60, 60, PLATE), (0, -16, -PLATE / 2))]


class Crank(Thing):
    """A crank with a gear about its axis. The origin is on the axis, on the supporting part; y points along the crank.

    Mounts: `axis` is the underside at the axis, `tip` the upper side at the other end, and `screw` the upper side at the axis.

    Args:
        gear: whether the gear has a `tooth` or a `gap` at the contact with the other crank
    """

    def __init__(self, gear: Literal["tooth", "gap"] = "tooth"):
        super().__init__(material="pla_orange")
        self.axis = MountPoint(MATE)
        self.tip = MountPoint(Location((0, LENGTH, LAYER)))
        self.screw = MountPoint(Location((0, 0, LAYER)), "m3-head")

    def result(self) -> Solid:
        """A bar and a gear with 23 straight teeth of module 1."""
        teeth, half = 23, pi / 23 / 2
        start = 0.0 if self.p.gear == "tooth" else 2 * half
        outline = []
        for k in range(teeth):
            a = start + 4 * half * k
            outline += [(r * cos(a + t * half), r * sin(a + t * half)) for r, t in ((PITCH - 1.2, -1.45), (PITCH + 0.9, -0.45),
                                                                                (PITCH + 0.9, 0.45), (PITCH - 1.2, 1.45))]
        gear = prism(outline, 0.5, LAYER - 0.5)
        body = softened(bar(LENGTH, 8, 6, LAYER - 0.5, 0.5), 0.7)
        return body.fuse(gear).cut(disc(3.2, 20, -5), disc(3.2, 20, -5, y=LENGTH)).solid()

    def collision(self) -> list[Solid]:
        """The bar."""
        return [block((12, LENGTH, LAYER - 0.5), (0, LENGTH / 2, LAYER / 2))]


class Follower(Thing):
    """The other side of the parallelogram: a bar without a gear. Origin and mounts are as for `Crank`."""

    def __init__(self) -> None:
        super().__init__(material="pla_orange")
        self.axis = MountPoint(MATE)
        self.tip = MountPoint(Location((0, LENGTH, LAYER)))
        self.screw = MountPoint(Location((0, 0, LAYER)), "m3-head")

    def result(self) -> Solid:
        """A slim bar."""
        body = softened(bar(LENGTH, 5.5, 5.5, LAYER - 0.5, 0.5), 0.7)
        return body.cut(disc(3.2, 20, -5), disc(3.2, 20, -5, y=LENGTH)).solid()

    def collision(self) -> list[Solid]:
        """The bar."""
        return [block((9, LENGTH, LAYER - 0.5), (0, LENGTH / 2, LAYER / 2))]


class Finger(Thing):
    """The left finger, on top of its crank and follower. The origin is on the tip of the crank; y points forwards, and x inwards.

    Mounts: `crank` and `follower` are on the underside. `pad` is for the pad, with z inwards. `screw_0` and `screw_1` are for its screws.

    Args:
        reach: distance from the tip of the crank to the middle of the pad
    """

    def __init__(self, reach: Annotated[Length, Range(40, 90)] = 52.0):
        super().__init__(material="pla_white")
        self.inside = PITCH - 4.4
        self.crank = MountPoint(MATE)
        self.follower = MountPoint(Location((*FOLLOWER, 0)) * MATE)
        self.pad = MountPoint(Location(Plane((self.inside, reach, -0.5), x_dir=(0, 1, 0), z_dir=(1, 0, 0))))
        self.screw = [MountPoint(Location((0, 0, 7)), "m3-head"), MountPoint(Location((*FOLLOWER, 7)), "m3-head")]

    def result(self) -> Solid:
        """A plate over both pivots that becomes narrower to the front, and a wall for the pad."""
        reach, x = self.p.reach, self.inside
        outline = [
            (-26, -9), (-22, -13.5), (-15, -13.5), (3, -7), (7, -1), (x - 1, 22), (x, 30), (x, reach + 19), (x - 5, reach + 21),
            (x - 8, reach + 16), (-8, 26), (-13, 10), (-24, -1),
        ]
        plate = softened(prism(outline, 0.5, 6.5), 0.9)
        wall = prism([(x, 30), (x, reach + 19), (x - 4, reach + 20), (x - 6, reach + 16), (x - 5, 32)], -10, 14)
        holes = [disc(3.2, 20, -5), disc(3.2, 20, -5, *FOLLOWER)]
        return plate.fuse(wall).cut(*holes).solid()

    def collision(self) -> list[Solid]:
        """The wall, and the plate in front of the pivots."""
        reach, x = self.p.reach, self.inside
        return [block((6, reach - 10, 17), (x - 3, (reach + 50) / 2, -1.5)), block((26, 34, 6.5), (-6, 4, 3.75))]


class Pad(Thing):
    """A pad with ridges. The origin is in the middle of its back; z points inwards. Its mounts are `back` and `face`."""

    def __init__(self, length: Annotated[Length, Range(15, 60)] = 32.0, width: Annotated[Length, Range(8, 30)] = 15.0):
        super().__init__(material="tpu")
        self.back = MountPoint(MATE)
        self.face = MountPoint(Location((0, 0, 4)))

    def result(self) -> Solid:
        """A block with seven transverse grooves."""
        length, width = self.p.length, self.p.width
        grooves = [block((1.2, 2 * width, 1.6), (k * length / 8, 0, 4)) for k in range(-3, 4)]
        return softened(block((length, width, 4), (0, 0, 2), corner=1.5), 0.6).cut(*grooves).solid()

    def collision(self) -> list[Solid]:
        """The block."""
        return [block((self.p.length, self.p.width, 4), (0, 0, 2))]


