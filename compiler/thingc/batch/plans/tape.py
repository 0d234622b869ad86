"""A tape records the computations of compiler passes with some numbers, so that the computations can be repeated for other numbers.

In the compiler passes, a `Traced` object takes the place of a number. Operators and the functions of `base/numeric.py` return another
`Traced` object, and add a line with the operation and its arguments to the tape. A decision such as `if mass > 0` is recorded as a *guard*.
The tape does not apply to values for which the decision would be different. Code that requires the value of a number, such as a count,
converts the number by `float` or `int`. A tape with such a conversion applies only to the converted value. In a generated file, a slot
takes the place of the number.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Sequence
from typing import Any

from thingc.base.numeric import Recorded

Number = Any
"""A number in a compiler pass, which is a float, an int or a `Traced` object."""

SLOT = re.compile("⟦(.*?)⟧")
"""Pattern of a slot that takes the place of a number in a text. The name of the slot is between brackets that no file format escapes."""


def slot(name: str) -> str:
    """Return the slot with this name as a string, which takes the place of a number in a generated file.

    The pattern `SLOT` matches the returned string.
    """
    return f"⟦{name}⟧"


class Tape:
    """A list of recorded operations in the order of computation.

    Each line of the tape is a tuple `(operation, arguments)`. Each argument of a line is a constant, or a `Ref` to another line.
    """

    def __init__(self) -> None:
        self.lines: list[tuple[str, tuple[Any, ...]]] = []
        self.values: list[Any] = []
        self.guards: list[tuple[int, str, tuple[Any, ...], Any]] = []
        self.pinned: list[Traced] = []
        self.writing = False
        self.reporting = False
        self.quoted: set[str] = set()  # while reporting, the texts of numbers that do not become slots
        self.operations: dict[str, Callable[..., Any]] = {}  # in addition to the operations of `base/numeric.py`
        self._known: dict[tuple[str, tuple[Any, ...]], int] = {}

    def variable(self, value: float, of: Sequence[Traced] = ()) -> Traced:
        """Add a variable with this value to the tape, and return the variable as a traced number.

        `of` contains traced numbers on which the variable depends through computations that the tape does not contain.
        """
        return self._line("variable", (Const(len(self.lines)), *map(_argument, of)), value)

    def copy(self) -> Tape:
        """Return a copy of the tape with its lines, values and guards."""
        tape = Tape()
        tape.lines, tape.values, tape.guards = list(self.lines), list(self.values), list(self.guards)
        tape.operations = dict(self.operations)
        return tape

    def apply(self, operation: str, arguments: Sequence[Number], value: Any) -> Traced:
        """Record an operation with the result `value`, and return the result as a traced number.

        If the tape already contains an equal line, this line is reused.
        """
        return self._line(operation, tuple(map(_argument, arguments)), value)

    def guard(self, operation: str, arguments: Sequence[Number], outcome: bool) -> bool:
        """Record the outcome of a decision as a guard, and return the outcome."""
        self.guards.append((len(self.lines), operation, tuple(map(_argument, arguments)), outcome))
        return outcome

    def pin(self, number: Traced) -> Any:
        """Return the value of a traced number for direct use in a compiler pass, and record that the tape applies only to this value."""
        self.pinned.append(number)
        self.guards.append((len(self.lines), "==", (Ref(number.line), Const(number.value)), True))
        return number.value

    def _line(self, operation: str, arguments: tuple[Any, ...], value: Any) -> Traced:
        key = (operation, arguments)
        line = self._known.get(key)
        if line is None:
            line = self._known[key] = len(self.lines)
            self.lines.append(key)
            self.values.append(value)
        return Traced(self, line, value)


class Ref(int):
    """A reference to the line of the tape with this index."""

    __slots__ = ()

    def __hash__(self) -> int:
        return hash(("ref", int(self)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Ref) and int(self) == int(other)


class Const:
    """A constant argument of an operation on the tape. Zeros with different signs are different constants."""

    __slots__ = ("text", "value")

    def __init__(self, value: Any) -> None:
        self.value = value
        self.text = repr(value)

    def __hash__(self) -> int:
        return hash(self.text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Const) and self.text == other.text


def _argument(number: Number) -> Ref | Const:
    return Ref(number.line) if isinstance(number, Traced) else Const(number)


def value_of(number: Number) -> Any:
    """Return the value of a number, which can be a traced number. The tape does not record this use of the value."""
    return number.value if isinstance(number, Traced) else number


class Traced(Recorded):
    """A number whose computations are recorded on a tape.

    Traced numbers are compared and hashed by identity, so that caches distinguish them.
    """

    __slots__ = ("line", "tape", "value")

    def __init__(self, tape: Tape, line: int, value: Any) -> None:
        self.tape = tape
        self.line = line
        self.value = value

    def __add__(self, other: Number) -> Any: return _binary("+", self, other)
    def __radd__(self, other: Number) -> Any: return _binary("+", other, self)
    def __sub__(self, other: Number) -> Any: return _binary("-", self, other)
    def __rsub__(self, other: Number) -> Any: return _binary("-", other, self)
    def __mul__(self, other: Number) -> Any: return _binary("*", self, other)
    def __rmul__(self, other: Number) -> Any: return _binary("*", other, self)
    def __truediv__(self, other: Number) -> Any: return _binary("/", self, other)
    def __rtruediv__(self, other: Number) -> Any: return _binary("/", other, self)
    def __pow__(self, other: Number) -> Any:
        is_integer = isinstance(other, (int, float)) and other == int(other)
        if not is_integer and not self > 0.0:
            self.tape.pin(self)  # otherwise, the result may be complex
        return _binary("**", self, other)

    def __rpow__(self, other: Number) -> Any: return _binary("**", other, self)
    def __mod__(self, other: Number) -> Any: return _binary("%", self, other)
    def __rmod__(self, other: Number) -> Any: return _binary("%", other, self)
    def __neg__(self) -> Traced: return self.tape.apply("-", (self,), -self.value)
    def __pos__(self) -> Traced: return self
    def __abs__(self) -> Traced: return self.tape.apply("abs", (self,), abs(self.value))

    def __lt__(self, other: Number) -> Any: return _compare("<", self, other)
    def __le__(self, other: Number) -> Any: return _compare("<=", self, other)
    def __gt__(self, other: Number) -> Any: return _compare(">", self, other)
    def __ge__(self, other: Number) -> Any: return _compare(">=", self, other)

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if not isinstance(other, (int, float, Traced)):
            return False
        return bool(_compare("==", self, other))

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return object.__hash__(self)

    def __bool__(self) -> bool:
        return self.tape.guard("!=", (self, 0.0), self.value != 0.0)

    def __int__(self) -> int:
        return int(self.tape.pin(self))

    def __index__(self) -> int:
        raise TypeError("a number that varies between variants cannot be used as a count")

    def __float__(self) -> float:
        return float(self.tape.pin(self))

    def __round__(self, digits: int | None = None) -> Any:
        if digits is None:
            return round(self.tape.pin(self))
        return self.tape.apply("round", (self, digits), round(self.value, digits))

    def __repr__(self) -> str:
        text = repr(self.tape.pin(self) if self.tape.writing else self.value)  # labels and messages are not part of files
        if self.tape.reporting:
            self.tape.quoted.add(text)
        return text

    def __format__(self, form: str) -> str:
        return self.slot(f":{form}") if self.tape.writing or self.tape.reporting else format(self.value, form)

    def operate(self, name: str, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Record a function call as a single line of the tape. The operations inside the function are not recorded.

        If the result is a boolean, it is recorded as a guard.
        """
        result = function(*map(value_of, arguments))
        if isinstance(result, bool):
            return self.tape.guard(name, arguments, result)
        return _items(self.tape.apply(name, arguments, result))

    def for_text(self) -> Any:
        """Return this traced number if texts can contain slots, otherwise return its value."""
        return self if self.tape.writing or self.tape.reporting else self.value

    def slot(self, form: str) -> str:
        """Return a placeholder for this number in a text. `form` is the format of the number that replaces the placeholder."""
        return slot(f"{self.line}:{form}")


