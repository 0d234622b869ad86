"""Implementation of `thingc print`, which lists the size, supports, walls, mass, filament, time and cost of printed parts.

Overhangs are surfaces that are flatter than 45 degrees; the support is the space below them. The command also tries the directions in which
the part rests on a large face. If a direction needs less support than the current direction, the table shows the best direction. To use
it, write `print: {up: auto}`. Mass, filament, time and cost are those of one piece, without support. To write the print plates, use
`thingc build DOC --emit 3mf`.

  thingc print assemblies/arm.yaml
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from msgspec.structs import asdict

from thingc.base.diagnostics import Diagnostic
from thingc.base.pose import Vector
from thingc.driver import pipeline
from thingc.driver.environment import Environment, with_environment
from thingc.tools.cli import console

if TYPE_CHECKING:
    from thingc.tools.workshop.print_measurements import PrintMeasurements


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
            from thingc.tools.workshop.print_measurements import measure_print

            prints, _ = prints_of(compilation.assembly, environment.store, workspace.bed, report)
            rows.extend(map(measure_print, prints))
        return console.final(report, strict=arguments.strict)

    found = with_environment(arguments.document, console.options_of(arguments), measure)
    lines = _table(rows) if rows else () if console.exit_code(found) else ["no parts are printed"]
    return console.print_result(arguments, found, lines, prints=[asdict(one) for one in rows])


def _table(rows: list[PrintMeasurements]) -> list[str]:
    lines = [(
        "part", "number", "up", "size [mm]", "overhang [cm^2]", "support [cm^3]", "wall [mm]", "mass [g]", "filament [m]", "time [min]",
        "cost", "less support with",
    )]
    for row in rows:
        better = f"{_direction(row.better_up)} ({_format(row.better_support, 1e6)} cm^3)" if row.better_up is not None else ""
        lines.append((
            row.part, str(row.number), _direction(row.up), " x ".join(f"{1e3 * length:.1f}" for length in row.size),
            _format(row.overhang, 1e4), _format(row.support, 1e6), _format(row.thinnest_wall, 1e3) + " thin" * row.thin,
            _format(row.mass, 1e3), _format(row.filament, 1.0), _format(row.time, 1.0 / 60.0, 0), row.cost or "", better,
        ))
    return console.table(lines, right=(1, 4, 5, 7, 8, 9, 10))


def _direction(up: Vector) -> str:
    return f"[{', '.join(f'{part:.4g}' for part in up)}]"


def _format(value: float | None, factor: float, digits: int = 2) -> str:
    return "" if value is None else f"{factor * value:.{digits}f}"
