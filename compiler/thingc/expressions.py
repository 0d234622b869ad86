"""Expressions: `=reach / 2 + 8 mm`. A small grammar of its own, with positions; dimensions are checked as it is worked out.

    comparison := sum [("<" | "<=" | ">" | ">=" | "==" | "!=") sum]
    sum        := product (("+" | "-") product)*
    product    := unary (("*" | "/") unary)*
    unary      := ("+" | "-") unary | power
    power      := atom ["**" unary]
    atom       := number [unit] | name | function "(" comparison ("," comparison)* ")" | "(" comparison ")"

A unit binds to the number before it, without spaces around its own `*` and `/`: `10 mm/rad * q` is (10 mm/rad) q.
Nothing else can be written, and working out is bounded by the length of the text: every value is one double.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Union

from thingc.diagnostics import did_you_mean
from thingc.units import (
    ANGLE, MAX_TEXT, NUMBER, UNITS, Dimension, Quantity, UnitError, converted, fits, scan_number, scan_unit, shortened,
)

Value = Union[Quantity, bool, str]


class ExpressionError(ValueError):
    """An expression that cannot be read or worked out.

    `kind` is `expression` (how it is written), `name` (an unknown name), `dimension`, `unit` or `value` (no finite
    result); `offset` and `end` are characters of the expression's text, its `=` counted where it has one.
    """

    def __init__(self, message: str, offset: int, end: int, *, kind: str = "expression", help: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.kind = kind
        self.help = help
        self.offset = offset
        self.end = end


@dataclass(frozen=True, slots=True, kw_only=True)
class Literal:
    """A number with its unit. `zero`: written as a bare 0, which is 0 of every dimension."""

    value: Quantity
    zero: bool
    offset: int
    end: int


@dataclass(frozen=True, slots=True, kw_only=True)
class NameUse:
    """A name: a parameter, or the index of a repeat."""

    name: str
    offset: int
    end: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Unary:
    """`-a` (a leading `+` leaves no trace)."""

    operand: Term
    offset: int
    end: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Binary:
    """`a op b`, `op` one of `+ - * / ** < <= > >= == !=`."""

    operator: str
    left: Term
    right: Term
    offset: int
    end: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """`function(a, b)`."""

    function: str
    arguments: tuple[Term, ...]
    offset: int
    end: int


Term = Union[Literal, NameUse, Unary, Binary, Call]

FUNCTIONS: dict[str, tuple[int, int]] = {
    "min": (1, 32), "max": (1, 32), "abs": (1, 1), "sqrt": (1, 1), "sin": (1, 1), "cos": (1, 1), "tan": (1, 1), "atan2": (2, 2),
}
"""Every function, with its least and largest number of arguments."""

CONSTANTS = {"pi": Quantity(math.pi)}

MAX_DEPTH = 60
"""Levels of parentheses, signs and powers in one expression."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Expression:
    """A parsed expression: its text as written (with the `=` where it had one) and its tree."""

    text: str
    tree: Term

    @property
    def names(self) -> tuple[NameUse, ...]:
        """Every use of a name, in the order written; constants and functions are none."""
        return tuple(term for term in _terms(self.tree) if isinstance(term, NameUse) and term.name not in CONSTANTS)


def _terms(tree: Term) -> Iterator[Term]:
    waiting = [tree]
    while waiting:
        term = waiting.pop()
        yield term
        if isinstance(term, Unary):
            waiting.append(term.operand)
        elif isinstance(term, Binary):
            waiting.extend((term.right, term.left))
        elif isinstance(term, Call):
            waiting.extend(reversed(term.arguments))


def parse_expression(text: str) -> Expression:
    """Read an expression, with or without its leading `=`. Raises ExpressionError."""
    if len(text) > MAX_TEXT:
        raise ExpressionError(f"an expression of {len(text)} characters is too long (at most {MAX_TEXT})", 0, len(text))
    return Expression(text=text, tree=_Parser(text).whole())


_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_OPERATOR = re.compile(r"\*\*|<=|>=|==|!=|[-+*/<>(),]")
_COMPARISONS = frozenset(("<", "<=", ">", ">=", "==", "!="))
_FOREIGN = {
    "^": "a power is written `**`", "%": "`%` is a unit here: `15 %`", "=": "equal is written `==`",
    ".": "a name here is one word: a parameter of this document",
    "&": "there is no `and`", "|": "there is no `or`", "[": "parentheses are round", "{": "parentheses are round",
    "$": "in expressions the index is written `i`, without `$`", "'": "text cannot stand in an expression",
    '"': "text cannot stand in an expression",
}


