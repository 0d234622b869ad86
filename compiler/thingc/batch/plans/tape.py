"""What passes do with a few numbers, written down while they do it: a tape, which is worked through again with other numbers.

A `Traced` stands for a number in the passes. It knows its value, and what is worked out of it is another `Traced`, with a line on the tape:
which operation, of what. Where a pass decides by it (`if mass > 0`), the decision goes onto the tape as well, as a *guard*: with numbers
for which it comes out differently the tape says nothing. Nothing else can be learned of a `Traced` without the tape's hearing of it:
it is no float, so that whoever needs one (a part's parameters, a count, a text) must ask for it, and then its value is guarded.
"""

from __future__ import annotations

import builtins
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from thingc.base import inertia, pose, summing
from thingc.base.gaps import Recorded

Number = Any
"""A float, an int or a `Traced`."""

TOKENS = re.compile(r"-?[0-9.]+e-2[67][0-9]")
"""Tokens in texts, and what might become of them."""
_EXPONENTS = range(-920, -865)
"""The powers of two at which tokens begin: one for each form in which numbers are written."""

_ELEMENTARY = ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "hypot", "copysign", "radians", "degrees", "remainder", "fmod")
"""Functions of `math` of one result, worked out as they are."""
_OF_MANY = ((math, "fsum"), (summing, "hypot_of"))
"""Functions of some numbers, of one result."""

WHOLE = ((pose, "quarter_exact"), (inertia, "principal_axes"))
"""Functions of ours that are one line of a tape, because what they decide on the way is nobody's business: the module, and their name."""


