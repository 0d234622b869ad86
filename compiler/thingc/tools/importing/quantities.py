"""Format the numbers of an imported robot as quantities in common units, with as few digits as possible.

For example, the length 0.0388353 m becomes `38.8353 mm`. Parsing this quantity gives the same double, because the compiler converts units
exactly and rounds once. If a double with 16 or 17 digits differs from a shorter number only by rounding errors, the shorter number is
written. Angles that are round numbers of degrees are written in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal

from thingc.base import units
from thingc.base.pose import Pose, Vector, rpy_of
from thingc.base.safe_text import escape_control
from thingc.tools.importing.source_model import ShapeKind

TURNS = ("revolute", "continuous", "ball", "screw")
"""Kinds of joints whose coordinate q is an angle."""
IN_NEWTONS = {
    units.FORCE: "N", units.TORQUE: "N*m", units.LINEAR_DAMPING: "N*s/m", units.ANGULAR_DAMPING: "N*m*s/rad",
    units.LINEAR_STIFFNESS: "N/m", units.ANGULAR_STIFFNESS: "N*m/rad",
}
"""Units of physical dimensions that are not written in SI base units."""
NOISE = 1e-12
"""Lengths [m] and components of unit vectors below this value are rounding errors, and are written as 0."""
ROUNDED, SHORT = 4, 12
"""A double is replaced by a number with at most `SHORT` digits if both differ by at most `ROUNDED` units in the last place."""
FIXED, FIXED_ANGLE = 15, 14
"""Number of decimals of positions [m] and quaternions, and of angles [rad] that are not a round number of degrees.

