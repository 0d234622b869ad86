"""Screws with the dimensions of bd_warehouse, and the solids to subtract from parts for their holes.

All dimensions are from the tables of bd_warehouse, which contain the values of the standards. This module creates screws without threads. A
revolved profile and one boolean operation take a tenth of the time of bd_warehouse's own screw. The module reads only the tables of
bd_warehouse, without importing its 30 classes of fasteners.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from copy import deepcopy
from functools import cache, cached_property
from importlib import resources
from math import sqrt
from typing import Annotated, Literal

import bd_warehouse
from build123d import Axis, Face, Location, Plane, Pos, RegularPolygon, Solid, Wire, extrude

from thingc import Length, MountPoint, Range, Shank, Thing

Size = Literal["M1.6", "M2", "M2.5", "M3", "M4", "M5", "M6", "M8"]
"""Metric thread sizes with coarse pitch."""

TABLES = resources.files(bd_warehouse) / "data"

HEAD_PLAY = 0.2
"""Radial clearance of a screw head in a counterbore [mm], sufficient for prints with a 0.4 mm nozzle."""

class Screw(Thing):
    """A hexagon socket head cap screw, ISO 4762, steel, property class 8.8.

    The origin is on the screw axis in the bearing plane (the underside of the head); z points towards the driver, so the head is at z > 0.
    Head and socket are as in ISO 4762 (outer diameter of a knurled head), and clearance holes as in ISO 273 (`Close` fine, `Normal` medium,
    `Loose` coarse). The diameters of tap drills are for soft materials. All values are from the tables in bd_warehouse.

    Args:
        size: size of the thread, with coarse pitch
        length: length from the bearing plane to the tip
        fit: fit of the clearance hole
    """

    bom = {"make": "buy"}

    def __init__(
        self,
        size: Size = "M2.5",
        length: Annotated[Length, Range(1, 300)] = 8,
        fit: Literal["Close", "Normal", "Loose"] = "Normal",
    ):
        super().__init__(material="steel")
        heads = _table("socket_head_cap_parameters.csv")
        designation = next(name for name in heads if name.partition("-")[0] == size)
        head = heads[designation]
        self.diameter = float(size[1:])
        self.pitch = float(designation.partition("-")[2])
        self.head_diameter = float(head["iso4762:dk"])
        self.head_height = float(head["iso4762:k"])
        self.socket_width = float(head["iso4762:s"])
        self.socket_depth = float(head["iso4762:t"])
        self.clearance_diameter = float(_table("clearance_hole_sizes.csv")[size][fit])
        self.tap_diameter = float(_table("tap_hole_sizes.csv")[designation]["Soft"])
        self.seat = MountPoint(Location((0, 0, 0), (0, 180, 0)), interface=[f"{size.lower()}-head", Shank(size, length)])
        self.tip = MountPoint(Location((0, 0, -length), (0, 180, 0)))
        self.drive = MountPoint(Location((0, 0, self.head_height)), interface=f"hex-{self.socket_width:g}")

    @property
    def body_hull(self) -> Solid:
        """Return the volume of the screw, with the outer cylinder of the thread and without the socket."""
        return self._hull(self.diameter, self.head_diameter, self.head_height)

    @property
    def clearance_hull(self) -> Solid:
        """Return the solid to subtract from the fastened part for the screw.

        The solid consists of the clearance hole and, above the bearing plane, a cylinder for the head with a clearance of `HEAD_PLAY`. The
        cylinder of the head is high enough to insert the screw along its axis.
        """
        return deepcopy(self._clearance)  # the kernel adds curves to a shape that it uses as a tool, so each further call takes longer

    @property
    def tapped_hull(self) -> Solid:
        """Return the hole to drill for the thread: a cylinder with the diameter of the tap drill over the whole length."""
        return Solid.make_cylinder(self.tap_diameter / 2, self.p.length, Plane((0, 0, -self.p.length)))

    @property
    def thread_hull(self) -> Solid:
        """Return a threaded hole as in drawings: a cylinder with the outer diameter of the thread over the whole length."""
        return Solid.make_cylinder(self.diameter / 2, self.p.length, Plane((0, 0, -self.p.length)))

    def result(self) -> Solid:
        """Return the head with its socket, and a cylinder with the pitch diameter (ISO 724), which has the volume of the thread."""
        pitch_diameter = self.diameter - 3 * sqrt(3) / 8 * self.pitch
        top = Pos(0, 0, self.head_height)
        socket = extrude(top * RegularPolygon(self.socket_width / 2, 6, major_radius=False), -self.socket_depth)
        return self._hull(pitch_diameter, self.head_diameter, self.head_height).cut(socket).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shapes: the head and the shank as two convex solids."""
        return [
            Solid.make_cylinder(self.head_diameter / 2, self.head_height),
            Solid.make_cylinder(self.diameter / 2, self.p.length, Plane((0, 0, -self.p.length))),
        ]

    @cached_property
    def _clearance(self) -> Solid:
        return self._hull(self.clearance_diameter, self.head_diameter + 2 * HEAD_PLAY, self.head_height + self.p.length)

    def _hull(self, shank: float, head: float, above: float) -> Solid:
        """Return two coaxial cylinders on both sides of the bearing plane, with their diameters and the height of the upper cylinder."""
        below = -self.p.length
        outline = [(0, below), (shank / 2, below), (shank / 2, 0), (head / 2, 0), (head / 2, above), (0, above)]
        return Solid.revolve(Face(Wire.make_polygon([(x, 0, z) for x, z in outline])), 360, Axis.Z)


Hole = Callable[[float], Screw]
"""A threaded hole, given as a function that returns a screw placed in the hole.

The argument of the function is the thickness [mm] of the fastened part. The bearing plane of the screw is above the face by this thickness,
and the tip is at the bottom of the hole.
"""


def threaded_hole(mouth: Location, size: Size, depth: float) -> Hole:
    """Return a hole that starts at `mouth`, whose z axis points out of the material, and has the depth `depth` [mm]."""

    def screw(thickness: float) -> Screw:
        return Screw(size, thickness + depth).move(mouth * Pos(0, 0, thickness))

    return screw


@cache
def _table(name: str) -> dict[str, dict[str, str]]:
    """Return a table of bd_warehouse as a mapping from the value in the first column to a row.

    Each row is a mapping from column headings to values.
    """
    with (TABLES / name).open(encoding="utf-8") as stream:
        rows = csv.reader(stream)
        _, *headings = (heading.strip() for heading in next(rows))
        return {key: dict(zip(headings, values)) for key, *values in rows}
