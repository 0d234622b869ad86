"""Write a build123d assembly as a STEP file with FreeCAD: its tree as `App::Part` objects, and equal solids as links to one solid."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

from build123d import Compound, Location, Shape, Solid, export_brep

EXPORT = """
import json, FreeCAD, Import, Part
document, solids = FreeCAD.newDocument("robot"), {{}}
def create(node):
    if "children" in node:
        made = document.addObject("App::Part")
        for child in node["children"]:
            made.addObject(create(child))
    elif node["brep"] in solids:
        made = document.addObject("App::Link")
        made.LinkedObject = solids[node["brep"]]
    else:
        made = solids[node["brep"]] = document.addObject("Part::Feature")
        shape = Part.Shape()
        shape.read(node["brep"])
        made.Shape = shape
    made.Label = node["label"]
    made.Placement = FreeCAD.Placement(FreeCAD.Vector(*node["position"]), FreeCAD.Rotation(*node["quaternion"]))
    return made
with open({tree!r}, encoding="utf-8") as file:
    root = create(json.load(file))
document.recompute()
Import.export([root], {step!r})
"""


def export_with_freecad(assembly: Compound, path: Path, command: str) -> None:
    """Write an assembly to a STEP file at `path` with FreeCAD. `command` is its program without a window, for example `freecadcmd`."""
    tree = path.with_suffix(".json")
    tree.write_text(json.dumps(_tree(assembly, path.parent, {})), encoding="utf-8")
    code = EXPORT.format(tree=str(tree), step=str(path))
    subprocess.run([command, "-c", code], check=True, capture_output=True, cwd=path.parent)
    assert path.exists(), f"{command} did not write {path}"


def _tree(shape: Shape[Any], folder: Path, files: dict[Any, str]) -> dict[str, Any]:
    """Return the name, the placement and the children or the BREP file of a shape. Solids with equal geometry share one file."""
    transformation = shape.location.wrapped.Transformation()
    rotation = transformation.GetRotation()
    node: dict[str, Any] = {
        "label": shape.label, "position": tuple(shape.location.position),
        "quaternion": (rotation.X(), rotation.Y(), rotation.Z(), rotation.W()),
    }
    if isinstance(shape, Solid):
        key = shape.wrapped.TShape()
        if key not in files:
            files[key] = str(folder / f"solid{len(files)}.brep")
            export_brep(shape.located(Location()), files[key])
        return {**node, "brep": files[key]}
    return {**node, "children": [_tree(child, folder, files) for child in shape.children]}
