"""Apply the raw attributes that documents define with `raw: {usd: ...}` to the prims of links and joints, and to the scene.

    joint: {crane.swing: {"physics:breakForce": 20.0}}            an attribute of a joint; the same for a link
    scene: {"token physxScene:solverType": TGS}                   of the scene; with its type, unless the value shows it
    link: {crane.boom: {apiSchemas: PhysxRigidBodyAPI}}           additional applied schemas

This module checks names, types and values, but not whether a reader supports the attributes.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Sequence

from thingc.base.diagnostics import Report
from thingc.base.safe_text import escape_control
from thingc.base.suggestions import did_you_mean
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.types import RawAttribute
from thingc.targets.raw import Fault, in_files, report_fault
from thingc.targets.usd.stage import JOINTS, SCENE
from thingc.targets.usd.usda import FLOAT_MAX, Prim, format_array, format_vector, quote
from thingc.targets.xml_writer import NO_CHARACTER, number

KINDS = ("joint", "link", SCENE)
"""Kinds of prims that can have raw attributes. Links and joints are selected by name."""

SCHEMAS = "apiSchemas"
"""The key under which documents list applied schemas. This key does not set an attribute."""

TYPES = ("bool", "int", "float", "double", "string", "token")
"""Types of USD attributes that documents can set. Each type can be an array (`int[]`), and a numeric type can also be a vector
(`float3`).
"""

_NAME = r"[A-Za-z_]\w*(?::[A-Za-z_]\w*)*"
_KEY = re.compile(rf"(?:(\S+) )?({_NAME})", re.ASCII)
_TYPE = re.compile(rf"(?:({'|'.join(TYPES)})(\[\])?|(int|float|double)([234]))")
_WRITTEN = re.compile(rf"((?:uniform )?\S+) ({_NAME}) = ", re.ASCII)
_INT_MAX = 2**31 - 1


def apply(assembly: Assembly, models: Sequence[Prim], report: Report) -> None:
    """Apply the raw attributes to the default prims of the chosen modes.

    Attributes that match no prim, and values of the wrong type, are reported.
    """
    for attribute in assembly.raw:
        if attribute.target == "usd":
            faults = filter(None, (_apply(attribute, prim) for prim in _prims(attribute, models)))
            report_fault(attribute, _fault(attribute, models) or next(faults, None), report)


def _fault(attribute: RawAttribute, models: Sequence[Prim]) -> Fault | None:
    """Return the reason why the path of a raw attribute is invalid, or None if the path is valid."""
    path = attribute.path
    if path[0] not in KINDS:
        return f"unknown kind of prim `{path[0]}` in `raw.usd`", did_you_mean(path[0], KINDS, what="kinds of prims"), 0
    if len(path) != (2 if path[0] == SCENE else 3):
        form = f"{SCENE}: {{ATTRIBUTE: VALUE}}" if path[0] == SCENE else f"{path[0]}: {{NAME: {{ATTRIBUTE: VALUE}}}}"
        return f"`{attribute.dotted}` must be the path of an attribute", f"write `{form}`", 0
    if models and not _prims(attribute, models):
        known = {prim.name for model in models for prim in _all(path[0], model)}
        return f"`raw.usd` refers to the unknown {path[0]} `{path[1]}`", did_you_mean(path[1], known, what=f"{path[0]}s"), 1
    return None


def _prims(attribute: RawAttribute, models: Sequence[Prim]) -> list[Prim]:
    """Return the USD prims to which a raw attribute applies."""
    kind, name = attribute.path[0], in_files(attribute.path[1])
    return [prim for model in models for prim in _all(kind, model) if kind == SCENE or prim.name == name]


def _all(kind: str, model: Prim) -> list[Prim]:
    """Return all USD prims of a kind, such as all joints."""
    if kind == "joint":
        return [joint for holder in model.children if holder.name == JOINTS for joint in holder.children]
    return [child for child in model.children if (child.name == SCENE if kind == SCENE else "PhysicsRigidBodyAPI" in child.schemas)]


def _apply(attribute: RawAttribute, prim: Prim) -> Fault | None:
    """Apply a raw attribute to a USD prim. Return the error if the attribute is invalid, or else None."""
    key, value, last = attribute.path[-1], json.loads(attribute.value), len(attribute.path)
    items = value if isinstance(value, list) else [value]
    invalid = re.search(NO_CHARACTER, "".join(item for item in items if isinstance(item, str)))
    if invalid is not None:
        return f"a string in USD cannot contain the character `{escape_control(invalid[0])}`", "remove the character", last
    if key == SCHEMAS:
        if not all(isinstance(item, str) and re.fullmatch(_NAME, item, re.ASCII) for item in items):
            return f"`{SCHEMAS}` must be a list of schema names", "write, for example, `[PhysxJointAPI]`", last
        prim.schemas += [item for item in dict.fromkeys(items) if item not in prim.schemas]
        return None
    if (named := _KEY.fullmatch(key)) is None:
        hint = "write a name such as `physics:breakForce`, or a type and a name such as `token physxScene:solverType`"
        return f"`{key}` is not a valid attribute name in USD", hint, last - 1
    type, name = named.groups()
    index, declared = next(
        ((index, match[1]) for index, line in enumerate(prim.properties) if (match := _WRITTEN.match(line)) and match[2] == name),
        (len(prim.properties), None),
    )
    if declared == "rel":
        return f"`{name}` is a relationship, not an attribute", "use the keys of the document instead", last - 1
    if type is None:
        type = (declared or _type_of(value)).removeprefix("uniform ")
    elif declared is not None and type != declared.removeprefix("uniform "):
        return f"the type of `{name}` is `{declared.removeprefix('uniform ')}`, not `{type}`", "remove the type", last - 1
    elif _TYPE.fullmatch(type) is None:
        types = ", ".join(f"`{item}`" for item in (*TYPES, "int[]", "float3"))
        return f"unknown type `{type}` of the attribute `{name}`", f"write one of {types}", last - 1
    literal = _literal(type, value)
    if literal is None:
        return f"expected a value of the type `{type}`, found `{escape_control(attribute.value)}`", _type_help(type), last
    prim.properties[index : index + 1] = [f"{declared or type} {name} = {literal}"]
    return None


def _type_of(value: object) -> str:
    """Return the USD type of an attribute with the given value. If the value is a list, return the first type that is valid for all
    items.
    """
    if isinstance(value, list):
        return next((f"{type}[]" for type in ("bool", "int", "float", "string") if _literal(f"{type}[]", value) is not None), "float[]")
    return {bool: "bool", int: "int", str: "string"}.get(type(value), "float")


def _literal(type: str, value: object) -> str | None:
    """Convert a value to USD text. Return None if the value does not have the USD type `type`."""
    scalar, size = type.removesuffix("[]"), None
    if type == "vector3f":
        scalar, size = "float", 3
    elif type[-1] in "234":
        scalar, size = type[:-1], int(type[-1])
    if scalar == type:
        return _scalar(scalar, value)
    texts = [_scalar(scalar, item) for item in value] if isinstance(value, list) else [None]
    if not all(text is not None for text in texts) or size not in (None, len(texts)):
        return None
    return format_array(filter(None, texts)) if size is None else format_vector(value if isinstance(value, list) else ())


def _scalar(type: str, value: object) -> str | None:
    match value:
        case bool():
            return str(int(value)) if type == "bool" else None
        case str():
            return quote(value) if type in ("string", "token") else None
        case int() if type == "int":
            return str(value) if abs(value) <= _INT_MAX else None
        case int() | float() if type in ("float", "double"):
            return number(value) if abs(value) <= (FLOAT_MAX if type == "float" else sys.float_info.max) else None
    return None


def _type_help(type: str) -> str:
    """Return the help text for a value of the USD type `type`."""
    descriptions = {
        "bool": "true or false", "int": f"a whole number of at most {_INT_MAX}", "string": "text", "token": "text",
        "double": "a number", "float": f"a number of at most {FLOAT_MAX:.3g}",
    }
    if type[-1] in "234" or type == "vector3f":
        return f"write a list of {3 if type == 'vector3f' else type[-1]} numbers"
    return f"write a list, each {descriptions[type.removesuffix('[]')]}" if type.endswith("[]") else f"write {descriptions[type]}"