class Tape:
    """The lines, in the order in which they came to be. A line is `(operation, arguments)`; arguments are numbers, and `Ref`s to lines."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, tuple[Any, ...]]] = []
        self.values: list[Any] = []
        self.guards: list[tuple[int, str, tuple[Any, ...], Any]] = []
        self.pinned: list[Traced] = []
        self.writing = False
        self.written: dict[str, int] = {}
        self.forms: dict[str, str] = {}
        self._places: dict[str, int] = {}
        self._known: dict[tuple[str, tuple[Any, ...]], int] = {}

    def variable(self, value: float, of: Sequence[Traced] = ()) -> Traced:
        """A number that will be another one next time; `of` what it depends on, in a way that nothing is written down of."""
        return self._line("variable", (Const(len(self.lines)), *map(_argument, of)), value)

    def copy(self) -> Tape:
        """The tape as it is now."""
        made = Tape()
        made.lines, made.values, made.guards = list(self.lines), list(self.values), list(self.guards)
        return made

    def apply(self, operation: str, arguments: Sequence[Number], value: Any) -> Traced:
        """The line of an operation that has just come to `value`, or the equal one that is there already."""
        return self._line(operation, tuple(map(_argument, arguments)), value)

    def guard(self, operation: str, arguments: Sequence[Number], outcome: bool) -> bool:
        """A decision; its outcome."""
        self.guards.append((len(self.lines), operation, tuple(map(_argument, arguments)), outcome))
        return outcome

    def pin(self, number: Traced) -> Any:
        """Somebody wants to know a value: the tape is of this value alone."""
        self.pinned.append(number)
        self.guards.append((len(self.lines), "==", (Ref(number.line), Const(number.value)), True))
        return number.value

    def token(self, number: Traced, form: str = "xml") -> float:
        """A float that stands for a line in a text, by its `repr`, which nothing else has. `form` is how the number is to be written:
        `xml`, or as another format does, or behind a `:` as `format` does with that."""
        place = self._places.setdefault(form, len(self._places))
        token = math.ldexp(1.0 + number.line * 2.0**-40, _EXPONENTS[place])
        self.written[repr(token)] = number.line
        self.forms[repr(token)] = form
        return token

    def _line(self, operation: str, arguments: tuple[Any, ...], value: Any) -> Traced:
        key = (operation, arguments)
        line = self._known.get(key)
        if line is None:
            line = self._known[key] = len(self.lines)
            self.lines.append(key)
            self.values.append(value)
        return Traced(self, line, value)


class Ref(int):
    """The number of a line."""

    __slots__ = ()

    def __hash__(self) -> int:
        return hash(("ref", int(self)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Ref) and int(self) == int(other)


class Const:
    """A number that is the same whatever the variables are; of zeros the sign counts."""

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
    """The value that a number has now, without a word to the tape."""
    return number.value if isinstance(number, Traced) else number


class Traced(Recorded):
    """A number on a tape. It is hashed and, first of all, compared as the object that it is: what is kept by it is kept by nobody else."""

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
        whole = isinstance(other, (int, float)) and other == int(other)
        if not whole and not self > 0.0:
            self.tape.pin(self)  # else a complex number may come of it
        return _binary("**", self, other)

    def __rpow__(self, other: Number) -> Any: return _binary("**", other, self)
    def __mod__(self, other: Number) -> Any: return _binary("%", self, other)
    def __rmod__(self, other: Number) -> Any: return _binary("%", other, self)
    def __neg__(self) -> Traced: return self.tape.apply("-", (self,), -self.value)
    def __pos__(self) -> Traced: return self
    def __abs__(self) -> Traced: return self.tape.apply("abs", (self,), abs(self.value))

    def __lt__(self, other: Number) -> Any: return _compared("<", self, other)
    def __le__(self, other: Number) -> Any: return _compared("<=", self, other)
    def __gt__(self, other: Number) -> Any: return _compared(">", self, other)
    def __ge__(self, other: Number) -> Any: return _compared(">=", self, other)

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if not isinstance(other, (int, float, Traced)):
            return False
        if self.tape.writing and isinstance(other, int):
            return False  # whether it is written with a point: see `targets.xml_writer.number`
        return bool(_compared("==", self, other))

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return object.__hash__(self)

    def __bool__(self) -> bool:
        return self.tape.guard("!=", (self, 0.0), self.value != 0.0)

    def __int__(self) -> int:
        return int(self.value) if self.tape.writing else int(self.tape.pin(self))

    def __index__(self) -> int:
        raise TypeError("a number that differs is no count")

    def __float__(self) -> float:
        return self.tape.token(self) if self.tape.writing else float(self.tape.pin(self))

    def __round__(self, digits: int | None = None) -> Any:
        return round(self.tape.pin(self), digits)

    def __repr__(self) -> str:
        return repr(self.tape.pin(self) if self.tape.writing else self.value)  # in labels and messages, of which no file is made

    def word(self, form: str) -> str:
        """The token of the number."""
        return repr(self.tape.token(self, form))

    def __format__(self, form: str) -> str:
        return repr(self.tape.token(self, f":{form}")) if self.tape.writing else format(self.value, form)


def _binary(operation: str, left: Number, right: Number) -> Any:
    if not isinstance(left, (int, float, Traced)) or not isinstance(right, (int, float, Traced)):
        return NotImplemented
    tape = next(one.tape for one in (left, right) if isinstance(one, Traced))
    return tape.apply(operation, (left, right), OPERATIONS[operation](value_of(left), value_of(right)))


def _compared(operation: str, left: Traced, right: Number) -> Any:
    if not isinstance(right, (int, float, Traced)):
        return NotImplemented
    if left.tape.writing and operation == "<" and type(right) is float and right == 1e16:
        return bool(left.value < right)  # how it is written: see `targets.xml_writer.number`
    return left.tape.guard(operation, (left, right), bool(OPERATIONS[operation](value_of(left), value_of(right))))


OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b, "/": lambda a, b: a / b, "**": lambda a, b: a**b,
    "%": lambda a, b: a % b, "<": lambda a, b: a < b, "<=": lambda a, b: a <= b, ">": lambda a, b: a > b, ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b, "!=": lambda a, b: a != b,
}
"""Operators of two numbers."""


def flat(value: Any) -> Iterator[Any]:
    """The numbers of nested tuples, in their order."""
    if isinstance(value, (tuple, list)):
        for one in value:
            yield from flat(one)
    else:
        yield value


def shaped(like: Any, numbers: Iterator[Any]) -> Any:
    """Nested tuples like these, of other numbers."""
    return tuple(shaped(one, numbers) for one in like) if isinstance(like, (tuple, list)) else next(numbers)


@contextmanager
def tracing(*others: tuple[Any, str, Any]) -> Iterator[None]:
    """While numbers may be traced: functions of `math`, `min` and `max`, and some of ours, take them as well. Of other numbers they give
    what they always do, also to other threads. `others` stand in for more: a module, the name, and what it is meanwhile."""
    stand_ins = (
        *((math, name, _elementary(name)) for name in _ELEMENTARY), *((math, name, _test(name)) for name in ("isfinite", "isnan", "isinf")),
        *((builtins, name, _extreme(name)) for name in ("min", "max")),
        *((module, name, _of_many(module, name)) for module, name in _OF_MANY),
        *((module, name, _whole(module, name)) for module, name in WHOLE), *others,
    )
    known: list[tuple[Any, str, Any]] = []
    try:
        for owner, name, function in stand_ins:
            known.append((owner, name, getattr(owner, name)))
            setattr(owner, name, function)
        yield
    finally:
        for owner, name, function in reversed(known):
            setattr(owner, name, function)


def _tape_of(values: Iterable[Any]) -> Tape | None:
    """The tape of the first of the values that is traced."""
    return next((one.tape for one in values if isinstance(one, Traced)), None)


def _elementary(name: str) -> Callable[..., Any]:
    """A function of `math`, of numbers that may be traced."""
    function = getattr(math, name)

    def traced(*arguments: Number) -> Any:
        tape = _tape_of(arguments)
        if tape is None:
            return function(*arguments)
        return tape.apply(f"math.{name}", arguments, function(*map(value_of, arguments)))

    return traced


def _of_many(module: Any, name: str) -> Callable[..., Any]:
    """A function of some numbers that may be traced: one operation on the tape."""
    function = getattr(module, name)

    def traced(values: Iterable[Number]) -> Any:
        listed = list(values)
        tape = _tape_of(listed)
        return function(listed) if tape is None else tape.apply(name, listed, function(map(value_of, listed)))

    return traced


def _extreme(name: str) -> Callable[..., Any]:
    """`min` or `max`, of numbers that may be traced: which of them it is, is not decided."""
    function = getattr(builtins, name)

    def traced(*arguments: Any, **named: Any) -> Any:
        if named or not arguments:
            return function(*arguments, **named)
        listed = list(arguments[0]) if len(arguments) == 1 else list(arguments)
        tape = _tape_of(listed)
        if tape is None or len(listed) == 1 or not all(isinstance(one, (int, float, Traced)) for one in listed):
            return function(listed)
        return tape.apply(name, listed, function(map(value_of, listed)))

    return traced


def _test(name: str) -> Callable[..., Any]:
    """A question to `math` about one number that may be traced: the answer is a guard."""
    function = getattr(math, name)

    def traced(number: Number) -> Any:
        if not isinstance(number, Traced):
            return function(number)
        return number.tape.guard(f"math.{name}", (number,), function(number.value))

    return traced


def _whole(module: Any, name: str) -> Callable[..., Any]:
    """A function of ours, whose argument may have traced numbers in it: one operation on the tape."""
    function = getattr(module, name)

    def traced(argument: Any) -> Any:
        listed = list(flat(argument))
        tape = _tape_of(listed)
        if tape is None:
            return function(argument)
        results = function(shaped(argument, map(value_of, listed)))
        call = tape.apply(name, listed, results)
        items = (tape.apply("item", (call, k), value) for k, value in enumerate(flat(results)))
        return shaped(results, items)

    return traced

