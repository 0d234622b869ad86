"""Small bus servos: ROBOTIS Dynamixel XL330 and Feetech STS3215.

The larger models XL430, XM430 and XM540 are in `thingc_stock.dynamixel`.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from math import pi
from typing import ClassVar

from build123d import Location, Plane, Pos, Solid

from thingc import Actuator, Bolts, MountPoint, Thing
from thingc_stock.dynamixel import servo_drive, velocity_gain
from thingc_stock.fasteners import Hole, Size, threaded_hole
from thingc_stock.servos import KGF_CM, ROTOR
from thingc_stock.shapes import bevelled, block, disc, spots


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """The dimensions of a model [mm], relative to the axis of the shaft at half the depth of the case.

    x is across the case, y along it to the short end, and z along the shaft. `horn` and `idler` contain diameter and thickness, and
    `circle` is the diameter through the centres of the horn's holes.
    """

    width: float
    height: float
    depth: float
    axis_to_top: float
    corner: float
    horn: tuple[float, float]
    idler: tuple[float, float]
    circle: float
    holes: int
    screw: Size
    interface: str


class BusServo(Thing):
    """A servo with a simple case, a horn in front and, for some models, an idler behind, as one rigid part.

    The origin is on the axis at half the depth of the case. The x axis points to the left, y to the top (the short end, next to the shaft),
    and z along the shaft out of the horn.

    Mounts: `rotor` is on the face of the horn. `front`, `back_face`, `left`, `right`, `top` and `bottom` are at the centres of the faces of
    the case, and `idler` is on the face of the idler. `screws_horn` lists the threaded holes of the horn, counted from +x towards +y.

    The solid has no cavities, so thingc scales its inertia to the mass of the model.
    """

    drawing: ClassVar[Drawing]
    actuator: ClassVar[Actuator]

    def __init__(self, color: str):
        super().__init__(material="abs", color=color)
        d = self.drawing
        self.middle = d.axis_to_top - d.height / 2
        self.horn_z = d.depth / 2 + d.horn[1]
        self.idler_z = -d.depth / 2 - d.idler[1]
        half = d.depth / 2
        self.front = MountPoint(Location((0, self.middle, half)))
        self.back_face = MountPoint(Location((0, self.middle, -half), (0, 180, 0)))
        self.left = MountPoint(Location((d.width / 2, self.middle, 0), (0, 90, 0)))
        self.right = MountPoint(Location((-d.width / 2, self.middle, 0), (0, -90, 0)))
        self.top = MountPoint(Location((0, d.axis_to_top, 0), (-90, 0, 0)))
        self.bottom = MountPoint(Location((0, d.axis_to_top - d.height, 0), (90, 0, 0)))
        self.rotor = MountPoint(Location((0, 0, self.horn_z)), [f"{d.interface}-horn", Bolts(d.screw, d.holes, d.circle, depth=d.horn[1])])
        self.idler = MountPoint(Location((0, 0, self.idler_z), (0, 180, 0)), f"{d.interface}-idler")
        self.screws_horn: list[Hole] = [
            threaded_hole(Pos(0, 0, self.horn_z) * spot, d.screw, d.horn[1]) for spot in spots(d.circle, d.holes)
        ]

    @abstractmethod
    def mass(self) -> tuple[float, str]:
        """Return the mass [kg] of the servo model and its source."""

    def case_hull(self, play: float = 0.0) -> Solid:
        """Return the case without horn and idler, `play` [mm] larger on all sides, for subtraction from a bracket."""
        d = self.drawing
        return block((d.width + 2 * play, d.height + 2 * play, d.depth + 2 * play), (0, self.middle, 0), corner=d.corner)

    def result(self) -> Solid:
        """Return the solid of the case, the horn with its holes, and the idler."""
        d = self.drawing
        pieces = [bevelled(d.horn[0], d.horn[1] + 0.5, 0.4, d.depth / 2 - 0.5)]
        if d.idler[1]:
            pieces.append(bevelled(d.idler[0], d.idler[1] + 0.5, 0.3, self.idler_z))
        seam = [  # the groove between case and lid
            block((d.width + 2, d.height + 2, 0.6), (0, self.middle, z)).cut(block((d.width - 0.8, d.height - 0.8, 2), (0, self.middle, z)))
            for z in (0.22 * d.depth, -0.28 * d.depth)
        ]
        holes = [hole(0.0).thread_hull for hole in self.screws_horn]
        return self.case_hull().cut(*seam).fuse(*pieces).cut(*holes, disc(0.14 * d.horn[0], 1.5, self.horn_z - 1.5)).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the case, and one cylinder for horn and idler."""
        d = self.drawing
        case = block((d.width, d.height, d.depth), (0, self.middle, 0))
        return [case, Solid.make_cylinder(d.horn[0] / 2, self.horn_z - self.idler_z, Plane((0, 0, self.idler_z)))]


