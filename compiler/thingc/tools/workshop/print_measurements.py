"""Measure prints: supports, walls, filament, printing time and cost."""

from __future__ import annotations

import math

import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Vector
from thingc.geometry.print_slices import UPRIGHT
from thingc.geometry.print_support import STEEPEST, PrintSolid
from thingc.model.resolve.types import Material
from thingc.tools.workshop.plates import Print, upright

FILAMENT = 1.75e-3
"""Diameter of the filament [m]."""
SPEED, LAYER_TIME = 28e-3, 4.0
"""Default speed of printing walls [m/s], and default time of a layer [s]: the printing times of PrusaSlicer's default profile."""
INFILL_SPEED = 3.0
"""Speed of the lines inside the walls, relative to the walls."""


class PrintMeasurements(FrozenStruct):
    """The measurements of a print, in SI units, with the size along the axes of the printer.

    `thinnest_wall` is None if the mesh is not closed, and `thin` is True if the wall is below two line widths. `filament` is the length of
    the filament, `time` the printing time, and `cost` the price of the material of one piece, without support. They are None if the
    document does not contain the required keys. `filament` and `time` are also None if the process is not `fdm`. `better_up` is a direction
    with less support.
    """

    part: str
    number: int
    up: Vector
    size: Vector
    overhang: float
    support: float
    thinnest_wall: float | None
    thin: bool
    mass: float
    filament: float | None
    time: float | None
    cost: str | None
    better_up: Vector | None
    better_support: float | None


def measure_print(print_: Print) -> PrintMeasurements:
    """Measure a print. Times and costs are estimates without support."""
    vertices, faces = upright(print_.stl, UPRIGHT)
    solid = PrintSolid(vertices, faces)
    (area, support), (up, least) = solid.support(print_.up), solid.least_support()
    better = least < 0.8 * support
    mass, material = print_.first.properties.mass, print_.first.material or Material(name="", density=None, origin=())
    process = print_.first.overrides.process_with(print_.first.material)
    volume = mass / material.density if material.density and process.technique == "fdm" else None
    wall, width, layer, time = thinnest_wall(solid, float(np.linalg.norm(vertices.max(axis=0)))), process.line_width, process.layer, None
    x, y, z = (1e-3 * float(length) for length in print_.vertices.max(axis=0).round(4))
    if volume is not None and width is not None and layer is not None and print_.first.record is not None:
        section = layer * (width - layer * (1.0 - math.pi / 4.0))  # of a line with round sides, as PrusaSlicer computes it
        walls = min(volume, print_.first.record.area * (process.walls or 0) * width)
        lines = (walls + (volume - walls) / INFILL_SPEED) / section
        time = lines / (process.speed or SPEED) + round(z / layer) * (process.layer_time or LAYER_TIME)
    amount, _, currency = (material.price_per_kg or "").partition(" ")
    return PrintMeasurements(
        part=print_.label, number=print_.count, up=print_.up, size=(x, y, z), overhang=1e-6 * area, support=1e-9 * support, mass=mass,
        thinnest_wall=None if wall is None else 1e-3 * wall, thin=wall is not None and width is not None and 1e-3 * wall < 2.0 * width,
        filament=None if volume is None else volume / (math.pi * (FILAMENT / 2.0) ** 2), time=time,
        cost=f"{float(amount) * mass:.2f} {currency}" if currency else None,
        better_up=up if better else None, better_support=1e-9 * least if better else None,
    )


def thinnest_wall(solid: PrintSolid, longest: float) -> float | None:
    """Return the smallest thickness of a solid [mm], or None if its mesh is not closed.

    The thickness is measured along the normals at points on the surface, to surfaces that face away from the point within 45 degrees. The
    solid must be smaller than `longest`.
    """
    points, owners, _ = solid.sample()
    inwards = -solid.normals[owners]
    lengths, normals = solid.cast(points, inwards, np.full(len(points), longest))
    opposite = (normals * inwards).sum(axis=1) > STEEPEST
    return float(lengths[opposite].min()) if opposite.any() else None
