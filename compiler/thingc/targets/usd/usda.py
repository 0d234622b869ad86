"""Write USD text files (`.usda`).

The package usd-core is not used to write the files, for three reasons. The first reason is that the bytes of a file would depend on the
version of usd-core. The second reason is that a build would need an additional package of 30 MB. The third reason is that usd-core would
round numbers in float attributes to eight digits, whereas this module writes all numbers exactly.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from thingc.base.pose import IDENTITY, Pose
from thingc.targets.xml_writer import number

INDENT = "    "

FLOAT_MAX = 3.4028234663852886e38
"""The largest value of a USD `float`."""

_ESCAPES = str.maketrans({"\\": "\\\\", '"': '\\"', "\n": "\\n", "\r": "\\r"})


@dataclass(slots=True, kw_only=True, eq=False)
class Prim:
    """A prim of a USD stage, with its properties and children.

    `type` is the type of the prim, such as `Xform`, and `schemas` contains the applied API schemas. Other metadata and properties are
    stored as lines of text. If `specifier` is `class`, the prim and its children are not part of the scene. Other prims can reference them.
    The class is mutable, because trees are built from the top.
    """

    type: str
    name: str
    specifier: str = "def"
    schemas: list[str] = field(default_factory=list)
    metadata: list[str] = field(default_factory=list)
    properties: list[str] = field(default_factory=list)
    children: list[Prim] = field(default_factory=list)

    def add(self, type: str, name: str, *schemas: str) -> Prim:
        """Add a child prim with the given type, name and schemas, and return it."""
        child = Prim(type=type, name=name, schemas=list(schemas))
        self.children.append(child)
        return child

    def set(self, property: str, value: str | float) -> None:
        """Add a property to the prim, such as `float physics:mass`. The value is a number, or a string that is already USD text."""
        self.properties.append(f"{property} = {value if isinstance(value, str) else number(value)}")

    def fill(self, values: Mapping[str, str | float | None]) -> None:
        """Add several properties, as `set` does. Values that are None are omitted."""
        for property, value in values.items():
            if value is not None:
                self.set(property, value)

    def place(self, pose: Pose, scale: tuple[float, ...] = (), *, always: bool = False) -> None:
        """Set the pose of the prim relative to its parent, and its scale factors. An identity is omitted, unless `always` is True."""
        steps = []
        if always or any(pose.translation):
            self.set("double3 xformOp:translate", format_vector(pose.translation))
            steps.append("translate")
        if always or pose.rotation != IDENTITY:
            self.set("quatd xformOp:orient", format_vector(pose.quaternion()))
            steps.append("orient")
        if scale:
            self.set("double3 xformOp:scale", format_vector(scale))
            steps.append("scale")
        if steps:
            self.set("uniform token[] xformOpOrder", format_array(quote(f"xformOp:{step}") for step in steps))


def quote(text: str) -> str:
    """Format a string or a token as USD text, in quotes."""
    return '"' + text.translate(_ESCAPES) + '"'


def format_vector(values: Iterable[float]) -> str:
    """Format a vector, a colour or a quaternion (w, x, y, z) as USD text."""
    return f"({', '.join(number(value) for value in values)})"


def format_array(values: Iterable[str]) -> str:
    """Format an array as USD text. The items of the array must already be USD text."""
    return f"[{', '.join(values)}]"


def format_prim(prim: Prim) -> str:
    """Format a USD prim and its descendants as USD text."""
    return "\n".join(_lines(prim, ""))


def dictionary(type: str, values: Mapping[str, str]) -> list[str]:
    """Return the lines of a dictionary in metadata. `type` is the type and the name of the dictionary. The keys of `values` include their
    types, such as `string author`.
    """
    return [f"{type} = {{", *(f"{INDENT}{name} = {value}" for name, value in values.items()), "}"]


def write(prims: Iterable[str], default: str, heading: str, metadata: Iterable[str] = ()) -> str:
    """Return the text of a USD layer. The units of the layer are metres, kilograms and seconds, and its z axis points up.

    `prims` contains the text of each prim. Empty strings are omitted. `default` is the name of the default prim. `metadata` contains more
    lines of metadata.
    """
    header = [
        *metadata, f"defaultPrim = {quote(default)}", f"doc = {quote(heading)}", "kilogramsPerUnit = 1", "metersPerUnit = 1",
        "timeCodesPerSecond = 1", 'upAxis = "Z"',
    ]
    lines = ["#usda 1.0", "(", *(f"{INDENT}{line}" for line in header), ")"]
    for prim in filter(None, prims):
        lines += ["", prim]
    return "\n".join([*lines, ""])


def _lines(prim: Prim, indent: str) -> Iterator[str]:
    """Yield the lines of a prim and its descendants. The function is recursive. The recursion is safe, because prims are nested only a few
    levels deep.
    """
    schemas = [f"prepend apiSchemas = {format_array(quote(schema) for schema in prim.schemas)}"] if prim.schemas else []
    metadata = [*schemas, *prim.metadata]
    yield f"{indent}{prim.specifier} {prim.type} {quote(prim.name)}" + (" (" if metadata else "")
    if metadata:
        yield from (f"{indent}{INDENT}{line}" for line in metadata)
        yield f"{indent})"
    yield f"{indent}{{"
    yield from (f"{indent}{INDENT}{line}" for line in prim.properties)
    for index, child in enumerate(prim.children):
        if index or prim.properties:
            yield ""
        yield from _lines(child, indent + INDENT)
    yield f"{indent}}}"
