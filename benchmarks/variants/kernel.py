"""What the CAD kernel alone takes for a part, for `memory.py`: `python benchmarks/variants/kernel.py PARTS`.

For every number on a line of its standard input so many braces of the arm are made, each of another reach: by the code of their class,
with their volume and their moments of inertia, and the two meshes that a build has of a part. Nothing is sliced, written or kept. Then
it says so.
"""

from __future__ import annotations

import importlib
import math
import sys

FINE, COARSE = math.radians(10.0), math.radians(30.0)
"""Angles [rad] between neighbouring triangles, as `thingc.toml` has them unless it says otherwise."""
LINEAR = 0.1
"""How far [mm] triangles are off a surface."""


def main() -> None:
    """Make parts until the input ends."""
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools

    sys.path.insert(0, sys.argv[1])
    brace = importlib.import_module("arm").RotorBrace
    made = 0
    for line in sys.stdin:
        for _ in range(int(line)):
            made += 1
            solid = brace(length=70.0 + 45.0 * (made * 0.6180339887498949 % 1.0)).result()
            assert solid.volume > 0.0 and solid.matrix_of_inertia
            for angle in (FINE, COARSE):
                BRepTools.Clean_s(solid.wrapped)
                BRepMesh_IncrementalMesh(solid.wrapped, LINEAR, False, angle, False)
        print("made", flush=True)


if __name__ == "__main__":
    main()
