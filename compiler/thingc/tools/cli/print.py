"""Implementation of `thingc print`, which shows how the printed parts of a robot are printed: their size, supports, mass and filament.

Overhangs are surfaces that are flatter than 45 degrees; the support is the space below them. The command also tries the directions in which
the part rests on a large face, and shows the direction with the least support, if it is smaller. To use it, write `print: {up: ...}`.
`thingc build DOC --emit 3mf` writes the print plates.

  thingc print assemblies/arm.yaml
"""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from msgspec.structs import asdict

from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Vector
from thingc.driver import pipeline
from thingc.driver.environment import Environment, with_environment
from thingc.geometry.print_slices import UPRIGHT
from thingc.tools.cli import console

if TYPE_CHECKING:
    from thingc.tools.workshop.plates import Print

FILAMENT = 1.75e-3
"""Diameter of the filament [m]."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc print` to the parser."""
    console.add_document(parser)
    console.add_format(parser)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc print`, and return the exit code."""
    console.require_document(arguments.document)
    rows: list[PrintMeasurements] = []

    def measure(environment: Environment) -> list[Diagnostic]:
        compilation = pipeline.compile(environment)
        report, workspace = compilation.report, environment.workspace
        if compilation.assembly is not None and workspace is not None and not report.failed:
            from thingc.tools.workshop.plates import prints_of

            prints, _ = prints_of(compilation.assembly, environment.store, workspace.bed, report)
            rows.extend(map(_measure_part, prints))
        return console.final(report, strict=arguments.strict)

    found = with_environment(arguments.document, console.options_of(arguments), measure)
    lines = _table(rows) if rows else () if console.exit_code(found) else ["no parts are printed"]
    return console.print_result(arguments, found, lines, prints=[asdict(one) for one in rows])


class PrintMeasurements(FrozenStruct):
    """The measurements of a print, in SI units, with the size along the axes of the printer.

    `filament` is the length of the filament of one piece, or None without a density. `better_up` is a direction with less support.
    """

    part: str
    number: int
    up: Vector
    size: Vector
    overhang: float
    support: float
    mass: float
    filament: float | None
    better_up: Vector | None
    better_support: float | None


def _measure_part(one: Print) -> PrintMeasurements:
    from thingc.tools.workshop.plates import upright
    from thingc.tools.workshop.supports import directions, support_of

    support = support_of(one.vertices, one.faces)
    others = directions(upright(one.stl, UPRIGHT)[0]) if support.volume > 0.0 else []
    least, up = min(((round(support_of(*upright(one.stl, up)).volume, 3), up) for up in others), default=(math.inf, one.up))
    better = least < 0.8 * support.volume
    mass, material = one.first.properties.mass, one.first.material
    density = material.density if material is not None else None
    x, y, z = (1e-3 * float(length) for length in one.vertices.max(axis=0).round(4))
    return PrintMeasurements(
        part=one.label, number=one.count, up=one.up, size=(x, y, z), overhang=1e-6 * support.area, support=1e-9 * support.volume, mass=mass,
        filament=mass / density / (math.pi * (FILAMENT / 2.0) ** 2) if density else None,
        better_up=up if better else None, better_support=1e-9 * least if better else None,
    )


def _table(rows: list[PrintMeasurements]) -> list[str]:
    lines = [("part", "number", "size [mm]", "overhang [cm^2]", "support [cm^3]", "mass [g]", "filament [m]", "less support with")]
    for row in rows:
        better = "" if row.better_up is None or row.better_support is None else (
            f"up: [{', '.join(f'{part:g}' for part in row.better_up)}] ({1e6 * row.better_support:.2f} cm^3)"
        )
        lines.append((
            row.part, str(row.number), " x ".join(f"{1e3 * length:.1f}" for length in row.size), f"{1e4 * row.overhang:.2f}",
            f"{1e6 * row.support:.2f}", f"{1e3 * row.mass:.2f}", "" if row.filament is None else f"{row.filament:.2f}", better,
        ))
    return console.table(lines, right=(1, 3, 4, 5, 6))
