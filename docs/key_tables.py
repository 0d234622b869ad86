"""Create the tables of the keys of document models, such as those in `docs/language/tests.md`, from the fields and their docstrings."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from pydantic.fields import FieldInfo

from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import FieldValidator
from thingc.documents.spec.name_types import RefersTo
from thingc.tools.schemas.general_schema import field_docstrings

REFERENCES = {"component": "components", "joint": "joints", "modes": "modes", "mount or export": "a mount", "poses": "poses"}
"""Types of references to several elements, and of references whose kind has another name on the pages."""


def key_tables(model: type[Model]) -> str:
    """Return the table of the keys of a model, and below it the tables of the mappings in its values."""
    lines = [f"<!-- keys: {model.__name__} -->", "| Key | Type | Default | Description |", "|---|---|---|---|"]
    hints = get_type_hints(model, include_extras=True)
    docstrings = field_docstrings()[model.__name__]
    for name, field in model.model_fields.items():
        lines.append(_row(field.alias or name, field, _type_of(hints[name]), docstrings.get(name) or field.description or ""))
    for name, field in model.model_fields.items():
        for inner in _models_in(hints[name]):
            text = inspect.getdoc(inner) or ""
            lines += ["", f"`{field.alias or name}`: {text[:1].lower()}{text[1:]}", "", key_tables(inner)]
    return "\n".join(lines)


def _row(key: str, field: FieldInfo, type_words: str, docstring: str) -> str:
    """Return the row of a key. The default is the one in the docstring (`; default: 1 s.`), or that of the field."""
    default = re.search(r"; default: (.*?)(?=\.(\s|$))", docstring, re.DOTALL)
    if default is not None:
        docstring = docstring.replace(default[0], "")
    value = "required" if field.is_required() else "none" if field.default in (None, [], {}) else f"`{json.dumps(field.default)}`"
    cells = [f"`{key}`", type_words, default[1] if default else value, _fragment(docstring)]
    return f"| {' | '.join(' '.join(cell.split()) for cell in cells)} |"


def _fragment(docstring: str) -> str:
    """Return a docstring with a lower-case beginning, and without the period of a single sentence."""
    text = docstring.strip().removesuffix(".")
    return text[:1].lower() + text[1:] + ("." if ". " in " ".join(text.split()) else "")


def _models_in(hint: Any) -> Iterator[type[Model]]:
    """Yield the models of mappings in the values of a type."""
    if isinstance(hint, type) and issubclass(hint, Model):
        yield hint
    for argument in get_args(hint):
        yield from _models_in(argument)


def _type_of(hint: Any) -> str:
    """Return the description of the values of a type, such as `a length`, `modes`, `3 numbers` or ``boolean or `references` ``."""
    marks = getattr(hint, "__metadata__", ())
    for mark in reversed(marks):
        if isinstance(mark, RefersTo):
            return REFERENCES.get(mark.kind, f"a {mark.kind}")
        if isinstance(mark, FieldValidator):
            return mark.description
    arguments = [argument for argument in get_args(hint) if argument is not NoneType]
    origin = get_origin(hint)
    if origin is Annotated:
        counts = [part.max_length for mark in marks for part in getattr(mark, "metadata", ()) if hasattr(part, "max_length")]
        return f"{counts[0]} {_plural(_type_of(get_args(hint.__origin__)[0]))}" if counts else _type_of(hint.__origin__)
    if origin is Literal:
        return " or ".join(f"`{word}`" for word in arguments)
    if origin is list:
        item = _type_of(arguments[0])
        return item if item == _plural(item) else f"list of {_plural(item)}"
    if arguments and origin is not dict:
        return " or ".join(dict.fromkeys(map(_type_of, arguments)))
    return {bool: "boolean", str: "string"}.get(hint, "mapping")


def _plural(words: str) -> str:
    return words if words.endswith("s") else f"{words.removeprefix('a ')}s"
