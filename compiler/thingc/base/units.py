"""Parse quantities: numbers with a unit, such as `120 mm`, `4.1 N*m` or `1270 kg/m^3`.

All supported units are in a fixed table. Every other unit raises an error with a hint. The conversion to SI units uses exact integer
arithmetic and rounds once, so `72 mm` is the float that is nearest to 0.072.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Union

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import for_text
from thingc.base.suggestions import Hint, Suggestion, closest_name, nearest
from thingc.base.unit_spellings import SYNONYMS, spellings

if TYPE_CHECKING:
    from fractions import Fraction

Exponent = Union[int, "Fraction"]


class UnitError(ValueError):
    """Raised if a string is not a valid quantity, or if the quantity has a wrong physical dimension.

    `kind` is `unit` for a missing or unknown unit, `dimension` for a wrong physical dimension, and `quantity` for any other error. `offset`
    and `end` are the range of the invalid characters in the string, or None if the whole string is invalid.
    """

    def __init__(
        self, message: Hint, *, kind: str = "quantity", help: Hint | None = None, offset: int | None = None, end: int | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.kind = kind
        self.help = help
        self.offset = offset
        self.end = end


class Dimension(FrozenStruct, kw_only=False):
    """A physical dimension: the exponents of length, mass, time and angle. The exponents are integers except after a square root.

    Angle is treated as a physical dimension, so that the number 30 is not interpreted as 30 degrees. See `fits` for exceptions.
    """

    length: Exponent = 0
    mass: Exponent = 0
    time: Exponent = 0
    angle: Exponent = 0

    def __mul__(self, other: Dimension) -> Dimension:
        """Return the physical dimension of the product of two quantities."""
        return Dimension(
            _whole(self.length + other.length), _whole(self.mass + other.mass),
            _whole(self.time + other.time), _whole(self.angle + other.angle),
        )

    def __truediv__(self, other: Dimension) -> Dimension:
        """Return the physical dimension of the quotient of two quantities."""
        return self * other**-1

    def __pow__(self, power: Exponent) -> Dimension:
        """Return the physical dimension of a power of a quantity."""
        return Dimension(_whole(self.length * power), _whole(self.mass * power), _whole(self.time * power), _whole(self.angle * power))

    @property
    def words(self) -> str:
        """The name of this physical dimension for messages, such as `a length`, `an angle` or `a quantity in m^2*kg`."""
        return _WORDS[self][0] if self in _WORDS else f"a quantity in {self.symbol}"

    @property
    def example(self) -> str:
        """An example of a quantity with this physical dimension, such as `120 mm`."""
        return _WORDS[self][1] if self in _WORDS else f"2 {self.symbol}"

    @property
    def symbol(self) -> str:
        """The unit of this physical dimension in SI base units, such as `kg*m^2/s^2`. The result is an empty string for plain numbers."""
        numerator: list[str] = []
        denominator: list[str] = []
        for unit, exponent in (("kg", self.mass), ("m", self.length), ("rad", self.angle), ("s", self.time)):
            if exponent:
                size = abs(exponent)
                factor = unit if size == 1 else f"{unit}^{size}" if isinstance(size, int) else f"{unit}^({size})"
                (numerator if exponent > 0 else denominator).append(factor)
        return "/".join(["*".join(numerator) or ("1" if denominator else ""), *denominator])


def _whole(exponent: Exponent) -> Exponent:
    """Convert a fraction with the denominator 1 to an integer. Other exponents are returned unchanged."""
    return exponent.numerator if exponent.denominator == 1 else exponent


_WORDS: dict[Dimension, tuple[str, str]] = {}


def _dimension(description: str, example: str, **exponents: Exponent) -> Dimension:
    """Create a physical dimension, with its description and an example for messages."""
    dimension = Dimension(**exponents)
    _WORDS[dimension] = description, example
    return dimension


NUMBER = _dimension("a number", "2")
LENGTH = _dimension("a length", "120 mm", length=1)
MASS = _dimension("a mass", "120 g", mass=1)
TIME = _dimension("a time", "2 ms", time=1)
ANGLE = _dimension("an angle", "30 deg", angle=1)
AREA = _dimension("an area", "120 mm^2", length=2)
VOLUME = _dimension("a volume", "120 mm^3", length=3)
DENSITY = _dimension("a density", "1270 kg/m^3", mass=1, length=-3)
VELOCITY = _dimension("a velocity", "0.5 m/s", length=1, time=-1)
ANGULAR_VELOCITY = _dimension("an angular velocity", "46 rpm", angle=1, time=-1)
ACCELERATION = _dimension("an acceleration", "9.81 m/s^2", length=1, time=-2)
FORCE = _dimension("a force", "300 N", mass=1, length=1, time=-2)
TORQUE = _dimension("a torque", "4.1 N*m", mass=1, length=2, time=-2)
POWER = _dimension("a power", "10 W", mass=1, length=2, time=-3)
PRESSURE = _dimension("a pressure", "2 MPa", mass=1, length=-1, time=-2)
FREQUENCY = _dimension("a frequency", "50 Hz", time=-1)
INERTIA = _dimension("a moment of inertia", "0.01 kg*m^2", mass=1, length=2)
ANGULAR_DAMPING = _dimension("an angular damping", "0.02 N*m*s/rad", mass=1, length=2, time=-1, angle=-1)
LINEAR_DAMPING = _dimension("a linear damping", "2 N*s/m", mass=1, time=-1)
ANGULAR_STIFFNESS = _dimension("an angular stiffness", "2 N*m/rad", mass=1, length=2, time=-2, angle=-1)
LINEAR_STIFFNESS = _dimension("a linear stiffness", "200 N/m", mass=1, time=-2)
LENGTH_PER_ANGLE = _dimension("a length per angle", "10 mm/rad", length=1, angle=-1)
ANGLE_PER_LENGTH = _dimension("an angle per length", "10 rad/m", length=-1, angle=1)


def fits(found: Dimension, expected: Dimension) -> bool:
    """Return whether a quantity of dimension `found` is valid where `expected` is required.

    The exponents of length, mass and time must be equal in both dimensions. The exponents of angle must also be equal, unless the dimension
    contains mass. Torque, damping, stiffness and inertia can be written with and without `/rad`: `N*m*s/rad` and `N*m*s` are the same
    damping. For all other quantities the angle counts, so `rad/s` is not valid as `Hz`, and `mm/rad` is not valid as `mm`.
    """
    return (
        found.length == expected.length and found.mass == expected.mass and found.time == expected.time
        and (found.angle == expected.angle or expected.mass != 0)
    )


class Quantity(FrozenStruct, kw_only=False):
    """A finite number `value` in SI base units (m, kg, s, rad), together with its physical dimension."""

    value: float
    dimension: Dimension = NUMBER

    def fits(self, expected: Dimension) -> bool:
        """Return whether this quantity is valid where the physical dimension `expected` is required. The number 0 is valid everywhere."""
        return fits(self.dimension, expected) or (self.value == 0.0 and self.dimension == NUMBER)

    def __str__(self) -> str:
        """Format this quantity for messages with six digits and a common unit, such as mm, deg or g."""
        return self.format(6)

    def format(self, digits: int) -> str:
        """Format this quantity for messages with `digits` significant digits and a common unit, such as mm, deg or g."""
        value = for_text(self.value)
        if self.dimension == MASS and abs(value) >= 1.0:
            return f"{value:.{digits}g} kg"
        for dimension, unit, scale in _SHOWN:
            if dimension == self.dimension:
                return f"{value * scale:z.{digits}g} {unit}"
        return f"{value:z.{digits}g} {self.dimension.symbol}".rstrip()


_SHOWN = ((LENGTH, "mm", 1e3), (ANGLE, "deg", 180.0 / math.pi), (MASS, "g", 1e3), (TORQUE, "N*m", 1.0), (FORCE, "N", 1.0))

_PI = 31415926535897932384626433832795028841971693993751058209749445923
"""Pi with 65 digits, so that angles are rounded once: pi = _PI / _PI_ONE."""
_PI_ONE = 10**64

Unit = tuple[int, int, Dimension]
"""SI value of a unit as numerator and denominator, and its physical dimension."""

UNITS: dict[str, Unit] = {
    "%": (1, 100, NUMBER),
    "um": (1, 10**6, LENGTH), "mm": (1, 1000, LENGTH), "cm": (1, 100, LENGTH), "dm": (1, 10, LENGTH), "m": (1, 1, LENGTH),
    "km": (1000, 1, LENGTH), "in": (254, 10**4, LENGTH), "ft": (3048, 10**4, LENGTH),
    "mg": (1, 10**6, MASS), "g": (1, 1000, MASS), "kg": (1, 1, MASS), "t": (1000, 1, MASS), "lb": (45359237, 10**8, MASS),
    "us": (1, 10**6, TIME), "ms": (1, 1000, TIME), "s": (1, 1, TIME), "min": (60, 1, TIME), "h": (3600, 1, TIME),
    "mrad": (1, 1000, ANGLE), "rad": (1, 1, ANGLE), "deg": (_PI, 180 * _PI_ONE, ANGLE), "rev": (2 * _PI, _PI_ONE, ANGLE),
    "rpm": (2 * _PI, 60 * _PI_ONE, ANGULAR_VELOCITY),
    "Hz": (1, 1, FREQUENCY), "kHz": (1000, 1, FREQUENCY),
    "mN": (1, 1000, FORCE), "N": (1, 1, FORCE), "kN": (1000, 1, FORCE), "kgf": (980665, 10**5, FORCE),
    "lbf": (45359237 * 980665, 10**13, FORCE), "ozf": (45359237 * 980665, 16 * 10**13, FORCE),
    "mJ": (1, 1000, TORQUE), "J": (1, 1, TORQUE), "kJ": (1000, 1, TORQUE),
    "mW": (1, 1000, POWER), "W": (1, 1, POWER), "kW": (1000, 1, POWER),
    "Pa": (1, 1, PRESSURE), "kPa": (1000, 1, PRESSURE), "MPa": (10**6, 1, PRESSURE), "GPa": (10**9, 1, PRESSURE),
}
"""All supported units. `in`, `ft`, `lb` and `lbf` are the international units (exact by definition)."""

_DEGREE = UNITS["deg"]

NUMBER_TEXT = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
"""A number in a text."""
_UNIT_WORD = re.compile(r"[^\W\d_²³]+|%|°")
_POWER = re.compile(r"(?:\^|\*\*)\s*([-+]?\d{1,2})(?!\d)", re.ASCII)
_SUPERSCRIPT = {"²": 2, "³": 3}
_OPERATOR = re.compile(r"\s*([*/·])\s*")

MAX_TEXT = 1000
"""Maximum number of characters of a quantity or expression."""
MAX_FACTORS = 12
"""Maximum number of factors of a unit."""


def exact(number: str) -> tuple[int, int]:
    """Convert a decimal number to an exact fraction. Return the numerator and the denominator.

    Numbers below about 1e-2000 are converted to 0. Raises `UnitError` of the kind `quantity` if the exponent of ten is above 400.
    """
    mantissa, _, power = number.lower().partition("e")
    integer, _, decimals = mantissa.partition(".")
    exponent = int(power or "0") - len(decimals)
    digits = int((integer + decimals) or "0")
    if digits == 0:
        return 0, 1
    if exponent > 400:
        raise UnitError(f"the number `{shorten(number)}` is too large", offset=0, end=len(number))
    if exponent < -2000:
        return 0, 1
    return (digits * 10**exponent, 1) if exponent >= 0 else (digits, 10**-exponent)


def to_si(number: str, unit: Unit) -> float:
    """Convert a decimal number in some unit to SI units. The exact value is rounded once to the nearest float.

    For degrees, the function returns the result of `math.radians`, which `math.degrees` converts back best. The last bit may differ from
    the exact value. Raises `UnitError` of the kind `quantity` if the value is too large for a double.
    """
    numerator, denominator = exact(number)
    try:
        value = math.radians(numerator / denominator) if unit == _DEGREE else (numerator * unit[0]) / (denominator * unit[1])
    except OverflowError:
        raise UnitError(f"the number `{shorten(number)}` is too large", offset=0, end=len(number)) from None
    return value + 0.0  # this converts -0 to 0


def scan_number(text: str, at: int = 0) -> tuple[str, int] | None:
    """Return the signed number that begins at the index `at` of a text, and the index after the number.

    Return None if there is no number.
    """
    match = NUMBER_TEXT.match(text, at)
    return (match.group(), match.end()) if match else None


def scan_unit(text: str, at: int, *, compact: bool = False, expected: tuple[Dimension, ...] = ()) -> tuple[Unit, int]:
    """Return the unit that begins at the index `at` of a text, such as `N*m*s/rad`, and the index after the unit.

    With `compact`, as in expressions, a unit must not contain spaces, and ends before a `*` or `/` that is not followed by a unit. For
    example, `8 mm*i` is 8 mm times i. Raises `UnitError` of the kind `unit` if the unit is missing or unknown. The help text of an unknown
    unit suggests a unit with one of the `expected` physical dimensions.
    """
    numerator, denominator, dimension = 1, 1, NUMBER
    sign = 1
    start = at
    for factor in range(MAX_FACTORS + 1):
        if factor == MAX_FACTORS:
            raise UnitError(f"a unit of more than {MAX_FACTORS} factors", kind="unit", offset=start, end=at)
        name = _UNIT_WORD.match(text, at)
        if name is None:
            character = text[at : at + 1]
            raise UnitError(
                f"expected a unit after `{text[start:at].strip()}`, found {f'`{character}`' if character else 'nothing'}",
                kind="unit", offset=at, end=at + 1,
            )
        base = UNITS.get(name.group())
        if base is None:
            raise _unknown_unit(text, start, *name.span(), expected)
        exponent, at = _power(text, name, compact=compact)
        dimension = dimension * base[2] ** (sign * exponent)
        upper, lower = base[0] ** abs(exponent), base[1] ** abs(exponent)
        if sign * exponent < 0:
            upper, lower = lower, upper
        numerator, denominator = numerator * upper, denominator * lower
        following = _OPERATOR.match(text, at)
        if following is None or compact and not _unit_after(text, following):
            break
        sign = -1 if following.group(1) == "/" else 1
        at = following.end()
    return (numerator, denominator, dimension), at


def _power(text: str, name: re.Match[str], *, compact: bool) -> tuple[int, int]:
    """Return the exponent that follows a unit, or 1 if there is no exponent, and the index after the exponent.

    With `compact`, as in expressions, `**` is not treated as an exponent. Raises `UnitError` for an invalid exponent.
    """
    at = name.end()
    power = _POWER.match(text, at)
    if power is not None and not (compact and power.group().startswith("**")):
        exponent = int(power.group(1))
        if abs(exponent) > 12:
            raise UnitError(f"the power {exponent} of `{name.group()}` is out of range (-12 to 12)", offset=power.start(), end=power.end())
        return exponent, power.end()
    return (_SUPERSCRIPT[text[at]], at + 1) if text[at : at + 1] in _SUPERSCRIPT else (1, at)


def _unit_after(text: str, operator: re.Match[str]) -> bool:
    """Return whether the operator `*` or `/` of an expression is directly followed by a unit."""
    name = _UNIT_WORD.match(text, operator.start() + 1)
    return operator.end() - operator.start() == 1 and name is not None and name.group() in UNITS and not _continues(text, name.end())


def _continues(text: str, at: int) -> bool:
    """Return whether an identifier continues at the index `at` of a text.

    For example, `m_2` and `s(` do not contain the units `m` and `s`.
    """
    return at < len(text) and (text[at] in "_(." or text[at].isdigit())


def _unknown_unit(text: str, start: int, at: int, end: int, expected: tuple[Dimension, ...]) -> UnitError:
    """Create the exception for an unknown unit. The message suggests a similar unit.

    The unit begins at the index `start` of `text`, and the characters from `at` to `end` (exclusive) are unknown. A unit with a `expected`
    physical dimension is preferred if it differs only in the second letter (`mn` for a length).
    """
    unknown = text[at:end]
    candidates = [unit for unit, (_, _, dimension) in UNITS.items() if dimension in expected]
    similar = nearest(unknown, candidates) or nearest(unknown, UNITS) or SYNONYMS.get(nearest(unknown, SYNONYMS) or "")
    is_close = similar and closest_name(unknown, UNITS) == similar and len(unknown) > 1
    typo = similar if is_close and similar and (unknown[0] == similar[0] or unknown == "MM") else None
    certain = SYNONYMS.get(unknown) or typo
    replacement = certain or next((unit for unit in candidates if len(unit) == len(unknown) == 2 and unit[0] == unknown[0]), None)
    stops = (start + len(re.match(r"[^\s()+,]*", text[start:]).group()), end)  # type: ignore[union-attr]
    product, stop = next(((unit, stop) for stop in stops if (unit := meant_unit(text[start:stop], expected))), (None, end))
    if product and not replacement:
        at, end, unknown, replacement, certain = start, stop, text[start:stop], product, product
    replacement = replacement or similar
    message = f"unknown unit `{shorten(unknown)}`" + (f"; did you mean `{replacement}`?" if replacement else "")
    help = None if replacement else "use a unit such as mm, m, deg, rad, g, kg, s, N, N*m, rpm, kg/m^3, %"
    return UnitError(Suggestion(message, (unknown, certain) if certain else None), kind="unit", offset=at, end=end, help=help)


def meant_unit(text: str, expected: tuple[Dimension, ...] = ()) -> str | None:
    """Return the correct spelling of a unit that is spelled informally, or None if the unit is unknown.

    For example, `Nms/rad` means `N*m*s/rad`, `kg m2` means `kg*m^2`, and `kg-cm` means `kgf*cm`. The unit must have one of the `expected`
    physical dimensions. If `expected` is empty, every physical dimension that has a name is accepted.
    """
    spelled = spellings(text.strip(), UNITS)
    spelled += [re.sub(r"\b(kg|lb)\b", r"\1f", spelling) for spelling in spelled]
    valid = [spelling for spelling in spelled if any(fits(scan_unit(spelling, 0)[0][2], dimension) for dimension in expected or _WORDS)]
    return min(valid, key=lambda spelling: len(_OPERATOR.findall(spelling)), default=None)


def parse_quantity(text: str, expected: tuple[Dimension, ...] = ()) -> Quantity:
    """Parse a quantity such as `120 mm`, `4.1 N*m` or `15 %`. A number without a unit has the dimension `NUMBER`.

    Spaces around `*` and `/`, and between the number and the unit, are optional. Raises `UnitError`, whose offsets count the characters of
    `text`. The help text of the error suggests a unit with a `expected` physical dimension.
    """
    if len(text) > MAX_TEXT:
        raise UnitError(f"the quantity has {len(text)} characters (at most {MAX_TEXT} are allowed)")
    at = len(text) - len(text.lstrip())
    scanned = scan_number(text, at)
    if scanned is None:
        raise UnitError(f"expected a number with a unit, found `{shorten(text.strip())}`", help="write, for example, `120 mm`")
    number, end_of_number = scanned
    at = len(text) - len(text[end_of_number:].lstrip())
    if at == len(text):
        return Quantity(to_si(number, (1, 1, NUMBER)))
    if text[at] == "_" and at == end_of_number:
        raise UnitError(f"expected a number, found `{shorten(text.strip())}`", help="remove `_` from the number")
    if scan_number(text, at) is not None or _UNIT_WORD.match(text, at) is None:
        raise UnitError(
            f"expected a unit after `{number}`, found `{shorten(text[at:])}`", offset=at, end=len(text),
            help=f"an expression begins with `=`: `={text.strip()}`" if text[at] in "+-*/()" else None,
        )
    unit, end = scan_unit(text, at, expected=expected)
    if text[end:].strip():
        product = meant_unit(text[at:], expected)
        raise UnitError(
            f"unexpected `{shorten(text[end:].strip())}` after `{text[:end].strip()}`", offset=end, end=len(text),
            help=f"write `{number} {product}`" if product else "an expression begins with `=`" if re.search(r"[-+(]", text[end:]) else None,
        )
    return Quantity(to_si(number, unit), unit[2])


def check_dimension(quantity: Quantity, expected: tuple[Dimension, ...], text: str) -> Quantity:
    """Return a quantity if its physical dimension is one of the `expected` dimensions. The number 0 is valid for all physical dimensions.

    `text` is the source text of the quantity. Raises `UnitError` of the kind `unit` if only the unit is missing. Raises `UnitError` of the
    kind `dimension`, with both physical dimensions in the message, if the unit has the wrong dimension.
    """
    for dimension in expected:
        if quantity.fits(dimension):
            return quantity
    found = shorten(text.strip())
    required = _join_choices([dimension.words for dimension in expected])
    first = expected[0]
    if quantity.dimension == NUMBER and NUMBER not in expected:
        number_text = found if scan_number(found) == (found, len(found)) else f"{quantity.value:.6g}"
        choices = [unit for dimension in expected for unit in suggested_units(dimension, number_text)[: 2 if len(expected) == 1 else 1]]
        advice = "write " + _join_choices([f"`{number_text} {unit}`" for unit in choices])
        certain = len(expected) == 1 and number_text == text.strip() and quantity.value >= _SURELY.get(first, math.inf)
        raise UnitError(
            f"{required} needs a unit, found `{found}`", kind="unit",
            help=Suggestion(advice, (number_text, f"{number_text} {choices[0]}") if certain else None),
        )
    example = _join_choices([dimension.example for dimension in expected])
    number, at = scan_number(text.strip()) or ("", 0)
    unit = meant_unit(text.strip()[at:], expected) if number else None
    raise UnitError(
        f"expected {required} (such as {example}), found {quantity.dimension.words} (`{found}`)", kind="dimension",
        help=f"write `{number} {unit}`" if unit else None,
    )


def _join_choices(words: list[str]) -> str:
    """Join words for a message: `a, b or c`."""
    *first, last = words
    return f"{', '.join(first)} or {last}" if first else last


def suggested_units(dimension: Dimension, numbers: str) -> tuple[str, ...]:
    """Return the units that a user probably meant by numbers without a unit, the most likely unit first.

    `numbers` is the text of the numbers. For small fractions, such as `1.57` or `0 0 0.12`, the first suggestion is the SI unit that URDF
    and MJCF use. For all other numbers, the first suggestion is the unit that is common in drawings, such as mm.
    """
    common, si, bound = _SUGGESTED.get(dimension, (dimension.example.partition(" ")[2], "", 0.0))
    if not si:
        return (common,)
    values = [float(number) for number in NUMBER_TEXT.findall(numbers)]
    small = any(value != int(value) for value in values if abs(value) < bound) and all(abs(value) < bound for value in values)
    return (si, common) if small else (common, si)


_SUGGESTED: dict[Dimension, tuple[str, str, float]] = {
    LENGTH: ("mm", "m", 2.0), ANGLE: ("deg", "rad", 6.3), MASS: ("g", "kg", 10.0), TIME: ("s", "ms", 0.0),
    ANGULAR_VELOCITY: ("rpm", "rad/s", 0.0),
}
"""For each physical dimension: the unit that is common in drawings, an alternative unit, and a bound. For fractions below the bound, the
alternative unit is suggested first.
"""

_SURELY: dict[Dimension, float] = {
    DENSITY: 100.0,
    **dict.fromkeys((FORCE, ACCELERATION, ANGULAR_STIFFNESS, LINEAR_STIFFNESS, ANGULAR_DAMPING, LINEAR_DAMPING), -math.inf),
}
"""Smallest value [SI], by physical dimension, for which a number without a unit has only one plausible unit. For example, a density of 100
must be in kg/m^3, because no material has a density of 100 g/cm^3.
"""


def shorten(text: str, limit: int = 60) -> str:
    """Shorten a source text to a single line for a message. Text beyond `limit` characters is omitted."""
    return flat if len(flat := " ".join(text.split())) <= limit else flat[: limit - 3] + "..."
