"""Outlines of flat parts, read with ezdxf, against closed forms and the integrals of the CAD kernel over the parts."""

from __future__ import annotations

import json
import math
from collections import Counter
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.special import ellipe

from thingc.tools.cli.main import main

PARTS = '''\
from build123d import *

BLIND = Pos(20, 10, 1) * Cylinder(6, 2)

def plate():
    body = extrude(RectangleRounded(100, 60, 8), 3) - extrude(Pos(-20, 0) * SlotOverall(30, 8), 3)
    holes = [Pos(x, y, 1.5) * Cylinder(2.1, 3) for x in (40, -40) for y in (20, -20)]
    return body - holes

def turned():
    """The plate in any direction, far away from the origin."""
    return Pos(300, -200, 100) * Rot(30, 40, 50) * plate()

def engraved():
    """Three holes of different radii, a counterbore and a rectangular pocket in the upper side."""
    body = Pos(0, 0, -2) * Box(100, 60, 4)
    holes = [Pos(x, y, -2) * Cylinder(r, 4) for x, y, r in ((0, 0, 3), (40, 0, 4), (0, 20, 5))]
    return body - holes - Pos(40, 0, -0.5) * Cylinder(7, 1) - Pos(-30, -15, -1) * Box(20, 10, 2)

def below():
    """Engraved from below."""
    return Rot(180, 0, 0) * engraved()

def oval():
    return extrude(Ellipse(40, 25), 2)

def chamfered():
    return chamfer(Box(50, 50, 3).edges().group_by(Axis.Z)[-1], 1)

def both():
    return Box(50, 50, 6) - Pos(0, 0, 3) * Cylinder(5, 2) - Pos(10, 0, -3) * Cylinder(5, 2)

def two():
    return Box(50, 50, 3) + Pos(100, 0, 0) * Box(50, 50, 3)

def shaft():
    return Cylinder(3, 80)

def boss():
    return Box(80, 80, 3) + Pos(0, 0, 3) * Cylinder(10, 3)

def ball():
    return Sphere(10)
'''
ROBOT = """\
thingc: assembly/1
name: robot
materials: {alu: {density: 2700 kg/m^3}, steel: {density: 7850 kg/m^3}}
defaults: {component: {material: alu}}
components:
  base: {part: flat:PART}
"""
PLATE_AREA = 100 * 60 - (4 - math.pi) * 64 - 4 * math.pi * 2.1**2 - (22 * 8 + math.pi * 16)
PLATE_PERIMETER = 2 * (84 + 44) + 2 * math.pi * 8 + 4 * 2 * math.pi * 2.1 + (2 * 22 + 2 * math.pi * 4)
Points = NDArray[np.float64]


def build(folder: Path, robot: str) -> dict[str, Any]:
    """Build the files of a robot, and return them as drawings of ezdxf by name."""
    (folder / "parts").mkdir(exist_ok=True)
    (folder / "parts/flat.py").write_text(PARTS)
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (folder / "robot.yaml").write_text(robot)
    folders = ["--store", str(folder / "store"), "-o", str(folder / "out")]
    assert main(["build", str(folder / "robot.yaml"), "--emit", "dxf,bom", *folders]) == 0
    drawings = {path.name: ezdxf.readfile(path) for path in sorted((folder / "out/robot").glob("dxf/*.dxf"))}
    for drawing in drawings.values():
        assert not drawing.audit().has_errors and drawing.units == ezdxf.units.MM
    return drawings


def lost(folder: Path) -> list[tuple[str, str]]:
    manifest = json.loads((folder / "out/robot/manifest.json").read_text())
    return [(one["path"], one["what"]) for one in manifest["losses"] if one["target"] == "dxf"]


def points_of(entity: Any) -> Points:
    """Points on an entity, which are exact up to the curvature of steps of 1e-4 of its range."""
    steps = np.linspace(0.0, 1.0, 10001)
    if entity.dxftype() == "LINE":
        return np.array([entity.dxf.start.vec2, entity.dxf.end.vec2])
    if entity.dxftype() == "SPLINE":
        return np.array([(p.x, p.y) for p in entity.construction_tool().points(steps * entity.knots[-1])])
    first, last = (0.0, 360.0) if entity.dxftype() == "CIRCLE" else (entity.dxf.start_angle, entity.dxf.end_angle)
    angles = np.radians(first + steps * ((last - first) % 360.0 or 360.0))
    return np.array(entity.dxf.center.vec2) + entity.dxf.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def loops_of(drawing: Any, layer: str = "CUT") -> list[Points]:
    """Return the closed outlines in a layer. Every end of an entity must meet exactly one other end."""
    rest = [points_of(one) for one in drawing.modelspace().query(f'*[layer=="{layer}"]')]
    loops: list[Points] = []
    while rest:
        loop = rest.pop()
        while np.linalg.norm(loop[0] - loop[-1]) > 1e-6:
            (index, at_end), = [(k, e) for k, one in enumerate(rest) for e in (0, -1) if np.linalg.norm(one[e] - loop[-1]) < 1e-6]
            more = rest.pop(index)
            loop = np.concatenate([loop, (more[::-1] if at_end else more)[1:]])
        loops.append(loop)
    return sorted(loops, key=lambda loop: -abs(area(loop)))


def area(loop: Points) -> float:
    x, y = loop.T
    return float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) / 2.0


def measured(drawing: Any) -> tuple[float, float]:
    """Return the area inside the largest outline and outside all others, and the length of all outlines."""
    outer, *holes = loops_of(drawing)
    length = sum(float(np.linalg.norm(np.diff(loop, axis=0), axis=1).sum()) for loop in (outer, *holes))
    return abs(area(outer)) - sum(abs(area(hole)) for hole in holes), length


