"""Parse settings, which assign values to parameters of a robot and to other values of its document by path.

A value is a number in SI units, or a string as in a document.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

from thingc.base.diagnostics import Code, Report
from thingc.base.numeric import isfinite
from thingc.base.source import SET, Document, MappingNode, Node, entries_of
from thingc.base.suggestions import Hint, did_you_mean
from thingc.base.units import NUMBER, Quantity, UnitError, parse_quantity
from thingc.documents.expressions.evaluation import ExpressionValue, evaluate
from thingc.documents.expressions.parsing import parse_expression
from thingc.documents.expressions.terms import Expression, ExpressionError
from thingc.documents.expressions.value_text import text_of
from thingc.documents.load.documents import Documents
from thingc.documents.spec.assembly import AssemblySpec
from thingc.documents.spec.settable_values import SECTIONS, current_value, joint_value_dimension, nested_document, nested_parameter_value
from thingc.model.resolve.parameters import AssemblyParameters
from thingc.model.resolve.raw import text as attribute_text
from thingc.model.resolve.resolver import Settings, Sources

EVERYWHERE = frozenset(("joints", "links", "sensors", "tendons", "transmissions"))
"""Sections of a document for which a pattern such as `joints.*` also matches elements of nested documents."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParsedSettings:
    """Parsed settings of a robot.

    `names` contains the sorted names of the numeric settings, and `values` contains their values in SI units. `texts` contains the values
    of all other settings as strings. `report` contains the errors, or is None if there are no errors.
    """

    names: tuple[str, ...]
    values: tuple[float, ...]
    texts: tuple[tuple[str, str], ...]
    report: Report | None = field(default=None, compare=False)


