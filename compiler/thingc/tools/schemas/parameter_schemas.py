"""Create JSON Schemas for values and parameters: quantities, names, parameters of parts, and parameters of nested documents."""

from __future__ import annotations

import copy
import os
import re
from collections.abc import Iterable, Mapping
from typing import Any

from thingc.base.diagnostics import Report
from thingc.base.filesystem import beginning
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import quote_names
from thingc.base.source import MappingNode, Node, entries_of, text_of
from thingc.base.units import NUMBER, UNITS, Dimension, Quantity, UnitError, fits, parse_quantity
from thingc.documents.load.documents import read_tree
from thingc.geometry.record import DIMENSIONS, WHOLE, ParameterKind, ParameterSchema, PartSchema, Value

Schema = dict[str, Any]

_NUMBER = r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?"
_ZERO = r"[-+]?0+(\.0*)?"
EXPRESSION = r"^\s*="
"""Regular expression of the beginning of an expression such as `=reach / 2`."""

MAX_BRANCHES = 300
"""Maximum number of branches in a schema. Language servers try the branches one by one."""


def quantity(dimension: Dimension) -> Schema:
    """Return the JSON Schema of a value that is a quantity with a unit, or an expression.

    Products of units, as in `0.1 N*m/N`, are validated only by the compiler.
    """
    units = "|".join(re.escape(name) for name, (_, _, own) in UNITS.items() if own == dimension and name != "%")
    pattern = rf"^\s*(=.*|{_NUMBER}\s*({units}|°|[^\s\d].*[*/·^²³].*)|{_ZERO})\s*$"
    description = dimension.words
    return {
        "oneOf": [
            {
                "type": "string", "pattern": pattern,
                "patternErrorMessage": f"expected {description} such as `{dimension.example}`, or an expression such as `=reach / 2`",
            },
            {"const": 0},
        ],
    }


def ratio() -> Schema:
    """Return the JSON Schema of a value that is a number, a percentage, or an expression."""
    return {"oneOf": [{"type": "string", "pattern": rf"^\s*(=.*|{_NUMBER}\s*%?)\s*$"}, {"type": "number"}]}


def number(kind: str, minimum: Value | None, maximum: Value | None) -> Schema:
    """Return the JSON Schema of a value that is a number within bounds, or an expression.

    `kind` is the kind of the parameter, which determines whether the number is an integer.
    """
    bounds = {key: bound for key, bound in (("minimum", minimum), ("maximum", maximum)) if bound is not None}
    plain: Schema = {"type": "integer" if kind in WHOLE else "number", **bounds}
    return {"oneOf": [plain, {"type": "string", "pattern": EXPRESSION}]}


def one_of(choices: Iterable[tuple[str, str]], **more: Any) -> Schema:
    """Return the JSON Schema of a string for which editors suggest names with descriptions.

    Other strings are valid unless `more` restricts them. The schema contains one `const` per name instead of an `enum`, because language
    servers show the description of a `const`. Language servers try all branches for every value. Therefore, if there are many names, the
    schema contains snippets instead, which are not validated.
    """
    known = list(choices)
    if len(known) > MAX_BRANCHES:
        return {"type": "string", **more, "defaultSnippets": [
            {"label": name, "body": name.replace("$", "\\$"), "description": text} for name, text in known
        ]}
    branches = [{"const": name, "title": name, **({"description": text} if text else {})} for name, text in known]
    return {"type": "string", "anyOf": [*branches, {"type": "string"}], **more} if branches else {"type": "string", **more}


def within(low: str | None, high: str | None) -> str:
    """Format the lower and upper bound of a parameter, for example `60 mm to 200 mm` or `at least 0`.

    Return an empty string for a parameter without bounds.
    """
    if low is not None and high is not None:
        return f"{low} to {high}"
    return f"at least {low}" if low is not None else f"at most {high}" if high is not None else ""


def parse_value(text: str) -> Quantity | None:
    """Parse a text such as `60 mm` as a quantity. Return None if the text is not a quantity."""
    try:
        return parse_quantity(text)
    except UnitError:
        return None


def fitting(parameters: Mapping[str, Quantity], dimension: Dimension) -> list[str]:
    """Return the expression `=name` for each parameter of the document that has this physical dimension."""
    return [f"={name}" for name, value in parameters.items() if fits(value.dimension, dimension)]


_KINDS: Mapping[ParameterKind, str] = {
    "length": "a length", "angle": "an angle", "mass": "a mass", "ratio": "a number or a percentage", "number": "a number",
    "count": "a whole number", "integer": "a whole number", "flag": "`true` or `false`", "text": "a string",
    "choice": "one of the listed values",
}