@pytest.mark.parametrize("name", ["plate", "turned"])
def test_the_outline_of_a_plate(tmp_path: Path, name: str) -> None:
    drawings = build(tmp_path, ROBOT.replace("PART", name))
    (drawing,) = drawings.values()
    assert [*drawings] == [f"{name}_3mm_alu.dxf"] and lost(tmp_path) == []
    assert measured(drawing) == pytest.approx((PLATE_AREA, PLATE_PERIMETER), rel=1e-6)
    kinds = Counter((one.dxftype(), round(getattr(one.dxf, "radius", 0.0), 9), one.dxf.layer) for one in drawing.modelspace())
    assert kinds == {("LINE", 0, "CUT"): 6, ("ARC", 8, "CUT"): 4, ("ARC", 4, "CUT"): 2, ("CIRCLE", 2.1, "CUT"): 4}
    (row,) = json.loads((tmp_path / "out/robot/bom.json").read_text())
    assert row["mass"] == pytest.approx(2700e-9 * 3 * measured(drawing)[0], rel=1e-6), "the volume that the kernel integrates"


def holes(drawing: Any) -> dict[float, Points]:
    return {one.dxf.radius: np.array(one.dxf.center.vec2) for one in drawing.modelspace().query('CIRCLE[layer=="CUT"]')}


def turn(drawing: Any) -> float:
    """Return twice the signed area of the triangle from the smallest to the largest hole."""
    (_, a), (_, b), (_, c) = sorted(holes(drawing).items())
    return float(np.cross([*(b - a), 0.0], [*(c - a), 0.0])[2])


@pytest.mark.parametrize(("part", "expected"), [("flat:engraved", 800.0), ("flat:below", 800.0), ("flat:engraved, mirror: x", -800.0)])
def test_pockets_are_engraved_and_seen_from_their_side(tmp_path: Path, part: str, expected: float) -> None:
    (drawing,) = build(tmp_path, ROBOT.replace("flat:PART", part)).values()
    assert measured(drawing)[0] == pytest.approx(6000 - math.pi * (9 + 16 + 25), rel=1e-6)
    assert sorted(holes(drawing)) == pytest.approx([3, 4, 5], abs=1e-9) and turn(drawing) == pytest.approx(expected, rel=1e-9)
    engraved = drawing.modelspace().query('*[layer=="ENGRAVE"]')
    assert Counter(one.dxftype() for one in engraved) == {"LINE": 4, "CIRCLE": 1}, "the edge of the hole is not engraved again"
    assert [abs(area(loop)) for loop in loops_of(drawing, "ENGRAVE")] == pytest.approx([200, math.pi * 49], rel=1e-6)


def test_other_curves_are_splines(tmp_path: Path) -> None:
    (drawing,) = build(tmp_path, ROBOT.replace("PART", "oval")).values()
    assert {one.dxftype() for one in drawing.modelspace()} == {"SPLINE"}
    assert measured(drawing) == pytest.approx((math.pi * 40 * 25, 4 * 40 * ellipe(1 - (25 / 40) ** 2)), rel=1e-6)


@pytest.mark.parametrize(("name", "reason"), [
    ("chamfered", "it has a face that is neither parallel nor perpendicular to its largest face"), ("two", "it has 2 solids"),
    ("shaft", "it is too thick for its area (80 mm for 28.2743 mm^2)"), ("both", "it has pockets on both sides"),
    ("ball", "it has no planar faces"),
    ("boss", "it has the full thickness in less than half of its area"),
])
def test_other_parts_are_losses(tmp_path: Path, name: str, reason: str) -> None:
    assert build(tmp_path, ROBOT.replace("PART", name)) == {}
    assert lost(tmp_path) == [("base", f"`flat:{name}` is not flat: {reason}")]


def test_names_contain_thickness_material_and_number(tmp_path: Path) -> None:
    more = "  more: {part: flat:plate, repeat: {count: 3}, at: {in: base.origin, xyz: [0 mm, 0 mm, =10 mm * (i + 1)]}}\n"
    other = "  other: {part: flat:plate, material: steel, at: {in: base.origin, xyz: 0 0 90 mm}}\n"
    bought = "  bought: {part: flat:oval, bom: {make: buy}, at: {in: base.origin, xyz: 0 0 99 mm}}\n"
    robot = ROBOT.replace("PART", "plate") + more + other + bought
    assert [*build(tmp_path, robot)] == ["plate_3mm_alu_x4.dxf", "plate_3mm_steel.dxf"]
    content = {path.name: path.read_bytes() for path in (tmp_path / "out/robot/dxf").iterdir()}
    (tmp_path / "again").mkdir()
    build(tmp_path / "again", robot)
    assert content == {path.name: path.read_bytes() for path in (tmp_path / "again/out/robot/dxf").iterdir()}


def test_the_edges_of_a_mesh_are_straight(tmp_path: Path) -> None:
    trimesh.creation.box((50.0, 50.0, 3.0)).export(tmp_path / "sheet.stl")
    (drawing,) = build(tmp_path, ROBOT.replace("part: flat:PART", "file: sheet.stl")).values()
    assert [one.dxftype() for one in drawing.modelspace()] == ["LINE"] * 4 and measured(drawing) == pytest.approx((2500, 200), rel=1e-6)


def test_robot_of_bought_parts_is_a_loss(tmp_path: Path) -> None:
    assert build(tmp_path, ROBOT.replace("flat:PART", "flat:plate, bom: {make: buy}")) == {}
    assert lost(tmp_path) == [("robot", "all parts of the robot are bought or have no geometry")]