class SettingsReader:
    """Parses settings for a document. A setting assigns a value to a parameter or to a path in the document.

    `parameters` contains the current values of all parameters of the document. `kinds` maps paths to example values. The type of a setting
    is the type of its example value.
    """

    def __init__(
        self, sources: Sources, fixed: Mapping[str, Any] | None = None, kinds: Mapping[str, ExpressionValue] | None = None,
    ) -> None:
        self._declared = AssemblyParameters(sources.documents, sources.specs, sources.workspace)
        self.parameters: Mapping[str, ExpressionValue] = self._declared.values
        self.fixed = dict(fixed or {})
        self._documents = sources.documents
        self._kinds: dict[str, ExpressionValue | None] = dict(kinds or {})
        self._meant: dict[str, tuple[str, ...]] = {}
        self._numeric: set[str] = set()  # names with numeric settings

    def kind(self, name: str) -> ExpressionValue | None:
        """Return the current value of a parameter or path, from the document or from a default.

        A new value in a setting must have the same type. Return None if there is no current value, or if the value cannot be evaluated.
        """
        if name not in self._kinds:
            known = self._kinds[name] = self.parameters.get(name) if "." not in name else self._value_at(name)
            vector, _, index = name.rpartition(".")
            if index.isdecimal() and known == Quantity(0.0):  # a bare 0 has the kind of the other elements of the vector
                others = (self._value_at(f"{vector}.{other}") for other in "012")
                self._kinds[name] = next((one for one in others if isinstance(one, Quantity) and one.dimension != NUMBER), known)
        return self._kinds[name]

    def _value_at(self, path: str) -> ExpressionValue | None:
        section, _, rest = path.partition(".")
        by_default = f"defaults.{section[:-1]}.{rest.partition('.')[2]}"
        places = (path, by_default) if section in ("joints", "components") else (path,)
        for place in (one + inner for inner in ("", ".value") for one in places):  # a mass may have a source
            stated = current_value(self._documents, place)
            if isinstance(stated, Expression):
                try:
                    stated = evaluate(stated, self.parameters)
                except ExpressionError:
                    stated = None
            if stated is not None:
                return stated
        return nested_parameter_value(self._documents, path)

    def matching_names(self, name: str) -> tuple[str, ...]:
        """Return the names of all parameters or paths that match a pattern, such as `leg_*` or `joints.*.dynamics.damping`.

        Paths in nested documents are included. If the name does not contain `*`, return only the name.
        """
        known = self._meant.get(name)
        if known is None:
            if "*" not in name:
                known = (name,)
            elif "." not in name:
                known = tuple(one for one in self.parameters if fnmatchcase(one, name))
            else:
                known = tuple(_everywhere(self._documents, self._documents.root, name.split(".")))
            self._meant[name] = known
        return known

    def _hint(self, name: str) -> Hint:
        """Return a help text for a pattern that does not match any parameter or path."""
        if "." not in name:
            return did_you_mean(name, self.parameters, what="parameters")
        met: list[Node] = [self._documents.root.tree]
        for word in name.split("."):
            inside = [(key, node) for one in met if isinstance(one, MappingNode) for key, node in one.entries.items()]
            met = [node for key, node in inside if fnmatchcase(key, word)]
            if not met:
                break
        return did_you_mean(word, [key for key, _ in inside])

    def read(self, settings: Mapping[str, Any]) -> ParsedSettings:
        """Parse settings. The given settings take precedence over the settings that are fixed for this reader.

        Unknown names, and values with a wrong type, are reported.
        """
        numbers: dict[str, float] = {}
        texts: dict[str, str] = {}
        report: Report | None = None
        if not isinstance(settings, Mapping):
            report = Report()
            message = f"settings must be a mapping from names to values, found {type(settings).__name__} `{settings}`"
            report.add(Code.CHOICE_OPTION, message, None, path=SET, help="write `{'joints.NAME.limit.upper': 1.5}`")
            settings = {}
        for given, value in (*self.fixed.items(), *settings.items()):
            if type(value) is float and given in self._numeric:  # this fast path has the same result as the code below
                numbers[given] = value + 0.0
                texts.pop(given, None)
                continue
            names = self.matching_names(given) if isinstance(given, str) else ()
            if type(value) is not float:
                value = _python_value(value)
            if not names:
                report = report or Report()
                help = self._hint(given) if isinstance(given, str) else "a name must be a string such as `joints.NAME.limit.upper`"
                report.add(Code.CHOICE_OPTION, f"the document has no element `{given}`", None, path=f"{SET}{given}", help=help)
            for name in names:
                numbers.pop(name, None)
                texts.pop(name, None)
                number = self._number(name, value)
                if number is not None:
                    numbers[name] = number
                    if name == given:
                        self._numeric.add(name)
                else:
                    texts[name] = attribute_text(value)
        names = tuple(sorted(numbers))
        return ParsedSettings(names=names, values=tuple(map(numbers.__getitem__, names)), texts=tuple(sorted(texts.items())), report=report)

    def _number(self, name: str, value: Any) -> float | None:
        """Convert the value of a numeric setting to SI units.

        Return None if the value is not a number, or if its physical dimension differs from the dimension of the current value.
        """
        kind = self.kind(name)
        if isinstance(value, str) and (isinstance(kind, Quantity) or (kind is None and "." in name)):
            try:
                quantity = parse_quantity(value)
            except UnitError:
                return None
            if kind is None and quantity.dimension != NUMBER:
                kind = self._kinds[name] = quantity  # without a value in the document, the first setting determines the kind
            return quantity.value if isinstance(kind, Quantity) and quantity.dimension == kind.dimension else None
        if isinstance(value, bool):
            return None
        try:
            number = float(value) + 0.0
        except (TypeError, ValueError, OverflowError):
            return None
        if kind is None and "." in name and (dimension := joint_value_dimension(self._documents, name)) is not None:
            kind = self._kinds[name] = Quantity(number, dimension)
        return number if isinstance(kind, Quantity) else None

    def quantities(self, read: ParsedSettings) -> dict[str, Quantity]:
        """Return all numeric settings as quantities, which are numbers with a physical dimension."""
        quantities = {}
        for name, value in zip(read.names, read.values):
            kind = self.kind(name)
            assert isinstance(kind, Quantity)
            quantities[name] = Quantity(value, kind.dimension)
        return quantities

    def values(self, read: ParsedSettings) -> dict[str, ExpressionValue]:
        """Return the values of all parameters and paths that result from the given settings.

        The result includes parameters whose expressions depend on other parameters. Values are numbers, booleans and expressions.
        """
        quantities, texts = self.quantities(read), dict(read.texts)
        known = {name: one for name, one in quantities.items() if isfinite(one.value)}
        given = {name: texts.get(name, "") for name in (*quantities, *texts) if "." not in name}
        values = {**self._declared.given_values(given, known), **quantities}
        stated = {path: _evaluate_text(text, values) for path, text in texts.items() if "." in path}
        return {**values, **{path: value for path, value in stated.items() if value is not None}}

    def as_given(self, settings: Mapping[str, Any]) -> dict[str, str]:
        """Return the settings whose value is a string, by name. A string is omitted if a numeric setting with the same name follows."""
        texts: dict[str, str] = {}
        for given, value in settings.items():
            for name in self.matching_names(given):
                texts.pop(name, None)
                if isinstance(value, str):
                    texts[name] = value
        return texts

    def settings(self, read: ParsedSettings, units: Mapping[str, str] | None = None, given: Mapping[str, str] | None = None) -> Settings:
        """Convert parsed settings to strings for the options `-p` and `--set` of `thingc build`.

        A number is written in the same way as in `given`. If `given` does not contain the number, it is written exactly, in the unit from
        `units` or in SI units.
        """
        units = units or {}
        numbers = {name: text_of(number, units.get(name, "")) for name, number in self.quantities(read).items()}
        texts = {**numbers, **dict(read.texts), **(given or {})}
        return Settings(
            parameters={name: text for name, text in texts.items() if "." not in name},
            choices={name: text for name, text in texts.items() if "." in name},
        )


