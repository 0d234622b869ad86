"""Find the keys and values that a JSON Schema allows at a path in a document.

The schemas are the output of `thingc schema`. Conditions in a schema are evaluated with the keys and scalars that the module `cursor` finds
in the text.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator, Mapping
from typing import Any

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Path
from thingc.base.units import NUMBER, UNITS, Dimension, UnitError, parse_quantity

Schema = dict[str, Any]


class KeyOffer(FrozenStruct):
    """A key that can be added to a mapping, with its description.

    The fields specify whether the key is required and whether its value must be a mapping.
    """

    name: str
    description: str
    required: bool
    mapping: bool


class SchemaWalk:
    """A JSON Schema, and the text of a document to which it applies.

    `keys` maps the path of each mapping to its keys, and `scalars` maps the path of each scalar to its text.
    """

    def __init__(self, schema: Schema, keys: Mapping[Path, tuple[str, ...]], scalars: Mapping[Path, str]) -> None:
        self.schema = schema
        self.keys = keys
        self.scalars = scalars

    def at(self, path: Path) -> list[Schema]:
        """Return the subschemas that can apply to the value at a path, the most specific first.

        References are followed, and conditions are evaluated.
        """
        schemas = self._flat(self.schema, ())
        for depth, step in enumerate(path):
            below = path[: depth + 1]
            schemas = [flat for schema in schemas for inner in _children(schema, step) for flat in self._flat(inner, below)]
        return schemas

    def key_offers(self, path: Path) -> list[KeyOffer]:
        """Return the keys that can be added to the mapping at a path, required keys first."""
        flats = self.at(path)
        present = set(self.keys.get(path, ()))
        mappings = [flat for flat in flats if "properties" in flat]
        required = {name for flat in mappings for name in (*flat.get("required", ()), *_missing_choices(flat, present))}
        offers: dict[str, KeyOffer] = {}
        for flat in flats:
            for name in flat.get("properties", {}):
                if name in present or name in offers or not all(_can_add_key(one, name, present) for one in flats):
                    continue
                declared = [one["properties"][name] for one in flats if name in one.get("properties", {})]
                inner = [each for child in declared for each in self._flat(child, (*path, name))]
                mapping = bool(inner) and all(map(_allows_mapping, inner))
                offers[name] = KeyOffer(name=name, description=find_description(inner), required=name in required, mapping=mapping)
        return sorted(offers.values(), key=lambda one: not one.required)

    def value_offers(self, path: Path) -> dict[str | bool, str]:
        """Return the values that the schema lists for a path, in the order of the schema, with their descriptions."""
        offers: dict[str | bool, str] = {}
        for flat in self.at(path):
            for value, text in _choices(flat):
                offers.setdefault(value, text)
        return offers

    def dimensions(self, path: Path) -> tuple[Dimension, ...]:
        """Return the physical dimensions that quantities at a path can have.

        Return an empty tuple if values at this path do not have units.
        """
        return _dimensions(self.at(path))

    def parameters_of(self, part: str) -> list[str]:
        """Return the names of the parameters that the JSON Schema contains for a part."""
        return list(self._definition(f"params of {part}").get("properties", {}))

    def needed_parameters(self, part: str) -> dict[str, Any]:
        """Return the names of the required parameters of a part, with an example value for each parameter."""
        schema = self._definition(f"params of {part}")
        needed: dict[str, Any] = {}
        for name in schema.get("required", ()):
            flats = self._flat(schema["properties"][name], ())
            examples = [one for flat in flats for one in flat.get("examples", ()) if not str(one).startswith("=")]
            words = [word for flat in flats for word, _ in _choices(flat)]
            measured = [one.example for one in _dimensions(flats)]
            needed[name] = next(iter((*examples, *words, *measured)), 1)
        return needed

    def mounts_of(self, component: str) -> list[tuple[str, str]]:
        """Return references to the default mounts of a component's part, with descriptions of the mounts."""
        part = self.scalars.get(("components", component, "part"))
        attach = {} if part is None else self._definition(f"mounts of {part}")
        mounts = attach.get("else", attach).get("properties", {})
        return [(f"{component}.{name}", str(one.get("description", ""))) for name, one in mounts.items() if "$ref" in one]

    def takes_mounts(self, path: Path) -> bool:
        """Return whether the value at a path can be a reference to a mount."""
        return any(flat.get("$ref") in ("#/$defs/mount", "#/$defs/frame") for flat in self.at(path))

    def _definition(self, name: str) -> Schema:
        definition: Schema = self.schema.get("$defs", {}).get(name, {})
        return definition

    def _flat(self, schema: Any, path: Path, followed: tuple[str, ...] = ()) -> list[Schema]:
        """Return a subschema, all schemas to which the subschema refers, and the branches of conditions that apply to the document."""
        if not isinstance(schema, dict):
            return []
        flats = [schema]
        reference = schema.get("$ref")
        if isinstance(reference, str) and reference not in followed:
            flats += self._flat(self._resolve(reference), path, (*followed, reference))
        for word in ("allOf", "anyOf", "oneOf"):
            for branch in schema.get(word, ()):
                flats += self._flat(branch, path, followed)
        if "if" in schema:
            flats += self._flat(schema.get("then" if self._applies(schema["if"], path) else "else"), path, followed)
        return flats

    def _resolve(self, reference: str) -> Any:
        node: Any = self.schema
        for step in reference.removeprefix("#/").split("/"):
            step = step.replace("%20", " ").replace("%25", "%").replace("~1", "/").replace("~0", "~")
            node = node.get(step) if isinstance(node, dict) else None
        return node

    def _applies(self, condition: Schema, path: Path) -> bool:
        """Return whether the document satisfies a condition of the schema. Conditions can only concern keys and scalars."""
        if "anyOf" in condition and not any(self._applies(one, path) for one in condition["anyOf"]):
            return False
        present = self.keys.get(path, ())
        if any(name not in present for name in condition.get("required", ())):
            return False
        return all(
            self.scalars.get((*path, name)) == one["const"]
            for name, one in condition.get("properties", {}).items() if "const" in one and name in present
        )


