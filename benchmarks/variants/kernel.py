"""Measure how long the CAD kernel needs for one part, without the rest of thingc: `python benchmarks/variants/kernel.py PARTS`.

The program is used by `memory.py` and `parallel.py`. Each line of standard input contains a number. For each line, the program creates this
number of braces of the arm, each with a different length, and then prints a line. For each brace, it does what a script would do for the
same numbers and meshes: it runs the code of the part class, computes volume, centre of mass and moments of inertia, creates the two meshes
of a build, and writes each mesh to an STL file. All braces share one process, so the servo in the code of the part class is created only
once. The program does not slice the braces, and does not create records or cache entries.
"""

from __future__ import annotations

import importlib
import math
import sys
import tempfile
from pathlib import Path

FINE, COARSE = math.radians(10.0), math.radians(30.0)
"""Maximum angles [rad] between neighbouring triangles of the two meshes, the defaults of `thingc.toml`."""
LINEAR = 0.1
"""Maximum distance [mm] between triangles and the surface of the part."""


def main() -> None:
    """Create parts until standard input ends."""
    from thingc.geometry.worker.lazy_build123d import import_cheaply

    import_cheaply("build123d")  # as in the processes that model parts
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools
    from OCP.StlAPI import StlAPI_Writer

    sys.path.insert(0, sys.argv[1])
    brace = importlib.import_module("arm").RotorBrace
    made, writer = 0, StlAPI_Writer()
    writer.ASCIIMode = False
    with tempfile.TemporaryDirectory() as folder:
        for line in sys.stdin:
            for _ in range(int(line)):
                made += 1
                solid = brace(length=70.0 + 45.0 * (made * 0.6180339887498949 % 1.0)).result()
                assert solid.volume > 0.0 and solid.center() and solid.matrix_of_inertia
                for angle in (FINE, COARSE):
                    BRepTools.Clean_s(solid.wrapped)
                    BRepMesh_IncrementalMesh(solid.wrapped, LINEAR, False, angle, False)
                    assert writer.Write(solid.wrapped, str(Path(folder) / f"{made}_{math.degrees(angle):.0f}.stl"))
            print("made", flush=True)


if __name__ == "__main__":
    main()
