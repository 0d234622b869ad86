"""`<inertial>`: the mass properties of a link as MuJoCo takes them."""

from __future__ import annotations

from thingc.emit.xml import number, numbers
from thingc.inertia import LEAST_MOMENT, ZERO, MassProperties, physical_fault, principal_moments
from thingc.pose import Matrix


def inertial(properties: MassProperties) -> dict[str, str]:
    """Mass [kg], centre [m] and inertia [kg m^2] about the centre, in the link's frame, as attributes of `<inertial>`.

    A link that never moves may have an inertia that no solid has (a mass at a point), or one of almost nothing: MuJoCo refuses to
    find its principal axes, and nothing depends on it, so it gets none.
    """
    inertia = properties.inertia
    attributes = {"pos": numbers(properties.centre), "mass": number(properties.mass)}
    if inertia == ZERO or physical_fault(inertia) is not None or principal_moments(inertia)[0] < LEAST_MOMENT * (1.0 + 1e-9):
        return {**attributes, "diaginertia": "0 0 0"}
    i = _within_triangle(inertia)
    return {**attributes, "fullinertia": numbers((i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2]))}


def _within_triangle(a: Matrix) -> Matrix:
    """The same inertia, of a flat body lifted by a 1e-12 part: MuJoCo demands A + B >= C of the principal moments to the
    last bit after finding them, and a plate has A + B = C."""
    low, middle, high = principal_moments(a)
    short = high - low - middle
    if short < -1e-12 * high:
        return a
    lift = max(short, 0.0) + 1e-12 * high
    return (
        (a[0][0] + lift, a[0][1], a[0][2]),
        (a[1][0], a[1][1] + lift, a[1][2]),
        (a[2][0], a[2][1], a[2][2] + lift),
    )
