"""A workspace whose parts read every kind of file, with the files that are built. It uses `from build123d import *`, like many users."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from conformance.harness import write

PARTS = '''
    """Many classes in one module."""

    import json
    from pathlib import Path

    from build123d import *

    import helpers
    from thingc import Length, Thing, asset

    WALL = 3


    class Plain(Thing):
        """Of nothing but itself."""

        def __init__(self):
            super().__init__(material="pine")
            self.body = Box(11, 12, 13)

        def result(self):
            return self.body


    class Base(Thing):
        def __init__(self, width: Length = 20):
            super().__init__(material="pine")
            self.body = Box(width, 10, 5)

        def result(self):
            return self.body


    class Derived(Base):
        """Inherits."""

        def __init__(self):
            super().__init__(30)


    class User(Thing):
        """Uses another class within."""

        def __init__(self):
            super().__init__(material="pine")
            self.body = Base(25).body + Pos(0, 0, 5) * Box(5, 5, 5)

        def result(self):
            return self.body


    class Walled(Thing):
        """Uses a constant of the module."""

        def __init__(self):
            super().__init__(material="pine")
            self.body = Box(WALL, 10, 10)

        def result(self):
            return self.body


    class Helped(Thing):
        """Uses a function of another module."""

        def __init__(self):
            super().__init__(material="pine")
            self.body = helpers.knob(4)

        def result(self):
            return self.body


    class FromStep(Thing):
        def __init__(self):
            super().__init__(material="pine")
            self.body = import_step(asset("files/motor.step")).solid()

        def result(self):
            return self.body


    class FromBrep(Thing):
        def __init__(self):
            super().__init__(material="pine")
            self.body = import_brep(asset("files/motor.brep")).solid()

        def result(self):
            return self.body


    class FromStl(Thing):
        def __init__(self):
            super().__init__(material="pine")
            self.body = Mesher().read(asset("files/motor.stl"))[0]

        def result(self):
            return self.body


    class FromJson(Thing):
        def __init__(self):
            super().__init__(material="pine")
            self.body = Box(*json.loads(asset("sizes.json").read_text()))

        def result(self):
            return self.body


    class Optional(Thing):
        """Taller where somebody says so."""

        def __init__(self):
            super().__init__(material="pine")
            wish = Path(__file__).with_name("wish.json")
            self.body = Box(6, 6, json.loads(wish.read_text()) if wish.exists() else 6)

        def result(self):
            return self.body
'''

HELPERS = '''
    """What parts share."""

    from build123d import *


    def knob(radius):
        return Cylinder(radius, 8)
'''

KNOBS = '''
    """A module beside the other one, which shares its helpers."""

    from build123d import *

    import helpers
    from thingc import Thing


    class Knob(Thing):
        def __init__(self):
            super().__init__(material="pine")
            self.body = Sphere(5) + helpers.knob(3)

        def result(self):
            return self.body
'''

CODE = ("Plain", "Base", "Derived", "User", "Walled", "Helped", "FromStep", "FromBrep", "FromStl", "FromJson", "Optional")
FILES = ("motor.step", "motor.brep", "motor.stl")
EVERYTHING = {"knobs:Knob", *(f"shelf:{name}" for name in CODE), *(f"files/{name}" for name in FILES)}
"""The definition texts of all parts of the document."""

MAKE = """
import sys
from thingc.geometry.worker.lazy_build123d import import_cheaply
import_cheaply("build123d")
from build123d import Box, Pos, export_brep, export_step, export_stl
for folder, height in zip(sys.argv[1::2], map(float, sys.argv[2::2])):
    solid = Box(10, 20, height) + Pos(0, 0, height / 2) * Box(4, 4, 6)
    export_step(solid, folder + "/motor.step")
    export_brep(solid, folder + "/motor.brep")
    export_stl(solid, folder + "/motor.stl")
"""


def document() -> str:
    """Return a document with all parts in a row, and a hinge."""
    lines = [
        "thingc: assembly/1", "name: shelf", "materials: {pine: {density: 500 kg/m^3, color: burlywood}}",
        "defaults: {component: {material: pine}}", "components:", "  first: {part: 'shelf:Plain'}",
    ]
    for place, name in enumerate(CODE[1:], 1):
        lines.append(f"  {name.lower()}: {{part: 'shelf:{name}', at: {{in: first.origin, xyz: {50 * place} 0 0 mm}}}}")
    for place, name in enumerate(FILES, 1):
        lines.append(f"  motor_{place}: {{file: files/{name}, at: {{in: first.origin, xyz: {50 * place} 50 0 mm}}}}")
    lines += [
        "  knob: {part: 'knobs:Knob', at: {in: first.origin, xyz: 0 50 0 mm}}", "  flap: {part: 'shelf:Plain'}", "joints:",
        "  hinge: {type: revolute, parent: first.origin, child: flap.origin, gap: 20 mm, limit: {lower: -10 deg, upper: 45 deg}}",
        "poses: {open: {hinge: 20 deg}}",
    ]
    return "\n".join(lines) + "\n"


def make_files(heights: dict[Path, float]) -> None:
    """Write STEP, BREP and STL files of a motor with the given height [mm] to each folder, in a separate process."""
    for folder in heights:
        folder.mkdir(parents=True, exist_ok=True)
    words = [word for folder, height in heights.items() for word in (str(folder), str(height))]
    subprocess.run([sys.executable, "-c", MAKE, *words], check=True)


def workspace(folder: Path) -> Path:
    """Create the workspace `ws` in a folder, and beside it the folder `other` with the files of another motor."""
    root = write(folder / "ws", {
        "parts/shelf.py": PARTS, "parts/helpers.py": HELPERS, "parts/knobs.py": KNOBS, "shelf.yaml": document(),
        "sizes.json": "[7, 8, 9]", "unread.json": "1",
    })
    make_files({root / "files": 30, folder / "other": 31})
    return root
