"""ROBOTIS Dynamixel X servos: XM430-W350, XL430-W250 and XM540-W270.

All servo models share a base class. A servo model consists of a `Drawing` (the dimensions in its published drawing), an actuator and a
mass.

Sources: ROBOTIS e-Manual, pages "XM430-W350", "XL430-W250" and "XM540-W270" (size, mass, gear ratio, stall torque and no-load speed at
12 V, control table), and the drawings that can be downloaded there, X-430 (XM430-W350, horn HN12-N101, idler HN12-I101) and X-540
(XM540-W270, horn HN13-N101, idler HN13-I101).
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import Annotated, ClassVar

from build123d import Face, Location, Plane, Pos, Solid, Wire

from thingc import Actuator, Bolts, Boss, Length, MountPoint, Range, Thing
from thingc_stock.fasteners import Hole, Size, threaded_hole

Positive = Annotated[Length, Range(minimum=0.1)]

FLIP = Location((0, 0, 0), (0, 180, 0))
"""A rotation by 180 deg about y, for mounts and holes on the back of a servo."""


Points = tuple[tuple[float, float], ...]
"""Positions in the frame of a mount [mm]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """The dimensions of a model [mm], relative to the output axis at half the depth (`middle`).

    x is to the left, y to the top (the short end, next to the output), and z to the front (the horn). A field `circle` is the diameter of
    the circle through the centres of the holes.
    """

    axis_to_top: float
    axis_to_bottom: float
    corner: float
    horn_thickness: float
    boss_height: float
    tip_diameter: float
    tip_height: float
    idler_thickness: float
    horn_circle: float
    horn_holes: int
    horn_screw: Size
    body_screw: Size
    body_hole_depth: float
    side_to_axis: float
    side_span_y: float
    side_span_z: float
    front_to_axis: float
    front_span: float
    top_to_middle: float
    top_span: float
    bottom_span_x: float
    bottom_span_z: float
    interface: str

    @property
    def bottom_bolts(self) -> Points:
        """The positions of the holes in the bottom, in the frame of the mount `bottom`."""
        return rectangle(self.bottom_span_x, self.bottom_span_z)

    @property
    def top_bolts(self) -> Points:
        """The positions of the holes in the top, in the frame of the mount `top`."""
        return tuple((s * self.top_span / 2, -self.top_to_middle) for s in (1, -1))

    def side_bolts(self, middle: float) -> Points:
        """The positions of the holes in the left and right faces, in the frames of their mounts, whose centre is at y = `middle`."""
        y = -self.side_to_axis - self.side_span_y / 2 - middle
        return tuple((u, y + v) for u, v in rectangle(self.side_span_z, self.side_span_y))

    def front_bolts(self, middle: float) -> Points:
        """The positions of the holes in the front, in the frame of the mount `front`, whose centre is at y = `middle`."""
        return tuple((s * self.front_span / 2, -self.front_to_axis - middle) for s in (1, -1))

    def body_bolts(self, at: Points) -> Bolts:
        """The threaded holes of the case at these positions."""
        return Bolts(self.body_screw, at=at, depth=self.body_hole_depth)

    def horn_bolts(self, depth: float | None = None) -> Bolts:
        """The holes of the horn and the idler with this depth, or clearance holes for their screws."""
        return Bolts(self.horn_screw, self.horn_holes, self.horn_circle, depth=depth)


def rectangle(x: float, y: float) -> Points:
    """Return the corners of a rectangle around the origin."""
    return tuple((s * x / 2, t * y / 2) for s in (1, -1) for t in (1, -1))


def mated(at: Points) -> Points:
    """Return positions of holes in the frame of a mount that is mated with theirs, in which x and y are swapped and negated."""
    return tuple((-y, -x) for x, y in at)


def position_gain(stall_torque: float) -> float:
    """Return the stiffness [N m/rad] of the position controller at the output, with default gains, for the stall torque [N m].

    The source is the control table in the e-Manual. The position P gain is 800, which gives 800/128 duty counts per encoder step, at 4096
    steps per turn. Full duty is 885 counts, which give the stall torque at standstill. The default I and D gains are 0.
    """
    return 800.0 / 128.0 * 4096.0 / (2.0 * pi) / 885.0 * stall_torque


