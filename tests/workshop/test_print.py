"""Supports, walls and print directions of simple solids, compared with closed forms, and the command that lists them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from thingc.geometry.print_support import PrintSolid
from thingc.tools.cli.main import main
from thingc.tools.workshop.plates import upright
from thingc.tools.workshop.print_measurements import thinnest_wall
from workshop.test_plates import placed

Box = list[list[float]]
T_SHAPE = trimesh.boolean.union([
    trimesh.creation.box(bounds=[[20, 20, 0], [30, 30, 31]]), trimesh.creation.box(bounds=[[0, 0, 30], [50, 50, 35]]),
])
"""A plate of 50 mm on a stem of 10 mm, 30 mm high. An area of 24 cm^2 overhangs a volume of 72 cm^3."""
Z = (0.0, 0.0, 1.0)


def stl(mesh: trimesh.Trimesh) -> bytes:
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    return content


def solid(mesh: trimesh.Trimesh) -> PrintSolid:
    return PrintSolid(*upright(stl(mesh), Z))


def union(*boxes: Box) -> trimesh.Trimesh:
    return trimesh.boolean.union([trimesh.creation.box(bounds=box) for box in boxes])


@pytest.mark.parametrize(("up", "area", "volume"), [
    (Z, 2400.0, 72000.0),
    ((0.0, 0.0, -1.0), 0.0, 0.0),
    ((1.0, 0.0, 0.0), 300.0, 6000.0),  # one side of the stem hangs 20 mm above the bed
])
def test_the_space_below_a_plate_is_its_support(up: tuple[float, float, float], area: float, volume: float) -> None:
    assert solid(T_SHAPE).support(up) == pytest.approx((area, volume), rel=1e-3, abs=1e-3)


@pytest.mark.parametrize(("slope", "hangs"), [(40.0, True), (44.0, True), (46.0, False), (60.0, False)])
def test_surfaces_steeper_than_45_degrees_need_no_support(slope: float, hangs: bool) -> None:
    """A cone stands on its tip. Its sides rise at the given angle."""
    run = 10.0 / np.tan(np.radians(slope))
    cone = trimesh.creation.cone(radius=run, height=10.0, sections=64)
    assert (solid(cone).support((0.0, 0.0, -1.0))[0] > 1.0) == hangs


def test_support_of_a_slope_is_the_space_below_it() -> None:
    """A cone stands on its tip. Its sides rise at 40 degrees, and the space around it is the cylinder without the cone."""
    run = 10.0 / np.tan(np.radians(40.0))
    cone = trimesh.creation.cone(radius=run, height=10.0, sections=256)
    assert solid(cone).support((0.0, 0.0, -1.0))[1] == pytest.approx(np.pi * run**2 * 10.0 * 2.0 / 3.0, rel=0.01)


def test_support_rests_on_the_part_below() -> None:
    """A part in the shape of a C: the upper plate overhangs the lower one, 10 mm above it."""
    shape = union([[0, 0, 0], [40, 20, 5]], [[0, 0, 15], [40, 20, 20]], [[0, 0, 1], [5, 20, 19]])
    assert solid(shape).support(Z)[1] == pytest.approx(35 * 20 * 10, rel=1e-3)
    half = union([[0, 0, 0], [20, 20, 5]], [[0, 0, 15], [40, 20, 20]], [[0, 0, 1], [5, 20, 19]])  # the lower plate is shorter
    assert solid(half).support(Z)[1] == pytest.approx(15 * 20 * 10 + 20 * 20 * 15, rel=0.02)


@pytest.mark.parametrize(("mesh", "up"), [
    (T_SHAPE, (0.0, 0.0, -1.0)),  # only this direction needs no support
    (trimesh.creation.box((40.0, 30.0, 5.0)), Z),  # no support in any direction: the largest face, as modelled
    (trimesh.creation.box((5.0, 30.0, 40.0)), (-1.0, 0.0, 0.0)),  # two largest faces: the smaller vector
    (trimesh.creation.cone(radius=20.0, height=15.0, sections=64), Z),
])
def test_the_automatic_direction_has_the_least_support(mesh: trimesh.Trimesh, up: tuple[float, float, float]) -> None:
    best, volume = solid(mesh).least_support()
    assert best == pytest.approx(up, abs=1e-6) and volume == pytest.approx(0.0, abs=1e-6)
    turn = trimesh.transformations.rotation_matrix(1.0, [1.0, 2.0, 3.0])
    if mesh in (T_SHAPE,):  # the direction turns with the part
        assert solid(mesh.copy().apply_transform(turn)).least_support()[0] == pytest.approx(turn[:3, :3] @ up, abs=1e-3)


@pytest.mark.parametrize("wall", [0.4, 0.8, 3.0])
def test_the_thinnest_wall_of_a_tray(wall: float) -> None:
    """One side of a tray is thinner than its other sides and its bottom."""
    tray = trimesh.boolean.difference([
        trimesh.creation.box(bounds=[[0, 0, 0], [40, 30, 20]]), trimesh.creation.box(bounds=[[wall, 4, 4], [36, 26, 21]]),
    ])
    assert thinnest_wall(solid(tray), 100.0) == pytest.approx(wall, abs=1e-5)


def test_the_wall_between_a_hole_and_a_side() -> None:
    """A hole with a diameter of 8 mm, 5 mm from a side, leaves 1 mm. The wall is thinnest along one line."""
    block = trimesh.creation.box(bounds=[[-5, -20, 0], [30, 20, 10]])
    hole = trimesh.creation.cylinder(radius=4.0, height=30.0, sections=128)
    assert thinnest_wall(solid(trimesh.boolean.difference([block, hole])), 100.0) == pytest.approx(1.0, abs=0.01)


def test_edges_are_not_thin_walls() -> None:
    """The faces of a prism enclose 60 degrees. A cone with a slope of 30 degrees is thin at its edge."""
    prism = trimesh.creation.cylinder(radius=20.0, height=20.0, sections=3)
    assert thinnest_wall(solid(prism), 100.0) == pytest.approx(20.0, abs=1e-4)
    cone = trimesh.creation.cone(radius=20.0, height=20.0 * np.tan(np.radians(30.0)), sections=64)
    assert (thinnest_wall(solid(cone), 100.0) or 100.0) < 1.0


def test_an_open_mesh_has_support_down_to_the_bed_and_no_walls() -> None:
    shape = union([[0, 0, 0], [40, 20, 5]], [[0, 0, 15], [40, 20, 20]], [[0, 0, 1], [5, 20, 19]])
    vertices, faces = upright(stl(shape), Z)
    top = (vertices[faces][:, :, 2] > 19.9).all(axis=1)
    opened = PrintSolid(vertices, faces[~top])
    assert opened.support(Z)[1] == pytest.approx(35 * 20 * 15, rel=1e-3) and thinnest_wall(opened, 100.0) is None


def robot(folder: Path, **components: str) -> str:
    """Write a robot of the given components, and return the path of its document."""
    (folder / "tee.stl").write_bytes(stl(T_SHAPE))
    lines = "".join(f"  {name}: {{file: tee.stl, {keys}}}\n" for name, keys in components.items())
    (folder / "robot.yaml").write_text(f"""\
