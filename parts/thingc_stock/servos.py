"""Hobby servos with a splined shaft from four manufacturers, and round horns for these servos.

All servo models have the same base class. A servo model consists of a `Drawing`, an actuator and a mass, and its docstring cites the
sources. A mass or torque without a published value has `estimated` as its source. For all servo models, the gains, the rotor inertia, the
gear ratio, and the heights of the case relative to the ears are estimates.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from math import radians
from typing import Annotated, ClassVar

from build123d import Location, Plane, Pos, Solid

from thingc import MATE, Actuator, Length, MountPoint, Range, Thing
from thingc_stock.fasteners import Hole, Size, threaded_hole
from thingc_stock.shapes import bevelled, block, disc, spots

KGF_CM = 0.0980665
"""The value of one kilogram-force centimetre in N m. Data sheets state torques in this unit."""

ROTOR = 0.045 / 353.5**2
"""Rotor inertia [kg m^2] of a servo with a width of 28.5 mm, as identified for the Dynamixel XM430 (see `thingc_stock.dynamixel`)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """The dimensions of a model [mm], relative to the axis of the shaft and the underside of the ears, which is on the frame.

    z is along the shaft, and y along the case towards the short end. `below` and `above` are the heights of the case below and above the
    underside of the ears. `lid` is the additional height of the round lid around the shaft. `spline` contains the diameter of the shaft and
    its height above the lid.
    """

    width: float
    length: float
    axis_to_end: float
    below: float
    above: float
    lid: float
    spline: tuple[float, float]
    ears: float
    ear: float
    holes: tuple[float, float]
    hole: float
    interface: str


def hobby_drive(torque: float, seconds: float, width: float, source: str = "vendor") -> Actuator:
    """Return a position drive for this stall torque [kgf cm] and this time for 60 deg without load [s], which are from `source`.

    All other values are estimates. The gain gives full torque at an error of 6 deg. The damping is that of a DC motor whose torque falls
    from the stall torque to 0 at the no-load speed. The rotor inertia is scaled with the fifth power of the case's `width` [mm]. The gear
    ratio is 250 : 1.
    """
    stall, speed = torque * KGF_CM, radians(60.0) / seconds
    return Actuator(
        kind="position",
        stall_torque=(stall, source),
        no_load_speed=(speed, source),
        gear_ratio=(250.0, "estimated"),
        rotor_inertia=(ROTOR * (width / 28.5) ** 5, "estimated"),
        kp=(stall / radians(6.0), "estimated"),
        kv=(stall / speed, "estimated"),
    )


