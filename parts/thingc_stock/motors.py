"""Stepper motors of size NEMA 17, and hubs for their shafts."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Annotated, Literal

from build123d import Location, Plane, Pos, Solid

from thingc import MATE, Actuator, Bolts, Bore, Boss, Length, MountPoint, Range, Thing
from thingc_stock.fasteners import Hole, Size, threaded_hole
from thingc_stock.shapes import bevelled, block, disc, spots


@dataclass(frozen=True, slots=True, kw_only=True)
class Stepper:
    """The published data of a stepper motor.

    The fields are the length of the body [mm], the mass [kg], the holding torque [N m], and the rotor inertia [kg m^2] with its source.
    """

    length: float
    mass: float
    torque: float
    inertia: tuple[float, str]


STEPPERS = {
    # Sources: lengths, torques and inertias of 17HS13 and 17HS19 are STEPPERONLINE's data in
    # github.com/eddietheengineer/stepper-calculator, motordatabase.csv. The mass of 17HS13 is from github.com/mattybabaallos/ACIS (wiki,
    # "Motors Information"), for a motor with the same torque, length, resistance and inductance. The mass of 17HS19 is from the
    # manufacturer's data in github.com/markcarroll/makerspace (2022-12-29-stepperonline-data-sheet.md). The data of 17HS15 are from a copy
    # of the manufacturer's page "Nema 17 Bipolar 45Ncm(63.74oz.in) 1.5A 42x42x39mm", and its inertia is copied from 17HS16-2004S1 in the
    # table, which is 1 mm longer.
    "17HS13": Stepper(length=34.0, mass=0.230, torque=0.26, inertia=(38e-7, "vendor")),
    "17HS15": Stepper(length=39.0, mass=0.280, torque=0.45, inertia=(54e-7, "estimated")),
    "17HS19": Stepper(length=48.0, mass=0.390, torque=0.59, inertia=(82e-7, "vendor")),
}
FLANGE, HOLES, PILOT, SHAFT = 42.3, 31.0, 22.0, 5.0
"""Dimensions of a motor of size NEMA 17 [mm]: edge of the flange, distance of the holes, and diameters of pilot and shaft.

Source: github.com/nophead/NopSCADlib, vitamins/stepper_motors.scad.
"""


class _Nema17(Thing):
    """A stepper motor of size NEMA 17.

    The origin is on the axis of the shaft in the face of the flange; z points along the shaft. The method `screws(thickness)` returns the
    screws that hold the motor.

    Mounts: `flange` is on the face of the flange, with z along the shaft. `rotor` is on the shaft at the beginning of its flat, and `tip`
    is at the end of the shaft. `bottom` is on the face opposite to the flange. `hole_0`, `hole_1` ... are at the M3 holes in the flange.

    Args:
        shaft: length of the shaft in front of the flange
    """

    model: Literal["17HS13", "17HS15", "17HS19"]

    def __init__(self, shaft: Annotated[Length, Range(10, 60)] = 24.0):
        super().__init__(material="steel", color="#33363b")
        self.length = STEPPERS[self.model].length
        self.flange = MountPoint(Location((0, 0, 0)), ["nema17", Bolts("M3", 4, HOLES * 2**0.5, 45, depth=4.5), Boss(PILOT, length=2.0)])
        self.rotor = MountPoint(Location((0, 0, 4)), ["shaft-5", Boss(SHAFT)])
        self.tip = MountPoint(Location((0, 0, shaft)))
        self.bottom = MountPoint(Location(Plane((0, 0, -self.length), x_dir=(-1, 0, 0), z_dir=(0, 0, -1))))
        self.hole = [MountPoint(spot, ["m3", Bolts("M3", depth=4.5)]) for spot in spots(HOLES * 2**0.5, 4, 45)]
        self.threads: list[Hole] = [threaded_hole(mount.location, "M3", 4.5) for mount in self.hole]

    def mass(self) -> tuple[float, str]:
        """Return the mass [kg] of this motor in the table of the module, and its source."""
        return (STEPPERS[self.model].mass, "vendor")

    def result(self) -> Solid:
        """Return the solid of two caps around the laminations, the pilot, and the shaft with its flat."""
        caps = [block((FLANGE, FLANGE, h), (0, 0, z), corner=3.5) for h, z in ((9.0, -4.5), (9.0, 4.5 - self.length))]
        core = block((FLANGE - 1.2, FLANGE - 1.2, self.length - 2), (0, 0, -self.length / 2), corner=5.5)
        shaft = bevelled(SHAFT, self.p.shaft + 1, 0.4, -1).cut(block((SHAFT, 1, self.p.shaft), (0, SHAFT / 2, 4 + self.p.shaft / 2)))
        body = core.fuse(*caps, disc(PILOT, 2.0 + 1, -1), shaft)
        return body.cut(*(hole(0.0).thread_hull for hole in self.threads)).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the body and the shaft."""
        return [block((FLANGE, FLANGE, self.length), (0, 0, -self.length / 2)), disc(SHAFT, self.p.shaft)]


