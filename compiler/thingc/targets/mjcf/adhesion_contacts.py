"""Contacts of what adheres: MuJoCo's own give way, and a robot that magnets hold would creep down its wall by millimetres a second.

How far one of MuJoCo's contacts gives, and how fast it creeps under friction, is what `solimp` and `solref` make of it; how much less it
creeps than it gives, `impratio`. Each was measured on MInchW at its wall and under its ceiling, and on feet of 0.1 to 0.5 kg that carry
up to five times their weight, with magnets of 30 to 1000 N per kg: softer contacts let it creep, harder ones lift a foot off that leans
by less than it sinks. Friction is as it was: what is too weak to hold slides.
"""

from __future__ import annotations

from collections.abc import Mapping

from thingc.model.assembly.types import Assembly
from thingc.model.robot.types import Robot

CLASS = "adhesive"
"""The class, in `collision`, of every geom of a link that adheres: MuJoCo lets an adhesion pull at all contacts of its link."""

CONTACT = {"margin": "1e-05", "solmix": "1000", "solref": "0.004 1", "solimp": "0.99 0.999 0.001 0.5 2"}
"""Of each such geom. `margin` [m]: what touches exactly, but for rounding, touches. `solmix`: this counts, not what a floor has, unless
it has a priority."""

OPTION = {"cone": "elliptic", "impratio": "100"}
"""Of the whole model. The two belong together: with pyramids such an `impratio` throws feet off the floor."""


def contact(assembly: Assembly) -> dict[str, str]:
    """What the class says of its geoms: nothing that raw attributes say of all that collides, or of all geoms."""
    stated = {path[3] for path in _raw(assembly) if len(path) == 4 and path[0] == "default" and path[1] != "visual" and path[2] == "geom"}
    return {name: value for name, value in CONTACT.items() if name not in stated}


def option(robot: Robot, stated: Mapping[str, object]) -> dict[str, str]:
    """What the options of a mode that adheres say beyond what the document has `stated`, or its raw attributes have."""
    if not adhering(robot):
        return {}
    options = {path[1] for path in _raw(robot.assembly) if len(path) == 2 and path[0] == "option"} | stated.keys()
    return {} if "cone" in options else {name: value for name, value in OPTION.items() if name not in options}


def adhering(robot: Robot) -> frozenset[int]:
    """The links that carry a mount with an adhesion; none in a mode that switches none on: feet that only stand rest better on soft
    contacts."""
    if not any(robot.adhesion.values()):
        return frozenset()
    return frozenset(robot.assembly.link_of[magnet.occurrence] for magnet in robot.assembly.adhesions)


def _raw(assembly: Assembly) -> list[tuple[str, ...]]:
    return [attribute.path for attribute in assembly.raw if attribute.target == "mjcf"]
