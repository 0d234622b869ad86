"""Parse expressions by precedence climbing. The parser of Python is not used, because it cannot report positions inside units."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection

from msgspec.structs import replace

from thingc.base.suggestions import Suggestion, did_you_mean
from thingc.base.units import MAX_TEXT, NUMBER, UNITS, Quantity, UnitError, scan_number, scan_unit, shorten, to_si
from thingc.documents.expressions import terms
from thingc.documents.expressions.terms import Binary, Call, Expression, ExpressionError, Literal, NameUse, Term, Unary


def parse_expression(text: str, *, dotted: bool = False) -> Expression:
    """Parse an expression. The leading `=` is optional.

    With `dotted`, names can contain dots (`centre.x`). Raises `ExpressionError` for invalid syntax.
    """
    if len(text) > MAX_TEXT:
        raise ExpressionError(f"the expression has {len(text)} characters (at most {MAX_TEXT} are allowed)", 0, len(text))
    return Expression(text=text, tree=_Parser(text, _DOTTED if dotted else _NAME).parse())


_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_DOTTED = re.compile(r"[A-Za-z_]\w*(?:\.(?:[A-Za-z_]\w*|\d+))*", re.ASCII)
_OPERATOR = re.compile(r"\*\*|<=|>=|==|!=|[-+*/<>(),]")
_SUPPORTED = "use only numbers, names, operators and functions"
_UNSUPPORTED_HINTS = {
    "^": "use `**` for powers", "%": "write `%` only as a unit: `15 %`", "=": "use `==` for equality",
    ".": "use a parameter of this document",
    "&": _SUPPORTED, "|": _SUPPORTED, "[": "use round parentheses", "{": "use round parentheses",
    "$": "write the index without `$`: `i`", "'": "remove the quotes", '"': "remove the quotes",
}


class _Parser:
    """A precedence-climbing parser for the text of an expression.

    `index` is the index of the next character, `depth` is the nesting depth, and `names` is the regular expression that names must match.
    """

    def __init__(self, text: str, names: re.Pattern[str] = _NAME) -> None:
        self.text = text
        self.names = names
        self.index = 0
        self.depth = 0

    def parse(self) -> Term:
        self.skip_spaces()
        if self.text.startswith("=", self.index):
            self.index += 1
        if self.peek() == "" and self.index == len(self.text):
            raise ExpressionError("expected an expression after `=`, found nothing", max(0, self.index - 1), len(self.text))
        tree = self.comparison()
        if self.index < len(self.text):
            raise self.unexpected_token("an operator or the end of the expression")
        return tree

    def skip_spaces(self) -> None:
        while self.index < len(self.text) and self.text[self.index].isspace():
            self.index += 1

    def peek(self) -> str:
        """Return the operator at the current position, or an empty string if the next token is not an operator."""
        self.skip_spaces()
        match = _OPERATOR.match(self.text, self.index)
        return match.group() if match else ""

    def unexpected_token(self, expected: str) -> ExpressionError:
        self.skip_spaces()
        if self.index >= len(self.text):
            return ExpressionError(f"expected {expected}, found the end of the expression", max(0, len(self.text) - 1), len(self.text))
        match = _OPERATOR.match(self.text, self.index) or _NAME.match(self.text, self.index)
        token = match.group() if match else self.text[self.index]
        number = scan_number(self.text, self.index)
        if number is not None and token[0] not in "+-":
            token = number[0]
        help = _UNSUPPORTED_HINTS.get(token)
        if token in ("and", "or", "not", "if", "else"):
            help = _SUPPORTED
        return ExpressionError(f"expected {expected}, found `{token}`", self.index, self.index + len(token), help=help)

    def comparison(self) -> Term:
        left = self.sum()
        operator = self.peek()
        if operator not in terms.COMPARISONS:
            return left
        self.index += len(operator)
        right = self.sum()
        if self.peek() in terms.COMPARISONS:
            raise ExpressionError("comparisons cannot be chained", self.index, self.index + len(self.peek()), help="write two comparisons")
        return Binary(operator=operator, left=left, right=right, offset=left.offset, end=right.end)

    def sum(self) -> Term:
        return self.chain(("+", "-"), self.product)

    def product(self) -> Term:
        return self.chain(("*", "/"), self.unary)

    def chain(self, operators: tuple[str, str], operand: Callable[[], Term]) -> Term:
        """Parse a sequence of operands and left-associative operators with the same precedence, such as `a + b - c`."""
        left = operand()
        while (operator := self.peek()) in operators:
            self.index += 1
            right = operand()
            left = Binary(operator=operator, left=left, right=right, offset=left.offset, end=right.end)
        return left

    def unary(self) -> Term:
        operator = self.peek()
        if operator not in ("+", "-"):
            return self.power()
        offset = self.index
        self.index += 1
        self.enter_level(offset)
        operand = self.unary()
        self.depth -= 1
        return operand if operator == "+" else Unary(operand=operand, offset=offset, end=operand.end)

    def power(self) -> Term:
        base = self.atom()
        if self.peek() != "**":
            return base
        offset = self.index
        self.index += 2
        self.enter_level(offset)
        exponent = self.unary()
        self.depth -= 1
        return Binary(operator="**", left=base, right=exponent, offset=base.offset, end=exponent.end)

    def enter_level(self, offset: int) -> None:
        self.depth += 1
        if self.depth > terms.MAX_DEPTH:
            raise ExpressionError(f"the expression has more than {terms.MAX_DEPTH} levels of nesting", offset, len(self.text))

    def atom(self) -> Term:
        if self.peek() == "(":
            opened = self.index
            self.index += 1
            self.enter_level(opened)
            inside = self.comparison()
            self.close_parenthesis(opened)
            self.depth -= 1
            return replace(inside, offset=opened, end=self.index)
        number = scan_number(self.text, self.index)
        if number is not None and self.text[self.index] not in "+-":
            return self.literal(*number)
        name = self.names.match(self.text, self.index)
        if name is None:
            raise self.unexpected_token("a number, a name or `(`")
        offset, self.index = self.index, name.end()
        if self.peek() == "(":
            return self.call(name.group(), offset)
        if name.group() in terms.FUNCTIONS:
            raise ExpressionError(
                f"the function `{name.group()}` has no arguments", offset, name.end(),
                help=f"write `{name.group()}(...)`",
            )
        return NameUse(name=name.group(), offset=offset, end=name.end())

    def close_parenthesis(self, opened: int) -> None:
        if self.peek() == ")":
            self.index += 1
        elif self.index >= len(self.text):
            raise ExpressionError("the parenthesis `(` is not closed", opened, opened + 1, help="add `)`")
        else:
            raise self.unexpected_token("an operator or `)`")

    def literal(self, number: str, end: int) -> Literal:
        offset, self.index = self.index, end
        unit = (1, 1, NUMBER)
        unit_index = end
        while unit_index < len(self.text) and self.text[unit_index] == " ":
            unit_index += 1
        unit_start = self.text[unit_index : unit_index + 1]
        bare = True
        try:
            if unit_start.isalpha() or unit_start in ("%", "°", "_") and unit_start:
                word = _NAME.match(self.text, unit_index)
                if word is not None and word.group() in terms.FUNCTIONS or unit_start == "_":
                    raise self.unexpected_token("an operator")
                unit, self.index = scan_unit(self.text, unit_index, compact=True)
                bare = False
            value = Quantity(to_si(number, unit), unit[2])
        except UnitError as error:
            start, stop = (offset, end) if error.kind == "quantity" or error.offset is None else (error.offset, error.end or end)
            kind = "unit" if error.kind == "unit" else "value"
            raise ExpressionError(error.message, start, stop, kind=kind, help=error.help) from None
        return Literal(value=value, zero=bare and value.value == 0.0, offset=offset, end=self.index)

    def call(self, name: str, offset: int) -> Call:
        opened = self.index
        if name not in terms.FUNCTIONS:
            exists = name in UNITS or name in terms.CONSTANTS
            raise ExpressionError(
                f"`{name}` is not a function" if exists else f"unknown function `{name}`", offset, offset + len(name), kind="name",
                help=did_you_mean(name, terms.FUNCTIONS, what="functions"),
            )
        self.index += 1
        self.enter_level(opened)
        arguments: list[Term] = []
        if self.peek() != ")":
            arguments.append(self.comparison())
            while self.peek() == ",":
                self.index += 1
                arguments.append(self.comparison())
        self.close_parenthesis(opened)
        self.depth -= 1
        minimum, maximum = terms.FUNCTIONS[name]
        if not minimum <= len(arguments) <= maximum:
            count = f"{minimum}" if minimum == maximum else f"{minimum} to {maximum}"
            arity = f"{count} argument{'' if count == '1' else 's'}"
            raise ExpressionError(f"`{name}` expects {arity}, found {len(arguments)}", offset, self.index)
        return Call(function=name, arguments=tuple(arguments), offset=offset, end=self.index)


_FOREIGN_EXPRESSION = re.compile(r"(?:\$\{|\{\{|\$\(|#\{|<%=?)\s*(.*?)\s*(?:\}\}?|\)|%>)|\$([A-Za-z]\w*)")
"""Regular expression of expressions in other languages: xacro, shells and templates."""


def expression_hint(text: str, names: Collection[str] | None = None) -> Suggestion | None:
    """Return a hint for a string that is probably an expression: without `=`, or in the syntax of another language such as xacro.

    Return None if the string is not an expression, or if `names` is given and the expression uses other names.
    """
    text = text.strip()
    foreign = _FOREIGN_EXPRESSION.fullmatch(text)
    body = (foreign.group(1) or foreign.group(2) or "") if foreign is not None else text
    try:
        expression = parse_expression(f"={body}")
    except ExpressionError:
        return None
    if names is not None and any(use.name not in names for use in expression.names):
        return None
    return Suggestion(f"an expression begins with `=`: `={shorten(body)}`", (text, f"={body}") if "\n" not in text else None)
