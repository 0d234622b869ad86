"""Meshes as prototypes: each is in a file once, and is referenced wherever it is drawn or collides."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import TypeVar

from thingc.base import numeric
from thingc.geometry.store.local import Store
from thingc.targets.geometry import Geometry, MeshAsset
from thingc.targets.usd.usda import Prim, listed, several

MESH = "mesh"
"""What the mesh in a prototype is called: an instance shares what is below it."""


Key = TypeVar("Key")


def identifiers(words: Mapping[Key, str]) -> dict[Key, str]:
    """Of each word a name that USD takes, `arm_Hand` of `arm.Hand`; where two would be one the second has a number."""
    names: dict[Key, str] = {}
    for key, word in words.items():
        plain = re.sub(r"\W", "_", word, flags=re.ASCII)
        names[key] = free(f"_{plain}" if plain[:1].isdigit() else plain, set(names.values()))
    return names


def free(word: str, taken: Collection[str]) -> str:
    """The word, with a number where something is called so."""
    return next(name for k in range(len(taken) + 1) if (name := f"{word}_{k}" if k else word) not in taken)


def prototypes(geometry: Geometry, store: Store, scope: str, names: dict[str, str]) -> Prim:
    """A class with a prototype for each mesh asset, which is there to be referenced alone."""
    prim = Prim(type="Scope", name=scope, specifier="class")
    drawn = {shape.mesh for shapes in geometry.shapes for shape in shapes.visual}
    for asset in geometry.meshes:
        parent = prim.add("Xform", names[asset.name])
        _mesh(parent.add("Mesh", MESH), asset, store.read(asset.mesh.sha256).decode(), drawn=asset.name in drawn)
    return prim


def _mesh(prim: Prim, asset: MeshAsset, text: str, *, drawn: bool) -> None:
    """The triangles of a mesh of the store (OBJ), as they are."""
    rows = [line.split() for line in text.splitlines()]
    points = [row[1:4] for row in rows if row and row[0] == "v"]
    corners = [int(corner.partition("/")[0]) - 1 for row in rows if row and row[0] == "f" for corner in row[1:4]]
    columns = [[float(point[k]) for point in points] for k in range(3)]
    low, high = map(numeric.minimum, columns), map(numeric.maximum, columns)
    prim.say("float3[] extent", listed((several(low), several(high))))
    prim.say("int[] faceVertexCounts", listed("3" for _ in range(len(corners) // 3)))
    prim.say("int[] faceVertexIndices", listed(str(corner) for corner in corners))
    prim.say("point3f[] points", listed(f"({', '.join(point)})" for point in points))
    prim.say("uniform token subdivisionScheme", '"none"')
    if drawn and not asset.mesh.closed:
        prim.say("uniform bool doubleSided", "1")
