"""The syntax tree of an expression, with the position of every term."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Union

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import Hint
from thingc.base.units import Quantity, scan_number


class ExpressionError(ValueError):
    """Raised if an expression cannot be parsed or evaluated.

    `kind` is the kind of the error: `expression` (syntax), `name` (an unknown name), `dimension`, `unit`, or `value` (a result that is not
    finite). `offset` and `end` are indices of characters in the source text of the expression, including a leading `=`.
    """

    def __init__(self, message: Hint, offset: int, end: int, *, kind: str = "expression", help: Hint | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.kind = kind
        self.help = help
        self.offset = offset
        self.end = end


class _TextRange(FrozenStruct):
    """The position of a term in the text of its expression: from the character `offset` to the character `end` (exclusive)."""

    offset: int
    end: int


class Literal(_TextRange):
    """A number in an expression, with its unit if any.

    `zero` is True for the number 0 without a unit, which is valid for every physical dimension.
    """

    value: Quantity
    zero: bool


class NameUse(_TextRange):
    """A name in an expression: a parameter, or the index of a repeat."""

    name: str


class Unary(_TextRange):
    """The negation `-a` in an expression. For `+a`, the parser returns only `a`."""

    operand: Term


class Binary(_TextRange):
    """A binary operation `a op b`. The operator is one of `+ - * / ** < <= > >= == !=`."""

    operator: str
    left: Term
    right: Term


class Call(_TextRange):
    """A function call, such as `min(a, b)`."""

    function: str
    arguments: tuple[Term, ...]


Term = Union[Literal, NameUse, Unary, Binary, Call]

FUNCTIONS: dict[str, tuple[int, int]] = {
    "min": (1, 32), "max": (1, 32), "abs": (1, 1), "sqrt": (1, 1), "sin": (1, 1), "cos": (1, 1), "tan": (1, 1), "atan2": (2, 2),
}
"""All functions of expressions, with their smallest and largest number of arguments."""

COMPARISONS = frozenset(("<", "<=", ">", ">=", "==", "!="))
"""Comparison operators, whose result is a boolean."""

CONSTANTS = {"pi": Quantity(math.pi)}

MAX_DEPTH = 60
"""Maximum nesting depth of parentheses, signs and powers in an expression."""


class Expression(FrozenStruct):
    """A parsed expression, with its source text (including a leading `=`) and its syntax tree."""

    text: str
    tree: Term

    @property
    def compares(self) -> bool:
        """Whether the expression is a comparison, whose value is a boolean."""
        return isinstance(self.tree, Binary) and self.tree.operator in COMPARISONS

    @property
    def names(self) -> tuple[NameUse, ...]:
        """Every use of a parameter or of a repeat index in the expression, in source order.

        Names of constants and functions are not included.
        """
        return tuple(term for term in _terms(self.tree) if isinstance(term, NameUse) and term.name not in CONSTANTS)


def _terms(tree: Term) -> Iterator[Term]:
    stack = [tree]
    while stack:
        term = stack.pop()
        yield term
        if isinstance(term, Unary):
            stack.append(term.operand)
        elif isinstance(term, Binary):
            stack.extend((term.right, term.left))
        elif isinstance(term, Call):
            stack.extend(reversed(term.arguments))


def find_tokens(expression: Expression) -> Iterator[tuple[int, int, str]]:
    """Yield the start, the end and the type of each token of an expression, for syntax highlighting.

    The type is `name`, `function`, `number` or `unit`.
    """
    for term in _terms(expression.tree):
        if isinstance(term, NameUse):
            yield term.offset, term.end, "name"
        elif isinstance(term, Call):
            yield term.offset, term.offset + len(term.function), "function"
        elif isinstance(term, Literal):
            scanned = scan_number(expression.text, term.offset)
            number = term.end if scanned is None else scanned[1]
            yield term.offset, number, "number"
            unit = expression.text[number : term.end].lstrip()
            if unit:
                yield term.end - len(unit), term.end, "unit"
