"""A workspace of two plain parts, documents that use them, and the results of `thingc test`."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

from thingc.documents.checks import kinds
from thingc.tools.cli.main import main

LENGTHS = {name for kind in kinds().values() for name in kind.lengths}
OTHERS = {"angle", "diverged", "effort", "margin", "margin_without_friction", "mass", "rest"}
"""Measured numbers that are not lengths."""

PARTS = '''
from build123d import Align, Box, Location, Pos

from thingc import Length, MountPoint, Thing


class Bar(Thing):
    """A square bar along x from its hinge `near` to its hinge `far`, whose axes are y; `back` is a `near` at the far end."""

    def __init__(self, length: Length = 100, width: Length = 20):
        super().__init__(material="stuff")
        self.body = Box(length, width, width, align=(Align.MIN, Align.CENTER, Align.CENTER))
        self.near = MountPoint(Location((0, 0, 0), (90, 0, 90)))
        self.far = MountPoint(Location((length, 0, 0), (-90, 0, 0)))
        self.back = MountPoint(Location((length, 0, 0), (90, 0, 90)))
        self.tip = MountPoint(Location((length, 0, 0), (0, 90, 0)))

    def result(self):
        return self.body


class Block(Thing):
    """A box around its own frame; slides along x from `left` to `right`."""

    def __init__(self, x: Length = 20, y: Length = 20, z: Length = 20):
        super().__init__(material="stuff")
        self.body = Box(x, y, z)
        self.left = MountPoint(Location((0, 0, 0), (0, -90, 0)))
        self.right = MountPoint(Location((0, 0, 0), (0, 90, 0)))

    def result(self):
        return self.body
'''

HEAD = """\
thingc: assembly/1
name: rig
materials: {stuff: {density: 1000 kg/m^3}}
"""

GROUND = (
    "  ground: {frame: true, mounts: {hinge: {rpy: -90 0 0 deg}, slide: {rpy: 0 90 0 deg}, "
    "far_hinge: {xyz: 200 0 0 mm, rpy: -90 0 0 deg}}}\n"
)

TWO_LINKS = HEAD + "components:\n" + GROUND + """\
  upper: {part: rig_parts:Bar}
  lower: {part: rig_parts:Bar, params: {length: 60 mm}}
joints:
  shoulder: {type: revolute, parent: ground.hinge, child: upper.near, limit: {lower: -170 deg, upper: 170 deg},
    drive: {kind: position, kp: 5 N*m/rad, effort: 1 N*m}}
  elbow: {type: revolute, parent: upper.far, child: lower.near, limit: {lower: LOWER, upper: UPPER},
    drive: {kind: position, kp: 5 N*m/rad, effort: 0.5 N*m}}
mounts: {tip: lower.tip, base: ground.hinge}
poses:
  level: {elbow: AT}
modes:
  bench: {root: ground, pose: level}
"""

SLIDERS = HEAD + "components:\n" + GROUND + """\
  left: {part: rig_parts:Block}
  right: {part: rig_parts:Block}
joints:
  one: {type: prismatic, parent: ground.slide, child: left.left, limit: {lower: -200 mm, upper: 200 mm}}
  two: {type: prismatic, parent: ground.slide, child: right.left, limit: {lower: -200 mm, upper: 200 mm}}
poses:
  apart: {two: 50 mm}
  close: {two: 20.4 mm}
  touching: {two: 20 mm}
  overlapping: {two: 17 mm}
modes:
  bench: {root: ground, pose: apart}
"""

PARALLELOGRAM = HEAD + "components:\n" + GROUND + """\
  crank: {part: rig_parts:Bar}
  coupler: {part: rig_parts:Bar, params: {length: 200 mm}}
  rocker: {part: rig_parts:Bar}
joints:
  crank: {type: revolute, parent: ground.hinge, child: crank.near, limit: {lower: -60 deg, upper: 60 deg},
    drive: {kind: position, kp: 5 N*m/rad, effort: 1 N*m}}
  pin: {type: continuous, parent: crank.far, child: coupler.near}
  rocker: {type: revolute, parent: ground.far_hinge, child: rocker.near, limit: {lower: -100 deg, upper: 100 deg}DRIVE}
  close: {type: continuous, parent: rocker.far, child: coupler.back, loop: true}
mounts: {middle: coupler.tip}
poses:
  level: {}
  lowered: {crank: 30 deg}
modes:
  bench: {root: ground, pose: level}
"""


def two_links(lower: str = "-150 deg", upper: str = "150 deg", at: str = "0") -> str:
    """Return two bars of 100 and 60 mm that turn about y; at 0 the first one is level along x."""
    return TWO_LINKS.replace("LOWER", lower).replace("UPPER", upper).replace("AT}", f"{at}}}")


class Workspace:
    """A folder with the parts. `test` writes a document and runs its tests."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "parts").mkdir(parents=True)
        (folder / "parts" / "rig_parts.py").write_text(PARTS)
        (folder / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts"]\n')

    def write(self, text: str, tests: str = "", name: str = "rig.yaml") -> Path:
        """Write the document with a `tests:` block of these lines."""
        document = self.folder / name
        document.write_text(text + (f"tests:\n{tests}" if tests else ""))
        return document

    def run(self, *words: str) -> tuple[int, str, str]:
        """Return exit code, standard output and standard error of `thingc test`."""
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
            code = main(["test", *words])
        return code, out.getvalue(), err.getvalue()

    def test(self, text: str, tests: str, *words: str, others: Collection[str] = ()) -> dict[str, Any]:
        """Return the JSON output; `code` is the exit code, and `by_name` has the last result of each name.

        `others` are measured numbers of a new kind that are not lengths."""
        document = self.write(text, tests)
        code, out, err = self.run(str(document), "--format", "json", *words)
        answer: dict[str, Any] = json.loads(out)
        assert code != 1 or answer.get("tests") or not tests, out
        answer["code"] = code
        answer["diagnostics"] = [found for found in answer["diagnostics"] if found["code"] != "TC610"]  # bars lie in the floor
        for result in answer.get("tests", []):
            numbers = {name for name, value in result["measured"].items() if isinstance(value, float)}
            missing = numbers - LENGTHS - OTHERS - {*others}
            assert not missing, f"add {missing} to `lengths` of the kind, or to `others` of this call if they are no lengths"
        answer["by_name"] = {result["name"]: result for result in answer.get("tests", [])}
        return answer
