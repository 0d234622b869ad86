"""Every text of a document that names something says so by its type: nobody has to know the keys."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

import pytest

from thingc.documents.names.document_names import SettingWord, setting_words
from thingc.documents.spec.annotation_types import FieldType, alternatives, model_keys, shape_of
from thingc.documents.spec.name_types import Declared, DeclaresName, ReferenceKind, RefersTo
from thingc.documents.spec.validation import KINDS, model_of

WORDS = ("a name", "a reference", "a comparison", "a parameter or the path of a value", "the path of a choice")
"""What fields of text are called."""
PROSE = {
    "base", "build", "catalog", "collide", "connector", "counterpart", "description", "detail", "doc", "emit", "file", "interface", "mesh",
    "model", "name", "number", "packages", "parts", "picture", "reason", "supplier", "thread",
}
"""Keys of text that names nothing in a document: words for people, files, things of other libraries, settings of a workspace."""
NUMBERED = {"allow", "cost", "noise", "cutoff", "groups"}
"""Mappings whose keys are codes, numbers of pieces, words of ours, or names that only the same mapping uses."""


def texts(shape: FieldType, key: str) -> Iterator[tuple[str, FieldType]]:
    """Every field of text or of a name in what a shape takes, with its key; keys of mappings as `key{}`."""
    for one in alternatives(shape):
        if one.model is not None:
            for inner, (value, _) in model_keys(one.model).items():
                yield from texts(value, inner)
        elif one.kind == "dict":
            if not one.by_number:
                yield f"{key}{{}}", shape_of(one.key)
            yield from texts(shape_of(one.members[0]), key)
        elif one.kind == "list":
            yield from texts(shape_of(one.members[0]), key)
        elif one.kind == "text" or (one.field is not None and one.field.words in WORDS):
            yield key, one


@pytest.mark.parametrize("kind", KINDS)
def test_every_field_of_text_says_what_it_names(kind: str) -> None:
    model = model_of(kind)
    assert model is not None
    silent = {key for key, shape in texts(shape_of(model), kind) if shape.names is None}
    assert silent - PROSE - {f"{key}{{}}" for key in NUMBERED} - {"raw{}"} == set()


def test_every_meaning_is_one_of_a_field() -> None:
    said = {shape.names for kind in KINDS if (model := model_of(kind)) is not None for _, shape in texts(shape_of(model), kind)}
    wordless = {RefersTo("expression"), RefersTo("raw"), RefersTo("pose of a nested assembly")}  # of fields that take more than names
    assert {*map(DeclaresName, get_args(Declared)), *map(RefersTo, get_args(ReferenceKind))} - wordless == said - {None}


def test_the_words_of_a_setting() -> None:
    component, joint = DeclaresName("component"), DeclaresName("joint")
    assert list(setting_words("components.leg.joints.knee.limit.upper")) == [
        SettingWord(offset=11, through=(), path=("components", "leg"), names=component),
        SettingWord(offset=22, through=("leg",), path=("joints", "knee"), names=joint),
    ]
    assert [(word.offset, word.names) for word in setting_words("components.arm.params.length")] == [
        (11, component), (22, RefersTo("parameter of a part")),
    ]
    assert list(setting_words("simulation.timestep")) == []
