"""Numbers of the source as quantities of a document: in the unit in which people read them, and to the digits that the source has.

A length of 0.0388353 m is written `38.8353 mm`, which is the same double: a document converts exactly and rounds once. A double of 16 or 17
digits that lies within its rounding of a short number is that number. An angle is in degrees where that is what the source's digits stand
for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal

from thingc.base.pose import Pose, Vector, rpy_of
from thingc.base.safe_text import escape_control
from thingc.tools.importing.source_model import ShapeKind, Sizes

TURNS = ("revolute", "continuous", "ball", "screw")
"""Kinds of joints whose q is an angle."""
NOISE = 1e-12
"""Lengths [m] and directions below it are rounding of whoever wrote the source, and 0."""
ROUNDED, SHORT = 4, 12
"""By how many last places a double may miss a number of so many digits that it stands for."""
FIXED, FIXED_ANGLE = 15, 14
"""Decimals of a position [m] and of a quaternion, and of an angle [rad] that is not a round number of degrees: more would change in every
round trip."""
_ROUND = 1e-11
"""By how much [rad] an angle may miss a round number of degrees that it stands for: 1.57079632679."""


def _format_decimal(value: Decimal) -> str:
    text = f"{value.normalize():f}" if value == 0 or -5 < value.adjusted() < 12 else f"{value.normalize():e}"
    return "0" if value == 0 else text


def scaled(value: float, power: int, beside: float = 0.0) -> str:
    """The number times that power of ten, digit by digit: `scaled(0.0388353, 3)` is `38.8353`. One that was worked out together with a
    larger one `beside` it is rounded as that is."""
    return _format_decimal(_short(float(value), ROUNDED * math.ulp(max(abs(value), abs(beside)))).scaleb(power))


def _short(value: float, within: float) -> Decimal:
    """The number as it was before somebody worked it out in doubles: 0.039999999999999994 is 0.04."""
    exact = Decimal(repr(value))
    if len(exact.as_tuple().digits) > 15:
        short = Decimal(f"{value:.{SHORT}g}")
        return short if abs(short - exact) <= within else exact
    return exact


def length(value: float) -> str:
    """Of metres: `38.8353 mm`, or `0`."""
    return "0" if abs(value) < NOISE else f"{scaled(value, 3)} mm"


def lengths(values: Sequence[float]) -> str:
    """Three at once: `38.8353 0 62.4 mm`."""
    largest = max(map(abs, values), default=0.0)
    return _shared([scaled(value, 3, largest) if abs(value) >= NOISE else "0" for value in values], "mm")


def shape_words(kind: ShapeKind, size: Sizes) -> str:
    """The size of a primitive: `box: 10 20 30 mm`, `sphere: {radius: 5 mm}`."""
    match kind:
        case "sphere":
            return f"sphere: {{radius: {length(size[0])}}}"
        case "cylinder" | "capsule":
            return f"{kind}: {{radius: {length(size[0])}, length: {length(size[-1])}}}"
        case "plane":
            return f"plane: [{length(size[0])}, {length(size[-1])}]"
        case _:
            return f"{kind}: {lengths(size)}"


def same_place(one: Pose, other: Pose) -> bool:
    """Whether two frames are one but for rounding."""
    numbers = zip((*one.translation, *sum(one.rotation, ())), (*other.translation, *sum(other.rotation, ())), strict=True)
    return all(abs(a - b) < NOISE for a, b in numbers)


def _shared(words: Sequence[str], unit: str) -> str:
    return " ".join(words) if set(words) == {"0"} else f"{' '.join(words)} {unit}"


def mass(value: float) -> str:
    """Of kilograms: `6.9 kg`, `820 g`."""
    return f"{scaled(value, 0)} kg" if value >= 1.0 else f"{scaled(value, 3)} g"


def _degrees(value: float) -> str | None:
    """A round number of degrees that an angle [rad] stands for, in four digits behind the point at most; None where it is none."""
    near = round(math.degrees(value), 4)
    return _format_decimal(Decimal(repr(near))) if abs(math.radians(near) - value) < _ROUND else None


def angle(value: float) -> str:
    """Of radians: `90 deg` or `1.5708 rad`, or `0`."""
    if abs(value) < NOISE:
        return "0"
    degrees = _degrees(value)
    return f"{scaled(value, 0)} rad" if degrees is None else f"{degrees} deg"


def angles(values: Sequence[float]) -> str:
    """Three at once, all of them in one unit; a half turn is one to the left, as is usual."""
    values = [0.0 if abs(value) < NOISE else math.pi if value == -math.pi else value for value in values]
    degrees = [_degrees(value) for value in values]
    if None in degrees:
        return _shared([scaled(round(value, FIXED_ANGLE), 0) for value in values], "rad")
    return _shared([word for word in degrees if word is not None], "deg")


def quantity(value: float, unit: str) -> str:
    """Any other, in its unit; `0` alone."""
    return "0" if value == 0.0 else f"{scaled(value, 0)} {unit}".rstrip()


def was(word: str, name: str) -> str:
    """A comment where the source has another name."""
    return "" if word == name else f"  # {escape_control(repr(name))} in the source"


def pose_words(pose: Pose, rpy: Vector | None = None, *, before: str = "") -> str:
    """`xyz: 0 0 50 mm, rpy: -90 0 0 deg`, each where it says something; with `before` in front of it, if there is anything. `rpy` [rad] are
    the angles of the source, where it has them; one that is worked out is written in round degrees, or else as a `quat`, which keeps all of
    its digits."""
    turned = ("rpy", angles(rpy if rpy is not None else rpy_of(pose.rotation)))
    if rpy is None and turned[1].endswith("rad"):
        turned = ("quat", quaternion_words(pose))
    words = (("xyz", lengths([round(one, FIXED) for one in pose.translation])), turned)
    said = [f"{key}: {value}" for key, value in words if value != "0 0 0"]
    return f"{before if said else ''}{', '.join(said)}"


def quaternion_words(pose: Pose) -> str:
    """`[1, 0, 0, 0]`: the largest number follows from the others, which are rounded. Reading the words gives the same words."""
    q = pose.quaternion()
    largest = max(range(4), key=lambda k: abs(q[k]))
    others = [0.0 if k == largest else round(one, FIXED) for k, one in enumerate(q)]
    others[largest] = math.copysign(math.sqrt(1.0 - math.fsum(one * one for one in others)), q[largest])
    return f"[{', '.join(quantity(one, '') for one in others)}]"