def velocity_gain(stall_torque: float, no_load_speed: float) -> float:
    """Return the damping [N m s/rad] due to back-EMF, for a motor with this stall torque [N m] and no-load speed [rad/s].

    At full duty the torque falls from the stall torque to 0 at the no-load speed.
    """
    return stall_torque / no_load_speed


def servo_drive(stall_torque: float, no_load_speed: float, gear_ratio: float, rotor_inertia: float) -> Actuator:
    """Return a position drive whose gains follow from published data: stall torque [N m], no-load speed [rad/s] and gear ratio.

    The rotor inertia at the motor [kg m^2] is an estimate.
    """
    return Actuator(
        kind="position",
        stall_torque=(stall_torque, "vendor"),
        no_load_speed=(no_load_speed, "vendor"),
        gear_ratio=(gear_ratio, "vendor"),
        rotor_inertia=(rotor_inertia, "estimated"),
        kp=(position_gain(stall_torque), "estimated"),
        kv=(velocity_gain(stall_torque, no_load_speed), "estimated"),
    )


class XSeries(Thing):
    """A Dynamixel X servo: case, horn and idler as one rigid part with all its screw holes.

    The origin is on the output axis at half the depth of the case. The x axis points to the left, y to the top (the short end, next to the
    output), and z out of the horn. Attach the driven part to the mount `rotor`.

    Mounts: Each of the six faces of the case has a mount at its centre. `horn` and `idler` are on the outer faces of the horn and the
    idler. `rotor` is another name of the mount `horn`, for use in joints.

    Every screw hole has a name. For example, `screw_left_top_front(thickness)` returns the `Screw` in the hole of this name, with its head
    on a plate of the given thickness. `screws_left`, `screws_right`, `screws_front`, `screws_top`, `screws_bottom`, `screws_horn` and
    `screws_idler` list the holes of a face. The lists `screws_horn` and `screws_idler` count the holes from +x towards +y.

    The solid has no cavities, so thingc scales its inertia to the manufacturer's mass.

    The dimensions of a servo model are constant. To subtract a servo from a part, use `XM430().adjust(width__add=0.2)`, which returns the
    same servo with clearance.

    Args:
        width: width of the case, along x
        height: height of the case, along y; a change is distributed evenly to both ends
        depth: depth of the case, along z, without horn and idler
        horn_diameter: diameter of the horn and of the idler
        boss_diameter: diameter of the boss in the middle of the horn
        idler: whether the idler is mounted on the back
    """

    drawing: ClassVar[Drawing]

    def __init__(
        self, width: Positive, height: Positive, depth: Positive, horn_diameter: Positive, boss_diameter: Positive, idler: bool,
    ):
        super().__init__(material="aluminium", color="#2b2b2e")
        d = self.drawing
        assert boss_diameter < d.horn_circle < horn_diameter, (
            f"the holes of the horn are on a circle of {d.horn_circle:g} mm, which must lie between the boss "
            f"({boss_diameter:g} mm) and the rim ({horn_diameter:g} mm)"
        )
        top = d.axis_to_top + (height - d.axis_to_top - d.axis_to_bottom) / 2
        bottom = top - height
        middle = (top + bottom) / 2
        front = depth / 2
        side = width / 2
        self.horn_z = front + d.horn_thickness
        self.idler_z = -front - (d.idler_thickness if idler else 0.0)

        self.front = MountPoint(Location((0, middle, front)), interface=d.body_bolts(d.front_bolts(middle)))
        self.back = MountPoint(Location((0, middle, -front), (0, 180, 0)))
        self.left = MountPoint(Location((side, middle, 0), (0, 90, 0)), interface=d.body_bolts(d.side_bolts(middle)))
        self.right = MountPoint(Location((-side, middle, 0), (0, -90, 0)), interface=d.body_bolts(d.side_bolts(middle)))
        self.top = MountPoint(Location((0, top, 0), (-90, 0, 0)), interface=d.body_bolts(d.top_bolts))
        self.bottom = MountPoint(Location((0, bottom, 0), (90, 0, 0)), interface=d.body_bolts(d.bottom_bolts))
        horn = [f"{d.interface}-horn", d.horn_bolts(d.horn_thickness), Boss(boss_diameter, length=d.boss_height)]
        self.rotor = MountPoint(Location((0, 0, self.horn_z)), interface=horn)
        self.horn = MountPoint(Location((0, 0, self.horn_z)), interface=horn)
        behind = [f"{d.interface}-idler", *([d.horn_bolts(d.idler_thickness)] if idler else [])]
        self.idler = MountPoint(Location((0, 0, self.idler_z), (0, 180, 0)), interface=behind)

        near, far = -d.side_to_axis, -d.side_to_axis - d.side_span_y
        along = d.side_span_z / 2
        self.screw_left_top_front = self._body_hole((side, near, along), (0, 90, 0))
        self.screw_left_top_rear = self._body_hole((side, near, -along), (0, 90, 0))
        self.screw_left_bottom_front = self._body_hole((side, far, along), (0, 90, 0))
        self.screw_left_bottom_rear = self._body_hole((side, far, -along), (0, 90, 0))
        self.screw_right_top_front = self._body_hole((-side, near, along), (0, -90, 0))
        self.screw_right_top_rear = self._body_hole((-side, near, -along), (0, -90, 0))
        self.screw_right_bottom_front = self._body_hole((-side, far, along), (0, -90, 0))
        self.screw_right_bottom_rear = self._body_hole((-side, far, -along), (0, -90, 0))
        self.screw_front_left = self._body_hole((d.front_span / 2, -d.front_to_axis, front), (0, 0, 0))
        self.screw_front_right = self._body_hole((-d.front_span / 2, -d.front_to_axis, front), (0, 0, 0))
        self.screw_top_left = self._body_hole((d.top_span / 2, top, d.top_to_middle), (-90, 0, 0))
        self.screw_top_right = self._body_hole((-d.top_span / 2, top, d.top_to_middle), (-90, 0, 0))
        across, along = d.bottom_span_x / 2, d.bottom_span_z / 2
        self.screw_bottom_left_front = self._body_hole((across, bottom, along), (90, 0, 0))
        self.screw_bottom_left_rear = self._body_hole((across, bottom, -along), (90, 0, 0))
        self.screw_bottom_right_front = self._body_hole((-across, bottom, along), (90, 0, 0))
        self.screw_bottom_right_rear = self._body_hole((-across, bottom, -along), (90, 0, 0))

        self.screws_left = [
            self.screw_left_top_front, self.screw_left_top_rear, self.screw_left_bottom_front, self.screw_left_bottom_rear,
        ]
        self.screws_right = [
            self.screw_right_top_front, self.screw_right_top_rear, self.screw_right_bottom_front, self.screw_right_bottom_rear,
        ]
        self.screws_front = [self.screw_front_left, self.screw_front_right]
        self.screws_top = [self.screw_top_left, self.screw_top_right]
        self.screws_bottom = [
            self.screw_bottom_left_front, self.screw_bottom_left_rear,
            self.screw_bottom_right_front, self.screw_bottom_right_rear,
        ]

    @cached_property
    def screws_horn(self) -> list[Hole]:
        """Return the holes of the horn, counted from +x towards +y."""
        d = self.drawing
        spots = [Pos(0, 0, self.horn_z) * spot for spot in _circle(d.horn_circle, d.horn_holes)]
        return [threaded_hole(spot, d.horn_screw, d.horn_thickness) for spot in spots]

    @cached_property
    def screws_idler(self) -> list[Hole]:
        """Return the holes of the idler, counted from +x towards +y, or an empty list for a servo without an idler."""
        d = self.drawing
        spots = [Pos(0, 0, self.idler_z) * spot * FLIP for spot in _circle(d.horn_circle, d.horn_holes) if self.p.idler]
        return [threaded_hole(spot, d.horn_screw, d.idler_thickness) for spot in spots]

    @abstractmethod
    def mass(self) -> tuple[float, str]:
        """Return the manufacturer's mass [kg] and its source, defined by each servo model."""

    def case_hull(self) -> Solid:
        """Return the case without holes, horn and idler."""
        x, c = self.p.width / 2, self.drawing.corner
        top, bottom, z = self.top.location.position.Y, self.bottom.location.position.Y, -self.p.depth / 2
        outline = [
            (x, bottom + c), (x, top - c), (x - c, top), (c - x, top),
            (-x, top - c), (-x, bottom + c), (c - x, bottom), (x - c, bottom),
        ]
        return Solid.extrude(Face(Wire.make_polygon([(u, v, z) for u, v in outline])), (0, 0, self.p.depth))

    def boss_hull(self, height: float) -> Solid:
        """Return a cylinder for the boss on the horn that ends `height` [mm] above the horn's face, for subtraction from a part."""
        return Solid.make_cylinder(self.p.boss_diameter / 2, height, Plane((0, 0, self.horn_z)))

    def idler_hull(self, height: float) -> Solid:
        """Return a cylinder for the idler that ends `height` [mm] behind the back of the case, for subtraction from a part."""
        return Solid.make_cylinder(self.p.horn_diameter / 2, height, Plane((0, 0, -self.p.depth / 2 - height)))

    def result(self) -> Solid:
        """Return the solid of the case, horn and idler, with holes of the outer diameter of the threads."""
        d = self.drawing
        rim = Solid.make_cylinder(self.p.horn_diameter / 2, self.horn_z - self.idler_z, Plane((0, 0, self.idler_z)))
        boss = self.boss_hull(d.boss_height)
        tip = Solid.make_cylinder(d.tip_diameter / 2, d.tip_height, Plane((0, 0, self.horn_z)))
        sides = [*self.screws_left, *self.screws_right, *self.screws_front, *self.screws_top, *self.screws_bottom]
        holes = [hole(0.0).thread_hull for hole in (*sides, *self.screws_horn, *self.screws_idler)]
        return self.case_hull().fuse(rim, boss, tip).cut(*holes).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the case, one cylinder for horn and idler, and the boss."""
        rim = Solid.make_cylinder(self.p.horn_diameter / 2, self.horn_z - self.idler_z, Plane((0, 0, self.idler_z)))
        return [self.case_hull(), rim, self.boss_hull(self.drawing.tip_height)]

    def _body_hole(self, position: tuple[float, float, float], rotation: tuple[float, float, float]) -> Hole:
        return threaded_hole(Location(position, rotation), self.drawing.body_screw, self.drawing.body_hole_depth)


class XM430(XSeries):
    """ROBOTIS Dynamixel XM430-W350 with horn HN12-N101 and idler HN12-I101.

    The e-Manual (emanual.robotis.com/docs/en/dxl/x/xm430-w350) lists 28.5 x 46.5 x 34 mm, 82 g and a gear ratio of 353.5 : 1. At 12 V, the
    stall torque is 4.1 N m, and the no-load speed is 46 rpm. According to the drawing X-430, horn and idler have a diameter of 19.5 mm with
    8 x M2 on a circle of 16 mm.

    The rotor inertia is 0.045 kg m^2 at the output. Haarnoja et al. identified this inertia on an XM430 with a known load ("Learning agile
    soccer skills for a bipedal robot with deep reinforcement learning", Science Robotics 9, 2024), and MuJoCo Menagerie's `robotis_op3`
    uses it. Haarnoja et al. also identified kp = 21.1 N m/rad and a damping of 1.084 N m s/rad. This module computes kp = 18.9 N m/rad and
    a damping of 0.85 N m s/rad from the data sheet at 12 V.

    Args:
        idler: whether the idler is mounted on the back
    """

    drawing = Drawing(
        axis_to_top=11.25, axis_to_bottom=35.25, corner=2.0,
        horn_thickness=2.0, boss_height=2.0, tip_diameter=4.3, tip_height=2.5, idler_thickness=2.0,
        horn_circle=16.0, horn_holes=8, horn_screw="M2",
        body_screw="M2.5", body_hole_depth=3.0,
        side_to_axis=4.0, side_span_y=24.0, side_span_z=12.0,
        front_to_axis=8.0, front_span=22.0, top_to_middle=6.0, top_span=16.0, bottom_span_x=16.0, bottom_span_z=12.0,
        interface="x430",
    )
    actuator = servo_drive(
        stall_torque=4.1, no_load_speed=46.0 * 2.0 * pi / 60.0, gear_ratio=353.5, rotor_inertia=0.045 / 353.5**2,
    )
    bom = {"make": "buy", "number": "XM430-W350", "supplier": "ROBOTIS"}

    def __init__(self, idler: bool = True):
        super().__init__(width=28.5, height=46.5, depth=34.0, horn_diameter=19.5, boss_diameter=8.0, idler=idler)

    def mass(self) -> tuple[float, str]:
        """Return the mass of 82 g from the e-Manual."""
        return (0.082, "vendor")


class XL430(XSeries):
    """ROBOTIS Dynamixel XL430-W250-T with a plastic case, a horn and an idler.

    The e-Manual (emanual.robotis.com/docs/en/dxl/x/xl430-w250; read in github.com/ROBOTIS-GIT/emanual, _data/dxl_x_info.yml) lists 28.5 x
    46.5 x 34 mm, 57.2 g and a gear ratio of 258.5 : 1. At 12 V, the stall torque is 1.5 N m, and the no-load speed is 61 rpm. The e-Manual
    lists the same size as for the XM430-W350, so holes and horns are copied from the XM430-W350 instead of a drawing of the XL430-W250. The
    rotor inertia is an estimate: it is copied from the XM430-W350, which has the same width.

    Args:
        idler: whether the idler is mounted on the back
    """

    drawing = XM430.drawing
    actuator = servo_drive(
        stall_torque=1.5, no_load_speed=61.0 * 2.0 * pi / 60.0, gear_ratio=258.5, rotor_inertia=0.045 / 353.5**2,
    )
    bom = {"make": "buy", "number": "XL430-W250-T", "supplier": "ROBOTIS"}

    def __init__(self, idler: bool = True):
        super().__init__(width=28.5, height=46.5, depth=34.0, horn_diameter=19.5, boss_diameter=8.0, idler=idler)

    def mass(self) -> tuple[float, str]:
        """Return the mass of 57.2 g from the e-Manual."""
        return (0.0572, "vendor")


class XM540(XSeries):
    """ROBOTIS Dynamixel XM540-W270 with horn HN13-N101 and idler HN13-I101.

    The e-Manual (emanual.robotis.com/docs/en/dxl/x/xm540-w270) lists 33.5 x 58.5 x 44 mm, 165 g and a gear ratio of 272.5 : 1. At 12 V, the
    stall torque is 10.6 N m, and the no-load speed is 30 rpm. According to the drawing X-540, horn and idler have a diameter of 26 mm with
    8 x M2.5 on a circle of 22 mm.

    The rotor inertia is an estimate, scaled from the XM430-W350 with the fifth power of the width of the case, as for similar motors.

    Args:
        idler: whether the idler is mounted on the back
    """

    drawing = Drawing(
        axis_to_top=13.75, axis_to_bottom=44.75, corner=2.0,
        horn_thickness=2.6, boss_height=2.3, tip_diameter=5.3, tip_height=3.0, idler_thickness=2.5,
        horn_circle=22.0, horn_holes=8, horn_screw="M2.5",
        body_screw="M2.5", body_hole_depth=4.0,
        side_to_axis=6.0, side_span_y=32.0, side_span_z=16.0,
        front_to_axis=10.5, front_span=27.0, top_to_middle=8.0, top_span=20.0, bottom_span_x=20.0, bottom_span_z=16.0,
        interface="x540",
    )
    actuator = servo_drive(
        stall_torque=10.6, no_load_speed=30.0 * 2.0 * pi / 60.0, gear_ratio=272.5,
        rotor_inertia=0.045 / 353.5**2 * (33.5 / 28.5) ** 5,
    )
    bom = {"make": "buy", "number": "XM540-W270", "supplier": "ROBOTIS"}

    def __init__(self, idler: bool = True):
        super().__init__(width=33.5, height=58.5, depth=44.0, horn_diameter=26.0, boss_diameter=10.0, idler=idler)

    def mass(self) -> tuple[float, str]:
        """Return the mass of 165 g from the e-Manual."""
        return (0.165, "vendor")


def _circle(diameter: float, count: int) -> list[Location]:
    """Return `count` evenly spaced positions on a circle, starting at +x and continuing towards +y."""
    return [Location((0, 0, 0), (0, 0, 360.0 * k / count)) * Pos(diameter / 2, 0, 0) for k in range(count)]
