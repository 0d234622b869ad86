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

    `fixed` contains settings that apply to every call. `kinds` maps paths to example values, which determine the type of a setting if the
    document does not contain its value. `parameters` contains the current values of all parameters of the document.
    """

    def __init__(
        self, sources: Sources, fixed: Mapping[str, Any] | None = None, kinds: Mapping[str, ExpressionValue] | None = None,
    ) -> None:
        self._declared = AssemblyParameters(sources.documents, sources.specs, sources.workspace)
        self.parameters: Mapping[str, ExpressionValue] = self._declared.values
        self.fixed = dict(fixed or {})
        self._documents = sources.documents
        self._kinds: dict[str, ExpressionValue | None] = dict(kinds or {})
        self._matches: dict[str, tuple[str, ...]] = {}
        self._numeric: set[str] = set()  # names with numeric settings

    def kind(self, name: str) -> ExpressionValue | None:
        """Return the current value of a parameter or path, whose type a new value must have.

        The value comes from the document or from a default. Return None if there is no value, or if it cannot be evaluated.
        """
        if name not in self._kinds:
            current = self._kinds[name] = self.parameters.get(name) if "." not in name else self._value_at(name)
            vector, _, index = name.rpartition(".")
            if index.isdecimal() and current == Quantity(0.0):  # a bare 0 has the kind of the other elements of the vector
                elements = (self._value_at(f"{vector}.{axis}") for axis in "012")
                self._kinds[name] = next((item for item in elements if isinstance(item, Quantity) and item.dimension != NUMBER), current)
        return self._kinds[name]

    def _value_at(self, path: str) -> ExpressionValue | None:
        section, _, inner_path = path.partition(".")
        default_path = f"defaults.{section[:-1]}.{inner_path.partition('.')[2]}"
        paths = (path, default_path) if section in ("joints", "components") else (path,)
        for candidate in (place + suffix for suffix in ("", ".value") for place in paths):  # a mass may have a source
            value = current_value(self._documents, candidate)
            if isinstance(value, Expression):
                try:
                    value = evaluate(value, self.parameters)
                except ExpressionError:
                    value = None
            if value is not None:
                return value
        return nested_parameter_value(self._documents, path)

    def matching_names(self, name: str) -> tuple[str, ...]:
        """Return the names of all parameters or paths that match a pattern, such as `leg_*` or `joints.*.dynamics.damping`.

        Paths in nested documents are included. If the name does not contain `*`, return only the name.
        """
        names = self._matches.get(name)
        if names is None:
            if "*" not in name:
                names = (name,)
            elif "." not in name:
                names = tuple(parameter for parameter in self.parameters if fnmatchcase(parameter, name))
            else:
                names = tuple(_find_paths(self._documents, self._documents.root, name.split(".")))
            self._matches[name] = names
        return names

    def _hint(self, name: str) -> Hint:
        """Return a help text for a pattern that does not match any parameter or path."""
        if "." not in name:
            return did_you_mean(name, self.parameters, what="parameters")
        nodes: list[Node] = [self._documents.root.tree]
        for key_pattern in name.split("."):
            entries = [(key, node) for parent in nodes if isinstance(parent, MappingNode) for key, node in parent.entries.items()]
            nodes = [node for key, node in entries if fnmatchcase(key, key_pattern)]
            if not nodes:
                break
        return did_you_mean(key_pattern, [key for key, _ in entries])

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
        for pattern, value in (*self.fixed.items(), *settings.items()):
            if type(value) is float and pattern in self._numeric:  # this fast path has the same result as the code below
                numbers[pattern] = value + 0.0
                texts.pop(pattern, None)
                continue
            names = self.matching_names(pattern) if isinstance(pattern, str) else ()
            if type(value) is not float:
                value = _python_value(value)
            if not names:
                report = report or Report()
                help = self._hint(pattern) if isinstance(pattern, str) else "a name must be a string such as `joints.NAME.limit.upper`"
                report.add(Code.CHOICE_OPTION, f"the document has no element `{pattern}`", None, path=f"{SET}{pattern}", help=help)
            for name in names:
                numbers.pop(name, None)
                texts.pop(name, None)
                number = self._number(name, value)
                if number is not None:
                    numbers[name] = number
                    if name == pattern:
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

    def quantities(self, parsed: ParsedSettings) -> dict[str, Quantity]:
        """Return all numeric settings as quantities, which are numbers with a physical dimension."""
        quantities = {}
        for name, value in zip(parsed.names, parsed.values):
            kind = self.kind(name)
            assert isinstance(kind, Quantity)
            quantities[name] = Quantity(value, kind.dimension)
        return quantities

    def values(self, parsed: ParsedSettings) -> dict[str, ExpressionValue]:
        """Return the values of all parameters of the document, and of the paths in the settings, after the settings are applied.

        Parameters whose expressions depend on other parameters are evaluated again.
        """
        quantities, texts = self.quantities(parsed), dict(parsed.texts)
        finite = {name: quantity for name, quantity in quantities.items() if isfinite(quantity.value)}
        texts_by_name = {name: texts.get(name, "") for name in (*quantities, *texts) if "." not in name}
        values = {**self._declared.given_values(texts_by_name, finite), **quantities}
        evaluated = {path: _evaluate_text(text, values) for path, text in texts.items() if "." in path}
        return {**values, **{path: value for path, value in evaluated.items() if value is not None}}

    def original_texts(self, settings: Mapping[str, Any]) -> dict[str, str]:
        """Return the values that are given as strings, keyed by name. If several settings match a name, only the last setting counts."""
        texts: dict[str, str] = {}
        for pattern, value in settings.items():
            for name in self.matching_names(pattern):
                texts.pop(name, None)
                if isinstance(value, str):
                    texts[name] = value
        return texts

    def settings(self, parsed: ParsedSettings, units: Mapping[str, str] | None = None, exact: Mapping[str, str] | None = None) -> Settings:
        """Convert parsed settings to strings for the options `-p` and `--set` of `thingc build`.

        A string in `exact` is used unchanged. Other numbers are formatted exactly, in the unit from `units` or in SI units.
        """
        units = units or {}
        numbers = {name: text_of(number, units.get(name, "")) for name, number in self.quantities(parsed).items()}
        texts = {**numbers, **dict(parsed.texts), **(exact or {})}
        return Settings(
            parameters={name: text for name, text in texts.items() if "." not in name},
            choices={name: text for name, text in texts.items() if "." in name},
        )


def settings_with(settings: Settings, values: Mapping[str, Any], report: Report, sources: Sources) -> Settings:
    """Return a copy of `settings` with the additional settings `values`. Unknown names are reported.

    If the document is not a valid assembly, return `settings` unchanged.
    """
    if not isinstance(sources.specs.get(sources.documents.root.relative), AssemblySpec):
        return settings
    reader = SettingsReader(sources)
    parsed = reader.read(values)
    if parsed.report is not None:
        report.diagnostics.extend(parsed.report.diagnostics)
    added = reader.settings(parsed)
    return Settings(parameters={**settings.parameters, **added.parameters}, choices={**settings.choices, **added.choices})


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


def _find_paths(documents: Documents, document: Document, pattern: Sequence[str], prefix: tuple[str, ...] = ()) -> list[str]:
    """Return all paths in a document and its nested documents that match `pattern`, which is a list of keys and patterns of keys.

    For example, `joints.*` matches the joints of the document and of all its nested documents. `prefix` is the path of the document.
    """
    paths = _match_below(documents, document, document.tree, pattern, prefix)
    components = document.tree.entries.get("components") if pattern[0] in EVERYWHERE else None
    for name in entries_of(components):
        inner = nested_document(documents, document, name)
        if inner is not None:
            paths += _find_paths(documents, inner, pattern, (*prefix, "components", name))
    return paths


def _match_below(documents: Documents, document: Document, node: Node | None, pattern: Sequence[str], prefix: tuple[str, ...]) -> list[str]:
    """Return all paths below `node` that match `pattern`. `prefix` is the path of the node.

    The document need not contain the keys after the last `*` of the pattern.
    """
    if prefix[-2:-1] == ("components",) and pattern and pattern[0] in SECTIONS and node is not document.tree:
        inner = nested_document(documents, document, prefix[-1])
        if inner is None:
            return []
        document, node = inner, inner.tree
    if not any("*" in element for element in pattern):
        return [".".join((*prefix, *pattern))]
    if not isinstance(node, MappingNode):
        return []
    key_pattern, *remaining = pattern
    names = [key for key in node.entries if fnmatchcase(key, key_pattern)]
    return [path for name in names for path in _match_below(documents, document, node.entries[name], remaining, (*prefix, name))]