def find_description(flats: list[Schema]) -> str:
    """Return the first description of a value in the schemas. Descriptions of individual choices are ignored."""
    return next((str(flat["description"]) for flat in flats if flat.get("description") and "const" not in flat), "")


def described_as(flats: list[Schema], value: str) -> str:
    """Return the description of one choice in the schemas, or an empty string if the schemas do not list this value."""
    return next((text for flat in flats for word, text in _choices(flat) if word == value and text), "")


def _children(schema: Schema, step: str | int) -> Iterator[Any]:
    if isinstance(step, int):
        yield schema.get("items")
    elif step in schema.get("properties", {}):
        yield schema["properties"][step]
    else:
        matching = [one for pattern, one in schema.get("patternProperties", {}).items() if re.search(pattern, step)]
        yield from matching or [schema.get("additionalProperties")]


def _can_add_key(schema: Schema, name: str, present: set[str]) -> bool:
    """Return whether a key can be added to a mapping that already has the keys `present`. Only rules about keys are checked."""
    if name not in schema.get("properties", {}):
        return True
    keys = {*present, name}
    if keys >= set(schema.get("not", {}).get("required", ("",))):
        return False
    choices = [set(branch["required"]) for branch in schema.get("oneOf", ()) if set(branch) == {"required"}]
    if sum(keys >= choice for choice in choices) > 1 or len(keys) > schema.get("maxProperties", len(keys)):
        return False
    for one in keys:
        rule = schema.get("dependentSchemas", {}).get(one, {})
        if keys >= set(rule.get("not", {}).get("required", ("",))):
            return False
        needs = [rule, *(branch for branch in rule.get("anyOf", ()) if "required" in branch)]
        if one == name and any(not present >= set(need.get("required", ())) for need in needs):
            return False
    return True


def _missing_choices(schema: Schema, present: set[str]) -> Iterator[str]:
    """Yield the keys of which a mapping must contain exactly one. Yield nothing if the mapping already contains one of these keys."""
    choices = [branch["required"] for branch in schema.get("oneOf", ()) if set(branch) == {"required"}]
    if not any(present >= set(choice) for choice in choices):
        yield from (choice[0] for choice in choices if len(choice) == 1)


def _allows_mapping(schema: Schema) -> bool:
    """Return whether the schema allows a mapping, because the schema describes a mapping or does not restrict the value."""
    kind = schema.get("type")
    return kind == "object" or (kind is None and not any(word in schema for word in ("const", "enum", "pattern")))


def _choices(schema: Schema) -> Iterator[tuple[str | bool, str]]:
    """Yield the choices that a schema lists as possible values, with their descriptions."""
    text = str(schema.get("description", ""))
    if isinstance(schema.get("const"), (str, bool)):
        yield schema["const"], text
    for word in schema.get("enum", ()):
        if isinstance(word, (str, bool)):
            yield word, ""
    for snippet in schema.get("defaultSnippets", ()):
        yield snippet["label"], snippet.get("description", "")
    if schema.get("type") == "boolean" and "const" not in schema:
        yield from ((True, ""), (False, ""))


_ALL = {unit[2] for unit in UNITS.values()} - {NUMBER}


def _dimensions(flats: list[Schema]) -> tuple[Dimension, ...]:
    """Return the physical dimensions of the quantities that match the patterns in schemas. The function tries all single units.

    If no unit matches, the dimensions of the examples in the schema are returned.
    """
    dimensions: dict[Dimension, None] = {}
    for schema in flats:
        pattern = schema.get("pattern")
        if not isinstance(pattern, str) or not re.search(pattern, "=a") or re.search(pattern, "1 a"):
            continue
        single = dict.fromkeys(
            unit[2] for name, unit in UNITS.items()
            if name != "%" and any(re.search(pattern, f"{numbers} {name}") for numbers in ("2", "2 2 2"))
        )
        if set(single) != _ALL:  # otherwise the pattern accepts any physical dimension
            dimensions.update(single or dict.fromkeys(_in_examples(flats)))
    return tuple(dimensions)


def _in_examples(flats: list[Schema]) -> Iterator[Dimension]:
    texts = " ".join(str(flat.get(key, "")) for flat in flats for key in ("patternErrorMessage", "description"))
    for example in (*re.findall(r"`([^`]*)`", texts), *(str(one) for flat in flats for one in flat.get("examples", ()))):
        with contextlib.suppress(UnitError):
            dimension = parse_quantity(example).dimension
            if dimension != NUMBER:
                yield dimension