With more decimals, values would change each time a robot is exported and imported.
"""
_ROUND = 1e-11
"""Maximum difference [rad] between an angle, such as 1.57079632679, and the round number of degrees that replaces it."""


def _format_decimal(value: Decimal) -> str:
    text = f"{value.normalize():f}" if value == 0 or -5 < value.adjusted() < 12 else f"{value.normalize():e}"
    return "0" if value == 0 else text


def scale_number(value: float, power: int, magnitude: float = 0.0) -> str:
    """Multiply a number by a power of ten, and format the exact product: `scale_number(0.0388353, 3)` is `38.8353`.

    The function removes rounding errors. If a larger number `magnitude` was part of the same computation, the rounding error of the larger
    number applies.
    """
    return _format_decimal(_short(float(value), ROUNDED * math.ulp(max(abs(value), abs(magnitude)))).scaleb(power))


def _short(value: float, within: float) -> Decimal:
    """Round a number to fewer digits if the change is at most `within`. For example, 0.039999999999999994 becomes 0.04."""
    exact = Decimal(repr(value))
    if len(exact.as_tuple().digits) > 15:
        short = Decimal(f"{value:.{SHORT}g}")
        return short if abs(short - exact) <= within else exact
    return exact


def length(value: float) -> str:
    """Format a length, given in metres, as a quantity such as `38.8353 mm`. A zero length becomes `0`."""
    return "0" if abs(value) < NOISE else f"{scale_number(value, 3)} mm"


def lengths(values: Sequence[float]) -> str:
    """Format three lengths, given in metres, as one quantity with a common unit: `38.8353 0 62.4 mm`."""
    largest = max(map(abs, values), default=0.0)
    return _share_unit([scale_number(value, 3, largest) if abs(value) >= NOISE else "0" for value in values], "mm")


def dimensions_of(kind: ShapeKind, size: Sequence[float]) -> Sequence[float]:
    """Return the dimensions [m] of a primitive shape, as in documents, from its size as in `Primitive`."""
    if kind in ("cylinder", "capsule"):
        return size[0], 2.0 * size[1]
    return [2.0 * one for one in size] if kind in ("box", "plane") else size


def shape_words(kind: ShapeKind, size: Sequence[float]) -> str:
    """Format the dimensions of a primitive shape, whose size [m] is as in `Primitive`: `box: 10 20 30 mm`, `sphere: {radius: 5 mm}`."""
    first, *others = dimensions_of(kind, size)
    match kind:
        case "sphere":
            return f"sphere: {{radius: {length(first)}}}"
        case "cylinder" | "capsule":
            return f"{kind}: {{radius: {length(first)}, length: {length(others[0])}}}"
        case "plane":
            return f"plane: [{length(first)}, {length(others[0])}]"
        case _:
            return f"{kind}: {lengths([first, *others])}"


def same_place(one: Pose, other: Pose) -> bool:
    """Return whether two poses are equal up to rounding errors."""
    numbers = zip((*one.translation, *sum(one.rotation, ())), (*other.translation, *sum(other.rotation, ())), strict=True)
    return all(abs(a - b) < NOISE for a, b in numbers)


def _share_unit(words: Sequence[str], unit: str) -> str:
    return " ".join(words) if set(words) == {"0"} else f"{' '.join(words)} {unit}"


def mass(value: float) -> str:
    """Format a mass, given in kilograms, as a quantity: `6.9 kg`, `820 g`."""
    return f"{scale_number(value, 0)} kg" if value >= 1.0 else f"{scale_number(value, 3)} g"


def _degrees(value: float) -> str | None:
    """Convert an angle from radians to degrees. Return None if the angle in degrees has more than four decimals."""
    near = round(math.degrees(value), 4)
    return _format_decimal(Decimal(repr(near))) if abs(math.radians(near) - value) < _ROUND else None


def angle(value: float) -> str:
    """Format an angle, given in radians, as a quantity: `90 deg`, `1.5708 rad`, or `0`."""
    if abs(value) < NOISE:
        return "0"
    degrees = _degrees(value)
    return f"{scale_number(value, 0)} rad" if degrees is None else f"{degrees} deg"


def angles(values: Sequence[float]) -> str:
    """Format three angles, given in radians, as one quantity with a common unit. An angle of -180 degrees becomes 180."""
    values = [0.0 if abs(value) < NOISE else math.pi if value == -math.pi else value for value in values]
    degrees = [_degrees(value) for value in values]
    if None in degrees:
        return _share_unit([scale_number(round(value, FIXED_ANGLE), 0) for value in values], "rad")
    return _share_unit([word for word in degrees if word is not None], "deg")


def quantity(value: float, unit: str) -> str:
    """Format a number and its unit as text. Zero is written without a unit."""
    return "0" if value == 0.0 else f"{scale_number(value, 0)} {unit}".rstrip()


def si_unit(dimension: units.Dimension) -> str:
    """Return the SI unit of a physical dimension, in the form `rad^-2` instead of `1/rad^2`."""
    above, _, below = dimension.symbol.partition("/")
    base, _, power = below.partition("^")
    return IN_NEWTONS.get(dimension) or (f"{base}^-{power or 1}" if above == "1" else dimension.symbol)


def flow(values: Mapping[str, str]) -> str:
    """Format a mapping in YAML on one line."""
    return f"{{{', '.join(f'{key}: {value}' for key, value in values.items())}}}"


def was(word: str, name: str) -> str:
    """Return a YAML comment with the source name of an element, or an empty string if the element has the same name in the document."""
    return "" if word == name else f"  # {escape_control(repr(name))} in the source"


def pose_words(pose: Pose, rpy: Vector | None = None, *, before: str = "") -> str:
    """Format a pose as keys of a YAML mapping, such as `xyz: 0 0 50 mm, rpy: -90 0 0 deg`. Zero vectors are omitted.

    A result that is not empty starts with the text `before`. `rpy` [rad] are the angles in the source, if known.
    """
    entries = pose_entries(pose, rpy)
    return before + flow(entries)[1:-1] if entries else ""


def pose_entries(pose: Pose, rpy: Vector | None = None) -> dict[str, str]:
    """Return the keys of a pose in YAML with their values. Zero vectors are omitted.

    Without the angles `rpy` [rad] of the source, the rotation is written in round degrees if possible, else as `quat`, which preserves all
    digits.
    """
    turned = ("rpy", angles(rpy if rpy is not None else rpy_of(pose.rotation)))
    if rpy is None and turned[1].endswith("rad"):
        turned = ("quat", quaternion_words(pose))
    words = (("xyz", lengths([round(one, FIXED) for one in pose.translation])), turned)
    return {key: value for key, value in words if value != "0 0 0"}


def quaternion_words(pose: Pose) -> str:
    """Format a rotation as a unit quaternion in YAML, such as `[1, 0, 0, 0]`.

    The three smaller components are rounded, and the largest component is computed from the rounded components. Therefore, parsing the text
    and formatting the rotation gives the same text.
    """
    q = pose.quaternion()
    largest = max(range(4), key=lambda k: abs(q[k]))
    others = [0.0 if k == largest else round(one, FIXED) for k, one in enumerate(q)]
    others[largest] = math.copysign(math.sqrt(1.0 - math.fsum(one * one for one in others)), q[largest])
    return f"[{', '.join(quantity(one, '') for one in others)}]"
