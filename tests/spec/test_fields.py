"""Field types of documents: conversion of valid values."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, strategies as st
from PIL import ImageColor
from pydantic import TypeAdapter, ValidationError

from thingc.base.units import ANGLE, LENGTH, LENGTH_PER_ANGLE, Quantity
from thingc.documents.expressions.terms import Expression
from thingc.documents.spec import assembly, fields


def value(name: str, raw: Any) -> Any:
    kind = assembly.RawField if name == "RawField" else getattr(fields, name)
    return TypeAdapter(kind).validate_python(raw, strict=True)


@pytest.mark.parametrize(("name", "raw", "expected"), [
    ("LengthField", "120 mm", Quantity(0.12, LENGTH)), ("LengthField", 0, Quantity(0.0)), ("LengthField", 0.0, Quantity(0.0)),
    ("LengthField", "0", Quantity(0.0)), ("AngleField", "180 deg", Quantity(math.pi, ANGLE)), ("RatioField", "15 %",
     Quantity(0.15)),
    ("RatioField", 0.15, Quantity(0.15)), ("NumberField", 3, Quantity(3.0)), ("NumberField", "3", Quantity(3.0)),
    ("MultiplierField", "10 mm/rad", Quantity(0.01, LENGTH_PER_ANGLE)), ("MultiplierField", -1, Quantity(-1.0)),
    ("AnyQuantityField", True, True), ("AnyQuantityField", "petg", "petg"), ("AnyQuantityField", 6, Quantity(6.0)),
    ("AnyQuantityField", "5 mm", Quantity(0.005, LENGTH)), ("AnyQuantityField", "-5 mm", Quantity(-0.005, LENGTH)),
    ("AnyQuantityField", "x430-horn", "x430-horn"), ("AnyQuantityField", "", ""),
    ("JointValueField", "30 deg", Quantity(math.pi / 6, ANGLE)), ("JointValueField", "20 mm", Quantity(0.02, LENGTH)),
    ("JointValueField", 0, Quantity(0.0)), ("JointValueField", "folded", "folded"),
    ("Vector3Length", "0 120 30 mm", (Quantity(0.0, LENGTH), Quantity(0.12, LENGTH), Quantity(0.03, LENGTH))),
    ("Vector3Length", ["10 mm", 0, "4 mm"], (Quantity(0.01, LENGTH), Quantity(0.0), Quantity(0.004, LENGTH))),
    ("Vector3Angle", "0 0 0", (Quantity(0.0),) * 3),
    ("Name", "base_link2", "base_link2"), ("ReferenceField", "hand.cap.pen", "hand.cap.pen"), ("ReferenceField", "body.hip_$i",
     "body.hip_$i"),
    ("ReferenceField", "leg_*.knee", "leg_*.knee"), ("ReferenceField", "leg_$i", "leg_$i"), ("ReferenceField", "plate", "plate"),
    ("ColorField", "Lavender", "#e6e6fa"), ("ColorField", "#888", "#888888"), ("ColorField", "#12AbcD", "#12abcd"),
    ("CountField", 6, 6), ("CountField", 6.0, 6), ("CountField", 0, 0), ("CostField", "12.50 EUR", "12.50 EUR"), ("CostField",
     "3 USD", "3 USD"),
    ("RawField", {"a": {"b": "0.01 1", "c": 1.5}}, {"a": {"b": "0.01 1", "c": 1.5}}), ("RawField", False, False),
])
def test_valid_values_are_converted(name: str, raw: Any, expected: Any) -> None:
    found = value(name, raw)
    assert found == expected
    assert type(found) is type(expected)


@pytest.mark.parametrize("name",
    ["LengthField", "AnyQuantityField", "JointValueField", "CountField", "NumberField", "InertiaField"])
def test_expressions_are_accepted_in_fields(name: str) -> None:
    found = value(name, "=reach / 2")
    assert isinstance(found, Expression)
    assert found.text == "=reach / 2"


def test_expressions_are_accepted_in_vectors() -> None:
    found = value("Vector3Length", ["=reach", 0, "4 mm"])
    assert isinstance(found[0], Expression)


def test_expression_is_rejected_for_a_whole_vector() -> None:
    with pytest.raises(ValidationError) as caught:
        value("Vector3Length", "=reach")
    assert caught.value.errors()[0]["ctx"]["message"] == "expected three values, each a length, found the string `=reach`"


@given(st.text(max_size=12))
def test_names_match_the_documented_pattern(text: str) -> None:
    import re

    good = re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", text, re.ASCII) is not None
    try:
        assert value("Name", text) == text
        assert good
    except ValidationError:
        assert not good


def test_colour_names_match_css() -> None:
    """The oracle is the table of Pillow, which has one more name."""
    named = {name: value for name, value in ImageColor.colormap.items() if name != "rebeccapurple"}
    assert len(named) == 147
    assert {name: value("ColorField", name.title()) for name in named} == named


_anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=15),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3), max_leaves=6,
)


_fields = [name for name in dir(fields) if name.endswith("Field") or name.startswith("Vector3") or name == "Name"]


@given(st.sampled_from(_fields), _anything)
def test_random_values_are_accepted_or_rejected_with_a_message(name: str, raw: Any) -> None:
    try:
        value(name, raw)
    except ValidationError as error:
        (entry,) = error.errors(include_url=False)
        assert entry["ctx"]["message"]
        assert "\n" not in entry["ctx"]["message"]