class HobbyServo(Thing):
    """A servo with two ears and a splined shaft.

    The origin is on the axis of the shaft at the underside of the ears; z is along the shaft, and y points to the short end of the case.
    The servo is inserted into a frame from above. The frame needs a cut-out (`pocket`) and holes for the screws (`screws`).

    Mounts: `flange` is on the underside of the ears in the middle of the case, with z down to the frame. `rotor` is on the shaft, for
    attachment of a horn. `bottom`, `left` (+x), `right`, `front` (+y) and `back` are on the faces of the case. `ear_0`, `ear_1` ... are at
    the positions of the screw heads.

    The solid has no cavities, so thingc scales its inertia to the mass of the model.
    """

    drawing: ClassVar[Drawing]
    actuator: ClassVar[Actuator]

    def __init__(self, color: str = "#26282c"):
        super().__init__(material="nylon", color=color)
        d = self.drawing
        self.middle = d.axis_to_end - d.length / 2
        self.top = d.above + d.lid
        z = (d.above - d.below) / 2
        self.flange = MountPoint(Location(Plane((0, self.middle, 0), x_dir=(-1, 0, 0), z_dir=(0, 0, -1))), f"{d.interface}-flange")
        self.rotor = MountPoint(Location((0, 0, self.top)), f"{d.interface}-shaft")
        self.bottom = MountPoint(Location(Plane((0, self.middle, -d.below), x_dir=(-1, 0, 0), z_dir=(0, 0, -1))))
        self.left = MountPoint(Location((d.width / 2, self.middle, z), (0, 90, 0)))
        self.right = MountPoint(Location((-d.width / 2, self.middle, z), (0, -90, 0)))
        self.front = MountPoint(Location((0, d.axis_to_end, z), (-90, 0, 0)))
        self.back = MountPoint(Location((0, d.axis_to_end - d.length, z), (90, 0, 0)))
        along, across = d.holes
        self.places = [
            (x, self.middle + y) for y in (along / 2, -along / 2) for x in ((across / 2, -across / 2) if across else (0.0,))
        ]
        self.ear = [MountPoint(Location((x, y, d.ear)), f"{d.interface}-ear") for x, y in self.places]

    @abstractmethod
    def mass(self) -> tuple[float, str]:
        """Return the mass [kg] of the servo model and its source."""

    def case_hull(self, play: float = 0.0) -> Solid:
        """Return the case without ears, lid and shaft, `play` [mm] larger on all sides."""
        d = self.drawing
        size = (d.width + 2 * play, d.length + 2 * play, d.below + d.above + 2 * play)
        return block(size, (0, self.middle, (d.above - d.below) / 2), corner=0.04 * d.width)

    def pocket(self, depth: float, play: float = 0.2) -> Solid:
        """Return the solid to subtract from a frame so that the case fits through it. `depth` [mm] is the thickness of the frame."""
        d = self.drawing
        return block((d.width + 2 * play, d.length + 2 * play, depth), (0, self.middle, -depth / 2))

    def screws(self, diameter: float, depth: float) -> list[Solid]:
        """Return the solids to subtract for the screws in the frame below the ears, with this diameter and depth [mm]."""
        return [disc(diameter, depth, -depth, x, y) for x, y in self.places]

    def result(self) -> Solid:
        """Return the solid of the case, the ears with their holes, the lid and the shaft."""
        d = self.drawing
        ears = block((d.width, d.ears, d.ear), (0, self.middle, d.ear / 2), corner=0.08 * d.width)
        lid = bevelled(0.94 * d.width, d.lid + 0.5, 0.04 * d.width, d.above - 0.5)
        gear = disc(0.45 * d.width, 0.8 * d.lid + 0.5, d.above - 0.5, y=-0.5 * d.width)
        shaft = disc(d.spline[0], d.spline[1] + 0.5, self.top - 0.5)
        holes = [disc(d.hole, d.ear + 2, -1, x, y) for x, y in self.places]
        return self.case_hull().fuse(ears, lid, gear, shaft).cut(*holes).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the case, the ears and the lid."""
        d = self.drawing
        ears = block((d.width, d.ears, d.ear), (0, self.middle, d.ear / 2))
        return [block((d.width, d.length, d.below + d.above), (0, self.middle, (d.above - d.below) / 2)), ears,
                disc(0.94 * d.width, d.lid, d.above)]


_MICRO = Drawing(
    width=11.8, length=22.2, axis_to_end=5.9, below=15.9, above=6.8, lid=4.5, spline=(4.6, 3.8), ears=32.2, ear=2.5,
    holes=(27.6, 0.0), hole=2.0, interface="micro-servo",
)


class SG90(HobbyServo):
    """Tower Pro SG90, the blue micro servo with nylon gears.

    The data sheet, as quoted by the National University of Singapore (nus.atlassian.net/wiki, page 27625578), lists about 22.2 x 11.8 x 31
    mm and 9 g. At 4.8 V, the torque is 1.8 kgf cm, and the time for 60 deg is 0.1 s. Ears, holes and axis agree within 0.4 mm with measured
    copies of this servo in github.com/kartchnb/openscad-servo-library (servos/sg90_clone.scad).
    """

    drawing = _MICRO
    actuator = hobby_drive(torque=1.8, seconds=0.1, width=11.8)
    bom = {"make": "buy", "number": "SG90", "supplier": "Tower Pro"}

    def __init__(self, color: str = "#2b6cb8"):
        super().__init__(color=color)

    def mass(self) -> tuple[float, str]:
        """Return the mass of 9 g from the data sheet."""
        return (0.009, "vendor")


class MG90S(HobbyServo):
    """Tower Pro MG90S, the micro servo with metal gears.

    The data sheet (github.com/TrDA-hab/Projects, Servo+ESP8266/MG90S-Datasheet.pdf) lists about 22.5 x 12 x 35.5 mm and 13.4 g. At 6 V, the
    torque is 2.2 kgf cm, and the time for 60 deg is 0.08 s. For the case and the shaft, a height of 32 mm out of the total 35.5 mm is
    assumed. Measured copies in github.com/kartchnb/openscad-servo-library (servos/mg90s_clone.scad) have a height of 32.5 mm, and their
    ears, holes and axis agree within 0.4 mm.
    """

    drawing = Drawing(
        width=12.0, length=22.5, axis_to_end=6.0, below=18.5, above=4.2, lid=6.1, spline=(4.8, 3.2), ears=32.5, ear=2.6,
        holes=(28.0, 0.0), hole=2.0, interface="micro-servo",
    )
    actuator = hobby_drive(torque=2.2, seconds=0.08, width=12.0)
    bom = {"make": "buy", "number": "MG90S", "supplier": "Tower Pro"}

    def mass(self) -> tuple[float, str]:
        """Return the mass of 13.4 g from the data sheet."""
        return (0.0134, "vendor")


class S3003(HobbyServo):
    """Futaba S3003, the standard analogue servo.

    ServoCity's page, as quoted in github.com/rngadam/XinCheJian-GGHC (wiki, "Mechanical design"), lists 41 x 20 x 36 mm (rounded from
    inches) and 37.2 g. At 6 V, the torque is 4.1 kgf cm, and the time for 60 deg is 0.19 s. The length and the width, with an accuracy of
    0.1 mm, are from the similar S3001, as quoted from Futaba in github.com/pichim/PM2_PES_Board_Example (markdown/servo.md). Ears and holes
    are estimates, which agree within 1 mm with a copy measured in github.com/kartchnb/openscad-servo-library (servos/s3003_clone.scad).
    """

    drawing = Drawing(
        width=19.8, length=40.4, axis_to_end=10.1, below=26.6, above=7.6, lid=1.8, spline=(5.9, 3.8), ears=54.6, ear=2.5,
        holes=(49.5, 10.0), hole=4.4, interface="servo-25t",
    )
    actuator = hobby_drive(torque=4.1, seconds=0.19, width=19.8)
    bom = {"make": "buy", "number": "S3003", "supplier": "Futaba"}

    def mass(self) -> tuple[float, str]:
        """Return the mass of 37.2 g from the seller's page."""
        return (0.0372, "vendor")


