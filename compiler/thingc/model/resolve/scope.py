"""Evaluate the values of a document: expressions, physical dimensions, bounds, and default values."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Set
from typing import Any, NamedTuple

from msgspec.structs import replace
from pydantic import BaseModel

from thingc.base import numeric
from thingc.base.diagnostics import MAX_FAULTS, Code, Note, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Matrix, Pose, Vector, make_pose, rotation_of
from thingc.base.primitives import FARTHEST
from thingc.base.source import Document, Origin, Path, ScalarNode, Span, format_path, node_at, walk
from thingc.base.suggestions import Hint
from thingc.base.units import ANGLE, LENGTH, NUMBER, Dimension, Quantity, shorten, suggested_units
from thingc.documents.expressions.evaluation import ExpressionValue, evaluate, format_value, kind_of
from thingc.documents.expressions.parsing import expression_hint
from thingc.documents.expressions.terms import Expression, ExpressionError
from thingc.documents.spec.assembly import TurnSpec
from thingc.documents.spec.invalid_entries import NO_DOUBTS, InvalidEntries
from thingc.documents.spec.poses import PoseSpec

NOTHING: frozenset[str] = frozenset()
UNIT = 1e-3
"""Tolerance for the length of a quaternion in a document, which should be normalized."""

_EXPRESSION_CODES = {"dimension": Code.DIMENSION, "unit": Code.DIMENSION, "value": Code.OUT_OF_RANGE}


class TooManyErrors(Exception):
    """Raised to abort a pass after the maximum number of errors has been reported."""


class Scope(FrozenStruct):
    """Evaluates the values of a document, or of one item of a `repeat`.

    `names` contains the names that expressions can use. Errors are reported. `broken` contains names with invalid values, which have been
    reported. An expression that contains one of these names is invalid, but is not reported again. `index` contains the name of the
    repeat's index, and its value in references (`$i`). `reported` contains the errors that any scope of the run has reported, so that an
    error is reported once for all items of a repeat and all uses of a document. `doubts` contains the locations of errors that validation
    has reported.
    """

    document: Document
    report: Report
    names: Mapping[str, ExpressionValue]
    broken: Set[str] = NOTHING
    index: tuple[str, str] | None = None
    reported: set[tuple[str, Code, Path, bool]] = set()
    doubts: InvalidEntries = NO_DOUBTS

    def repeat_scope(self, name: str, value: int) -> Scope:
        """Create the scope of one item of a `repeat`, in which expressions can use the index of the item."""
        return replace(self, names={**self.names, name: Quantity(float(value))}, broken=self.broken - {name}, index=(name, str(value)))

    # --- places ---------------------------------------------------------------------------------------------------

    def span(self, path: Path, *, key: bool = False) -> Span:
        """Return the span of the value (or the key) at `path`."""
        return self.document.span(path, key=key)

    def origin(self, path: Path, *, key: bool = False) -> Origin:
        """Return the location of the value (or the key) at `path`, as the origin of an element of this document."""
        return (self.document.span(path, key=key),)

    def source_text(self, path: Path) -> str | None:
        """Return the source text of the scalar at `path`, or None if the value is not a scalar."""
        node = node_at(self.document.tree, path)
        return node.text if isinstance(node, ScalarNode) else None

    def has_expression(self, path: Path) -> bool:
        """Return whether the value at `path` contains an expression."""
        node = node_at(self.document.tree, path)
        return node is not None and any(isinstance(inner, ScalarNode) and str(inner.value).startswith("=") for _, inner in walk(node))

    def error(
        self, code: Code, message: Hint, path: Path, *, help: Hint | None = None, notes: Iterable[Note] = (), key: bool = False,
        span: Span | None = None,
    ) -> None:
        """Report an error at `path` once. The location is the value, the key if `key` is True, or `span` if given.

        Errors at the locations in `doubts` are not reported.
        """
        if self.doubts.touch(path):
            return
        error = (self.document.relative, code, path, key)
        if error in self.reported:
            return
        if len(self.reported) >= MAX_FAULTS:
            raise TooManyErrors
        self.reported.add(error)
        self.report.add(code, message, span or self.document.span(path, key=key), help=help, notes=notes, path=format_path(path))

    def second_note(self, message: str, path: Path, error_path: Path) -> list[Note]:
        """Return a note with `path` as a second location of an error at `error_path`. Return no notes if both are on the same line."""
        second, first = self.document.span(path), self.document.span(error_path)
        return [] if second.line == first.line else [Note(message=message, span=second)]

    # --- values ---------------------------------------------------------------------------------------------------

    def value(self, raw: Any, path: Path) -> ExpressionValue | None:
        """Evaluate a value of the document: a number, a quantity such as `20 mm`, or an expression.

        If the value is invalid, report an error once and return None.
        """
        if isinstance(raw, Quantity):
            return raw
        if isinstance(raw, Expression):
            if self.broken and any(use.name in self.broken for use in raw.names):
                return None
            try:
                return evaluate(raw, self.names)
            except ExpressionError as error:
                if error.kind == "name" and self.doubts.lacks("parameters"):
                    return None
                self.error(
                    _EXPRESSION_CODES.get(error.kind, Code.EXPRESSION), error.message, path, help=error.help,
                    span=self._subspan(raw, path, error.offset, error.end),
                )
                return None
        if isinstance(raw, (int, float)) and not isinstance(raw, bool):
            return Quantity(float(raw))
        if isinstance(raw, (bool, str)):
            return raw
        raise TypeError(f"not a value of a document: {raw!r}")

    def _subspan(self, expression: Expression, path: Path, offset: int, end: int) -> Span | None:
        """Return the span of a part of an expression, given by a range of characters in a scalar on one line."""
        node = node_at(self.document.tree, path)
        if not isinstance(node, ScalarNode) or node.span.line != node.span.end_line:
            return None
        source = str(node.value)
        quotes = node.span.end_column - node.span.column - len(source)
        at = source.find(expression.text)
        if at < 0 or quotes not in (0, 2):
            return None
        first = node.span.column + quotes // 2 + at + offset
        return replace(node.span, column=first, end_column=max(first + 1, first + end - offset))

    def number(
        self, raw: Any, path: Path, dimension: Dimension | tuple[Dimension, ...], subject: str, *,
        above: float | None = None, least: float | None = None, most: float | None = None, notes: Iterable[Note] = (),
    ) -> float | None:
        """Evaluate a number in a document, check its physical dimension and its bounds, and return it in SI units.

        If the value is invalid, report an error and return None. A missing number, which is None, stays None.

        `subject` is the name of the value in messages: "the mass", "`limit.lower` of joint `yaw`". `notes` explains why the value must have
        this physical dimension.
        """
        quantity = None if raw is None else self.value(raw, path)
        if quantity is None:
            return None
        dimensions = dimension if isinstance(dimension, tuple) else (dimension,)
        if not isinstance(quantity, Quantity) or not any(quantity.fits(expected) for expected in dimensions):
            self.wrong_dimension(quantity, dimensions, subject, path, notes)
            return None
        value = quantity.value + 0.0
        rule = None
        if above is not None and not value > above:
            rule = f"above {Quantity(above, quantity.dimension)}" if above else "above 0"
        elif least is not None and most is not None and not least <= value <= most:
            rule = f"between {_format_bound(least, quantity.dimension)} and {_format_bound(most, quantity.dimension)}"
        elif least is not None and not value >= least:
            rule = f"at least {_format_bound(least, quantity.dimension)}"
        elif most is not None and not value <= most:
            rule = f"at most {_format_bound(most, quantity.dimension)}"
        if rule is not None:
            self.error(Code.OUT_OF_RANGE, f"{subject} must be {rule}, found {self.format_value(quantity, path)}", path)
            return None
        return value

    def count(self, raw: Any, path: Path, subject: str, *, least: int = 0) -> int | None:
        """Evaluate an integer such as the count of a `repeat`, and check its lower bound.

        If the value is invalid, report an error and return None.
        """
        value = self.number(raw, path, NUMBER, subject, least=float(least))
        if value is None:
            return None
        if value != int(value):
            self.error(Code.VALUE_KIND, f"{subject} must be a whole number, found {self.format_value(Quantity(value), path)}", path)
            return None
        return int(value)

    def vector(self, raw: Any, path: Path, dimension: Dimension, subject: str) -> Vector | None:
        """Evaluate a vector of three values with the same physical dimension, and return it in SI units. A missing vector stays None.

        If a value is invalid, or a length is above `FARTHEST`, report an error and return None.
        """
        if raw is None:
            return None
        least, most = (-FARTHEST, FARTHEST) if dimension == LENGTH else (None, None)
        x, y, z = (self.number(part, (*path, index), dimension, subject, least=least, most=most) for index, part in enumerate(raw))
        return None if x is None or y is None or z is None else (x, y, z)

    def direction(self, raw: Any, path: Path, subject: str, code: Code, zero: str = "", example: str = "[1, 0, 0]") -> Vector | None:
        """Evaluate a vector, such as an axis, and return it with length 1. A missing vector stays None.

        If the vector is invalid, report an error and return None. `code`, `zero` and `example` are the code and the message for a vector of
        length 0 (by default a message with the `subject`), and the vector in its help text.
        """
        vector = self.vector(raw, path, NUMBER, subject)
        if vector is None:
            return None
        size = numeric.hypot(*vector)
        if size > 0.0:
            return (vector[0] / size, vector[1] / size, vector[2] / size)
        self.error(code, zero or f"{subject} must not be zero", path, help=f"write, for example, `{example}`")
        return None

    def pose(self, spec: PoseSpec, path: Path) -> Pose | None:
        """Evaluate the pose at `path`, which consists of a position and a rotation.

        If the pose is invalid, report an error and return None.
        """
        translation = self.vector(spec.xyz, (*path, "xyz"), LENGTH, "`xyz`")
        rotation = self.rotation(spec, path)
        return None if translation is None or rotation is None else Pose(rotation=rotation, translation=translation)

    def rotation(self, spec: PoseSpec | TurnSpec, path: Path) -> Matrix | None:
        """Evaluate the rotation at `path`, which the document specifies by `quat` or `rpy`.

        If the rotation is invalid, report an error and return None.
        """
        if isinstance(spec, TurnSpec) or spec.quat is None:
            angles = self.vector(spec.rpy, (*path, "rpy"), ANGLE, "`rpy`")
            return None if angles is None else make_pose((0.0, 0.0, 0.0), angles).rotation
        place = (*path, "quat")
        w, x, y, z = (self.number(part, (*place, index), NUMBER, "`quat`") for index, part in enumerate(spec.quat))
        if w is None or x is None or y is None or z is None:
            return None
        length = numeric.sqrt(w * w + x * x + y * y + z * z)
        if not abs(length - 1.0) <= UNIT:
            unit = ", ".join(f"{part / length:.6g}" for part in (w, x, y, z)) if 0.0 < length < numeric.inf else "1, 0, 0, 0"
            self.error(Code.OUT_OF_RANGE, f"`quat` must have length 1, found {length:.6g}", place, help=f"write `[{unit}]`")
            return None
        return rotation_of((w, x, y, z))

    def format_value(self, value: ExpressionValue, path: Path) -> str:
        """Format a value for messages: the source text in backticks and, for an expression, its result."""
        result = format_value(value)
        text = (self.source_text(path) or result).strip()
        return f"`{shorten(text)}` ({result})" if text.startswith("=") and text[1:].strip() != result else f"`{shorten(text)}`"

    def wrong_dimension(
        self, value: ExpressionValue, expected: tuple[Dimension, ...], subject: str, path: Path, notes: Iterable[Note] = (),
    ) -> None:
        """Report an error for a value with a wrong physical dimension.

        The message contains the expected physical dimension and the dimension of the value.
        """
        message, help = dimension_message(value, expected, subject, self.source_text(path), self.names)
        self.error(Code.DIMENSION, message, path, help=help, notes=notes)


def dimension_message(
    value: ExpressionValue, expected: tuple[Dimension, ...], subject: str, source: str | None, names: Collection[str] = (),
) -> tuple[str, Hint | None]:
    """Return the message and the help text for a value with a wrong physical dimension.

    `subject` is the name of the value in messages, `source` is its source text, and `names` contains the names that expressions can use.
    """
    requirement = " or ".join(f"{dimension.words} (such as {dimension.example})" for dimension in expected)
    text = shorten((source if source is not None else format_value(value)).strip())
    help: Hint | None = expression_hint(value, names) if isinstance(value, str) else None
    if isinstance(value, str) and help is not None and text.startswith("="):
        help = f"write `={shorten(value)}` for an expression"
    if isinstance(value, Quantity) and value.dimension == NUMBER and not text.startswith("="):
        unit = suggested_units(expected[0], text)[0]
        help = f"write `{text} {unit}`" if unit else None
    elif isinstance(value, Quantity) and text == (source or "").strip() and not set(names).isdisjoint(re.findall(r"\w+", text)):
        help = next(filter(None, (_conversion_help(text, value.dimension, one) for one in expected)), None)
    return f"{subject} must be {requirement}, found {kind_of(value)} (`{text}`)", help


def _conversion_help(text: str, found: Dimension, expected: Dimension) -> str | None:
    """Return the help text for an expression that must be multiplied or divided by one unit to have the expected physical dimension.

    Examples are `=pinion / 1 rad`, `=count * 1 mm` and `=width / 1 mm`.
    """
    body = text.removeprefix("=")
    term = f"({body})" if re.search(r"[-+<>=]", body) else body
    if found == NUMBER:
        return f"write `={term} * 1 {expected.example.partition(' ')[2]}`"
    if expected / found in (ANGLE, ANGLE**-1):
        return f"write `={term} {'*' if expected / found == ANGLE else '/'} 1 rad`"
    return f"write `={term} / 1 {found.example.partition(' ')[2]}`" if expected == NUMBER else None


def _format_bound(value: float, dimension: Dimension) -> str:
    return str(Quantity(value, dimension)) if value else "0"


def find_item(items: list[Any] | dict[str, Any], number: int) -> tuple[Any, int | str] | None:
    """Return the element `number` of a list, or of a mapping whose keys are indices, and the index or key of this element.

    Return None if the element does not exist.
    """
    if isinstance(items, dict):
        return (items[str(number)], str(number)) if str(number) in items else None
    return (items[number], number) if number < len(items) else None


class LayeredValue(NamedTuple):
    """The value of a setting and its path in the document. If the setting is missing, the value is None."""

    value: Any = None
    path: Path = ()

    def __bool__(self) -> bool:
        return self.value is not None

    @property
    def own(self) -> bool:
        """Whether the element itself contains the setting, which is not a default value of the document."""
        return bool(self) and self.path[0] != "defaults"


class DefaultLayers(FrozenStruct, kw_only=False):
    """The settings of an element, followed by layers of default values. The most specific layer comes first.

    Each layer is a model and its path in the document.
    """

    items: tuple[tuple[BaseModel, Path], ...]

    def pick(self, key: str, number: int | None = None) -> LayeredValue:
        """Return a setting from the most specific layer that contains it."""
        return next(self._written_values(key, number), LayeredValue())

    def sub(self, key: str, number: int | None = None) -> DefaultLayers:
        """Return the layers of a setting that is a mapping, such as `limit`, for calls such as `layers.sub("limit").pick("lower")`.
        """
        return DefaultLayers(tuple((value, path) for value, path in self._written_values(key, number) if isinstance(value, BaseModel)))

    def entries(self, key: str) -> dict[str, LayeredValue]:
        """Return the entries of a setting that is a mapping, from all layers. Entries of more specific layers take precedence."""
        written = [(getattr(model, key, None) or {}, path) for model, path in reversed(self.items)]
        return {name: LayeredValue(value, (*path, key, name)) for mapping, path in written for name, value in mapping.items()}

    def _written_values(self, key: str, number: int | None) -> Iterator[LayeredValue]:
        for model, path in self.items:
            value = getattr(model, key, None) if key in model.model_fields_set else None
            place: Path = (*path, key.rstrip("_"))
            if number is not None and isinstance(value, (list, dict)):
                item = find_item(value, number)
                value, place = (None, place) if item is None else (item[0], (*place, item[1]))
            if value is not None:
                yield LayeredValue(value, place)

    def __bool__(self) -> bool:
        return bool(self.items)
