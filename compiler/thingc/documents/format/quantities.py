"""One space between a number and its unit, where that surely changes nothing."""

from __future__ import annotations

import re

from pydantic_core import PydanticCustomError

from thingc.base.units import UnitError, parse_quantity
from thingc.documents.spec.annotation_types import FieldType

_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_GLUED = re.compile(rf"({_NUMBER}(?: {_NUMBER})*)( *)((?:[^\W\d_]|%).*)", re.ASCII)


def spaced(text: str, shape: FieldType | None) -> str:
    """`120mm` as `120 mm`, `0 0 4mm` as `0 0 4 mm`; any other text, and any text that is no quantity here, as it is."""
    match = _GLUED.fullmatch(text)
    if match is None or match.group(2) == " " or shape is None:
        return text
    better = f"{match.group(1)} {match.group(3)}"
    return better if equal_values(text, better, shape) else text


def equal_values(text: str, other: str, shape: FieldType | None) -> bool:
    """Whether two texts are one quantity to the field that takes them (no field: None, or an item of a vector)."""
    if shape is not None and shape.kind == "field" and shape.field is not None:
        try:
            value = shape.field.validate(text)
            return not isinstance(value, str) and bool(value == shape.field.validate(other))
        except PydanticCustomError:
            pass
    if shape is None or not takes_vectors(shape):
        return False
    try:
        return parse_quantity(text) == parse_quantity(other)
    except UnitError:
        return False


def takes_vectors(shape: FieldType) -> bool:
    """Whether a field takes three values, so that the items of a list there are quantities."""
    if shape.kind != "field" or shape.field is None:
        return False
    try:
        return isinstance(shape.field.validate("0 0 0"), tuple)
    except PydanticCustomError:
        return False
