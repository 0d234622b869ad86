"""Expressions: values are compared with Python and pint, error messages exactly."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, strategies as st

from thingc.base.suggestions import text_of
from thingc.base.units import ANGLE, AREA, LENGTH, LENGTH_PER_ANGLE, MASS, NUMBER, Dimension, Quantity, parse_quantity
from thingc.documents.expressions.evaluation import evaluate
from thingc.documents.expressions.parsing import parse_expression
from thingc.documents.expressions.terms import Expression, ExpressionError

NAMES: dict[str, Quantity | bool | str] = {
    "reach": parse_quantity("100 mm"), "width": parse_quantity("40 mm"), "mass": parse_quantity("2 kg"),
    "angle": parse_quantity("30 deg"),
    "i": Quantity(3.0), "n": Quantity(0.0), "on": True, "word": "petg", "s": parse_quantity("3 s"),
}


def value(text: str) -> Quantity | bool | str:
    return evaluate(parse_expression(text), NAMES)


@pytest.mark.parametrize(("text", "expected", "dimension"), [
    ("=reach / 2 + 8 mm", 0.058, LENGTH),
    ("= reach/2", 0.05, LENGTH),
    ("reach", 0.1, LENGTH),
    ("=2 ** 3 ** 2", 512.0, NUMBER),
    ("=-2 ** 2", -4.0, NUMBER),
    ("=(-2) ** 2", 4.0, NUMBER),
    ("=2 ** -1", 0.5, NUMBER),
    ("=8 - 3 - 2", 3.0, NUMBER),
    ("=8 / 2 / 2", 2.0, NUMBER),
    ("=1 + 2 * 3", 7.0, NUMBER),
    ("=-i * 2", -6.0, NUMBER),
    ("=reach * width", 0.004, AREA),
    ("=sqrt(reach * reach)", 0.1, LENGTH),
    ("=sqrt(reach) * sqrt(reach)", 0.1, LENGTH),
    ("=(reach ** 3) ** (1/3)", 0.1, LENGTH),
    ("=10 mm/rad * angle", 0.01 * math.pi / 6, LENGTH),
    ("=10 mm/rad", 0.01, LENGTH_PER_ANGLE),
    ("=8 mm*i", 0.024, LENGTH),
    ("=8 mm*2", 0.016, LENGTH),
    ("=1/2 m", 0.5, Dimension(length=-1)),
    ("=min(reach, 80 mm)", 0.08, LENGTH),
    ("=max(0, reach - 1 m)", 0.0, LENGTH),
    ("=min(reach)", 0.1, LENGTH),
    ("=abs(-reach)", 0.1, LENGTH),
    ("=sin(30 deg)", 0.5, NUMBER),
    ("=cos(0)", 1.0, NUMBER),
    ("=tan(angle)", math.tan(math.pi / 6), NUMBER),
    ("=atan2(reach, reach)", math.pi / 4, ANGLE),
    ("=i * 60 deg", math.pi, ANGLE),
    ("=pi * 1 rad", math.pi, ANGLE),
    ("=15 %", 0.15, NUMBER),
    ("=reach + 0", 0.1, LENGTH),
    ("=0 + reach", 0.1, LENGTH),
    ("=1e2mm", 0.1, LENGTH),
    ("=4.1 N*m/(2 N)", 2.05, LENGTH),
])
def test_values_and_dimensions(text: str, expected: float, dimension: Dimension) -> None:
    found = value(text)
    assert isinstance(found, Quantity)
    assert found.value == pytest.approx(expected, rel=1e-14, abs=1e-300)
    assert found.dimension == dimension


@pytest.mark.parametrize(("text", "expected"), [
    ("=on", True), ("=word", "petg"), ("=reach > width", True), ("=reach < 0", False), ("=i == 3", True), ("=i != 3", False),
    ("=reach >= 100 mm", True), ("=on == on", True), ("=0 <= mass", True),
])
def test_booleans_and_strings(text: str, expected: bool | str) -> None:
    assert value(text) is expected or value(text) == expected


def test_unit_product_requires_no_spaces() -> None:
    """`8 mm*s` is a quantity with a compound unit; `8 mm * s` is a product with the name `s`."""
    assert value("=8 mm*s") == Quantity(0.008, Dimension(length=1, time=1))
    assert value("=8 mm * s") == Quantity(0.024, Dimension(length=1, time=1))


@pytest.mark.parametrize(("text", "message", "kind", "place", "help"), [
    ("=rech / 2", "unknown name `rech`", "name", (1, 5), "did you mean `reach`?"),
    ("=reach + mass", "cannot combine `reach` (a length) with `mass` (a mass)", "dimension", (9, 13), None),
    ("=reach + 5", "cannot combine `reach` (a length) with `5` (a number)", "dimension", (9, 10), "write `5 mm`"),
    ("=reach + n", "cannot combine `reach` (a length) with `n` (a number)", "dimension", (9, 10), None),
    ("=reach > 5 g", "cannot combine `reach` (a length) with `5 g` (a mass)", "dimension", (9, 12), None),
    ("=min(reach, mass)", "cannot combine `reach` (a length) with `mass` (a mass)", "dimension", (12, 16), None),
    ("=9**9**9", "the result of `9**9**9` is not finite", "value", (1, 8), None),
    ("=1/n", "division by zero in `1/n`", "value", (1, 4), None),
    ("=0 ** -1", "division by zero in `0 ** -1`", "value", (1, 8), None),
    ("=sqrt(-1)", "the result of `sqrt(-1)` is not finite", "value", (1, 9), None),
    ("=(-8) ** 0.5", "the result of `(-8) ** 0.5` is not finite", "value", (1, 12), None),
    ("=reach ** 0.37", "the exponent of a length must be a small whole number or fraction, found `0.37`", "dimension", (10, 14),
     None),
    ("=2 ** reach", "an exponent must be a number, found a length (`reach`)", "dimension", (6, 11), None),
    ("=sin(i)", "`sin` expects an angle (such as 30 deg), found a number (`i`)", "dimension", (5, 6),
     "for radians write `i * 1 rad`"),
    ("=on + 1", "expected a quantity, found a boolean (`on`)", "dimension", (1, 3), None),
    ("=word * 2", "expected a quantity, found a string (`word`)", "dimension", (1, 5), None),
    ("=mm", "unknown name `mm`", "name", (1, 3), "write the unit after a number: `2 mm`"),
    ("=(reach + 1 mm", "the parenthesis `(` is not closed", "expression", (1, 2), "add `)`"),
    ("=reach)", "expected an operator or the end of the expression, found `)`", "expression", (6, 7), None),
    ("=reach ^ 2", "expected an operator or the end of the expression, found `^`", "expression", (7, 8), "use `**` for powers"),
    ("=hand.size", "expected an operator or the end of the expression, found `.`", "expression", (5, 6),
     "use a parameter of this document"),
    ("=", "expected an expression after `=`, found nothing", "expression", (0, 1), None),
    ("=reach +", "expected a number, a name or `(`, found the end of the expression", "expression", (7, 8), None),
    ("=reach + * 2", "expected a number, a name or `(`, found `*`", "expression", (9, 10), None),
    ("=1 < 2 < 3", "comparisons cannot be chained", "expression", (7, 8), "write two comparisons"),
    ("=foo(3)", "unknown function `foo`", "name", (1, 4),
     "known functions: `abs`, `atan2`, `cos`, `max`, `min`, `sin`, `sqrt`, `tan`"),
    ("=mim(3)", "unknown function `mim`", "name", (1, 4), "did you mean `min`?"),
    ("=pi(3)", "`pi` is not a function", "name", (1, 3),
     "known functions: `abs`, `atan2`, `cos`, `max`, `min`, `sin`, `sqrt`, `tan`"),
    ("=min", "the function `min` has no arguments", "expression", (1, 4), "write `min(...)`"),
    ("=atan2(1)", "`atan2` expects 2 arguments, found 1", "expression", (1, 9), None),
    ("=sqrt()", "`sqrt` expects 1 argument, found 0", "expression", (1, 7), None),
    ("=8 mmm + 1 mm", "unknown unit `mmm`; did you mean `mm`?", "unit", (3, 6), None),
    ("=reach if 3", "expected an operator or the end of the expression, found `if`", "expression", (7, 9),
     "use only numbers, names, operators and functions"),
    ("=leg_$i", "expected an operator or the end of the expression, found `$`", "expression", (5, 6),
     "write the index without `$`: `i`"),
    ("=1e999", "the number `1e999` is too large", "value", (1, 6), None),
    ("=" + "(" * 61 + "1" + ")" * 61, "the expression has more than 60 levels of nesting", "expression", (61, 124), None),
    ("=" + "1+" * 500 + "1", "the expression has 1002 characters (at most 1000 are allowed)", "expression", (0, 1002), None),
    ("=__import__('os')", "unknown function `__import__`", "name", (1, 11),
     "known functions: `abs`, `atan2`, `cos`, `max`, `min`, `sin`, `sqrt`, `tan`"),
    ("=[1, 2]", "expected a number, a name or `(`, found `[`", "expression", (1, 2), "use round parentheses"),
])
def test_error_messages(text: str, message: str, kind: str, place: tuple[int, int], help: str | None) -> None:
    with pytest.raises(ExpressionError) as caught:
        value(text)
    error = caught.value
    assert (str(error.message), error.kind, (error.offset, error.end), text_of(error.help)) == (message, kind, place, help)


def test_names_are_listed_with_their_positions() -> None:
    found = parse_expression("=reach * pi + min(i, reach) - 8 mm").names
    assert [(use.name, use.offset) for use in found] == [("reach", 1), ("i", 18), ("reach", 21)]


def test_long_sum_does_not_exceed_recursion_limit() -> None:
    expression = parse_expression("=" + "+".join(["1"] * 499))
    assert evaluate(expression, {}) == Quantity(499.0)
    assert expression.names == ()


# Random arithmetic over plain numbers: Python is the oracle, its own precedence against ours.
_number = st.one_of(st.integers(0, 9).map(str), st.sampled_from(["1.5", "2e1", ".25"]))


def _combine(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    operator = st.sampled_from(["+", "-", "*", "/", " + ", " - ", " * ", " / "])
    return st.one_of(
        st.tuples(inner, operator, inner).map("".join), inner.map(lambda text: f"({text})"), inner.map(lambda text: f"-{text}"),
        st.tuples(st.sampled_from(["min", "max"]), inner, inner).map(lambda found: f"{found[0]}({found[1]}, {found[2]})"),
        st.tuples(inner.map(lambda text: f"({text})"), st.sampled_from(["**2", "**3", " ** -1"])).map("".join),
    )


@given(st.recursive(_number, _combine, max_leaves=12))
def test_arithmetic_matches_python(text: str) -> None:
    """Python evaluates random expressions of numbers; a fault there must be an ExpressionError here."""
    try:
        expected = float(eval(text, {"min": min, "max": max, "__builtins__": {}}))
    except (ZeroDivisionError, OverflowError):
        with pytest.raises(ExpressionError):
            value(f"={text}")
        return
    try:
        found = value(f"={text}")
    except ExpressionError as error:
        # ours are doubles from the start: a division by what rounds to zero, or integers beyond a double
        assert error.kind == "value"
        return
    assert isinstance(found, Quantity)
    assert found.value == pytest.approx(expected, rel=1e-12, abs=1e-12)


@given(st.text(max_size=40))
def test_random_text_is_parsed_or_rejected(text: str) -> None:
    _try(text)


@given(st.lists(st.sampled_from(["reach", "mass", "(", ")", "+", "-", "*", "/", "**", "min(", ",", "8", " ", "mm", "deg", "<",
    "==", "i", "0", ".", "%", "sqrt("]), max_size=25))
def test_random_tokens_are_parsed_or_rejected(pieces: list[str]) -> None:
    _try("=" + "".join(pieces))


def _try(text: str) -> None:
    try:
        expression = parse_expression(text)
        assert isinstance(expression, Expression)
        found = evaluate(expression, NAMES)
        assert not isinstance(found, Quantity) or math.isfinite(found.value)
    except ExpressionError as error:
        assert 0 <= error.offset <= error.end <= max(1, len(text)), (error.message, error.offset, error.end)
    assert NAMES["mass"] == Quantity(2.0, MASS)