def settings_with(own: Settings, values: Mapping[str, Any], report: Report, sources: Sources) -> Settings:
    """Return a copy of the settings `own` with the additional settings `values`.

    Unknown names are reported. If the document is not a valid assembly, return `own` unchanged.
    """
    if not isinstance(sources.specs.get(sources.documents.root.relative), AssemblySpec):
        return own
    reader = SettingsReader(sources)
    read = reader.read(values)
    if read.report is not None:
        report.diagnostics.extend(read.report.diagnostics)
    more = reader.settings(read)
    return Settings(parameters={**own.parameters, **more.parameters}, choices={**own.choices, **more.choices})


def _python_value(value: Any) -> Any:
    """Convert a numpy scalar to a Python value. Integers that are too large for a float are converted to infinity."""
    if hasattr(value, "item") and not getattr(value, "ndim", 0):
        value = value.item()
    if isinstance(value, int) and abs(value) > sys.float_info.max:
        return math.inf if value > 0 else -math.inf
    return value


def _evaluate_text(text: str, names: Mapping[str, ExpressionValue]) -> ExpressionValue | None:
    """Evaluate a string that is `true`, `false` or an expression.

    Return None for any other string, and for expressions that cannot be evaluated.
    """
    if text in ("true", "false"):
        return text == "true"
    try:
        return evaluate(parse_expression(text), names) if text.startswith("=") else None
    except ExpressionError:
        return None


def _everywhere(documents: Documents, document: Document, words: Sequence[str], before: tuple[str, ...] = ()) -> list[str]:
    """Return all paths in a document and its nested documents that match a pattern. The pattern is a list of keys.

    For example, `joints.*` matches the joints of the document and of all its nested documents.
    """
    found = _matching(documents, document, document.tree, words, before)
    components = document.tree.entries.get("components") if words[0] in EVERYWHERE else None
    for name in entries_of(components):
        inner = nested_document(documents, document, name)
        if inner is not None:
            found += _everywhere(documents, inner, words, (*before, "components", name))
    return found


def _matching(documents: Documents, document: Document, node: Node | None, words: Sequence[str], before: tuple[str, ...]) -> list[str]:
    """Return all paths below a node of a document that match a pattern.

    The document need not contain the keys after the last `*` of the pattern.
    """
    if before[-2:-1] == ("components",) and words and words[0] in SECTIONS and node is not document.tree:
        inner = nested_document(documents, document, before[-1])
        if inner is None:
            return []
        document, node = inner, inner.tree
    if not any("*" in word for word in words):
        return [".".join((*before, *words))]
    if not isinstance(node, MappingNode):
        return []
    first, *rest = words
    names = [key for key in node.entries if fnmatchcase(key, first)]
    return [path for name in names for path in _matching(documents, document, node.entries[name], rest, (*before, name))]
