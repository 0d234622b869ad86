"""Drawings of parts, read as SVG by svgelements and ElementTree, against the dimensions in the code of the parts."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import svgelements

from thingc.tools.cli.main import main

PARTS = '''\
from build123d import *
from thingc import MountPoint, Thing

class Block(Thing):
    bom = {"name": "Block <&> 1/2"}

    def __init__(self):
        super().__init__()
        self.top = MountPoint(Location((5, 35, 20)))
        self.side = MountPoint(Location((25, 0, 15), (90, 0, 0)))
        self.far = MountPoint(Location((9000, 0, 0)))

    def result(self):
        body = Box(60, 40, 20, align=Align.MIN)
        through = Pos(10, 10, 10) * Cylinder(3, 20)
        blind = Pos(30, 20, 16) * Cylinder(2.5, 8)
        screw = [Pos(50, 30, 10) * Cylinder(2, 20), Pos(50, 30, 18.5) * Cylinder(4, 3)]
        across = Pos(40, 20, 10) * Rot(90, 0, 0) * Cylinder(1.5, 40)
        tilted = Pos(10, 30, 20) * Rot(0, 30, 0) * Cylinder(1, 6)
        return body - [through, blind, *screw, across, tilted]

def plate():
    """Holes that a chamfer, a keyway and a slit cut, and a blind hole that a slit cuts."""
    body = chamfer(Box(60, 40, 8, align=Align.MIN).edges().group_by(Axis.Z)[-1], 2)
    through = [Pos(x, 3.5, 4) * Cylinder(2, 9) for x in (10, 30)] + [Pos(x, 20, 4) * Cylinder(4, 9) for x in (15, 30)]
    blind = Pos(48, 20, 6) * Cylinder(4, 8)
    return body - [*through, blind, Pos(15, 24, 4) * Box(2, 3, 9), Pos(30, 30, 4) * Box(1, 20, 9), Pos(48, 30, 6) * Box(1, 20, 8)]

def ring():
    return Torus(20, 5)

def needle():
    return Box(2000, 3, 3)
'''
ROBOT = """\
thingc: assembly/1
name: robot
materials: {alu: {density: 2700 kg/m^3}}
defaults: {component: {material: alu}}
components:
  base: {part: solid:PART}
  other: {part: solid:PART, at: {in: base.origin, xyz: 0 0 90 mm}}
  bought: {part: solid:needle, bom: {make: buy}, at: {in: base.origin, xyz: 0 0 99 mm}}
"""
SVG = "{http://www.w3.org/2000/svg}"


def build(folder: Path, part: str) -> dict[str, bytes]:
    """Build the drawings of a robot, and return them by name."""
    (folder / "parts").mkdir(exist_ok=True)
    (folder / "parts/solid.py").write_text(PARTS)
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (folder / "robot.yaml").write_text(ROBOT.replace("PART", part))
    folders = ["--store", str(folder / "store"), "-o", str(folder / "out")]
    assert main(["build", str(folder / "robot.yaml"), "--emit", "drawing", *folders]) == 0
    return {path.name: path.read_bytes() for path in sorted((folder / "out/robot/drawing").iterdir())}


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> ElementTree.Element:
    folder = tmp_path_factory.mktemp("block")
    drawings = build(folder, "Block")
    assert [*drawings] == ["Block_1_2_alu_x2.svg"] and build(tmp_path_factory.mktemp("again"), "Block") == drawings
    shutil.rmtree(folder / "out")
    assert build(folder, "Block") == drawings, "the cache contains what the CAD kernel has computed"
    return ElementTree.fromstring(drawings["Block_1_2_alu_x2.svg"])


def paths(drawing: ElementTree.Element, kind: str) -> list[svgelements.Path]:
    return [svgelements.Path(one.attrib["d"]) for one in drawing.iter(f"{SVG}path") if one.get("class") == kind]


def rows(drawing: ElementTree.Element) -> list[list[str]]:
    """Return the texts of the sheet in lines from top to bottom, each from left to right."""
    lines: dict[float, list[tuple[float, str]]] = {}
    for one in drawing.iter(f"{SVG}text"):
        lines.setdefault(float(one.attrib["y"]), []).append((float(one.attrib["x"]), one.text or ""))
    return [[text for x, text in sorted(lines[y]) if x > 290.0] for y in sorted(lines)]


def test_edges_have_a_canonical_order() -> None:
    """The CAD kernel returns edges in an order that depends on addresses in memory, so that parts from the cache had other drawings."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeTorus

    from thingc.tools.kernel.views import views_of

    for shape in (BRepPrimAPI_MakeBox(60.0, 40.0, 20.0).Shape(), BRepPrimAPI_MakeTorus(20.0, 5.0).Shape()):
        for view in views_of(shape).by_name.values():
            assert len(view.visible) > 1 and list(view.visible) == sorted(view.visible, key=repr)


