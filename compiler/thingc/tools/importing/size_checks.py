"""Whether a robot is of a size, and weighs what, can be reckoned with, in whatever format it was written."""

from __future__ import annotations

import math

from thingc.base.diagnostics import Code, Report
from thingc.base.inertia import HEAVIEST, LARGEST_MOMENT
from thingc.base.primitives import FARTHEST
from thingc.tools.importing.source_model import SourceRobot

_METRES = "mind the unit: lengths are in metres"


def refuse_endless(robot: SourceRobot, report: Report) -> None:
    """Report what reaches too far or weighs too much, at its line, and weights that nobody can work out: finite numbers can have a product
    that is none."""
    for link in robot.links:
        far = {shape.where: shape for shape in link.shapes if shape.kind != "mesh" and not max(map(abs, shape.size)) <= FARTHEST}
        for where, shape in far.items():
            message = f"this {shape.kind} measures {max(map(abs, shape.size)):.3g} m, and {FARTHEST:g} m at most are read"
            report.add(Code.SOURCE_VALUE, message, where, help=_METRES)
        if link.weight is None or far:
            continue
        of, where = link.weight.properties, link.weight.where
        if not all(map(math.isfinite, (of.mass, *of.centre, *sum(of.inertia, ())))):
            message = f"the weight of link `{link.name}` comes to numbers that are not finite"
            report.add(Code.SOURCE_VALUE, message, where, help="mind the sizes and densities of its shapes")
        elif of.mass > HEAVIEST:
            message = f"link `{link.name}` weighs {of.mass:.3g} kg, and {HEAVIEST:g} kg at most are read"
            report.add(Code.SOURCE_VALUE, message, where, help="mind the unit: masses are in kilograms")
        elif (most := max(map(abs, sum(of.inertia, ())))) > LARGEST_MOMENT:
            message = f"link `{link.name}` has a moment of inertia of {most:.3g} kg m^2, and {LARGEST_MOMENT:g} kg m^2 at most are read"
            report.add(Code.SOURCE_VALUE, message, where, help="mind the units: they are kilograms and metres")
        elif (most := max(map(abs, of.centre))) > FARTHEST:
            message = f"the centre of mass of link `{link.name}` is {most:.3g} m off, and {FARTHEST:g} m at most are read"
            report.add(Code.SOURCE_VALUE, message, where, help=_METRES)
    for one in robot.hangings:
        if (most := max(map(abs, one.pose.translation))) > FARTHEST:
            message = f"link `{one.child}` is {most:.3g} m from the one that it hangs on, and {FARTHEST:g} m at most are read"
            report.add(Code.SOURCE_VALUE, message, one.where, help=_METRES)
