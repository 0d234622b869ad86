"""Tendons of documents in MJCF: `fixed` ones, and the drives that pull them.

A tendon over a joint at which a loop is cut is left out of that mode. A drive on one is there in every mode that does not choose its
actuators.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from thingc.emit.artifact import Loss
from thingc.emit.mjcf.drives import drive_attributes, joint_range
from thingc.emit.mjcf.elements import dynamics_attributes
from thingc.emit.xml import Element, number, numbers
from thingc.graph.types import LinkedTendon
from thingc.robot.types import Robot


def present(robot: Robot) -> tuple[LinkedTendon, ...]:
    """Those of a mode: all of whose joints are in its tree."""
    there = {joint.path for body in robot.bodies for joint in body.joints}
    return tuple(one for one in robot.assembly.tendons if there.issuperset(one.moves))


def pulled(robot: Robot) -> tuple[LinkedTendon, ...]:
    """Those of a mode that a drive pulls there."""
    return tuple(one for one in present(robot) if one.actuator is not None and one.path in robot.pulled)


def tendons(robot: Robot, section: Element) -> None:
    """A `fixed` for each."""
    for one in present(robot):
        attributes = {"name": one.path}
        bounds = joint_range(one.limit)
        if bounds is not None:
            attributes["range"] = numbers(bounds)
        attributes |= dynamics_attributes(one.dynamics)
        attributes.pop("springref", None)
        if one.dynamics.stiffness is not None:
            attributes["springlength"] = number(one.dynamics.rest or 0.0)
        fixed = section.add("fixed", attributes, one.origin)
        for path, factor in one.moves.items():
            fixed.add("joint", {"joint": path, "coef": number(factor)}, one.origin)


def drives(robot: Robot, section: Element) -> None:
    """An actuator for each that is pulled."""
    for one in pulled(robot):
        if one.actuator is not None:
            attributes = {"name": one.path, "tendon": one.path, **drive_attributes(one, one.actuator)}
            section.add(one.actuator.kind, attributes, one.actuator.origin)


def controls(robot: Robot, q: Mapping[str, float]) -> Iterator[float]:
    """The commands that keep the drives of `drives` at `q` [rad or m]: a length, or 0."""
    for one in pulled(robot):
        yield one.length(q) if one.actuator is not None and one.actuator.kind == "position" else 0.0


def losses(robot: Robot) -> Iterator[Loss]:
    """Those that a mode leaves out."""
    there = present(robot)
    for one in robot.assembly.tendons:
        if one not in there:
            yield Loss.of(one.origin, "mjcf", robot.mode.name, one.path, "this tendon: a loop is cut at one of its joints", "omitted")