thingc: assembly/1
name: robot
materials:
  pla:
    density: 1250 kg/m^3
    price_per_kg: 24.90 EUR
    process: {{kind: fdm, walls: 3, line_width: 0.5 mm, layer: 0.25 mm, top: 4, bottom: 4}}
defaults: {{component: {{material: pla}}}}
components:
{lines}""")
    return str(folder / "robot.yaml")


def run(folder: Path, capsys: pytest.CaptureFixture[str], command: str, document: str, *options: str) -> str:
    assert main([command, document, "--store", str(folder / "store"), *options]) == 0
    return capsys.readouterr().out


def measured(folder: Path, capsys: pytest.CaptureFixture[str], document: str, *options: str) -> list[dict[str, Any]]:
    prints: list[dict[str, Any]] = json.loads(run(folder, capsys, "print", document, "--format", "json", *options))["prints"]
    return prints


def test_the_command_shows_a_direction_with_less_support(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = robot(
        tmp_path, tee="allow: {TC407: two pieces}", more="at: {in: tee.origin, xyz: 100 0 0 mm}",
        bought="at: {in: tee.origin, xyz: 200 0 0 mm}, bom: {make: buy}",
    )
    (row,) = measured(tmp_path, capsys, document)
    volume = T_SHAPE.volume * 1e-9
    assert (row["part"], row["number"], row["up"]) == ("tee", 2, [0.0, 0.0, 1.0])
    assert row["size"] == pytest.approx([0.05, 0.05, 0.035], abs=1e-6) and row["mass"] == pytest.approx(1250.0 * volume, rel=1e-6)
    assert row["overhang"] == pytest.approx(24e-4, rel=1e-3) and row["support"] == pytest.approx(72e-6, rel=1e-3)
    assert row["filament"] == pytest.approx(volume / (np.pi * 0.875e-3**2), rel=1e-6)
    assert row["thinnest_wall"] == pytest.approx(5e-3, abs=1e-7) and not row["thin"]
    assert row["better_up"] == [0.0, 0.0, -1.0] and row["better_support"] == pytest.approx(0.0, abs=1e-12)
    section = 0.25e-3 * 0.25e-3 + np.pi / 4.0 * 0.25e-3**2  # a square between two half circles
    walls = (2 * 50 * 50 + 4 * 50 * 5 + 4 * 10 * 30) * 1e-6 * 3 * 0.5e-3  # the surface of the plate and of the sides of the stem
    lines = (walls + (volume - walls) / 3.0) / section
    assert row["time"] == pytest.approx(lines / 28e-3 + 140 * 4.0, rel=1e-6), "35 mm are 140 layers"
    assert row["cost"] == f"{24.90 * 1250.0 * volume:.2f} EUR"
    text = run(tmp_path, capsys, "print", document)
    assert "[0, 0, -1] (0.00 cm^3)" in text and row["cost"] in text


def test_time_depends_on_the_process_and_thin_walls_on_the_line_width(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = robot(tmp_path, tee="process: {speed: 56 mm/s, layer_time: 1 s}", more=(
        "process: {line_width: 2.6 mm}, at: {in: tee.origin, xyz: 100 0 0 mm}"
    ))
    fast, wide = measured(tmp_path, capsys, document)
    slow = measured(tmp_path, capsys, robot(tmp_path, tee="material: pla"))[0]
    assert fast["time"] - 140.0 == pytest.approx((slow["time"] - 560.0) / 2.0, rel=1e-6)
    assert wide["thin"] and not fast["thin"], "5 mm are less than two lines of 2.6 mm"
    assert " 5.00 thin " in run(tmp_path, capsys, "print", robot(tmp_path, tee="process: {line_width: 2.6 mm}"))


def test_files_and_mass_use_the_automatic_direction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The stem points up in the STL file and on the plate. The mass is that of the same print with a stated direction."""
    stated = robot(tmp_path, tee="process: {infill: 20 %}, print: {up: [0, 0, -1]}")
    upside_down = measured(tmp_path, capsys, stated)[0]["mass"]
    plain = measured(tmp_path, capsys, robot(tmp_path, tee="process: {infill: 20 %}"))[0]["mass"]
    document = robot(tmp_path, tee="process: {infill: 20 %}, print: {up: auto}")
    (row,) = measured(tmp_path, capsys, document)
    assert row["up"] == [0.0, 0.0, -1.0] and row["mass"] == upside_down != plain and row["better_up"] is None
    run(tmp_path, capsys, "build", document, "--emit", "stl,3mf", "-o", str(tmp_path / "out"))
    mesh = trimesh.load_mesh(next(tmp_path.glob("out/robot/stl/*.stl")))
    ((_, corners, faces),) = placed(next(tmp_path.glob("out/robot/3mf/*.3mf")).read_bytes())
    for made in (mesh, trimesh.Trimesh(corners, faces)):
        high = made.vertices[made.vertices[:, 2] > made.bounds[1, 2] - 1e-3]
        assert np.ptp(high, axis=0)[:2] == pytest.approx([10.0, 10.0], abs=1e-3), "the end of the stem"
        assert made.volume == pytest.approx(T_SHAPE.volume, rel=1e-6)


def test_a_mirrored_assembly_has_its_own_automatic_direction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot(tmp_path, tee="print: {up: auto}")
    (tmp_path / "pair.yaml").write_text(
        "thingc: assembly/1\nname: pair\ncomponents:\n  one: {assembly: robot.yaml, mirror: z}\n",
    )
    (row,) = measured(tmp_path, capsys, str(tmp_path / "pair.yaml"))
    assert row["up"] == [0.0, 0.0, 1.0] and row["support"] == pytest.approx(0.0, abs=1e-12), "the stem points down in the part"


def test_a_locked_robot_has_the_mass_of_the_automatic_direction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = robot(tmp_path, tee="process: {infill: 20 %}, print: {up: auto}")
    before = json.loads(run(tmp_path, capsys, "info", document, "--format", "json"))["mass"]
    run(tmp_path, capsys, "lock", str(tmp_path))
    assert '"up":"auto"' in re.sub(r"\s", "", (tmp_path / "parts.lock.json").read_text())
    locked = json.loads(run(tmp_path, capsys, "info", document, "--no-code", "--format", "json"))["mass"]
    assert locked == pytest.approx(before, rel=1e-9)
