"""Find the values of an assembly that a variant can set or choose, given their paths (`joints.elbow.limit.upper`)."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.kinds import KINDS
from thingc.base.joints.twist import dimensions_of
from thingc.base.source import Document, MappingNode, Node, Path, ScalarNode, SequenceNode, node_at
from thingc.base.units import Dimension
from thingc.documents.expressions.evaluation import ExpressionValue
from thingc.documents.expressions.terms import Expression
from thingc.documents.load.yaml_scalars import core_value
from thingc.documents.spec.fields import any_value

if TYPE_CHECKING:
    from thingc.documents.load.documents import Documents
    from thingc.documents.spec.assembly import AssemblySpec

KEYS = ("part", "file", "assembly", "material")
"""Keys of a component whose values a variant can choose."""
DEFAULT_MATERIAL = "defaults.component.material"
EXAMPLES = "`components.NAME.part` (or `.assembly`, `.file`, `.material`), or `defaults.component.material`"

VALUES = "the path of a value, such as `joints.NAME.limit.upper` or `components.NAME.mass`"
SECTIONS = ("components", "defaults", "joints", "links", "materials", "poses", "sensors", "tendons", "transmissions")
"""Sections of a nested assembly whose values a variant can set. Components do not have keys with these names."""


class ChoicePath(FrozenStruct):
    """A parsed path of a choice. For `components.leg.components.foot.part`, the names are `leg` and `foot`, and the key is `part`."""

    components: tuple[str, ...]
    key: str


def parse(path: str) -> ChoicePath | None:
    """Parse a path such as `components.foot.part`. Return None if the path does not refer to a choice."""
    steps = path.split(".")
    names: list[str] = []
    while len(steps) > 2 and steps[0] == "components":
        names.append(steps[1])
        steps = steps[2:]
    key = ".".join(steps)
    if not all(name.isidentifier() and name.isascii() for name in names):
        return None
    if key == DEFAULT_MATERIAL or (names and key in KEYS):
        return ChoicePath(components=tuple(names), key=key)
    return None


def split_nested(path: str) -> tuple[str, str] | None:
    """Split a path into the name of a component and the rest of the path, which refers to a value in the nested assembly.

    Return None if the path does not refer to a value in a nested assembly.
    """
    steps = path.split(".", 2)
    if len(steps) < 3 or steps[0] != "components" or steps[2].partition(".")[0] not in SECTIONS or "." not in steps[2]:
        return None
    return steps[1], steps[2]


def is_value(path: str) -> bool:
    """Return whether a path refers to a value, such as a limit, and not to a choice, such as a part or a material."""
    steps = path.split(".")
    return len(steps) > 1 and all(steps) and " " not in path and parse(path) is None


def dimension_at(document: Document, path: Path) -> Dimension | None:
    """Return the physical dimension of the joint value at `path`.

    Return None if the value does not belong to a joint, or if its dimension is ambiguous. The dimension depends on the `type` of the joint.
    For `defaults`, poses and patterns, all matching joints must have the same dimension.
    """
    names, key = _joints(document, path)
    coordinates = {_coordinate(document, name) for name in names}
    coordinate = coordinates.pop() if len(coordinates) == 1 else None
    return dimensions_of(coordinate).get(key) if coordinate is not None else None

_VECTOR = re.compile(r"(\S+)\s+(\S+)\s+([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(.*)", re.ASCII)
"""Regular expression of a vector: three numbers with a common unit."""


def _joints(document: Document, path: Path) -> tuple[list[str], str]:
    """Return the names of the joints to which the value at a path applies, and the key of the value."""
    joints = node_at(document.tree, ("joints",))
    names = list(joints.entries) if isinstance(joints, MappingNode) else []
    key = str(path[-1]) if path else ""
    if len(path) > 2 and path[0] == "joints":
        return [str(path[1])], key
    if path[:2] == ("defaults", "joint"):
        return names, key
    if len(path) == 3 and path[0] == "poses":
        entry_name = re.sub(r"_\d+$", "", key)  # name of an element of a repeat
        return [name for name in names if name in (key, entry_name) or fnmatchcase(name, key)], "offset"
    return [], key


def _coordinate(document: Document, name: str) -> Dimension | None:
    kind = node_at(document.tree, ("joints", name, "type"))
    joint_kind = KINDS.get(str(kind.value)) if isinstance(kind, ScalarNode) else None
    return joint_kind.coordinate if joint_kind is not None else None


def current_value(documents: Documents, path: str) -> ExpressionValue | Expression | None:
    """Return the value at a path in the root document or a nested document.

    A vector that the document contains as one string is returned as a string. Return None if the document does not specify the value, or if
    the value is an expression in a nested document.
    """
    document, keys = _leading(documents, path)
    return None if document is None else _value(documents, document, keys)


def nested_parameter_value(documents: Documents, path: str) -> ExpressionValue | None:
    """Return the default value of a parameter of a nested document, given a path such as `components.leg.parameters.length`.

    Return None if the value is an expression, or if the path does not refer to a parameter of a nested document.
    """
    document, keys = _leading(documents, path)
    if document is None or len(keys) != 4 or (keys[0], keys[2]) != ("components", "parameters"):
        return None
    document = nested_document(documents, document, keys[1])
    if document is None:
        return None
    values = (_value(documents, document, ("parameters", keys[3], *inner)) for inner in ((), ("value",)))
    return next((value for value in values if value is not None and not isinstance(value, Expression)), None)


def joint_value_dimension(documents: Documents, path: str) -> Dimension | None:
    """Return the physical dimension of the joint value at a path, which can lead into nested assemblies.

    The document need not contain the value. Return None if the path does not refer to a value of a joint.
    """
    document, keys = _leading(documents, path)
    return None if document is None else dimension_at(document, keys)


def _leading(documents: Documents, path: str) -> tuple[Document | None, tuple[str, ...]]:
    """Return the nested document that contains the value at a path, and the keys of the value in this document."""
    document: Document | None = documents.root
    while document is not None and (through := split_nested(path)) is not None:
        component, path = through
        document = nested_document(documents, document, component)
    return document, tuple(path.split("."))


def nested_document(documents: Documents, document: Document, component: str) -> Document | None:
    """Return the document of a component that is a nested assembly, or None."""
    text = node_at(document.tree, ("components", component, "assembly"))
    return documents.find_referenced(document, text.text) if isinstance(text, ScalarNode) else None


def _value(documents: Documents, document: Document, keys: tuple[str, ...]) -> ExpressionValue | Expression | None:
    node = node_in_full(document.tree, keys)
    if not isinstance(node, ScalarNode):
        return None
    try:
        value = any_value(node.value)
    except ValueError:
        return node.text
    return None if isinstance(value, Expression) and document is not documents.root else value


def current_choices(assembly: AssemblySpec) -> dict[str, str]:
    """Return the current choices (parts, files, assemblies and materials) of the components in a document, keyed by path.

    Selecting a current choice again does not change the robot.
    """
    default = assembly.defaults.component if assembly.defaults is not None else None
    choices = {DEFAULT_MATERIAL: default.material} if default is not None and default.material is not None else {}
    for name, component in assembly.components.items():
        choices.update({f"components.{name}.{key}": text for key in KEYS if (text := getattr(component, key)) is not None})
    return choices


def expand_short_form(tree: Node, keys: tuple[str, ...]) -> tuple[tuple[str, ...], Node] | None:
    """Return the path and the long form of a value that the document contains in short form, if `keys` refer to a key inside this value.

    Otherwise, return None. Two kinds of values have a short form. A joint drive can be only the name of a component, or come from
    `defaults` (`joints.elbow.drive.kp`). A vector can be a single string (`modes.moon.gravity.2`).
    """
    node = node_at(tree, keys[:-1])
    vector = _VECTOR.fullmatch(node.text.strip()) if keys[-1].isdecimal() and isinstance(node, ScalarNode) else None
    if vector is not None and node is not None:
        elements = [f"{number} {vector[4]}".strip() for number in vector.group(1, 2, 3)]
        items = tuple(ScalarNode(value=core_value(element), text=element, span=node.span) for element in elements)
        return keys[:-1], SequenceNode(items=items, span=node.span)
    if len(keys) < 4 or (keys[0], keys[2]) != ("joints", "drive") or node_at(tree, keys[:2]) is None:
        return None
    joint_drive = node_at(tree, keys[:3])
    drive = node_at(tree, ("defaults", "joint", "drive")) if joint_drive is None else joint_drive
    if isinstance(drive, ScalarNode):
        drive = MappingNode(entries={"component": drive}, keys={"component": drive.span}, span=drive.span)
    elif joint_drive is not None:
        return None
    return (keys[:3], drive) if isinstance(drive, MappingNode) else None


def node_in_full(tree: Node, keys: tuple[str, ...]) -> Node | None:
    """Return the node at a path, or None. Values in short form are expanded, so the path can refer to a key inside such a value."""
    place, node = expand_short_form(tree, keys) or ((), tree)
    return node_at(node, keys[len(place):])
