"""The time of the CAD kernel alone for a part, for `memory.py`: `python benchmarks/variants/kernel.py PARTS`.

For every number on a line of standard input, it creates that many braces of the arm, each with another reach: with the code of their class,
volume and moments of inertia, and the two meshes of a build. Nothing is sliced, written or cached. Then it prints a line.
"""

from __future__ import annotations

import importlib
import math
import sys

FINE, COARSE = math.radians(10.0), math.radians(30.0)
"""Angles [rad] between neighbouring triangles, the defaults of `thingc.toml`."""
LINEAR = 0.1
"""Maximum distance [mm] of triangles from a surface."""


def main() -> None:
    """Create parts until the end of the input."""
    from thingc.geometry.worker.lazy_build123d import import_cheaply

    import_cheaply("build123d")  # as the processes that model parts
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