def _items(result: Traced) -> Any:
    """Return the items of a traced result that is a tuple. The items are traced numbers in nested tuples with the same structure."""
    if not isinstance(result.value, tuple):
        return result
    return tuple(_items(result.tape.apply("item", (result, place), item)) for place, item in enumerate(result.value))


def _binary(operation: str, left: Number, right: Number) -> Any:
    if not isinstance(left, (int, float, Traced)) or not isinstance(right, (int, float, Traced)):
        return NotImplemented
    tape = next(number.tape for number in (left, right) if isinstance(number, Traced))
    return tape.apply(operation, (left, right), OPERATORS[operation](value_of(left), value_of(right)))


def _compare(operation: str, left: Traced, right: Number) -> Any:
    if not isinstance(right, (int, float, Traced)):
        return NotImplemented
    return left.tape.guard(operation, (left, right), bool(OPERATORS[operation](value_of(left), value_of(right))))


def _minus(first: Any, *second: Any) -> Any:
    return first - second[0] if second else -first


OPERATORS: dict[str, Callable[..., Any]] = {
    "+": operator.add, "-": _minus, "*": operator.mul, "/": operator.truediv, "**": operator.pow, "%": operator.mod,
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "!=": operator.ne,
}
"""Functions for the operators with two numbers. For the operator `-`, the function also accepts a single number."""


def variables_of(tape: Tape, number: Traced) -> list[int]:
    """Return the indices of the variables of the tape on which a traced number depends."""
    variables = [line for line, (operation, _) in enumerate(tape.lines) if operation == "variable"]
    needed = lines_needed(tape, [Ref(number.line)])
    return [k for k, line in enumerate(variables) if line in needed]


def lines_needed(tape: Tape, references: Sequence[Any]) -> set[int]:
    """Return the indices of all lines of the tape that are needed to compute `references`. Constants in `references` are ignored."""
    needed: set[int] = set()
    waiting = [int(reference) for reference in references if isinstance(reference, Ref)]
    while waiting:
        line = waiting.pop()
        if line not in needed:
            needed.add(line)
            waiting.extend(int(reference) for reference in tape.lines[line][1] if isinstance(reference, Ref))
    return needed