def part_schema(part: PartSchema, own: Mapping[str, Quantity]) -> Schema:
    """Return the JSON Schema of the mapping `params:` of a component that uses a part.

    Expressions in the mapping can use the parameters of the document, `own`.
    """
    required = [one.name for one in part.parameters if one.required]
    return {
        "type": "object", "title": f"Parameters of {part.reference}",
        "description": part.doc.strip().partition("\n")[0].strip() or f"The parameters of `{part.reference}`.",
        "properties": {one.name: _parameter_schema(one, own) for one in part.parameters}, "additionalProperties": False,
        **({"required": required} if required else {}),
    }


def documentation(part: PartSchema) -> str:
    """Return the text that editors show for the key `part:`: the docstring and the parameters of the Thing."""
    lines = [part.doc.strip() or f"`{part.reference}` has no docstring."]
    facts = []
    if part.parameters and "Args:" not in part.doc:
        facts.append("Parameters: " + ", ".join(f"`{one.name}`" for one in part.parameters) + ".")
    if part.material:
        facts.append(f"Material: `{part.material}` by default.")
    if part.actuator:
        facts.append("Has an actuator: use it in `drive` of a joint.")
    return "\n\n".join([*lines, *([" ".join(facts)] if facts else [])])


def _parameter_schema(one: ParameterSchema, own: Mapping[str, Quantity]) -> Schema:
    examples: list[Any] = [] if one.default is None else [_plain(one)]
    if one.kind not in ("flag", "text", "choice"):
        examples += fitting(own, DIMENSIONS.get(one.kind, NUMBER))
    return {**_value(one), "title": one.name, "description": _description(one), **({"examples": examples} if examples else {})}


def _value(one: ParameterSchema) -> Schema:
    if one.kind == "flag":
        return {"oneOf": [{"type": "boolean"}, {"type": "string", "pattern": EXPRESSION}]}
    if one.kind == "text":
        return {"type": ["string", "number"]}
    if one.kind == "choice":
        return {"anyOf": [
            *({"const": choice} for choice in one.choices),
            *({"const": plain} for choice in one.choices if (plain := _as_number(choice)) is not None),
            {"type": "string", "pattern": EXPRESSION},
        ]}
    if one.kind == "ratio":
        return ratio()
    dimension = DIMENSIONS.get(one.kind, NUMBER)
    return quantity(dimension) if dimension != NUMBER else number(one.kind, one.minimum, one.maximum)


def _as_number(choice: Any) -> float | int | None:
    """Convert a choice of a parameter from a string to the number that YAML would parse, for example "12" to 12.

    Return None if the choice is not a number.
    """
    if not isinstance(choice, str) or not re.fullmatch(r"-?\d+(\.\d+)?", choice, re.ASCII):
        return None
    return float(choice) if "." in choice else int(choice)


def _plain(one: ParameterSchema) -> Any:
    """Return the default value of a parameter in the syntax of documents: numbers and Booleans unchanged, and quantities as strings."""
    default = one.default
    if isinstance(default, (bool, str)) or one.kind in ("number", *WHOLE):
        return default
    return one.format_value(default) if default is not None else None


def _sentence(doc: str) -> str:
    """Format a docstring as a sentence followed by a space, or return an empty string if there is none."""
    return f"{doc[0].upper()}{doc[1:]}{'' if doc.endswith(('.', '!', '?')) else '.'} " if doc else ""


def _description(one: ParameterSchema) -> str:
    """Describe a parameter of a part in words: `Edge of the plate. A length, 90 mm to 300 mm; 100 mm by default.`"""
    doc = _sentence(one.doc.strip())
    kind = _KINDS.get(one.kind, one.kind)
    dimension = DIMENSIONS.get(one.kind, NUMBER)
    if dimension != NUMBER:
        kind += f" such as `{dimension.example}`"
    if one.kind == "choice":
        kind = "one of " + quote_names([one.format_value(choice) for choice in one.choices], 20)
    limits = within(*(None if bound is None else one.format_value(bound) for bound in (one.minimum, one.maximum)))
    text = f"{doc}{kind[0].upper()}{kind[1:]}" + (f", {limits}" if limits else "")
    if one.required:
        return f"{text}; required."
    return f"{text}; `{one.format_value(one.default)}` by default." if one.default is not None else f"{text}."


