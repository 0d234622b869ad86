"""Keywords of other formats and programs, with the corresponding keys and values of thingc.

The keywords are in `foreign_keywords.toml`, which is read when a document contains an unknown key or value.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

from pydantic import BaseModel

from thingc.base.suggestions import Hint, Suggestion
from thingc.base.units import shorten
from thingc.documents.spec import assembly, drives, link_shapes, mass, materials, modes, repeats, sensors
from thingc.documents.spec.annotation_types import model_keys, one_of

SHORT_FORM_KEYS: Mapping[type[BaseModel], tuple[str, ...]] = {
    assembly.LimitSpec: ("lower", "upper"), modes.WorldAtSpec: ("xyz",), modes.HoldSpec: ("xyz",), assembly.MountSpec: ("xyz",),
    assembly.MimicSpec: ("joint",), repeats.RepeatSpec: ("count",), assembly.AtSpec: ("in",), modes.ModeSpec: ("root",),
    mass.InertiaMatrix: ("ixx", "iyy", "izz"), drives.DriveSpec: ("kind",), drives.DynamicsSpec: ("damping",),
    materials.MaterialSpec: ("density",), materials.FrictionSpec: ("slide",), materials.ProcessSpec: ("kind",),
    sensors.SensorSpec: ("type",), modes.ContactsSpec: ("exclude",), link_shapes.RoundSpec: ("radius",),
    link_shapes.LongSpec: ("radius", "length"), link_shapes.DecomposeSpec: ("pieces",),
}
"""Models of mappings for which users often write a single value or a list of values, with the keys of these values."""


@cache
def keywords() -> tuple[Mapping[str, Mapping[str, str]], Mapping[str, list[str]]]:
    """Return the keys and the values of other formats, with their replacements in thingc.

    The first mapping is keyed by the class name of a document model, and then by a key of another format. Its value is the key of thingc
    that replaces the other key, or a sentence that explains the difference. The second mapping maps values of other formats to lists of
    choices of thingc.
    """
    tables: dict[str, Any] = tomllib.loads((resources.files(__package__) / "foreign_keywords.toml").read_text(encoding="utf-8"))
    keys = {model: {word: key for key, words in table.items() for word in words.split()} for model, table in tables["keys"].items()}
    return keys, {keyword: target.split() for target, keywords_text in tables["words"].items() for keyword in keywords_text.split()}


def key_for(model: type[BaseModel], key: str) -> str | None:
    """Return the key of thingc that replaces a key of another format, or a sentence that explains the difference.

    Return None for an unknown key.
    """
    for base in model.__mro__:
        replacement = keywords()[0].get(base.__name__, {}).get(key.lower().replace("-", "_"))
        if replacement is not None:
            return replacement
    return None


def choice_hint(word: str, choices: list[str]) -> Hint | None:
    """Return a hint if `word` is a value of another format that corresponds to one of the choices. Otherwise, return None."""
    keyword = word.lower().replace("-", "_").replace(" ", "_")
    names = [name for name in keywords()[1].get(keyword, ()) if name in choices]
    return Suggestion(f"use {one_of(names)}", (word, names[0]) if len(names) == 1 else None) if names else None


def mapping_text(model: type[BaseModel], texts: list[str], value: object) -> str | None:
    """Return the text of the mapping that the user probably intended, if a value or list was written instead. Otherwise, return None.

    `texts` contains the source text of `value`, or of each item if `value` is a list.
    """
    keys = SHORT_FORM_KEYS.get(model)
    if keys is None or not texts or not all(texts) or isinstance(value, bool):
        return None
    if keys == ("xyz",):
        return f"{{xyz: [{', '.join(texts)}]}}" if len(texts) == 3 else f"{{xyz: {shorten(texts[0])}}}" if len(texts) == 1 else None
    required_count = sum(required for _, required in model_keys(model).values())
    if not max(required_count, 1 if len(keys) < 2 else 2) <= len(texts) <= len(keys):
        return None
    return "{" + ", ".join(f"{key}: {shorten(text, 40)}" for key, text in zip(keys, texts)) + "}"
