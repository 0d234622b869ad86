"""Evaluate expressions. The value of each term is a double with a physical dimension, and each error contains the position of a term."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Union

from thingc.base import numeric
from thingc.base.suggestions import Hint, did_you_mean
from thingc.base.units import ANGLE, NUMBER, UNITS, Dimension, Quantity, fits, shorten
from thingc.documents.expressions.terms import CONSTANTS, Binary, Call, Expression, ExpressionError, Literal, NameUse, Term, Unary

ExpressionValue = Union[Quantity, bool, str]
"""The value of an expression or a parameter."""


def evaluate(expression: Expression, names: Mapping[str, ExpressionValue]) -> ExpressionValue:
    """Evaluate an expression and return its value. `names` maps the names of parameters, and the index of a repeat, to their values.

    For an expression that is a single name, the value can be a boolean or a string. The value of a comparison is a boolean, and the value
    of every other expression is a finite `Quantity`. Raises ExpressionError for unknown names, incompatible dimensions, and results that
    are not finite.
    """
    return _Evaluator(expression.text, names).value(expression.tree)


class _Evaluator:
    """Evaluates the syntax tree of an expression. Error messages quote the source text of the expression."""

    def __init__(self, text: str, names: Mapping[str, ExpressionValue]) -> None:
        self.text = text
        self.names = names

    def value(self, term: Term) -> ExpressionValue:
        if isinstance(term, Literal):
            return term.value
        if isinstance(term, NameUse):
            return self.lookup(term)
        if isinstance(term, Unary):
            operand = self.quantity(term.operand)
            return Quantity(0.0 - operand.value, operand.dimension)
        if isinstance(term, Call):
            return self.call(term)
        if term.operator in ("+", "-", "*", "/"):
            return self.chain(term)
        if term.operator == "**":
            return self.power(term)
        return self.compare(term)

    def lookup(self, term: NameUse) -> ExpressionValue:
        if term.name in self.names:
            return self.names[term.name]
        if term.name in CONSTANTS:
            return CONSTANTS[term.name]
        if term.name in UNITS:
            help: Hint = f"write the unit after a number: `2 {term.name}`"
        else:
            help = did_you_mean(term.name, [*self.names, *CONSTANTS], what="names")
        raise ExpressionError(f"unknown name `{term.name}`", term.offset, term.end, kind="name", help=help)

    def quantity(self, term: Term) -> Quantity:
        value = self.value(term)
        if isinstance(value, Quantity):
            return value
        message = f"expected a quantity, found {kind_of(value)} (`{self.source_of(term)}`)"
        raise ExpressionError(message, term.offset, term.end, kind="dimension")

    def source_of(self, term: Term) -> str:
        return shorten(self.text[term.offset : term.end])

    def common_dimension(self, left: Term, a: Quantity, right: Term, b: Quantity) -> Dimension:
        """Return the common physical dimension of the operands `left` and `right`, whose values are `a` and `b`.

        The number 0 without a unit is compatible with every dimension.
        """
        if fits(b.dimension, a.dimension) and fits(a.dimension, b.dimension):
            return a.dimension
        if _zero(right):
            return a.dimension
        if _zero(left):
            return b.dimension
        help = None
        for term, quantity, other_quantity in ((right, b, a), (left, a, b)):
            if quantity.dimension == NUMBER and isinstance(term, Literal):
                unit = other_quantity.dimension.example.partition(" ")[2]
                help = f"write `{self.source_of(term)} {unit}`"
        raise ExpressionError(
            f"cannot combine `{self.source_of(left)}` ({a.dimension.words}) with `{self.source_of(right)}` ({b.dimension.words})",
            right.offset, right.end, kind="dimension", help=help,
        )

    def finite(self, term: Term, work: Callable[[], float], dimension: Dimension) -> Quantity:
        try:
            result = work()
        except ZeroDivisionError:
            raise ExpressionError(f"division by zero in `{self.source_of(term)}`", term.offset, term.end, kind="value") from None
        except (OverflowError, ValueError):
            result = numeric.inf
        if isinstance(result, complex) or not numeric.isfinite(result):
            raise ExpressionError(f"the result of `{self.source_of(term)}` is not finite", term.offset, term.end, kind="value")
        return Quantity(result + 0.0, dimension)

    def chain(self, term: Binary) -> Quantity:
        """Evaluate a sum or a product with many operands from left to right.

        A loop is used instead of recursion, so that the depth of long sums is not limited.
        """
        operations: list[Binary] = []
        leftmost: Term = term
        while isinstance(leftmost, Binary) and leftmost.operator in ("+", "-", "*", "/"):
            operations.append(leftmost)
            leftmost = leftmost.left
        total = self.quantity(leftmost)
        for step in reversed(operations):
            total = self.step(step, total, self.quantity(step.right))
        return total

    def step(self, term: Binary, a: Quantity, b: Quantity) -> Quantity:
        if term.operator == "*":
            return self.finite(term, lambda: a.value * b.value, a.dimension * b.dimension)
        if term.operator == "/":
            return self.finite(term, lambda: a.value / b.value, a.dimension / b.dimension)
        dimension = self.common_dimension(term.left, a, term.right, b)
        sign = 1.0 if term.operator == "+" else -1.0
        return self.finite(term, lambda: a.value + sign * b.value, dimension)

    def power(self, term: Binary) -> Quantity:
        base, exponent = self.quantity(term.left), self.quantity(term.right)
        if exponent.dimension != NUMBER:
            raise ExpressionError(
                f"an exponent must be a number, found {exponent.dimension.words} (`{self.source_of(term.right)}`)",
                term.right.offset, term.right.end, kind="dimension",
            )
        dimension = base.dimension
        if dimension != NUMBER:
            from fractions import Fraction

            ratio = Fraction(exponent.value).limit_denominator(12)
            if abs(exponent.value) > 12.0 or abs(float(ratio) - exponent.value) > 1e-12:
                raise ExpressionError(
                    f"the exponent of {dimension.words} must be a small whole number or fraction, found `{self.source_of(term.right)}`",
                    term.right.offset, term.right.end, kind="dimension",
                )
            dimension = dimension**ratio
        return self.finite(term, lambda: base.value**exponent.value, dimension)

    def compare(self, term: Binary) -> bool:
        left, right = self.value(term.left), self.value(term.right)
        equality = term.operator in ("==", "!=")
        if equality and not isinstance(left, Quantity) and type(left) is type(right):
            return (left == right) is (term.operator == "==")
        a, b = self.quantity(term.left), self.quantity(term.right)
        self.common_dimension(term.left, a, term.right, b)
        x, y = a.value, b.value
        return {"<": x < y, "<=": x <= y, ">": x > y, ">=": x >= y, "==": x == y, "!=": x != y}[term.operator]

    def call(self, term: Call) -> Quantity:
        arguments = [self.quantity(argument) for argument in term.arguments]
        first = arguments[0]
        x = first.value
        if term.function in ("min", "max"):
            return self.extreme(term, arguments)
        if term.function == "abs":
            return Quantity(abs(x), first.dimension)
        if term.function == "sqrt":
            from fractions import Fraction

            return self.finite(term, lambda: numeric.sqrt(x), first.dimension ** Fraction(1, 2))
        if term.function == "atan2":
            self.common_dimension(term.arguments[0], first, term.arguments[1], arguments[1])
            return Quantity(numeric.atan2(x, arguments[1].value), ANGLE)
        if first.dimension != ANGLE and not _zero(term.arguments[0]):
            text = self.source_of(term.arguments[0])
            raise ExpressionError(
                f"`{term.function}` expects an angle (such as 30 deg), found {first.dimension.words} (`{text}`)", term.arguments[0].offset,
                term.arguments[0].end, kind="dimension", help=f"for radians write `{text} * 1 rad`" if first.dimension == NUMBER else None,
            )
        return self.finite(term, lambda: {"sin": numeric.sin, "cos": numeric.cos, "tan": numeric.tan}[term.function](x), NUMBER)

    def extreme(self, term: Call, arguments: list[Quantity]) -> Quantity:
        """Evaluate `min` or `max`. The result has the physical dimension of the first argument that is not 0 without a unit."""
        reference = next((k for k, argument in enumerate(term.arguments) if not _zero(argument)), 0)
        for argument, quantity in zip(term.arguments, arguments, strict=True):
            self.common_dimension(term.arguments[reference], arguments[reference], argument, quantity)
        values = [argument.value for argument in arguments]
        return Quantity(numeric.minimum(values) if term.function == "min" else numeric.maximum(values), arguments[reference].dimension)


def _zero(term: Term) -> bool:
    return isinstance(term, Literal) and term.zero


def kind_of(value: ExpressionValue) -> str:
    """Return a description of the type of a value for messages, for example `an angle`, `a string` or `a boolean`."""
    if isinstance(value, Quantity):
        return value.dimension.words
    return "a boolean" if isinstance(value, bool) else "a string"


def format_value(value: ExpressionValue) -> str:
    """Format the value of an expression in the syntax of documents, such as `20 mm` or `true`."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def plain(value: ExpressionValue) -> float | bool | str:
    """Convert a quantity to a number in SI units. Booleans and strings are returned unchanged.

    A number without a dimension and a fractional part is converted to an int, unless it is recorded, because it may vary.
    """
    if not isinstance(value, Quantity):
        return value
    if value.dimension == NUMBER and not isinstance(value.value, numeric.Recorded) and value.value % 1.0 == 0.0:
        return int(value.value)
    return value.value + 0.0