class HS422(HobbyServo):
    """Hitec HS-422, the standard deluxe servo.

    No data sheet was found, so the size (40.6 x 19.8 x 36.6 mm), the mass (45.5 g), and the torque (4.1 kgf cm) and time for 60 deg (0.16
    s) at 6 V are estimates. Ears and holes are as for the similar HS-311 in Hitec's "Announced specification of HS-311 standard servo".
    """

    drawing = Drawing(
        width=19.8, length=40.6, axis_to_end=10.2, below=26.7, above=7.9, lid=2.0, spline=(5.8, 3.8), ears=52.8, ear=2.5,
        holes=(47.8, 10.2), hole=4.4, interface="servo-24t",
    )
    actuator = hobby_drive(torque=4.1, seconds=0.16, width=19.8, source="estimated")
    bom = {"make": "buy", "number": "HS-422", "supplier": "Hitec"}

    def mass(self) -> tuple[float, str]:
        """Return the estimated mass of 45.5 g."""
        return (0.0455, "estimated")


class DS3218(HobbyServo):
    """DSServo DS3218, a digital servo with 20 kgf cm and metal gears.

    No data sheet was found, so the size (40 x 20 x 40.5 mm), the mass (60 g), and the torque (21.5 kgf cm) and time for 60 deg (0.14 s) at
    6.8 V are estimates.
    """

    drawing = Drawing(
        width=20.0, length=40.0, axis_to_end=10.0, below=28.0, above=9.5, lid=3.0, spline=(5.9, 4.0), ears=54.0, ear=2.5,
        holes=(49.5, 10.0), hole=4.4, interface="servo-25t",
    )
    actuator = hobby_drive(torque=21.5, seconds=0.14, width=20.0, source="estimated")
    bom = {"make": "buy", "number": "DS3218", "supplier": "DSServo"}

    def mass(self) -> tuple[float, str]:
        """Return the estimated mass of 60 g."""
        return (0.060, "estimated")


class Horn(Thing):
    """A round horn for a splined shaft: a bevelled disc with a hub and a circle of threaded holes.

    The origin is in the middle of the back of the horn; z points along the shaft. The shape is not based on a manufacturer's drawing; the
    defaults are estimates of common aluminium horns for 25 teeth. For example, `Horn(diameter=14, thickness=2, circle=10, screw="M2",
    hub=7)` is a horn for a micro servo.

    Mounts: `spline` is on the back of the horn, for attachment to the mount `rotor` of a servo. `face` is on the front of the horn, and
    `hole_0`, `hole_1` ... are at its holes.

    Args:
        diameter: diameter of the disc
        thickness: thickness of the disc
        circle: diameter through the centres of the holes
        screw: thread of the holes
        hub: diameter of the hub on the face; its height is half the thickness of the disc
    """

    bom = {"make": "buy"}

    def __init__(
        self,
        diameter: Annotated[Length, Range(8, 60)] = 20.0,
        thickness: Annotated[Length, Range(1, 8)] = 3.0,
        circle: Annotated[Length, Range(5, 50)] = 14.0,
        screw: Size = "M3",
        hub: Annotated[Length, Range(3, 20)] = 8.5,
    ):
        super().__init__(material="aluminium")
        size = float(screw[1:])
        assert hub + size < circle < diameter - size, (
            f"the holes, on a circle of {circle:g} mm, lie between the hub ({hub:g} mm) and the rim ({diameter:g} mm)"
        )
        self.spline = MountPoint(MATE)
        self.face = MountPoint(Location((0, 0, thickness)))
        self.hole = [MountPoint(Pos(0, 0, thickness) * spot) for spot in spots(circle, 4, 45)]
        self.screws: list[Hole] = [threaded_hole(mount.location, screw, thickness) for mount in self.hole]

    def result(self) -> Solid:
        """Return the solid of the disc and the hub, with the threaded holes and a bore for the shaft."""
        p = self.p
        body = bevelled(p.diameter, p.thickness, 0.15 * p.thickness).fuse(disc(p.hub, 0.5 * p.thickness, p.thickness))
        return body.cut(disc(0.7 * p.hub, 2 * p.thickness), *(hole(0.0).thread_hull for hole in self.screws)).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the disc and its hub."""
        return [disc(self.p.diameter, self.p.thickness), disc(self.p.hub, 1.5 * self.p.thickness)]
