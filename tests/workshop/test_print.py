"""Supports of prints, compared with closed forms, and the command that lists them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from thingc.tools.cli.main import main
from thingc.tools.workshop.plates import upright
from thingc.tools.workshop.supports import support_of

T_SHAPE = trimesh.boolean.union([
    trimesh.creation.box(bounds=[[20, 20, 0], [30, 30, 31]]), trimesh.creation.box(bounds=[[0, 0, 30], [50, 50, 35]]),
])
"""A plate of 50 mm on a stem of 10 mm, 30 mm high. An area of 24 cm^2 overhangs a volume of 72 cm^3."""


def stl(mesh: trimesh.Trimesh) -> bytes:
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    return content


@pytest.mark.parametrize(("up", "area", "volume"), [
    ((0.0, 0.0, 1.0), 2400.0, 72000.0),
    ((0.0, 0.0, -1.0), 0.0, 0.0),
    ((1.0, 0.0, 0.0), 300.0, 6000.0),  # one side of the stem hangs 20 mm above the bed
])
def test_the_space_below_a_plate_is_its_support(up: tuple[float, float, float], area: float, volume: float) -> None:
    found = support_of(*upright(stl(T_SHAPE), up))
    assert found.area == pytest.approx(area, abs=1e-3)
    assert found.volume == pytest.approx(volume, rel=0.02, abs=1e-6)


@pytest.mark.parametrize(("slope", "hangs"), [(40.0, True), (44.0, True), (46.0, False), (60.0, False)])
def test_surfaces_steeper_than_45_degrees_need_no_support(slope: float, hangs: bool) -> None:
    """A cone stands on its tip. Its sides rise at the given angle."""
    run = 10.0 / np.tan(np.radians(slope))
    cone = trimesh.creation.cone(radius=run, height=10.0, sections=64)
    assert (support_of(*upright(stl(cone), (0.0, 0.0, -1.0))).area > 1.0) == hangs


def test_support_rests_on_the_part_below() -> None:
    """A part in the shape of a C: the upper plate overhangs the lower one, 10 mm above it."""
    shape = trimesh.boolean.union([
        trimesh.creation.box(bounds=[[0, 0, 0], [40, 20, 5]]), trimesh.creation.box(bounds=[[0, 0, 15], [40, 20, 20]]),
        trimesh.creation.box(bounds=[[0, 0, 1], [5, 20, 19]]),
    ])
    assert support_of(*upright(stl(shape), (0.0, 0.0, 1.0))).volume == pytest.approx(35 * 20 * 10, rel=0.02)


def test_the_command_shows_a_direction_with_less_support(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "tee.stl").write_bytes(stl(T_SHAPE))
    (tmp_path / "robot.yaml").write_text("""\
thingc: assembly/1
name: robot
materials: {pla: {density: 1250 kg/m^3}}
components:
  tee: {file: tee.stl, material: pla}
  more: {file: tee.stl, material: pla, at: {in: tee.origin, xyz: 100 0 0 mm}}
  bought: {file: tee.stl, material: pla, at: {in: tee.origin, xyz: 200 0 0 mm}, bom: {make: buy}}
""")
    assert main(["print", str(tmp_path / "robot.yaml"), "--store", str(tmp_path / "store"), "--format", "json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["prints"]
    volume = T_SHAPE.volume * 1e-9
    assert (row["part"], row["number"], row["up"]) == ("tee", 2, [0.0, 0.0, 1.0])
    assert row["size"] == pytest.approx([0.05, 0.05, 0.035], abs=1e-6) and row["mass"] == pytest.approx(1250.0 * volume, rel=1e-6)
    assert row["overhang"] == pytest.approx(24e-4, rel=1e-3) and row["support"] == pytest.approx(72e-6, rel=0.02)
    assert row["filament"] == pytest.approx(volume / (np.pi * 0.875e-3**2), rel=1e-6)
    assert row["better_up"] == [0.0, 0.0, -1.0] and row["better_support"] == pytest.approx(0.0, abs=1e-12)
    assert main(["print", str(tmp_path / "robot.yaml"), "--store", str(tmp_path / "store")]) == 0
    assert "up: [0, 0, -1] (0.00 cm^3)" in capsys.readouterr().out
