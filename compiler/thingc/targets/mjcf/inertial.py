"""`<inertial>`: the mass properties of a link as MuJoCo takes them."""

from __future__ import annotations

from thingc.base.inertia import LEAST_MOMENT, ZERO, MassProperties, physical_fault, principal_moments, within_triangle
from thingc.targets.xml_writer import XmlValue


def inertial(properties: MassProperties) -> dict[str, XmlValue]:
    """Mass [kg], centre [m] and inertia [kg m^2] about the centre, in the link's frame, as attributes of `<inertial>`.

    A link that never moves may have an inertia that no solid has (a mass at a point), or one of almost nothing: MuJoCo refuses to
    find its principal axes, and nothing depends on it, so it gets none.
    """
    inertia = properties.inertia
    attributes: dict[str, XmlValue] = {"pos": properties.centre, "mass": properties.mass}
    if inertia == ZERO or physical_fault(inertia) is not None or principal_moments(inertia)[0] < LEAST_MOMENT * (1.0 + 1e-9):
        return {**attributes, "diaginertia": "0 0 0"}
    i = within_triangle(inertia)
    return {**attributes, "fullinertia": (i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2])}