def test_views_are_to_scale_and_in_first_angle(block: ElementTree.Element) -> None:
    front, top, left, _ = (np.array(path.bbox()).reshape(2, 2) for path in paths(block, "visible"))
    sizes = [tuple((high - low).round(3)) for low, high in (front, top, left)]
    assert sizes == [(120, 40), (120, 80), (80, 40)], "2 : 1"
    assert top[0, 1] > front[1, 1] and top[0, 0] == front[0, 0], "the top view is below the front view"
    assert left[0, 0] > front[1, 0] and left[0, 1] == front[0, 1], "the view from the left is to the right of the front view"


def test_edges_match_the_part(block: ElementTree.Element) -> None:
    front, top, left, _ = paths(block, "visible")
    x0, _, _, bottom = top.bbox()
    circles = {
        (round((one.center.x - x0) / 2, 3), round((bottom - one.center.y) / 2, 3), round(one.rx / 2, 3))
        for one in top if isinstance(one, svgelements.Arc)
    }
    assert circles == {(10, 10, 3), (30, 20, 2.5), (50, 30, 2), (50, 30, 4)}
    x0, _, _, bottom = front.bbox()
    hidden = {
        tuple(round(value / 2, 3) for value in (one.start.x - x0, bottom - one.start.y, one.end.x - x0, bottom - one.end.y))
        for one in paths(block, "hidden")[0] if isinstance(one, svgelements.Line)
    }
    upright = {(line[0], *sorted((line[1], line[3]))) for line in hidden if line[0] == line[2]}
    assert upright >= {(27.5, 12, 20), (32.5, 12, 20), (46, 17, 20), (54, 17, 20), (48, 0, 17), (52, 0, 17)}
    x0, _, x1, _ = left.bbox()
    starts = {round((x1 - one.start.x) / 2, 3) for one in paths(block, "hidden")[2] if isinstance(one, svgelements.Line)}
    assert starts >= {7, 13}, "y points to the left"


def test_tables_and_title(block: ElementTree.Element) -> None:
    lines = rows(block)
    assert [line for line in lines if line and line[0] in "1234"] == [
        ["1", "6", "10", "10", "0 to 20", "through"], ["2", "5", "30", "20", "12 to 20", "8"],
        ["3", "4", "50", "30", "0 to 17", "through"], ["3", "8", "50", "30", "17 to 20", "3"],
        ["4", "3", "40", "0 to 40", "10", "through"],
    ]
    tilted = next(line for line in lines if line[:1] == ["5"])
    assert tilted[1] == "2" and tilted[3] == "30" and " to " in tilted[2] and " to " in tilted[4]
    assert [line for line in lines if line and line[0] in "ABC"] == [
        ["A", "top", "5", "35", "20", "+z"], ["B", "side", "25", "0", "15", "-y"], ["C", "far", "9000", "0", "0", "+z"],
    ]
    texts = [one.text for one in block.iter(f"{SVG}text")]
    assert {"60", "40", "20", "alu", "2 : 1", "2", "robot", "Block_1_2"} <= {*texts}
    assert not any(float(one.attrib["x"]) > 410.0 for one in block.iter(f"{SVG}text"))


def test_holes_with_cuts_in_their_walls_are_through(tmp_path: Path) -> None:
    drawing = ElementTree.fromstring(build(tmp_path, "plate")["plate_alu_x2.svg"])
    holes = (line for line in rows(drawing) if len(line) == 6 and line[0] in "12345")
    found = {(x, y): (across, z, depth) for _, across, x, y, z, depth in holes}
    assert found == {
        ("10", "3.5"): ("4", "0 to 8", "through"), ("30", "3.5"): ("4", "0 to 8", "through"),
        ("15", "20"): ("8", "0 to 8", "through"), ("30", "20"): ("8", "0 to 8", "through"), ("48", "20"): ("8", "2 to 8", "6"),
    }


def test_long_part_is_drawn_at_a_reduced_scale(tmp_path: Path) -> None:
    drawing = ElementTree.fromstring(build(tmp_path, "needle")["needle_alu_x2.svg"])
    assert "1 : 10" in [one.text for one in drawing.iter(f"{SVG}text")]
    x0, y0, x1, y1 = paths(drawing, "visible")[0].bbox()
    assert (x1 - x0, y1 - y0) == pytest.approx((200, 0.3), abs=2e-3)
    x0, _, x1, _ = paths(drawing, "visible")[3].bbox()
    assert x1 - x0 > 100.0, "the isometric view has its own scale and place"


def test_outline_of_a_round_part_is_visible(tmp_path: Path) -> None:
    """The exact algorithm of the CAD kernel draws one end of the ring as hidden."""
    drawing = ElementTree.fromstring(build(tmp_path, "ring")["ring_alu_x2.svg"])
    for path, size in zip(paths(drawing, "visible")[:3], ((50, 10), (50, 50), (50, 10)), strict=True):
        x0, y0, x1, y1 = path.bbox()
        assert ((x1 - x0) / 2, (y1 - y0) / 2) == pytest.approx(size, rel=0.01), "2 : 1"
