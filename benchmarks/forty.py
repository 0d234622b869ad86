"""Write a robot of forty parts in one module, to measure the cost of editing one part. The cache key of each part covers the code of the
whole module.
"""

from __future__ import annotations

from pathlib import Path

PARTS = 40

_HEAD = """\
from typing import Annotated

from build123d import Box, Cylinder, Location, Pos
from thingc import Length, MountPoint, Range, Thing
"""

_PART = '''

class Plate{number}(Thing):
    """A plate with holes."""

    def __init__(self, thickness: Annotated[Length, Range(1, 20)] = {thickness}) -> None:
        self.thickness = thickness
        self.top = MountPoint(Location((0, 0, thickness)))

    def result(self):
        plate = Box(40 + {number}, 30, 2 * self.thickness)
        for x in (-15, -5, 5, 15):
            plate -= Pos(x, 8) * Cylinder(2, 4 * self.thickness)
            plate -= Pos(x, -8) * Cylinder(1.5, 4 * self.thickness)
        return plate
'''


def write_forty(workspace: Path) -> str:
    """Write the module of the parts and the document to a workspace. Return the path of the document relative to the workspace."""
    (workspace / "parts" / "forty.py").write_text(_HEAD + "".join(_PART.format(number=k, thickness=3.0) for k in range(PARTS)))
    lines = ["thingc: assembly/1", "name: forty", "materials: {steel: {density: 7850 kg/m^3}}", "components:", "  base: {frame: true}"]
    for k in range(PARTS):
        lines.append(f"  plate_{k}: {{part: forty:Plate{k}, material: steel, at: {{in: base.origin, xyz: [0, 0, {20 * k} mm]}}}}")
    (workspace / "forty.yaml").write_text("\n".join([*lines, ""]))
    return "forty.yaml"
