"""Convert between the units of part code (mm, degrees) and of part records (SI). Only this module converts these units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from OCP.gp import gp_Trsf

from thingc.base.pose import Matrix, Pose, Vector
from thingc.base.units import parse_quantity
from thingc.geometry.record import Value

MM = 1000.0
"""Number of millimetres in a metre. Dividing a length by this number causes only one rounding, so 72 mm becomes exactly the float 0.072."""

_UNITS = {"length": "mm", "angle": "deg"}


def to_si(kind: str, value: Any) -> Value:
    """Convert the value of a parameter from the units of part code (mm, deg) to SI units. `kind` is its kind in `ParameterSchema`.

    The result is rounded in the same way as a value in a document. Therefore, a default is equal to the same value in a document.
    """
    if value is None or kind not in _UNITS or isinstance(value, bool):
        return value  # type: ignore[no-any-return]
    if not math.isfinite(value):
        return float(value)
    return parse_quantity(f"{float(value)!r} {_UNITS[kind]}").value


def to_author(kind: str, value: Value) -> Value:
    """Convert a canonical SI value to the units of part code. The result has 15 digits, so 0.042000000000000003 m becomes 42 mm."""
    if isinstance(value, (bool, str)):
        return value
    if kind == "length":
        return float(f"{value * MM:.15g}")
    if kind == "angle":
        return float(f"{math.degrees(value):.14g}")
    return value


def length(value: float) -> float:
    """Convert a length from [mm] to [m]."""
    return float(value) / MM


def vector(value: Sequence[float]) -> Vector:
    """Convert three numbers from [mm] to [m]."""
    x, y, z = value
    return (float(x) / MM + 0.0, float(y) / MM + 0.0, float(z) / MM + 0.0)


def volume(value: float) -> float:
    """Convert a volume from [mm^3] to [m^3]."""
    return float(value) / 1e9


def area(value: float) -> float:
    """Convert an area from [mm^2] to [m^2]."""
    return float(value) / 1e6


def unit_inertia(rows: Sequence[Sequence[float]]) -> Matrix:
    """Convert a 3 x 3 matrix from [mm^5] to [m^5]."""
    return matrix([[entry / 1e15 + 0.0 for entry in row] for row in rows])


def matrix(rows: Sequence[Sequence[float]]) -> Matrix:
    """Convert a nested sequence of 3 x 3 numbers to a matrix of floats, without changing the unit."""
    a, b, c = (tuple(float(entry) for entry in row) for row in rows)
    return (a, b, c)  # type: ignore[return-value]


def pose(transformation: gp_Trsf) -> Pose:
    """Convert a transformation of the CAD kernel, with its translation in mm, to a pose in metres.

    Rounding errors of the kernel are removed from the rotation: entries within 1e-15 of 0, 1 or -1 become exact.
    """
    rows = [[_clean(transformation.Value(i, j)) for j in (1, 2, 3)] for i in (1, 2, 3)]
    x, y, z = (transformation.Value(i, 4) for i in (1, 2, 3))
    return Pose(rotation=matrix(rows), translation=vector((x, y, z)))


def _clean(entry: float) -> float:
    nearest = round(entry)
    return float(nearest) if abs(entry - nearest) < 1e-15 else entry


def transformation(placement: Pose) -> gp_Trsf:
    """Convert a pose in metres to a transformation of the CAD kernel, with its translation in mm.

    This function is the inverse of the function `pose`.
    """
    r = placement.rotation
    x, y, z = (value * MM for value in placement.translation)
    result = gp_Trsf()
    result.SetValues(r[0][0], r[0][1], r[0][2], x, r[1][0], r[1][1], r[1][2], y, r[2][0], r[2][1], r[2][2], z)
    return result
