"""What others see of a document: its kind, its name, what it is, and the parameters that a parent may set."""

from __future__ import annotations

import copy
import os
import re
from collections.abc import Mapping

from thingc.base.diagnostics import Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import MappingNode, Node, text_of
from thingc.documents.load.documents import read_tree
from thingc.tools.schemas import values
from thingc.tools.schemas.values import Schema


class ParameterSymbol(FrozenStruct):
    """A parameter as it is written; empty texts for what is not."""

    value: str
    minimum: str = ""
    maximum: str = ""
    doc: str = ""


class DocumentSymbols(FrozenStruct):
    """Of one document; `kind` is empty where it has none. `whole`: it could be parsed."""

    kind: str
    whole: bool = True
    name: str = ""
    description: str = ""
    parameters: Mapping[str, ParameterSymbol] = {}


_KIND = re.compile(rb"""^[^#\n]*thingc["']?[ \t]*[:=][ \t]*["']?(\w+)/""", re.MULTILINE)


def read_symbols(path: str) -> DocumentSymbols:
    """Of the file at a path; of one that cannot be parsed the kind alone."""
    try:
        with open(path, "rb") as stream:
            data = stream.read(10_000_001)
    except OSError:
        return DocumentSymbols(kind="", whole=False)
    tree = read_tree(path, data, Report())
    if tree is not None:
        return symbols_of(tree)
    kind = _KIND.search(data)
    return DocumentSymbols(kind=kind.group(1).decode() if kind is not None else "", whole=False)


def symbols_of(tree: MappingNode) -> DocumentSymbols:
    """Of a tree, as far as it makes sense."""
    parameters = tree.entries.get("parameters")
    return DocumentSymbols(
        kind=text_of(tree.entries.get("thingc")).strip().partition("/")[0], name=text_of(tree.entries.get("name")).strip(),
        description=" ".join(text_of(tree.entries.get("description")).split()),
        parameters={name: _parameter(node) for name, node in parameters.entries.items()}
        if isinstance(parameters, MappingNode) else {},
    )


def _parameter(node: Node) -> ParameterSymbol:
    if not isinstance(node, MappingNode):
        return ParameterSymbol(value=text_of(node).strip())
    value, low, high, doc = (text_of(node.entries.get(key)).strip() for key in ("value", "min", "max", "doc"))
    return ParameterSymbol(value=value, minimum=low, maximum=high, doc=doc)


def parameters_schema(document: str, symbols: DocumentSymbols) -> Schema:
    """The schema of the `parameters:` that a parent sets in a nested document."""
    return {
        "type": "object", "title": f"Parameters of {document}", "description": symbols.description or f"What `{document}` takes.",
        "properties": {name: _schema(name, one) for name, one in symbols.parameters.items()}, "additionalProperties": False,
    }


def _schema(name: str, one: ParameterSymbol) -> Schema:
    quantity = values.parse_value(one.value)
    schema: Schema = {"type": ["string", "number", "boolean"]}
    words = ""
    if quantity is not None and quantity.dimension.symbol and quantity.value:
        schema = values.quantity(quantity.dimension)
        words = quantity.dimension.words
    doc = one.doc[:1].upper() + one.doc[1:] + ("" if one.doc.endswith((".", "!", "?")) else ".") + " " if one.doc else ""
    limits = values.within(one.minimum or None, one.maximum or None)
    said = ", ".join(word for word in (words and words[0].upper() + words[1:], limits) if word)
    default = f"`{one.value}` unless set." if one.value else ""
    schema.update({
        "title": name, "description": f"{doc}{said}{'; ' if said and default else ''}{default}".strip() or f"`{name}`.",
        "examples": [one.value] if one.value else [],
    })
    return schema


def of_variants(general: Schema, assembly: DocumentSymbols | None, others: Mapping[str, DocumentSymbols]) -> Schema:
    """The schema of a variants document: the assemblies that it can name, and the parameters of the one that it names."""
    schema = copy.deepcopy(general)
    fields: Schema = schema["properties"]
    choices = [(name, one.description or one.name) for name, one in others.items()]
    fields["assembly"] = {**fields["assembly"], **values.one_of(choices)}
    if assembly is not None and assembly.whole:
        section = fields["parameters"]
        each = section.pop("patternProperties", {"": section.get("additionalProperties")})
        (value,) = each.values()
        section["properties"] = {
            name: {**value, "title": name, "description": one["description"]}
            for name, one in parameters_schema("", assembly)["properties"].items()
        }
        section["patternProperties"] = {r"\.": value}  # paths
        section["additionalProperties"] = False
    return schema


def near(document: str, other: str) -> str:
    """How a document names another one: both are paths in the workspace."""
    return os.path.relpath(other, os.path.dirname(document) or ".").replace(os.sep, "/")
