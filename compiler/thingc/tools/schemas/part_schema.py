"""What an editor shows of a Thing: itself as a choice for `part:`, and its parameters as the keys of `params:`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from thingc.base.safe_text import quoted
from thingc.base.units import NUMBER, Quantity
from thingc.geometry.record import DIMENSIONS, WHOLE, ParameterKind, ParameterSchema, PartSchema
from thingc.tools.schemas import values
from thingc.tools.schemas.values import Schema

_KINDS: Mapping[ParameterKind, str] = {
    "length": "a length", "angle": "an angle", "mass": "a mass", "ratio": "a number or a percentage", "number": "a number",
    "count": "a whole number", "integer": "a whole number", "flag": "`true` or `false`", "text": "a text",
    "choice": "one of the words offered",
}


def parameters(part: PartSchema, own: Mapping[str, Quantity]) -> Schema:
    """The schema of the `params:` of a part; `own` are the document's parameters, which expressions may use."""
    schema: Schema = {
        "type": "object",
        "title": f"Parameters of {part.reference}",
        "description": first_line(part.doc) or f"What `{part.reference}` takes.",
        "properties": {one.name: _parameter(one, own) for one in part.parameters},
        "additionalProperties": False,
    }
    required = [one.name for one in part.parameters if one.required]
    if required:
        schema["required"] = required
    return schema


def documentation(part: PartSchema) -> str:
    """The docstring of a Thing with its parameters, as the hover text of `part:`."""
    lines = [part.doc.strip() or f"`{part.reference}` has no docstring."]
    facts = []
    if part.parameters and "Args:" not in part.doc:
        facts.append("Parameters: " + ", ".join(f"`{one.name}`" for one in part.parameters) + ".")
    if part.material:
        facts.append(f"Of `{part.material}` unless the document says otherwise.")
    if part.actuator:
        facts.append("Has an actuator: a joint's `drive` may name it.")
    return "\n\n".join([*lines, *([" ".join(facts)] if facts else [])])


def first_line(text: str) -> str:
    """The first sentence or line of a docstring."""
    return text.strip().partition("\n")[0].strip()


def _parameter(one: ParameterSchema, own: Mapping[str, Quantity]) -> Schema:
    schema = _value(one)
    examples: list[Any] = [] if one.default is None else [_plain(one)]
    if one.kind not in ("flag", "text", "choice"):
        examples += values.fitting(own, DIMENSIONS.get(one.kind, NUMBER))
    schema["title"] = one.name
    schema["description"] = _description(one)
    if examples:
        schema["examples"] = examples
    return schema


def _value(one: ParameterSchema) -> Schema:
    if one.kind == "flag":
        return {"oneOf": [{"type": "boolean"}, {"type": "string", "pattern": values.EXPRESSION}]}
    if one.kind == "text":
        return {"type": ["string", "number"]}
    if one.kind == "choice":
        return {"anyOf": [
            *({"const": choice} for choice in one.choices),
            *({"const": number} for choice in one.choices if (number := _as_number(choice)) is not None),
            {"type": "string", "pattern": values.EXPRESSION},
        ]}
    if one.kind == "ratio":
        return values.ratio()
    dimension = DIMENSIONS.get(one.kind, NUMBER)
    if dimension != NUMBER:
        return values.quantity(dimension)
    return values.number(one.kind, one.minimum, one.maximum)


def _as_number(choice: Any) -> float | int | None:
    """What YAML makes of a choice that is a text and looks like a number: `12` may be written for "12"."""
    if not isinstance(choice, str) or not re.fullmatch(r"-?\d+(\.\d+)?", choice, re.ASCII):
        return None
    return float(choice) if "." in choice else int(choice)


def _plain(one: ParameterSchema) -> Any:
    """The default as a document would have it: numbers and flags as such, what has a unit as a text."""
    default = one.default
    if isinstance(default, (bool, str)) or one.kind in ("number", *WHOLE):
        return default
    return one.shown(default) if default is not None else None


def _description(one: ParameterSchema) -> str:
    """`Edge of the plate. A length, 90 mm to 300 mm; 100 mm unless set.`"""
    doc = one.doc.strip()
    if doc:
        doc = doc[0].upper() + doc[1:] + ("" if doc.endswith((".", "!", "?")) else ".") + " "
    kind = _KINDS.get(one.kind, one.kind)
    dimension = DIMENSIONS.get(one.kind, NUMBER)
    if dimension != NUMBER:
        kind += f" such as `{dimension.example}`"
    if one.kind == "choice":
        kind = "one of " + quoted([one.shown(choice) for choice in one.choices], 20)
    low = None if one.minimum is None else one.shown(one.minimum)
    high = None if one.maximum is None else one.shown(one.maximum)
    limits = values.within(low, high)
    text = f"{doc}{kind[0].upper()}{kind[1:]}" + (f", {limits}" if limits else "")
    if one.required:
        return f"{text}; required."
    return f"{text}; `{one.shown(one.default)}` unless set." if one.default is not None else f"{text}."
