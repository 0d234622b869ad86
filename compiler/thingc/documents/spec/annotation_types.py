"""Types of the values in documents, such as mapping, list or choice, derived from the annotations of pydantic models.

A validation error of pydantic contains a location in the model. The types in this module are used to find the corresponding position in the
document, similar names, and a description of the expected type.
"""

from __future__ import annotations

import types
from collections.abc import Sequence
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from msgspec.structs import replace
from pydantic import BaseModel

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import nearest
from thingc.documents.spec.fields import FieldValidator, Index
from thingc.documents.spec.name_types import DeclaresName, RefersTo


class FieldType(FrozenStruct):
    """The type of a value in a document, derived from an annotation.

    `kind` is `model`, `dict`, `list`, `literal`, `field` (a type of `spec.fields`), `text`, `flag`, `number` or `union`. `model` is the
    class of a document model. `members` contains the types of dict values, of list items, or of the branches of a union. `key` is the type
    of dict keys. `choices` contains the allowed values of a `Literal`. `field` is the validator, and `annotation` is the annotation.
    `names` is the kind of name that the value declares or refers to.
    """

    kind: str
    annotation: Any
    model: type[BaseModel] | None = None
    members: tuple[Any, ...] = ()
    choices: tuple[Any, ...] = ()
    field: FieldValidator | None = None
    key: Any = None
    names: DeclaresName | RefersTo | None = None

    @property
    def by_number(self) -> bool:
        """Whether the value is a mapping whose keys are the indices of a joint's coordinates."""
        return self.kind == "dict" and self.key is Index

    @property
    def description(self) -> str:
        """A description of the valid values for messages."""
        if self.model is not None:
            keys = model_keys(self.model)
            own_keys = [key for key in self.model.__annotations__ if key in keys]
            names = [key for key, (_, required) in keys.items() if required] or list(dict.fromkeys([*own_keys, *keys]))[:3]
            return "a mapping with " + ", ".join(f"`{key}`" for key in names)
        if self.kind == "literal":
            return one_of([format_choice(choice) for choice in self.choices])
        if self.field is not None:
            return self.field.description
        if self.kind == "union":
            shapes = [shape_of(member) for member in self.members]
            has_model = any(shape.model is not None for shape in shapes)
            numbered = any(shape.by_number for shape in shapes)  # there may be several values, in a list or by number
            omitted = {*(("dict",) if has_model else ()), *(("list", "dict") if numbered else ())}
            return " or ".join(shape.description for shape in shapes if shape.kind not in omitted)
        number = "a whole number" if self.annotation is int else "a number"
        return {"dict": "a mapping", "list": "a list", "text": "a string", "flag": "a boolean", "number": number}[self.kind]


@cache
def shape_of(annotation: Any) -> FieldType:
    """Convert a Python annotation of a document model to a `FieldType`. For an optional type, `None` is ignored."""
    return _field_shape(annotation, ())


def _field_shape(annotation: Any, metadata: Sequence[Any]) -> FieldType:
    """Return the type of a field of a document model, given its annotation and its `metadata`."""
    names = next((extra for extra in metadata if isinstance(extra, (DeclaresName, RefersTo))), None)
    for extra in metadata:
        if isinstance(extra, FieldValidator):
            return FieldType(kind="field", annotation=annotation, field=extra, names=names)
    origin = get_origin(annotation)
    arguments = get_args(annotation)
    if origin is Annotated:
        return replace(_field_shape(arguments[0], arguments[1:]), annotation=annotation)
    if origin in (Union, types.UnionType):
        members = tuple(argument for argument in arguments if argument is not type(None))
        return shape_of(members[0]) if len(members) == 1 else FieldType(kind="union", annotation=annotation, members=members)
    if origin is Literal:
        return FieldType(kind="literal", annotation=annotation, choices=arguments)
    if origin is dict:
        return FieldType(kind="dict", annotation=annotation, members=(arguments[1],), key=arguments[0])
    if origin is list:
        return FieldType(kind="list", annotation=annotation, members=(arguments[0],))
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return FieldType(kind="model", annotation=annotation, model=annotation)
    return FieldType(kind={str: "text", bool: "flag"}.get(annotation, "number"), annotation=annotation, names=names)


@cache
def model_keys(model: type[BaseModel]) -> dict[str, tuple[FieldType, bool]]:
    """Return the keys that a document model defines, in order.

    Each key is mapped to the type of its value and to whether the key is required.
    """
    return {
        field.alias or name: (_field_shape(field.annotation, field.metadata), field.is_required())
        for name, field in model.model_fields.items()
    }


def alternatives(shape: FieldType) -> list[FieldType]:
    """Return the types that a value may have: the branches of a union type, or the type itself."""
    return [shape_of(member) for member in shape.members] if shape.kind == "union" else [shape]


def branch_of(shape: FieldType, value: Any) -> FieldType | None:
    """Return the branch of a union type that the user probably intended by `value`.

    Return None if all branches require another type of value.
    """
    branches = alternatives(shape)
    if isinstance(value, dict):
        candidates = [branch for branch in branches if branch.kind in ("model", "dict")]
        if any(branch.by_number for branch in candidates):
            numbered = bool(value) and all(key.isdigit() for key in value)
            candidates = [branch for branch in candidates if branch.by_number == numbered] or candidates
        return max(candidates, key=lambda branch: likeness(branch, value)) if candidates else None
    if isinstance(value, list):
        sequence = next((branch for branch in branches if branch.kind == "list"), None)
        of_models = sequence is not None and shape_of(sequence.members[0]).model is not None
        if of_models and any(branch.by_number for branch in branches) and not any(isinstance(item, dict) for item in value):
            return None  # `limit: [-90 deg, 90 deg]` is not a list of limits
        return next((branch for branch in branches if branch.kind in ("list", "field")), None)
    if isinstance(value, str):
        literal = next((branch for branch in branches if branch.kind == "literal"), None)
        kinds = ("field", "text") if literal is None else ("field", "text", "list")
        text = next((branch for branch in branches if branch.kind in kinds), None)
        return literal if text is None or literal is not None and value.isidentifier() else text
    return next((branch for branch in branches if branch.kind in ("field", "flag", "number")), None)


def likeness(branch: FieldType, value: dict[str, Any]) -> float:
    """Return a score of the similarity between a mapping and a type: the number of keys of `value` that the type defines.

    A key that is only similar to a defined key counts 0.5. For a type that accepts arbitrary keys, the score is 0.25.
    """
    if branch.model is None:
        return 0.25
    keys = model_keys(branch.model)
    return sum(1.0 if key in keys else 0.5 if nearest(key, keys) else 0.0 for key in value)


def one_of(names: Sequence[str]) -> str:
    """Format alternatives for a message: "`a`, `b` or `c`"."""
    quoted = [f"`{name}`" for name in names]
    return quoted[0] if len(quoted) == 1 else ", ".join(quoted[:-1]) + " or " + quoted[-1]


def format_choice(choice: Any) -> str:
    """Format an allowed value of a field as it is written in documents."""
    return {True: "true", False: "false"}[choice] if isinstance(choice, bool) else str(choice)