def _drive(model: str, speed: float) -> Actuator:
    """Return a position drive whose maximum torque is the holding torque of the motor.

    `speed` [rad/s] is an estimate of the no-load speed at 24 V. With micro-stepping, a stepper motor acts as a spring. The torque of the
    motor is maximal at a displacement of a quarter of an electrical turn (1.8 deg).
    """
    motor = STEPPERS[model]
    return Actuator(
        kind="position", stall_torque=(motor.torque, "vendor"), no_load_speed=(speed, "estimated"), gear_ratio=1.0,
        rotor_inertia=motor.inertia, kp=(motor.torque / (1.8 * pi / 180.0), "estimated"),
        kv=(motor.torque / speed, "estimated"),
    )


class Nema17Short(_Nema17):
    """The STEPPERONLINE motor 17HS13-0404S1 with 34 mm length, 230 g and 0.26 N m."""

    model = "17HS13"
    actuator = _drive("17HS13", 80.0)
    bom = {"make": "buy", "number": "17HS13-0404S1", "supplier": "STEPPERONLINE"}


class Nema17(_Nema17):
    """The STEPPERONLINE motor 17HS15-1504S1 with 39 mm length, 280 g and 0.45 N m."""

    model = "17HS15"
    actuator = _drive("17HS15", 80.0)
    bom = {"make": "buy", "number": "17HS15-1504S1", "supplier": "STEPPERONLINE"}


class Nema17Long(_Nema17):
    """The STEPPERONLINE motor 17HS19-2004S1 with 48 mm length, 390 g and 0.59 N m."""

    model = "17HS19"
    actuator = _drive("17HS19", 80.0)
    bom = {"make": "buy", "number": "17HS19-2004S1", "supplier": "STEPPERONLINE"}


class ShaftHub(Thing):
    """A clamping hub: a collar on a shaft, with a flange and four threaded holes for the driven part.

    The origin is in the middle of the flange's back, on the axis of the shaft; z points out of the end of the shaft. The shape is not based
    on a manufacturer's drawing; the proportions are estimates of common aluminium hubs for a shaft of 5 mm.

    Mounts: `shaft` is in the back of the collar, for attachment to the mount `rotor` of a motor. `face` is on the outer face of the flange,
    and `hole_0`, `hole_1` ... are at the threaded holes.

    Args:
        bore: diameter of the shaft
        diameter: diameter of the flange
        thickness: thickness of the flange
        collar: length of the collar behind the flange
        circle: diameter through the centres of the holes
        screw: thread of the holes
    """

    bom = {"make": "buy"}

    def __init__(
        self,
        bore: Annotated[Length, Range(2, 12)] = 5.0,
        diameter: Annotated[Length, Range(12, 60)] = 22.0,
        thickness: Annotated[Length, Range(1.5, 8)] = 3.0,
        collar: Annotated[Length, Range(4, 30)] = 9.0,
        circle: Annotated[Length, Range(8, 50)] = 16.0,
        screw: Size = "M3",
    ):
        super().__init__(material="aluminium")
        assert bore + 3 < circle < diameter - 3, f"the holes, on a circle of {circle:g} mm, need room between bore and rim"
        self.shaft = MountPoint(Location((0, 0, -collar)) * MATE, ["shaft-5", Bore(bore)])
        self.face = MountPoint(Location((0, 0, thickness)), Bolts(screw, 4, circle, 45, depth=thickness))
        self.hole = [MountPoint(Pos(0, 0, thickness) * spot) for spot in spots(circle, 4, 45)]
        self.screws: list[Hole] = [threaded_hole(mount.location, screw, thickness) for mount in self.hole]

    def result(self) -> Solid:
        """Return the solid of the flange and the collar with their bore and the threaded holes."""
        p = self.p
        body = bevelled(p.diameter, p.thickness, 0.3).fuse(bevelled(p.circle - 3, p.collar + 1, 0.3, -p.collar))
        return body.cut(disc(p.bore, p.collar + p.thickness + 2, -p.collar - 1), *(hole(0.0).thread_hull for hole in self.screws)).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the flange and the collar."""
        return [disc(self.p.diameter, self.p.thickness), disc(self.p.circle - 3, self.p.collar, -self.p.collar)]
