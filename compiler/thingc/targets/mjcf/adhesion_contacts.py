"""Define contact parameters for links with adhesion. With MuJoCo's defaults, a robot held by magnets creeps down a wall by millimetres per
second.

The parameters `solimp` and `solref` determine how far a contact yields, and how fast it creeps under friction. `impratio` reduces the
creep. The values come from simulations of MInchW on a wall and under a ceiling. Other simulations used feet of 0.1 to 0.5 kg that carry up
to five times their weight, with magnets of 30 to 1000 N per kg. With softer contacts, the robot creeps. With harder contacts, a foot that
is slightly tilted detaches. The friction is not changed, so a robot without enough friction still slides.
"""

from __future__ import annotations

from collections.abc import Mapping

from thingc.model.assembly.types import Assembly
from thingc.model.robot.types import Robot

CLASS = "adhesive"
"""The default class of all geoms of links with adhesion. The class is a subclass of `collision`. All geoms have this class because in
MuJoCo, adhesion acts at all contacts of the link.
"""

CONTACT = {"margin": "1e-05", "solmix": "1000", "solref": "0.004 1", "solimp": "0.99 0.999 0.001 0.5 2"}
"""Attributes of each geom of a link with adhesion.

The `margin` [m] includes contacts whose distance is 0 except for rounding errors. `solmix` gives these values precedence over the values of
the floor, unless the floor has a priority.
"""

OPTION = {"cone": "elliptic", "impratio": "100"}
"""Solver options of a model with adhesion. Use both options together. With pyramidal cones, this value of `impratio` would throw feet off
the floor.
"""


def contact(assembly: Assembly) -> dict[str, str]:
    """Return the attributes of the default class for geoms of links with adhesion.

    An attribute is omitted if a raw attribute sets it for all geoms or for all collision geoms.
    """
    raw = {path[3] for path in _raw(assembly) if len(path) == 4 and path[0] == "default" and path[1] != "visual" and path[2] == "geom"}
    return {name: value for name, value in CONTACT.items() if name not in raw}


def option(robot: Robot, from_document: Mapping[str, object]) -> dict[str, str]:
    """Return the attributes of the element `option` that a mode with adhesion needs.

    An option is omitted if the document specifies it (`from_document`), or if a raw attribute sets it.
    """
    if not adhering(robot):
        return {}
    options = {path[1] for path in _raw(robot.assembly) if len(path) == 2 and path[0] == "option"} | from_document.keys()
    return {} if "cone" in options else {name: value for name, value in OPTION.items() if name not in options}


def adhering(robot: Robot) -> frozenset[int]:
    """Return the indices of the links whose adhesion is active in a mode. The result is empty for a mode without active adhesion.

    Links without active adhesion are not included, because their feet rest better on soft contacts.
    """
    if not any(robot.adhesion.values()):
        return frozenset()
    return frozenset(robot.assembly.link_of[magnet.occurrence] for magnet in robot.assembly.adhesions)


def _raw(assembly: Assembly) -> list[tuple[str, ...]]:
    return [attribute.path for attribute in assembly.raw if attribute.target == "mjcf"]
