"""Whether a robot is of a size, and weighs what, can be reckoned with, in whatever format it was written."""

from __future__ import annotations

import math

from thingc.diagnostics import Code, Report
from thingc.importing.model import SourceRobot
from thingc.primitives import FARTHEST


def refuse_endless(robot: SourceRobot, report: Report) -> None:
    """Report shapes that reach too far, and weights that nobody can work out, at their lines: finite numbers can have a product that is
    none."""
    for link in robot.links:
        far = {shape.where: shape for shape in link.shapes if shape.kind != "mesh" and not max(map(abs, shape.size)) <= FARTHEST}
        for where, shape in far.items():
            message = f"this {shape.kind} measures {max(map(abs, shape.size)):.3g} m, and {FARTHEST:g} m at most are read"
            report.add(Code.SOURCE_VALUE, message, where, help="mind the unit: lengths are in metres")
        if link.weight is None or far:
            continue
        of = link.weight.properties
        if not all(map(math.isfinite, (of.mass, *of.centre, *sum(of.inertia, ())))):
            message = f"the weight of link `{link.name}` comes to numbers that are not finite"
            report.add(Code.SOURCE_VALUE, message, link.weight.where, help="mind the sizes and densities of its shapes")
