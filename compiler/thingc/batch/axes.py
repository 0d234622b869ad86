"""Read the axes of a `variants/1` document, and check that every value on an axis is valid for its parameter."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document, Path, ScalarNode, format_path, node_at
from thingc.base.suggestions import Hint
from thingc.base.units import NUMBER, Quantity, shorten
from thingc.batch.values import Paths, as_value, evenly_spaced, is_whole, of_kind, spaced_si
from thingc.documents.expressions.evaluation import ExpressionValue, format_value, kind_of, plain
from thingc.documents.expressions.terms import Expression
from thingc.documents.expressions.value_text import text_of
from thingc.documents.spec.variants import AxisSpec
from thingc.geometry.record import Value
from thingc.model.resolve.parameters import AssemblyParameters

MOST_VALUES = 100_000
"""Maximum number of values on an axis."""
MOST_TRIED = 20
"""Maximum number of values per path that are checked with the assembly before the batch starts."""


class Axis(FrozenStruct):
    """An axis of a `variants/1` document: the values of one parameter or, if `choice` is true, the values that are selected at one path.

    An axis has a tuple of `values`, or a `range` from which values are sampled. If `whole` is true, only integers are sampled, including
    both ends of the range.
    """

    key: str
    choice: bool = False
    values: tuple[ExpressionValue, ...] = ()
    range: tuple[Quantity, Quantity] | None = None
    whole: bool = False

    def draw(self, u: float) -> ExpressionValue:
        """Return the value on the axis for a random number `u` in [0, 1), which is interpreted as a fraction of the range."""
        if self.range is None:
            return self.values[min(int(u * len(self.values)), len(self.values) - 1)]
        low, high = self.range
        if self.whole:
            return Quantity(float(min(low.value + int(u * (high.value - low.value + 1.0)), high.value)), low.dimension)
        return Quantity(min(low.value + u * (high.value - low.value), high.value) + 0.0, low.dimension)


class AxisParser:
    """Reads the axes and values in a `variants/1` document and reports invalid values.

    `parameters` contains the parameters of the assembly. `paths` contains the paths at which the document sets other values. The callback
    `fits(path, text, at)` returns whether a string is a valid value at one of these paths, and reports an invalid string.
    """

    def __init__(
        self, document: Document, parameters: AssemblyParameters, report: Report, paths: Paths, fits: Callable[[str, str, Path], bool],
    ) -> None:
        self.document = document
        self.parameters = parameters
        self.report = report
        self.paths = paths
        self.fits = fits
        self.values_tried: dict[str, int] = {}

    def value(self, name: str, raw: Any, path: Path) -> ExpressionValue | None:
        """Check the value of the parameter or path `name`, and return the value.

        If the value of a parameter or path is invalid, report an error and return None.
        """
        if isinstance(raw, Expression):
            self._error(
                "expressions are not allowed in a variants document", path,
                help=f"write a value, or define a parameter with the expression in `{self.parameters.name}`",
            )
            return None
        checked = as_value(raw)
        assert checked is not None
        if "." in name:
            return self._check_path_value(name, checked, path)

        def complain(name: str, code: Code, message: str, *, help: Hint | None = None, notes: Iterable[Note] = ()) -> None:
            key = code is Code.UNKNOWN_PARAMETER
            where = self._key(path) if key else path
            self.report.add(code, message, self.document.span(where, key=key), help=help, notes=notes, path=format_path(where))

        value, document_value = self.parameters.check_value(name, checked, complain), self.parameters.values.get(name)
        if isinstance(value, Quantity) and value.dimension == NUMBER and value.value == 0.0 and isinstance(document_value, Quantity):
            return Quantity(0.0, document_value.dimension)  # 0 without a unit
        return value

    def _check_path_value(self, name: str, value: ExpressionValue, path: Path) -> ExpressionValue | None:
        """Check the value of a path in the assembly document, and return the value. Return None for an invalid value.

        The first `MOST_TRIED` values of each path are checked by resolving the assembly with each value. Later values must only have the
        same type.
        """
        tried = self.values_tried[name] = self.values_tried.get(name, 0) + 1
        if tried <= MOST_TRIED and not self.fits(name, self._text_at(path) or text_of(value), path):
            self.values_tried[name] = MOST_TRIED if tried == 1 else tried
            return None
        kind = self.paths.kinds.get(name)
        sound = of_kind(value, kind)
        if sound is None and kind is not None:
            self._error(f"the values of a path must have the same type, found {kind_of(value)} and `{format_value(kind)}`", path)
        return sound

    def axis(self, name: str, raw: Any) -> Axis | None:
        """Return the axis of a parameter from its value in the document: a list, a range with steps, or a single value.

        Return None if the axis has no valid value.
        """
        path: Path = ("parameters", name)
        if isinstance(raw, list):
            if not raw:
                self._error(f"`{name}` has no values", path, help="write at least one value, or remove the key")
                return None
            listed = [self.value(name, value_or_none, (*path, index)) for index, value_or_none in enumerate(raw)]
            sound = [value_or_none for value_or_none in listed if value_or_none is not None]
            self._warn_of_duplicates(path, listed)
            first: dict[Value, ExpressionValue] = {}
            for value in sound:
                first.setdefault(plain(value), value)
            return Axis(key=name, values=tuple(first.values())) if sound else None
        if isinstance(raw, AxisSpec):
            values = self._range_values(name, raw, path)
            return Axis(key=name, values=values) if values else None
        value_or_none = self.value(name, raw, path)
        return None if value_or_none is None else Axis(key=name, values=(value_or_none,))

    def _warn_of_duplicates(self, path: Path, values: list[ExpressionValue | None]) -> None:
        first: dict[object, int] = {}
        for index, value in enumerate(values):
            if value is None:
                continue
            key = (type(value), plain(value))
            if key in first:
                self.report.warn(
                    Code.DUPLICATE_VARIANT, f"the value `{format_value(value)}` is listed twice",
                    self.document.span((*path, index)), help="remove one of the two values", path=format_path(path),
                    notes=[Note(message="also listed here", span=self.document.span((*path, first[key])))],
                )
            first.setdefault(key, index)

    def _range_values(self, name: str, raw: AxisSpec, path: Path) -> tuple[ExpressionValue, ...]:
        first, last = self.value(name, raw.from_, (*path, "from")), self.value(name, raw.to, (*path, "to"))
        count = self.count(raw.count, (*path, "count"), least=2)
        if first is None or last is None or count is None:
            return ()
        if not isinstance(first, Quantity) or not isinstance(last, Quantity):
            wrong, key = (first, "from") if not isinstance(first, Quantity) else (last, "to")
            self._error(f"a range requires two numbers, found {kind_of(wrong)}", (*path, key), help=f"list the values: `{name}: [...]`")
            return ()
        if first.value == last.value:
            self._error(f"`from` and `to` of `{name}` are equal", (*path, "to"), help="use different values")
            return ()
        exact = evenly_spaced(self._text_at((*path, "from")), self._text_at((*path, "to")), count)
        return tuple(exact if exact is not None else spaced_si(first, last, count))

    def range(self, name: str, raw: list[Any]) -> Axis | None:
        """Return the axis of a parameter whose values are sampled from a range.

        If the range is invalid, report an error and return None.
        """
        path: Path = ("sample", "ranges", name)
        low, high = (self.value(name, end, (*path, index)) for index, end in enumerate(raw))
        if low is None or high is None:
            return None
        for index, end in enumerate((low, high)):
            if not isinstance(end, Quantity):
                self._error(
                    f"the range of `{name}` requires two numbers, found {kind_of(end)}", (*path, index),
                    help=f"write a list of values under `parameters`: `{name}: [{shorten(format_value(end))}, ...]`",
                )
                return None
        assert isinstance(low, Quantity) and isinstance(high, Quantity)
        if not low.value < high.value:
            self._error(
                f"the bounds of `{name}` must increase, found {low} and {high}", path,
                help="write the smaller value first" if low.value > high.value else "use two different values",
            )
            return None
        whole = all(is_whole(self._text_at((*path, index))) for index in (0, 1))
        return Axis(key=name, range=(low, high), whole=whole)

    def count(self, raw: Any, path: Path, *, least: int, most: int = MOST_VALUES) -> int | None:
        """Check an integer in the document, such as `count`, and return the integer.

        If the integer is not between `least` and `most`, report an error and return None.
        """
        if isinstance(raw, Expression):
            self._error(f"`{path[-1]}` must be a number, not an expression", path, help="write the number")
            return None
        if not least <= raw <= most:
            rule = f"at least {least}" if raw < least else f"at most {most}"
            help = f"write, for example, `{path[-1]}: {max(least, 16) if raw < least else most}`"
            self._error(f"`{path[-1]}` must be {rule}, found `{raw}`", path, help=help)
            return None
        return int(raw)

    def _text_at(self, path: Path) -> str:
        node = node_at(self.document.tree, path)
        return node.text if isinstance(node, ScalarNode) else ""

    def _key(self, path: Path) -> Path:
        """Return the key path of a parameter in the document, for the key path of one of the parameter's values."""
        while path and (isinstance(path[-1], int) or path[-1] in ("from", "to")):
            path = path[:-1]
        return path

    def _error(self, message: str, path: Path, *, help: Hint | None = None) -> None:
        self.report.add(Code.VARIANT_VALUE, message, self.document.span(path), help=help, path=format_path(path))
