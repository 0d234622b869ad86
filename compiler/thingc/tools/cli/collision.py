"""Implementation of `thingc collision`, which measures how well the collision shapes of a robot approximate its parts.

For each part, the table shows how far the part extends beyond its collision shapes, how far the shapes extend beyond the part, and the
volume of the shapes divided by the volume of the part.

  thingc collision assemblies/arm.yaml
  thingc collision assemblies/arm.yaml -o shapes.png         also draw the shapes over the parts
"""

from __future__ import annotations

import argparse

from msgspec import to_builtins

from thingc.driver.environment import Environment
from thingc.driver.pipeline import Compilation
from thingc.model.assembly.types import Assembly
from thingc.targets.render.picture import NoGraphics
from thingc.tools.cli import console, render
from thingc.tools.collision.deviations import Deviation, deviations


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc collision` to the parser."""
    console.add_document(parser)
    formats = ("mjcf", "urdf", "sdf", "usd")
    parser.add_argument("--target", choices=formats, default="", help="measure the shapes for this format (default: those for all formats)")
    parser.add_argument("--mode", metavar="M", help="measure the shapes in this mode (default: those for all modes)")
    parser.add_argument("-o", "--output", metavar="PNG", help="PNG file for a picture of the collision shapes")
    console.add_format(parser)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc collision`, and return the exit code. With text output, diagnostics are printed to standard error."""
    render.check_output(arguments.output)
    found: list[Deviation] = []

    def measure(environment: Environment, compilation: Compilation, assembly: Assembly) -> None:
        chosen = assembly.in_target(arguments.target)
        found[:] = deviations(chosen if arguments.mode is None else chosen.in_mode(arguments.mode), environment.store)
        if arguments.output is not None:
            robot = compilation.robots[0]
            pose = robot.keyframes[0].name if robot.keyframes else None
            render.draw(environment, compilation, robot, pose, arguments.output, collision=True)

    try:
        diagnostics, _ = console.compile_document(arguments, measure, arguments.mode, compat=())
    except NoGraphics as fault:
        diagnostics = [fault.diagnostic]
    return console.print_result(arguments, diagnostics, as_text(found) if found else (), collision=to_builtins(found))


def as_text(found: list[Deviation]) -> list[str]:
    """Format the deviations as a table."""
    rows = [("part", "collision", "shapes", "part outside", "shapes beyond", "volume ratio")]
    for one in found:
        path = one.paths[0] + (f" (and {len(one.paths) - 1} more)" if len(one.paths) > 1 else "")
        numbers = ("", "", "") if one.ratio is None else (_millimetres(one.outside), _millimetres(one.beyond), f"{one.ratio:.3f}")
        rows.append((path, one.kind, str(one.shapes), *numbers))
    return console.table(rows, right=(2, 3, 4, 5))


def _millimetres(length: float | None) -> str:
    return f"{1e3 * (length or 0.0):.3g} mm"
