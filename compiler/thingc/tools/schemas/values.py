"""Schemas of single values: quantities of a dimension, choices of names, and how values are shown to a reader."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from thingc.base.units import UNITS, Dimension, Quantity, UnitError, fits, parse_quantity
from thingc.geometry.record import WHOLE, Value

Schema = dict[str, Any]

_NUMBER = r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?"
_ZERO = r"[-+]?0+(\.0*)?"
EXPRESSION = r"^\s*="
"""What an expression begins with."""

MAX_BRANCHES = 300
"""Names of one place that a language server has to try one by one."""


def quantity(dimension: Dimension) -> Schema:
    """A quantity of a dimension with its unit, or an expression. Products of units (`0.1 N*m/N`) are left to the compiler."""
    units = "|".join(re.escape(name) for name, (_, _, own) in UNITS.items() if own == dimension and name != "%")
    pattern = rf"^\s*(=.*|{_NUMBER}\s*({units}|°|[^\s\d].*[*/·^²³].*)|{_ZERO})\s*$"
    words = dimension.words
    return {
        "oneOf": [
            {
                "type": "string", "pattern": pattern,
                "patternErrorMessage": f"expected {words} such as `{dimension.example}`, or an expression such as `=reach / 2`",
            },
            {"const": 0},
        ],
    }


def ratio() -> Schema:
    """A number or a percentage, or an expression."""
    return {"oneOf": [{"type": "string", "pattern": rf"^\s*(=.*|{_NUMBER}\s*%?)\s*$"}, {"type": "number"}]}


def number(kind: str, minimum: Value | None, maximum: Value | None) -> Schema:
    """A bare number (a whole one, if that is its kind) within bounds, or an expression."""
    plain: Schema = {"type": "integer" if kind in WHOLE else "number"}
    if minimum is not None:
        plain["minimum"] = minimum
    if maximum is not None:
        plain["maximum"] = maximum
    return {"oneOf": [plain, {"type": "string", "pattern": EXPRESSION}]}


def one_of(choices: Iterable[tuple[str, str]], **more: Any) -> Schema:
    """A text for which names are offered, each with its description; others are as good, where `more` does not say otherwise.

    One `const` per name rather than an `enum`: language servers show the description of the name that is written, not the
    whole list. They try every branch at every value, though: of many names snippets are made, which are only offered.
    """
    known = list(choices)
    if len(known) > MAX_BRANCHES:
        return {"type": "string", **more, "defaultSnippets": [
            {"label": name, "body": name.replace("$", "\\$"), "description": text} for name, text in known
        ]}
    branches = [{"const": name, "title": name, **({"description": text} if text else {})} for name, text in known]
    return {"type": "string", "anyOf": [*branches, {"type": "string"}], **more} if branches else {"type": "string", **more}


def within(low: str | None, high: str | None) -> str:
    """A range in words: `60 mm to 200 mm`, `at least 0`; empty without bounds."""
    if low is not None and high is not None:
        return f"{low} to {high}"
    return f"at least {low}" if low is not None else f"at most {high}" if high is not None else ""


def parse_value(text: str) -> Quantity | None:
    """The quantity that a text is; None for anything else."""
    try:
        return parse_quantity(text)
    except UnitError:
        return None


def fitting(parameters: Mapping[str, Quantity], dimension: Dimension) -> list[str]:
    """`=name` of the document's parameters that can stand where a dimension is wanted."""
    return [f"={name}" for name, value in parameters.items() if fits(value.dimension, dimension)]