class XL330(BusServo):
    """ROBOTIS Dynamixel XL330-M288-T.

    The e-Manual (emanual.robotis.com/docs/en/dxl/x/xl330-m288) lists 20 x 34 x 26 mm, 18 g and a gear ratio of 288.4 : 1. At 5 V, the stall
    torque is 0.52 N m, and the no-load speed is 103 rpm. Other dimensions are not from ROBOTIS's drawing, but from a model in
    github.com/wyolum/orbigator, fabricate/dynamixel_motor.scad. The case is 23 mm deep, and the axis is 9.5 mm from the top. The horn has a
    diameter of 16 mm with four holes of 2 mm on a circle of 12 mm.

    The rotor inertia is an estimate, scaled from the XM430 with the fifth power of the width of the case, as for similar motors.
    """

    drawing = Drawing(
        width=20.0, height=34.0, depth=23.0, axis_to_top=9.5, corner=1.5, horn=(16.0, 3.0), idler=(10.0, 0.0),
        circle=12.0, holes=4, screw="M2", interface="xl330",
    )
    actuator = servo_drive(
        stall_torque=0.52, no_load_speed=103.0 * 2.0 * pi / 60.0, gear_ratio=288.4, rotor_inertia=ROTOR * (20.0 / 28.5) ** 5,
    )
    bom = {"make": "buy", "number": "XL330-M288-T", "supplier": "ROBOTIS"}

    def __init__(self, color: str = "#ecebe6"):
        super().__init__(color=color)

    def mass(self) -> tuple[float, str]:
        """Return the mass of 18 g from the e-Manual."""
        return (0.018, "vendor")


class STS3215(BusServo):
    """Feetech STS3215-C018, a bus servo with 30 kgf cm for 12 V.

    The SO-100 and SO-101 robot arms use this servo, also in a version for 7.4 V. Feetech's data are quoted in
    github.com/TheRobotStudio/SO-ARM100 (issue 134) and in a test (robonine.com, "Testing of Feetech STS3215 servomotor"): a gear ratio of
    345 : 1, and 30 kgf cm and 45 rpm at 12 V. The dimensions are from the model used to design the arms, in the same repository
    (STEP/SO100/STS3215_03a.step). The case has 45.4 x 24.8 mm and a depth of 31.8 mm without the rim around the horn. The axis is 10.2 mm
    from the end. The horns have a diameter of 20 mm with four holes of 2.5 mm, for M3, on a circle of 14 mm. The faces are at z = 18.7 mm
    (horn) and z = -17.7 mm (idler).

    The mass (55 g) and the gain (full torque at an error of 5 deg) are estimates. The rotor inertia is scaled from the XM430 with the fifth
    power of the width of the case, as for similar motors.
    """

    drawing = Drawing(
        width=24.8, height=45.4, depth=31.8, axis_to_top=10.2, corner=1.0, horn=(20.0, 2.8), idler=(20.0, 1.8),
        circle=14.0, holes=4, screw="M3", interface="sts3215",
    )
    actuator = Actuator(
        kind="position",
        stall_torque=(30.0 * KGF_CM, "vendor"),
        no_load_speed=(45.0 * 2.0 * pi / 60.0, "vendor"),
        gear_ratio=(345.0, "vendor"),
        rotor_inertia=(ROTOR * (24.8 / 28.5) ** 5, "estimated"),
        kp=(30.0 * KGF_CM / (pi / 36.0), "estimated"),
        kv=(velocity_gain(30.0 * KGF_CM, 45.0 * 2.0 * pi / 60.0), "estimated"),
    )
    bom = {"make": "buy", "number": "STS3215-C018", "supplier": "Feetech"}

    def __init__(self, color: str = "#24262b"):
        super().__init__(color=color)

    def mass(self) -> tuple[float, str]:
        """Return the estimated mass of 55 g."""
        return (0.055, "estimated")
