"""Quantities: values and dimensions are compared with pint, error messages exactly."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from fractions import Fraction
from functools import cache
from typing import Any

import pytest
from hypothesis import given, strategies as st

from thingc.base.diagnostics import Code, Report
from thingc.base.source import Span
from thingc.base.suggestions import Suggestion, text_of
from thingc.base.units import (
    ACCELERATION,
    ANGLE,
    ANGULAR_DAMPING,
    ANGULAR_STIFFNESS,
    ANGULAR_VELOCITY,
    DENSITY,
    FORCE,
    FREQUENCY,
    INERTIA,
    LENGTH,
    LENGTH_PER_ANGLE,
    LINEAR_DAMPING,
    MASS,
    NUMBER,
    TIME,
    TORQUE,
    UNITS,
    VELOCITY,
    Dimension,
    Quantity,
    UnitError,
    check_dimension,
    fits,
    parse_quantity,
)
from thingc.base.vector_text import parse_vector

OURS_IN_PINT = {
    "%": "percent", "rev": "turn", "t": "metric_ton", "kgf": "kilogram_force", "lbf": "pound_force", "ozf": "ounce_force",
    "in": "inch", "us": "microsecond", "h": "hour", "um": "micrometer",
}
COMPOUND = [
    "N*m", "mN*m", "N*mm", "kgf*cm", "ozf*in", "kg*m^2", "g*cm^2", "kg/m^3", "g/cm^3", "m/s^2", "mm/s", "rad/s", "deg/s",
    "N*m/rad",
    "N*m*s/rad", "N*s/m", "mm/rad", "rad/m", "J/deg", "W", "kN/mm",
]


@cache
def registry() -> Any:
    """The unit registry of pint. It is created when a test needs it, because pytest inspects every name of a module."""
    import pint

    return pint.UnitRegistry(non_int_type=Fraction)


def oracle(unit: str) -> tuple[float, Dimension]:
    """Value in SI base units and dimension of one unit by pint, which treats angles as numbers."""
    words, angle = [], 0
    sign = 1
    for piece in unit.replace("/", " / ").replace("*", " * ").split():
        if piece in "*/":
            sign = -1 if piece == "/" else 1
            words.append(piece)
            continue
        name, _, power = piece.partition("^")
        words.append(OURS_IN_PINT.get(name, name) + (f"**{power}" if power else ""))
        if name in ("rad", "mrad", "deg", "rev", "rpm"):
            angle += sign * int(power or 1)
    quantity = registry().Quantity(Fraction(1), registry().parse_units("".join(words))).to_base_units()
    found = quantity.dimensionality
    return float(quantity.magnitude), Dimension(
        length=int(found.get("[length]", 0)), mass=int(found.get("[mass]", 0)), time=int(found.get("[time]", 0)), angle=angle,
    )


@pytest.mark.parametrize("unit", [*UNITS, *COMPOUND])
def test_units_match_pint(unit: str) -> None:
    value, dimension = oracle(unit)
    ours = parse_quantity(f"1 {unit}")
    assert ours.value == pytest.approx(value, rel=1e-15)
    assert ours.dimension == dimension


@given(st.decimals(min_value=-10**9, max_value=10**9, allow_nan=False, places=7),
    st.sampled_from(["mm", "g", "kg/m^3", "N*m", "us", "in", "%"]))
def test_conversion_is_correctly_rounded(number: Decimal, unit: str) -> None:
    scale = {"mm": Fraction(1, 1000), "g": Fraction(1, 1000), "kg/m^3": Fraction(1), "N*m": Fraction(1), "us": Fraction(1, 10**6),
             "in": Fraction(254, 10000), "%": Fraction(1, 100)}[unit]
    assert parse_quantity(f"{number:f} {unit}").value == float(Fraction(number) * scale)


@given(st.floats(min_value=-1e300, max_value=1e300))
def test_repr_of_floats_round_trips(value: float) -> None:
    assert parse_quantity(repr(value)) == Quantity(value + 0.0)
    assert parse_quantity(f"{value!r} m") == Quantity(value + 0.0, LENGTH)


def test_common_values_are_exact() -> None:
    assert parse_quantity("72 mm").value == 0.072
    assert parse_quantity("0.1 mm").value == 1e-4
    assert parse_quantity("90 deg").value == math.pi / 2
    assert parse_quantity("180 deg").value == math.pi
    assert parse_quantity("1 rev").value == 2 * math.pi
    assert parse_quantity("15 %") == Quantity(0.15)
    assert parse_quantity("60 rpm").value == 2 * math.pi
    assert str(parse_quantity("-0 mm").value) == "0.0"


@given(st.integers(min_value=-3600, max_value=3600))
def test_degrees_match_math_radians(degrees: int) -> None:
    assert parse_quantity(f"{degrees} deg").value == math.radians(degrees)


@given(st.integers(min_value=-3600, max_value=3600), st.sampled_from([("rpm", 30), ("rev", Fraction(1, 2)), ("deg/s", 180)]))
def test_other_angular_units_are_correctly_rounded(number: int, unit: tuple[str, int | Fraction]) -> None:
    """The oracle is mpmath with 60 digits."""
    from mpmath import mp, mpf

    with mp.workdps(60):
        scale = Fraction(unit[1])
        expected = float(mpf(number) * mp.pi * scale.denominator / scale.numerator)
    assert parse_quantity(f"{number} {unit[0]}").value == expected


@pytest.mark.parametrize("text",
    ["4.1 N*m", "4.1 N * m", "4.1N*m", " 4.1  N* m ", "4.1 m*N", "4.1 N·m", "4.1 J", "4100 N*mm", "+4.1e0 N*m"])
def test_equivalent_spellings_of_a_torque(text: str) -> None:
    assert parse_quantity(text) == Quantity(4.1, TORQUE)


@pytest.mark.parametrize(("text", "dimension"), [
    ("1 kg*m^2", INERTIA), ("1 kg*m**2", INERTIA), ("1 kg*m²", INERTIA), ("1 m^-3*kg", DENSITY), ("1 mm/rad", LENGTH_PER_ANGLE),
    ("1 rad/s", ANGULAR_VELOCITY), ("1 Hz", FREQUENCY), ("1 N*m*s/rad", ANGULAR_DAMPING), ("1 kg*m/s^2", FORCE),
])
def test_dimensions_of_products(text: str, dimension: Dimension) -> None:
    assert parse_quantity(text).dimension == dimension


@pytest.mark.parametrize(("text", "message", "kind", "place"), [
    ("12 mmm", "unknown unit `mmm`; did you mean `mm`?", "unit", (3, 6)),
    ("4 Nm", "unknown unit `Nm`; did you mean `N*m`?", "unit", (2, 4)),
    ("30 degrees", "unknown unit `degrees`; did you mean `deg`?", "unit", (3, 10)),
    ("30 °", "unknown unit `°`; did you mean `deg`?", "unit", (3, 4)),
    ("3 kg/mmm^3", "unknown unit `mmm`; did you mean `mm`?", "unit", (5, 8)),
    ("3 xyzzy", "unknown unit `xyzzy`", "unit", (2, 7)),
    ("5 m*", "expected a unit after `m*`, found nothing", "unit", (4, 5)),
    ("5 m/3", "expected a unit after `m/`, found `3`", "unit", (4, 5)),
    ("5 mm + 3", "unexpected `+ 3` after `5 mm`", "quantity", (4, 8)),
    ("5 mm 3", "unexpected `3` after `5 mm`", "quantity", (4, 6)),
    ("5 6 mm", "expected a unit after `5`, found `6 mm`", "quantity", (2, 6)),
    ("5:1", "expected a unit after `5`, found `:1`", "quantity", (1, 3)),
    ("5 _mm", "expected a unit after `5`, found `_mm`", "quantity", (2, 5)),
    ("5 m^99", "the power 99 of `m` is out of range (-12 to 12)", "quantity", (3, 6)),
    ("1e999 m", "the number `1e999` is too large", "quantity", (0, 5)),
    ("1_000 mm", "expected a number, found `1_000 mm`", "quantity", None),
    ("long", "expected a number with a unit, found `long`", "quantity", None),
    ("", "expected a number with a unit, found ``", "quantity", None),
    ("inf mm", "expected a number with a unit, found `inf mm`", "quantity", None),
    ("nan", "expected a number with a unit, found `nan`", "quantity", None),
    ("1 " + "*".join(["m"] * 13), "a unit of more than 12 factors", "unit", (2, 26)),
    ("1" * 1001, "the quantity has 1001 characters (at most 1000 are allowed)", "quantity", None),
])
def test_error_messages_and_positions(text: str, message: str, kind: str, place: tuple[int, int] | None) -> None:
    with pytest.raises(UnitError) as caught:
        parse_quantity(text)
    assert str(caught.value.message) == message
    assert caught.value.kind == kind
    assert (caught.value.offset, caught.value.end) == (place or (None, None))


@pytest.mark.parametrize(("text", "expected", "message", "help"), [
    ("30", (ANGLE,), "an angle needs a unit, found `30`", "write `30 deg` or `30 rad`"),
    ("120", (LENGTH,), "a length needs a unit, found `120`", "write `120 mm` or `120 m`"),
    ("3", (TORQUE, FORCE), "a torque or a force needs a unit, found `3`", "write `3 N*m` or `3 N`"),
    ("1.57", (ANGLE,), "an angle needs a unit, found `1.57`", "write `1.57 rad` or `1.57 deg`"),
    ("0.12", (LENGTH,), "a length needs a unit, found `0.12`", "write `0.12 m` or `0.12 mm`"),
    ("12.5", (LENGTH,), "a length needs a unit, found `12.5`", "write `12.5 mm` or `12.5 m`"),
    ("20", (ANGULAR_STIFFNESS,), "an angular stiffness needs a unit, found `20`", "write `20 N*m/rad`"),
    ("120 g", (LENGTH,), "expected a length (such as 120 mm), found a mass (`120 g`)", None),
    ("30 deg", (NUMBER,), "expected a number (such as 2), found an angle (`30 deg`)", None),
    ("10 rad/s", (FREQUENCY,), "expected a frequency (such as 50 Hz), found an angular velocity (`10 rad/s`)", None),
    ("1 m^2*kg*s", (LENGTH,), "expected a length (such as 120 mm), found a quantity in kg*m^2*s (`1 m^2*kg*s`)", None),
])
def test_wrong_dimension_messages_name_both_dimensions(text: str, expected: tuple[Dimension, ...], message: str, help: str | None) -> None:
    with pytest.raises(UnitError) as caught:
        check_dimension(parse_quantity(text), expected, text)
    assert str(caught.value.message) == message
    assert text_of(caught.value.help) == help


def test_suggestion_has_text_and_edit() -> None:
    """For a unit with exactly one correction, text and edit are fields. A diagnostic from the plain text has no fix."""
    with pytest.raises(UnitError) as caught:
        parse_quantity("12 mmm")
    message = caught.value.message
    assert message == Suggestion("unknown unit `mmm`; did you mean `mm`?", ("mmm", "mm"))
    assert not isinstance(message, str) and type(str(message)) is str
    with pytest.raises(AttributeError):
        message.fix = None  # type: ignore[misc]
    report = Report()
    report.add(Code.BAD_UNIT, message, Span(file="a.yaml", line=1, column=4, end_line=1, end_column=10))
    report.add(Code.BAD_UNIT, str(message), None)
    assert [[(edit.written, edit.replacement) for edit in one.fixes] for one in report.diagnostics] == [[("mmm", "mm")], []]
    assert {type(one.message) for one in report.diagnostics} == {str}


def test_angle_matters_only_without_mass() -> None:
    """Dimensions with mass may differ in angle, such as N*m/rad and N*m. Without mass, the angle must match."""
    assert fits(parse_quantity("1 N*m*s").dimension, ANGULAR_DAMPING)
    assert fits(parse_quantity("1 N*m/rad").dimension, TORQUE)
    assert not fits(NUMBER, ANGLE)
    assert not fits(ANGLE, NUMBER)
    assert not fits(FREQUENCY, ANGULAR_VELOCITY)
    assert not fits(LENGTH_PER_ANGLE, LENGTH)
    assert parse_quantity("0").fits(LENGTH)
    assert not parse_quantity("0 g").fits(LENGTH)
    assert not parse_quantity("1").fits(ANGLE)


def test_vectors_are_parsed() -> None:
    assert parse_vector("0 120 -30 mm") == (Quantity(0.0, LENGTH), Quantity(0.12, LENGTH), Quantity(-0.03, LENGTH))
    assert [part.value for part in parse_vector("0 0 -9.81 m/s^2")] == [0.0, 0.0, -9.81]
    assert parse_vector("0 0 0") == (Quantity(0.0),) * 3


@pytest.mark.parametrize(("written", "dimension", "meant"), [
    ("Nms/rad", ANGULAR_DAMPING, "N*m*s/rad"), ("mNms/rad", ANGULAR_DAMPING, "mN*m*s/rad"), ("Nm/rad", ANGULAR_STIFFNESS, "N*m/rad"),
    ("Ncm/deg", ANGULAR_STIFFNESS, "N*cm/deg"), ("Ns/m", LINEAR_DAMPING, "N*s/m"), ("N m", TORQUE, "N*m"), ("N.m", TORQUE, "N*m"),
    ("Newtonmeter", TORQUE, "N*m"), ("kgm2", INERTIA, "kg*m^2"), ("kg m^2", INERTIA, "kg*m^2"), ("kg-m²", INERTIA, "kg*m^2"),
    ("gcm2", INERTIA, "g*cm^2"), ("kg/m3", DENSITY, "kg/m^3"), ("m/s2", ACCELERATION, "m/s^2"), ("ms^-1", VELOCITY, "m*s^-1"),
    ("kg*cm", TORQUE, "kgf*cm"), ("kg-cm", TORQUE, "kgf*cm"), ("kgcm", TORQUE, "kgf*cm"), ("ozin", TORQUE, "ozf*in"),
    ("in-lb", TORQUE, "in*lbf"), ("kg", FORCE, "kgf"), ("mps", VELOCITY, "m/s"), ("rps", ANGULAR_VELOCITY, "rev/s"),
    ("cms", LENGTH, "cm"), ("mn", LENGTH, "mm"), ("N*mmm", TORQUE, "N*mm"),
])
def test_suggested_unit_is_valid(written: str, dimension: Dimension, meant: str) -> None:
    with pytest.raises(UnitError) as caught:
        check_dimension(parse_quantity(f"5 {written}", (dimension,)), (dimension,), f"5 {written}")
    said = f"{caught.value.message} {caught.value.help}"
    words = re.findall("did you mean `(.*)`|write `5 (.*)`", said)
    suggested = "".join(words[0])
    whole = written.replace("mmm", suggested) if "mmm" in written else suggested
    assert whole == meant
    assert parse_quantity(f"5 {whole}").fits(dimension)


@pytest.mark.parametrize("written", ["grad", "MN", "Nm/A", "V", "mAh", "m" * 29, "mm 3"])
def test_ambiguous_unit_has_no_fix(written: str) -> None:
    with pytest.raises(UnitError) as caught:
        parse_quantity(f"5 {written}", (LENGTH,))
    assert written not in (getattr(caught.value.message, "fix", None) or ())


@pytest.mark.parametrize(("text", "message"), [
    ("0 120 mm", "expected three numbers and a unit, found two numbers (`0 120 mm`)"),
    ("1 2 3 4 mm", "expected three numbers and a unit, found 4 numbers (`1 2 3 4 mm`)"),
    ("mm", "expected three numbers and a unit, found `mm`"),
    ("1 2 3 mm 4", "unexpected `4` after `1 2 3 mm`"),
    ("1 mm 2 mm 3 mm", "expected three numbers and a unit, found one number (`1 mm 2 mm 3 mm`)"),
    ("1 2 3 mm*x", "unknown unit `x`"),
])
def test_error_messages_of_vectors(text: str, message: str) -> None:
    with pytest.raises(UnitError) as caught:
        parse_vector(text)
    assert str(caught.value.message) == message


@pytest.mark.parametrize(("text", "shown"), [
    ("0.1 m", "100 mm"), ("30 deg", "30 deg"), ("120 g", "120 g"), ("2.5 kg", "2.5 kg"), ("4.1 N*m", "4.1 N*m"), ("2 ms",
     "0.002 s"),
    ("1270 kg/m^3", "1270 kg/m^3"), ("2", "2"), ("3 m/s", "3 m/s"), ("2 Hz", "2 1/s"),
])
def test_quantities_are_formatted_for_messages(text: str, shown: str) -> None:
    assert str(parse_quantity(text)) == shown


@given(st.text(max_size=30))
def test_random_text_is_a_quantity_or_rejected(text: str) -> None:
    try:
        assert math.isfinite(parse_quantity(text).value)
    except UnitError as error:
        assert error.offset is None or 0 <= error.offset <= len(text)


@given(st.lists(st.sampled_from([*UNITS, "*", "/", "^", "2", "-3", " ", "1.5", "e3", "(", "°", "²"]), max_size=12))
def test_random_units_are_parsed_or_rejected(pieces: list[str]) -> None:
    for read in (parse_quantity, parse_vector):
        try:
            read("1 " + "".join(pieces))
        except UnitError as error:
            assert error.message
    assert TIME != MASS
