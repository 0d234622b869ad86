"""Parse expressions by precedence climbing. The parser of Python is not used, because it cannot report positions inside units."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection

from msgspec.structs import replace

from thingc.base.suggestions import Suggestion, did_you_mean
from thingc.base.units import MAX_TEXT, NUMBER, UNITS, Quantity, UnitError, scan_number, scan_unit, shorten, to_si
from thingc.documents.expressions.terms import (
    COMPARISONS,
    CONSTANTS,
    FUNCTIONS,
    MAX_DEPTH,
    Binary,
    Call,
    Expression,
    ExpressionError,
    Literal,
    NameUse,
    Term,
    Unary,
)


def parse_expression(text: str, *, dotted: bool = False) -> Expression:
    """Parse an expression. The leading `=` is optional.

    With `dotted`, names can contain dots (`centre.x`). Raises `ExpressionError` for invalid syntax.
    """
    if len(text) > MAX_TEXT:
        raise ExpressionError(f"an expression of {len(text)} characters is too long (at most {MAX_TEXT})", 0, len(text))
    return Expression(text=text, tree=_Parser(text, _DOTTED if dotted else _NAME).whole())


_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_DOTTED = re.compile(r"[A-Za-z_]\w*(?:\.(?:[A-Za-z_]\w*|\d+))*", re.ASCII)
_OPERATOR = re.compile(r"\*\*|<=|>=|==|!=|[-+*/<>(),]")
_FOREIGN = {
    "^": "use `**` for powers", "%": "`%` is a unit here: `15 %`", "=": "use `==` for equality",
    ".": "use the name of a parameter of this document, without `.`",
    "&": "`and` is not supported", "|": "`or` is not supported", "[": "use round parentheses", "{": "use round parentheses",
    "$": "in expressions, write the index as `i`, without `$`", "'": "expressions cannot contain strings",
    '"': "expressions cannot contain strings",
}


class _Parser:
    """A precedence-climbing parser for the text of an expression.

    `at` is the index of the next character, and `names` is the regular expression that names must match.
    """

    def __init__(self, text: str, names: re.Pattern[str] = _NAME) -> None:
        self.text = text
        self.names = names
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
            raise self.unexpected_token("an operator or the end of the expression")
        return tree

    def spaces(self) -> None:
        while self.at < len(self.text) and self.text[self.at].isspace():
            self.at += 1

    def peek(self) -> str:
        """Return the operator at the current position, or an empty string if the next token is not an operator."""
        self.spaces()
        match = _OPERATOR.match(self.text, self.at)
        return match.group() if match else ""

    def unexpected_token(self, wanted: str) -> ExpressionError:
        self.spaces()
        if self.at >= len(self.text):
            return ExpressionError(f"expected {wanted}, found the end of the expression", max(0, len(self.text) - 1), len(self.text))
        match = _OPERATOR.match(self.text, self.at) or _NAME.match(self.text, self.at)
        shown = match.group() if match else self.text[self.at]
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
        if operator not in COMPARISONS:
            return left
        self.at += len(operator)
        right = self.sum()
        if self.peek() in COMPARISONS:
            raise ExpressionError("comparisons cannot be chained", self.at, self.at + len(self.peek()), help="write two comparisons")
        return Binary(operator=operator, left=left, right=right, offset=left.offset, end=right.end)

    def sum(self) -> Term:
        return self.chain(("+", "-"), self.product)

    def product(self) -> Term:
        return self.chain(("*", "/"), self.unary)

    def chain(self, operators: tuple[str, str], operand: Callable[[], Term]) -> Term:
        """Parse a sequence of operands and left-associative operators with the same precedence, such as `a + b - c`."""
        left = operand()
        while (operator := self.peek()) in operators:
            self.at += 1
            right = operand()
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
        name = self.names.match(self.text, self.at)
        if name is None:
            raise self.unexpected_token("a number, a name or `(`")
        offset, self.at = self.at, name.end()
        if self.peek() == "(":
            return self.call(name.group(), offset)
        if name.group() in FUNCTIONS:
            raise ExpressionError(
                f"`{name.group()}` is a function: write its arguments in parentheses", offset, name.end(),
                help=f"write `{name.group()}(...)`",
            )
        return NameUse(name=name.group(), offset=offset, end=name.end())

    def closing(self, opened: int) -> None:
        if self.peek() == ")":
            self.at += 1
        elif self.at >= len(self.text):
            raise ExpressionError("the `(` opened here is not closed", opened, opened + 1, help="add `)`")
        else:
            raise self.unexpected_token("an operator or `)`")

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
                    raise self.unexpected_token("an operator")
                unit, self.at = scan_unit(self.text, following, compact=True)
                bare = False
            value = Quantity(to_si(number, unit), unit[2])
        except UnitError as error:
            at, stop = (offset, end) if error.kind == "quantity" or error.offset is None else (error.offset, error.end or end)
            kind = "unit" if error.kind == "unit" else "value"
            raise ExpressionError(error.message, at, stop, kind=kind, help=error.help) from None
        return Literal(value=value, zero=bare and value.value == 0.0, offset=offset, end=self.at)

    def call(self, name: str, offset: int) -> Call:
        opened = self.at
        if name not in FUNCTIONS:
            known = name in UNITS or name in CONSTANTS
            raise ExpressionError(
                f"`{name}` is not a function" if known else f"unknown function `{name}`", offset, offset + len(name), kind="name",
                help=did_you_mean(name, FUNCTIONS, what="functions"),
            )
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
            arity = f"{count} argument{'' if count == '1' else 's'}"
            raise ExpressionError(f"`{name}` expects {arity}, found {len(arguments)}", offset, self.at)
        return Call(function=name, arguments=tuple(arguments), offset=offset, end=self.at)


_MARKED = re.compile(r"(?:\$\{|\{\{|\$\(|#\{|<%=?)\s*(.*?)\s*(?:\}\}?|\)|%>)|\$([A-Za-z]\w*)")
"""Regular expression of expressions in other languages: xacro, shells and templates."""


def expression_hint(text: str, names: Collection[str] | None = None) -> Suggestion | None:
    """Return a hint for a string that is an expression without `=` or an expression in the syntax of another language.

    Return None if the string is not an expression, or if it uses names that are not in `names`.
    """
    text = text.strip()
    marked = _MARKED.fullmatch(text)
    inside = (marked.group(1) or marked.group(2) or "") if marked is not None else text
    try:
        expression = parse_expression(f"={inside}")
    except ExpressionError:
        return None
    if names is not None and any(use.name not in names for use in expression.names):
        return None
    return Suggestion(f"an expression begins with `=`: `={shorten(inside)}`", (text, f"={inside}") if "\n" not in text else None)