class ParameterSymbol(FrozenStruct):
    """A parameter in the text of a document. If the document does not contain a key, the field with the same name is empty."""

    value: str
    minimum: str = ""
    maximum: str = ""
    doc: str = ""


class DocumentSymbols(FrozenStruct):
    """The header, the parameters and the modes of a document, to which other documents can refer.

    `kind` is an empty string for an unknown kind of document. `whole` specifies whether the document is well-formed.
    """

    kind: str
    whole: bool = True
    name: str = ""
    description: str = ""
    parameters: Mapping[str, ParameterSymbol] = {}
    modes: tuple[str, ...] = ()


_KIND = re.compile(rb"""^[^#\n]*thingc["']?[ \t]*[:=][ \t]*["']?(\w+)/""", re.MULTILINE)


def read_symbols(path: str) -> DocumentSymbols:
    """Read the header and the parameters of a document. If the file cannot be parsed, read only the kind of the document."""
    try:
        data = beginning(path, 10_000_001)
    except OSError:
        return DocumentSymbols(kind="", whole=False)
    tree = read_tree(path, data, Report())
    if tree is not None:
        return symbols_of(tree)
    kind = _KIND.search(data)
    return DocumentSymbols(kind=kind.group(1).decode() if kind is not None else "", whole=False)


def symbols_of(tree: MappingNode) -> DocumentSymbols:
    """Return the header, the valid parameters and the modes in the syntax tree of a document."""
    return DocumentSymbols(
        kind=text_of(tree.entries.get("thingc")).strip().partition("/")[0], name=text_of(tree.entries.get("name")).strip(),
        description=" ".join(text_of(tree.entries.get("description")).split()),
        parameters={name: _parameter(node) for name, node in entries_of(tree.entries.get("parameters")).items()},
        modes=tuple(entries_of(tree.entries.get("modes"))),
    )


def _parameter(node: Node) -> ParameterSymbol:
    if not isinstance(node, MappingNode):
        return ParameterSymbol(value=text_of(node).strip())
    value, low, high, doc = (text_of(node.entries.get(key)).strip() for key in ("value", "min", "max", "doc"))
    return ParameterSymbol(value=value, minimum=low, maximum=high, doc=doc)


def parameters_schema(document: str, symbols: DocumentSymbols) -> Schema:
    """Return the JSON Schema of the mapping `parameters:`, with which a document sets the parameters of a nested document."""
    return {
        "type": "object", "title": f"Parameters of {document}", "description": symbols.description or f"The parameters of `{document}`.",
        "properties": {name: _schema(name, one) for name, one in symbols.parameters.items()}, "additionalProperties": False,
    }


def _schema(name: str, one: ParameterSymbol) -> Schema:
    value = parse_value(one.value)
    schema: Schema = {"type": ["string", "number", "boolean"]}
    words = ""
    if value is not None and value.dimension.symbol and value.value:
        schema = quantity(value.dimension)
        words = value.dimension.words
    doc = _sentence(one.doc)
    limits = within(one.minimum or None, one.maximum or None)
    text = ", ".join(word for word in (words and words[0].upper() + words[1:], limits) if word)
    default = f"`{one.value}` by default." if one.value else ""
    schema.update({
        "title": name, "description": f"{doc}{text}{'; ' if text and default else ''}{default}".strip() or f"`{name}`.",
        "examples": [one.value] if one.value else [],
    })
    return schema


def of_variants(general: Schema, assembly: DocumentSymbols | None, others: Mapping[str, DocumentSymbols]) -> Schema:
    """Return the JSON Schema of a variants document.

    The schema contains the names of assemblies that the document can vary, and the parameters of the chosen assembly.
    """
    schema = copy.deepcopy(general)
    fields: Schema = schema["properties"]
    fields["assembly"] = {**fields["assembly"], **one_of([(name, one.description or one.name) for name, one in others.items()])}
    if assembly is not None and assembly.whole:
        section = fields["parameters"]
        (value,) = section.pop("patternProperties", {"": section.get("additionalProperties")}).values()
        section["properties"] = {
            name: {**value, "title": name, "description": one["description"]}
            for name, one in parameters_schema("", assembly)["properties"].items()
        }
        section["patternProperties"] = {r"\.": value}  # the keys are paths of parameters
        section["additionalProperties"] = False
    return schema


def relative_to_document(document: str, other: str) -> str:
    """Convert the path of a document to a path relative to the folder of another document. Both paths are relative to the workspace."""
    return os.path.relpath(other, os.path.dirname(document) or ".").replace(os.sep, "/")
