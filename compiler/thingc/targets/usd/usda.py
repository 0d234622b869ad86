"""USD's text, written by us.

With usd-core's own writer the bytes would depend on its version, a build would need a package of 30 MB, and every number of UsdPhysics,
whose attributes are floats, would be cut to eight digits. Here all are written as exactly as they are known: a reader rounds them once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from thingc.base.pose import IDENTITY, Pose
from thingc.targets.xml_writer import number

INDENT = "    "

FLOAT_MAX = 3.4028234663852886e38
"""The largest number that a `float` holds."""

_ESCAPES = str.maketrans({"\\": "\\\\", '"': '\\"', "\n": "\\n", "\r": "\\r"})


@dataclass(slots=True, kw_only=True, eq=False)
class Prim:
    """A prim: its `type` (`Xform`) and `name`, the API schemas applied to it, other metadata and properties as lines of text, and its
    children. `specifier` `class` has it and all below it be there to be referenced alone. Not frozen: a tree is grown from the top."""

    type: str
    name: str
    specifier: str = "def"
    schemas: list[str] = field(default_factory=list)
    metadata: list[str] = field(default_factory=list)
    properties: list[str] = field(default_factory=list)
    children: list[Prim] = field(default_factory=list)

    def add(self, type: str, name: str, *schemas: str) -> Prim:
        """A new last child."""
        child = Prim(type=type, name=name, schemas=list(schemas))
        self.children.append(child)
        return child

    def say(self, property: str, value: str | float) -> None:
        """A property, `float physics:mass`, and its value: a number, or text as USD has it."""
        self.properties.append(f"{property} = {value if isinstance(value, str) else number(value)}")

    def place(self, pose: Pose, scale: tuple[float, ...] = ()) -> None:
        """Where it is in its parent, if that says anything, and how large [1]."""
        steps = []
        if any(pose.translation):
            self.say("double3 xformOp:translate", several(pose.translation))
            steps.append("translate")
        if pose.rotation != IDENTITY:
            self.say("quatd xformOp:orient", several(pose.quaternion()))
            steps.append("orient")
        if scale:
            self.say("double3 xformOp:scale", several(scale))
            steps.append("scale")
        if steps:
            self.say("uniform token[] xformOpOrder", listed(quoted(f"xformOp:{step}") for step in steps))


def quoted(text: str) -> str:
    """A string or a token."""
    return '"' + text.translate(_ESCAPES) + '"'


def several(values: Iterable[float]) -> str:
    """A vector, a colour or a quaternion (w, x, y, z)."""
    return f"({', '.join(number(value) for value in values)})"


def listed(values: Iterable[str]) -> str:
    """An array of what is text already."""
    return f"[{', '.join(values)}]"


def rendered(prim: Prim) -> str:
    """A prim and what is below it."""
    return "\n".join(_lines(prim, ""))


def write(prims: Iterable[str], default: str, heading: str) -> str:
    """The layer: metres, kilograms, z up; `prims` are rendered (one of nothing is none), `default` names the one that a reference to the
    file means."""
    lines = [
        "#usda 1.0", "(", f"{INDENT}defaultPrim = {quoted(default)}", f"{INDENT}doc = {quoted(heading)}", f"{INDENT}kilogramsPerUnit = 1",
        f"{INDENT}metersPerUnit = 1", f'{INDENT}upAxis = "Z"', ")",
    ]
    for prim in filter(None, prims):
        lines += ["", prim]
    return "\n".join([*lines, ""])


def _lines(prim: Prim, indent: str) -> Iterator[str]:
    """A prim and what is below it; prims lie a few levels deep, links side by side."""
    schemas = [f"prepend apiSchemas = {listed(quoted(schema) for schema in prim.schemas)}"] if prim.schemas else []
    metadata = [*schemas, *prim.metadata]
    yield f"{indent}{prim.specifier} {prim.type} {quoted(prim.name)}" + (" (" if metadata else "")
    if metadata:
        yield from (f"{indent}{INDENT}{line}" for line in metadata)
        yield f"{indent})"
    yield f"{indent}{{"
    yield from (f"{indent}{INDENT}{line}" for line in prim.properties)
    for number_, child in enumerate(prim.children):
        if number_ or prim.properties:
            yield ""
        yield from _lines(child, indent + INDENT)
    yield f"{indent}}}"
