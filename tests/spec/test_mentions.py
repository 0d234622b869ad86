"""Every text field of a document that contains a name declares this in its type, so tools need no list of keys."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

import pytest

from thingc.documents.names.document_names import SettingWord, setting_words
from thingc.documents.spec.annotation_types import FieldType, alternatives, model_keys, shape_of
from thingc.documents.spec.name_types import Declared, DeclaresName, ReferenceKind, RefersTo
from thingc.documents.spec.validation import KINDS, model_of

WORDS = ("a name", "a reference", "a comparison", "a parameter or the path of a value", "the path of a choice")
"""Descriptions of text fields."""
PROSE = {
    "base", "build", "catalog", "collide", "connector", "counterpart", "description", "detail", "doc", "emit", "file", "interface", "mesh",
    "model", "name", "number", "packages", "parts", "picture", "reason", "supplier", "thread",
}
"""Keys of text that does not refer to anything in a document: text for people, files, elements of other libraries, workspace settings."""
NUMBERED = {"allow", "cost", "noise", "cutoff", "groups"}
"""Mappings whose keys are codes, quantities, fixed words, or names that only the same mapping uses."""


def text_fields(shape: FieldType, key: str) -> Iterator[tuple[str, FieldType]]:
    """Every field of text or of a name that a shape accepts, with its key; keys of mappings as `key{}`."""
    for one in alternatives(shape):
        if one.model is not None:
            for inner, (value, _) in model_keys(one.model).items():
                yield from text_fields(value, inner)
        elif one.kind == "dict":
            if not one.by_number:
                yield f"{key}{{}}", shape_of(one.key)
            yield from text_fields(shape_of(one.members[0]), key)
        elif one.kind == "list":
            yield from text_fields(shape_of(one.members[0]), key)
        elif one.kind == "text" or (one.field is not None and one.field.description in WORDS):
            yield key, one


@pytest.mark.parametrize("kind", KINDS)
def test_text_fields_declare_what_they_name(kind: str) -> None:
    model = model_of(kind)
    assert model is not None
    silent = {key for key, shape in text_fields(shape_of(model), kind) if shape.names is None}
    assert silent - PROSE - {f"{key}{{}}" for key in NUMBERED} - {"raw{}"} == set()


def test_every_kind_of_name_is_used_by_a_field() -> None:
    said = {shape.names for kind in KINDS if (model := model_of(kind)) is not None for _, shape in text_fields(shape_of(model), kind)}
    wordless = {RefersTo("expression"), RefersTo("raw"), RefersTo("pose of a nested assembly")}  # of fields that take more than names
    assert {*map(DeclaresName, get_args(Declared)), *map(RefersTo, get_args(ReferenceKind))} - wordless == said - {None}


def test_setting_paths_are_split_into_names() -> None:
    component, joint = DeclaresName("component"), DeclaresName("joint")
    assert list(setting_words("components.leg.joints.knee.limit.upper")) == [
        SettingWord(offset=11, through=(), path=("components", "leg"), names=component),
        SettingWord(offset=22, through=("leg",), path=("joints", "knee"), names=joint),
    ]
    assert [(word.offset, word.names) for word in setting_words("components.arm.params.length")] == [
        (11, component), (22, RefersTo("parameter of a part")),
    ]
    assert list(setting_words("simulation.timestep")) == []