class _Parser:
    """Precedence climbing over one text; `at` is the next character."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.depth = 0

    def whole(self) -> Term:
        self.spaces()
        if self.text.startswith("=", self.at):
            self.at += 1
        if self.peek() == "" and self.at == len(self.text):
            raise ExpressionError("expected an expression after `=`, found nothing", max(0, self.at - 1), len(self.text))
        tree = self.comparison()
        if self.at < len(self.text):
            raise self.unexpected("an operator or the end")
        return tree

    def spaces(self) -> None:
        while self.at < len(self.text) and self.text[self.at].isspace():
            self.at += 1

    def peek(self) -> str:
        """The operator that comes next, or an empty text."""
        self.spaces()
        found = _OPERATOR.match(self.text, self.at)
        return found.group() if found else ""

    def unexpected(self, wanted: str) -> ExpressionError:
        self.spaces()
        if self.at >= len(self.text):
            return ExpressionError(f"expected {wanted}, found the end", max(0, len(self.text) - 1), len(self.text))
        found = _OPERATOR.match(self.text, self.at) or _NAME.match(self.text, self.at)
        shown = found.group() if found else self.text[self.at]
        number = scan_number(self.text, self.at)
        if number is not None and shown[0] not in "+-":
            shown = number[0]
        help = _FOREIGN.get(shown)
        if shown in ("and", "or", "not", "if", "else"):
            help = f"there is no `{shown}` in expressions"
        return ExpressionError(f"expected {wanted}, found `{shown}`", self.at, self.at + len(shown), help=help)

    def comparison(self) -> Term:
        left = self.sum()
        operator = self.peek()
        if operator not in _COMPARISONS:
            return left
        self.at += len(operator)
        right = self.sum()
        if self.peek() in _COMPARISONS:
            raise ExpressionError("comparisons cannot be chained", self.at, self.at + len(self.peek()), help="compare twice")
        return Binary(operator=operator, left=left, right=right, offset=left.offset, end=right.end)

    def sum(self) -> Term:
        left = self.product()
        while (operator := self.peek()) in ("+", "-"):
            self.at += 1
            right = self.product()
            left = Binary(operator=operator, left=left, right=right, offset=left.offset, end=right.end)
        return left

    def product(self) -> Term:
        left = self.unary()
        while (operator := self.peek()) in ("*", "/"):
            self.at += 1
            right = self.unary()
            left = Binary(operator=operator, left=left, right=right, offset=left.offset, end=right.end)
        return left

    def unary(self) -> Term:
        operator = self.peek()
        if operator not in ("+", "-"):
            return self.power()
        offset = self.at
        self.at += 1
        self.deeper(offset)
        operand = self.unary()
        self.depth -= 1
        return operand if operator == "+" else Unary(operand=operand, offset=offset, end=operand.end)

    def power(self) -> Term:
        base = self.atom()
        if self.peek() != "**":
            return base
        offset = self.at
        self.at += 2
        self.deeper(offset)
        exponent = self.unary()
        self.depth -= 1
        return Binary(operator="**", left=base, right=exponent, offset=base.offset, end=exponent.end)

    def deeper(self, offset: int) -> None:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise ExpressionError(f"an expression may nest at most {MAX_DEPTH} levels", offset, len(self.text))

    def atom(self) -> Term:
        if self.peek() == "(":
            opened = self.at
            self.at += 1
            self.deeper(opened)
            inside = self.comparison()
            self.closing(opened)
            self.depth -= 1
            return replace(inside, offset=opened, end=self.at)
        number = scan_number(self.text, self.at)
        if number is not None and self.text[self.at] not in "+-":
            return self.literal(*number)
        name = _NAME.match(self.text, self.at)
        if name is None:
            raise self.unexpected("a number, a name or `(`")
        offset, self.at = self.at, name.end()
        if self.peek() == "(":
            return self.call(name.group(), offset)
        if name.group() in FUNCTIONS:
            raise ExpressionError(
                f"`{name.group()}` is a function and needs arguments in parentheses", offset, name.end(), help=f"write `{name.group()}(...)`",
            )
        return NameUse(name=name.group(), offset=offset, end=name.end())

    def closing(self, opened: int) -> None:
        if self.peek() == ")":
            self.at += 1
        elif self.at >= len(self.text):
            raise ExpressionError("the `(` opened here is never closed", opened, opened + 1, help="add `)`")
        else:
            raise self.unexpected("an operator or `)`")

    def literal(self, number: str, end: int) -> Literal:
        offset, self.at = self.at, end
        unit = (1, 1, NUMBER)
        following = end
        while following < len(self.text) and self.text[following] == " ":
            following += 1
        rest = self.text[following : following + 1]
        bare = True
        try:
            if rest.isalpha() or rest in ("%", "°", "_") and rest:
                word = _NAME.match(self.text, following)
                if word is not None and word.group() in FUNCTIONS or rest == "_":
                    raise self.unexpected("an operator")
                unit, self.at = scan_unit(self.text, following, compact=True)
                bare = False
            value = Quantity(converted(number, unit), unit[2])
        except UnitError as error:
            at, stop = (offset, end) if error.kind == "quantity" or error.offset is None else (error.offset, error.end or end)
            kind = "unit" if error.kind == "unit" else "value"
            raise ExpressionError(error.message, at, stop, kind=kind, help=error.help) from None
        return Literal(value=value, zero=bare and value.value == 0.0, offset=offset, end=self.at)

    def call(self, name: str, offset: int) -> Call:
        opened = self.at
        if name not in FUNCTIONS:
            message = f"unknown function `{name}`" if name not in UNITS and name not in CONSTANTS else f"`{name}` is no function"
            raise ExpressionError(message, offset, offset + len(name), kind="name", help=did_you_mean(name, FUNCTIONS, what="functions"))
        self.at += 1
        self.deeper(opened)
        arguments: list[Term] = []
        if self.peek() != ")":
            arguments.append(self.comparison())
            while self.peek() == ",":
                self.at += 1
                arguments.append(self.comparison())
        self.closing(opened)
        self.depth -= 1
        least, most = FUNCTIONS[name]
        if not least <= len(arguments) <= most:
            count = f"{least}" if least == most else f"{least} to {most}"
            raise ExpressionError(
                f"`{name}` takes {count} argument{'' if count == '1' else 's'}, found {len(arguments)}", offset, self.at,
            )
        return Call(function=name, arguments=tuple(arguments), offset=offset, end=self.at)


def evaluate(expression: Expression, names: Mapping[str, Value]) -> Value:
    """Work an expression out. `names` are the parameters and the repeat index (a Quantity of dimension NUMBER).

    A name alone passes a flag or a text through; a comparison gives a flag; everything else gives a finite Quantity.
    Raises ExpressionError for an unknown name, dimensions that do not go together, and results that are not finite.
    """
    return _Evaluator(expression.text, names).value(expression.tree)


def zero_literal(expression: Expression) -> bool:
    """Whether it is a bare `0`, which is 0 of every dimension."""
    return isinstance(expression.tree, Literal) and expression.tree.zero


class _Evaluator:
    """Walks a tree; the text is for messages."""

    def __init__(self, text: str, names: Mapping[str, Value]) -> None:
        self.text = text
        self.names = names

    def value(self, term: Term) -> Value:
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

    def lookup(self, term: NameUse) -> Value:
        if term.name in self.names:
            return self.names[term.name]
        if term.name in CONSTANTS:
            return CONSTANTS[term.name]
        if term.name in UNITS:
            help = f"a unit follows its number: `2 {term.name}`"
        else:
            help = did_you_mean(term.name, [*self.names, *CONSTANTS], what="names")
        raise ExpressionError(f"unknown name `{term.name}`", term.offset, term.end, kind="name", help=help)

    def quantity(self, term: Term) -> Quantity:
        value = self.value(term)
        if isinstance(value, Quantity):
            return value
        found = "true or false" if isinstance(value, bool) else "a text"
        raise ExpressionError(
            f"expected a quantity, found {found} (`{self.written(term)}`)", term.offset, term.end, kind="dimension",
        )

    def written(self, term: Term) -> str:
        return shortened(self.text[term.offset : term.end])

    def same(self, left: Term, a: Quantity, right: Term, b: Quantity) -> Dimension:
        """The common dimension of two operands (a bare 0 takes the other's)."""
        if fits(b.dimension, a.dimension) and fits(a.dimension, b.dimension):
            return a.dimension
        if _zero(right):
            return a.dimension
        if _zero(left):
            return b.dimension
        help = None
        for term, found, other in ((right, b, a), (left, a, b)):
            if found.dimension == NUMBER and isinstance(term, Literal):
                unit = other.dimension.example.partition(" ")[2]
                help = f"write `{self.written(term)} {unit}`"
        raise ExpressionError(
            f"`{self.written(left)}` is {a.dimension.words}, `{self.written(right)}` is {b.dimension.words}: they do not go together",
            right.offset, right.end, kind="dimension", help=help,
        )

    def finite(self, term: Term, work: Callable[[], float], dimension: Dimension) -> Quantity:
        try:
            result = work()
        except ZeroDivisionError:
            raise ExpressionError(f"division by zero in `{self.written(term)}`", term.offset, term.end, kind="value") from None
        except (OverflowError, ValueError):
            result = math.inf
        if not isinstance(result, float) or not math.isfinite(result):
            raise ExpressionError(f"`{self.written(term)}` has no finite result", term.offset, term.end, kind="value")
        return Quantity(result + 0.0, dimension)

    def chain(self, term: Binary) -> Quantity:
        """Sums and products lean to the left: a loop along them, so that a long sum needs no deep stack."""
        spine: list[Binary] = []
        first: Term = term
        while isinstance(first, Binary) and first.operator in ("+", "-", "*", "/"):
            spine.append(first)
            first = first.left
        total = self.quantity(first)
        for step in reversed(spine):
            a, b = total, self.quantity(step.right)
            if step.operator == "*":
                total = self.finite(step, lambda: a.value * b.value, a.dimension * b.dimension)
            elif step.operator == "/":
                total = self.finite(step, lambda: a.value / b.value, a.dimension / b.dimension)
            else:
                dimension = self.same(step.left, a, step.right, b)
                sign = 1.0 if step.operator == "+" else -1.0
                total = self.finite(step, lambda: a.value + sign * b.value, dimension)
        return total

    def power(self, term: Binary) -> Quantity:
        base, exponent = self.quantity(term.left), self.quantity(term.right)
        if exponent.dimension != NUMBER:
            raise ExpressionError(
                f"an exponent is a number, found {exponent.dimension.words} (`{self.written(term.right)}`)",
                term.right.offset, term.right.end, kind="dimension",
            )
        dimension = base.dimension
        if dimension != NUMBER:
            from fractions import Fraction

            ratio = Fraction(exponent.value).limit_denominator(12)
            if abs(exponent.value) > 12.0 or abs(float(ratio) - exponent.value) > 1e-12:
                raise ExpressionError(
                    f"the exponent of {dimension.words} must be a small whole number or fraction, found `{self.written(term.right)}`",
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
        self.same(term.left, a, term.right, b)
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

            return self.finite(term, lambda: math.sqrt(x), first.dimension ** Fraction(1, 2))
        if term.function == "atan2":
            self.same(term.arguments[0], first, term.arguments[1], arguments[1])
            return Quantity(math.atan2(x, arguments[1].value), ANGLE)
        if first.dimension != ANGLE and not _zero(term.arguments[0]):
            shown = self.written(term.arguments[0])
            raise ExpressionError(
                f"`{term.function}` takes an angle (such as 30 deg), found {first.dimension.words} (`{shown}`)",
                term.arguments[0].offset, term.arguments[0].end, kind="dimension",
                help=f"for radians write `{shown} * 1 rad`" if first.dimension == NUMBER else None,
            )
        return self.finite(term, lambda: {"sin": math.sin, "cos": math.cos, "tan": math.tan}[term.function](x), NUMBER)

    def extreme(self, term: Call, arguments: list[Quantity]) -> Quantity:
        """`min` and `max`: the dimension is that of the first argument that is no bare 0."""
        lead = next((k for k, argument in enumerate(term.arguments) if not _zero(argument)), 0)
        for argument, found in zip(term.arguments, arguments, strict=True):
            self.same(term.arguments[lead], arguments[lead], argument, found)
        values = [argument.value for argument in arguments]
        return Quantity(min(values) if term.function == "min" else max(values), arguments[lead].dimension)


def _zero(term: Term) -> bool:
    return isinstance(term, Literal) and term.zero
