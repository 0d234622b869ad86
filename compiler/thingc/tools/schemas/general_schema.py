"""JSON Schema (draft 2020-12) of each kind of document, for editors. `docs/generate.py` writes `schemas/`.

Titles, descriptions and examples come from the pydantic models. The description of a field is the docstring below the field.
"""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from thingc.documents.checks import kinds
from thingc.documents.spec.base import Model
from thingc.documents.spec.validation import model_of

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of document (`assembly`, `calibration`, `materials`, `variants`, `workspace`)."""
    model = model_of(kind)
    assert model is not None, kind
    schema = model.model_json_schema(schema_generator=_Generator)
    documented = {**field_docstrings(), "TestSpec": {check.name: check.summary for check in kinds().values()}}
    for name, definition in {**schema.get("$defs", {}), model.__name__: schema}.items():
        _describe(definition, documented.get(name, {}))
    cleaned: dict[str, Any] = _without_null(schema)
    definitions = cleaned.get("$defs", {})
    for definition in (*definitions.values(), cleaned):
        for name, field in definition.get("properties", {}).items():
            _complete(name, field, definitions)
    properties: dict[str, Any] = cleaned["properties"]
    properties["$schema"] = {
        "type": "string", "title": "Schema", "description": "The path or URL of the JSON Schema of this document, for editors.",
        "examples": [f"../schemas/{kind}-1.json"],
    }
    return {"$schema": DIALECT, **cleaned, "title": f"thingc {kind} document, version 1"}


def field_docstrings() -> dict[str, dict[str, str]]:
    """Return the docstrings of the fields of all loaded pydantic models, including inherited fields, keyed by class name and field name."""
    models = [*_submodels(Model)]
    texts: dict[str, dict[str, str]] = {}
    for module in dict.fromkeys(model.__module__ for model in models):
        nodes = ast.parse(inspect.getsource(sys.modules[module])).body
        texts |= {node.name: dict(_field_texts(node)) for node in nodes if isinstance(node, ast.ClassDef)}
    return {
        model.__name__: {name: text for base in reversed(model.__mro__) for name, text in texts.get(base.__name__, {}).items()}
        for model in models
    }


class _Generator(GenerateJsonSchema):
    """The JSON Schema generator of pydantic, extended with the schemas of `fields`."""

    def dict_schema(self, schema: Any) -> dict[str, Any]:
        """Return the JSON Schema of a mapping, including the regular expression of its keys.

        For types with validators, the method of pydantic omits this expression.
        """
        mapping: dict[str, Any] = super().dict_schema(schema)
        keys = schema.get("keys_schema")
        if keys is not None and keys.get("metadata"):
            names = self.generate_inner(keys)
            if "pattern" in names:
                mapping["propertyNames"] = {"pattern": names["pattern"]}
        return mapping


def _submodels(model: type[Model]) -> Iterator[type[Model]]:
    for one in model.__subclasses__():
        yield one
        yield from _submodels(one)


def _field_texts(node: ast.ClassDef) -> Iterator[tuple[str, str]]:
    """Yield the names and the docstrings of the fields that a class defines."""
    for statements in pairwise(node.body):
        match statements:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                yield name, inspect.cleandoc(text)
            case _:
                pass


def _describe(definition: dict[str, Any], documented: dict[str, str]) -> None:
    """Prepend the docstring of each field to the description of the type of the field."""
    for name, field in definition.get("properties", {}).items():
        text = documented.get(name)
        if text is not None:
            description = field.get("description")
            field["description"] = f"{text} {description}" if description and description != text else text


def _complete(name: str, field: dict[str, Any], definitions: dict[str, Any]) -> None:
    """Add information for editors to the schema of a field: a title, the description of a mapping, and the choices as examples."""
    field.setdefault("title", name.replace("_", " ").title())
    if "$ref" in field:
        inner = definitions[field["$ref"].rpartition("/")[2]]
        if "description" not in field and "description" in inner:
            field["description"] = inner["description"]
    if "examples" not in field:
        if "enum" in field:
            field["examples"] = list(field["enum"])
        elif "const" in field:
            field["examples"] = [field["const"]]
        elif field.get("type") == "boolean":
            field["examples"] = [not field.get("default", False)]


def _without_null(schema: Any) -> Any:
    """Remove `null`, which is not a valid value in documents, and null defaults from a schema."""
    if isinstance(schema, list):
        return [_without_null(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    cleaned = {key: _without_null(value) for key, value in schema.items() if not (key == "default" and value is None)}
    branches = cleaned.get("anyOf")
    if isinstance(branches, list) and {"type": "null"} in branches:
        other_branches = [branch for branch in branches if branch != {"type": "null"}]
        if len(other_branches) == 1:
            del cleaned["anyOf"]
            return {**other_branches[0], **cleaned, **_both(other_branches[0], cleaned)}
        cleaned["anyOf"] = other_branches
    return cleaned


def _both(inner: dict[str, Any], outer: dict[str, Any]) -> dict[str, Any]:
    texts = [text for text in (outer.get("description"), inner.get("description")) if text]
    return {"description": " ".join(texts)} if texts else {}
