"""Print plates, read by the rules of the 3MF standard and sliced by PrusaSlicer, compared with the files of the parts."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import zipfile
from collections import Counter
from collections.abc import Mapping
from io import BytesIO
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import lib3mf
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from thingc.tools.cli.main import main

CORE = {"m": "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"}
ROBOT = """\
thingc: assembly/1
name: robot
materials:
  pla:
    density: 1240 kg/m^3
    color: teal
    process: {kind: fdm, walls: 3, line_width: 0.45 mm, layer: 0.2 mm, top: 4, bottom: 4, infill: 15 %}
defaults: {component: {material: pla}}
components:
  base: {file: long.stl, process: {infill: 100 %}}
  wedge: {file: wedge.stl, repeat: {count: COUNT}, at: {in: base.origin, xyz: "=0 mm", 0 mm, "=0.1 m * (i + 1)"}, print: {up: [1, 0, 0]}}
  bought: {file: wedge.stl, at: {in: base.origin, xyz: -100 0 0 mm}, bom: {make: buy}}
""".replace('"=0 mm", 0 mm, "=0.1 m * (i + 1)"', '[0 mm, 0 mm, "=0.1 m * (i + 1)"]')
LONG = trimesh.creation.box((40.0, 240.0, 10.0))
"""It fits on the bed only if it is turned."""
WEDGE = trimesh.convex.convex_hull(np.array([[0, 0, 0], [60, 0, 0], [0, 50, 0], [0, 0, 20], [60, 0, 5]], dtype=float))


def build(folder: Path, capsys: pytest.CaptureFixture[str], count: int = 3, bed: str = "", document: str = ROBOT) -> tuple[int, str]:
    """Build the plates of the robot. Return the exit code and the output."""
    LONG.export(folder / "long.stl")
    WEDGE.export(folder / "wedge.stl")
    (folder / "thingc.toml").write_text(f'thingc = "workspace/1"\n{bed}\n')
    (folder / "robot.yaml").write_text(document.replace("COUNT", str(count)))
    folders = ["--store", str(folder / "store"), "-o", str(folder / "out")]
    code = main(["build", str(folder / "robot.yaml"), "--emit", "3mf", *folders, "--force"])
    said = capsys.readouterr()
    return code, said.out + said.err


def plates(folder: Path) -> list[bytes]:
    return [path.read_bytes() for path in sorted((folder / "out" / "robot" / "3mf").iterdir())]


def placed(plate: bytes) -> list[tuple[str, NDArray[np.float64], NDArray[np.float64]]]:
    """Return every item of a plate by the rules of the standard: the name of its object, and the corners of its triangles on the bed
    [mm]."""
    with zipfile.ZipFile(BytesIO(plate)) as archive:
        root = ElementTree.fromstring(archive.read("3D/3dmodel.model"))
    objects: dict[str, tuple[str, NDArray[np.float64], NDArray[np.int64]]] = {}
    for one in root.iterfind(".//m:object", CORE):
        corners = np.array([[float(v.attrib[k]) for k in "xyz"] for v in one.iterfind(".//m:vertex", CORE)])
        faces = np.array([[int(t.attrib[k]) for k in ("v1", "v2", "v3")] for t in one.iterfind(".//m:triangle", CORE)])
        objects[one.attrib["id"]] = one.attrib["name"], corners, faces
    found = []
    for item in root.iterfind(".//m:item", CORE):
        name, corners, faces = objects[item.attrib["objectid"]]
        rows = np.array([float(word) for word in item.attrib["transform"].split()]).reshape(4, 3)
        found.append((name, corners @ rows[:3] + rows[3], faces))
    return found


def test_parts_are_upright_on_the_bed_without_overlaps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert build(tmp_path, capsys)[0] == 0
    (plate,) = plates(tmp_path)
    items = placed(plate)
    assert Counter(name for name, _, _ in items) == {"long": 1, "wedge_x3": 3}
    for name, corners, faces in items:
        source = LONG if name == "long" else WEDGE
        assert trimesh.Trimesh(corners, faces).volume == pytest.approx(source.volume, rel=1e-6), "neither mirrored nor scaled"
        low, high = corners.min(axis=0), corners.max(axis=0)
        assert low[2] == pytest.approx(0.0, abs=1e-6) and (low[:2] >= 2.0).all() and (high[:2] <= (248.0, 208.0)).all()
        size = (240.0, 40.0, 10.0) if name == "long" else (20.0, 50.0, 60.0)  # up is the longest axis of the wedge
        assert high - low == pytest.approx(size, abs=1e-4)
    for (_, one, _), (_, other, _) in combinations(items, 2):
        between = np.maximum(one.min(axis=0) - other.max(axis=0), other.min(axis=0) - one.max(axis=0))[:2]
        assert between.max() >= 4.9, "parts have a gap of 5 mm"
    assert b'displaycolor="#008080"' in zipfile.ZipFile(BytesIO(plate)).read("3D/3dmodel.model")


def test_lib3mf_reads_a_plate_without_warnings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path, capsys)
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromBuffer(plates(tmp_path)[0])
    assert reader.GetWarningCount() == 0
    meshes, names, items = model.GetMeshObjects(), {}, model.GetBuildItems()
    while meshes.MoveNext():
        mesh = meshes.GetCurrentMeshObject()
        names[mesh.GetResourceID()] = mesh.GetName()
        assert mesh.IsManifoldAndOriented() and mesh.IsValid()
    counted: Counter[str] = Counter()
    while items.MoveNext():
        counted[names[items.GetCurrent().GetObjectResourceID()]] += 1
    assert counted == {"long": 1, "wedge_x3": 3}


def test_many_parts_are_on_several_plates_and_the_bytes_are_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path, capsys, count=40)
    made = plates(tmp_path)
    assert len(made) == 2
    assert Counter(name for plate in made for name, _, _ in placed(plate)) == {"long": 1, "wedge_x40": 40}
    build(tmp_path, capsys, count=40)
    assert plates(tmp_path) == made


VARIED = ROBOT.replace("""
defaults:""", """
  petg: {density: 1270 kg/m^3, color: red, process: {layer: 0.3 mm}}
  clear: {density: 1140 kg/m^3, process: {kind: resin, layer: 0.05 mm}}
defaults:""") + """\
  red: {file: wedge.stl, material: petg, at: {in: base.origin, xyz: 0 0 -100 mm}, print: {up: [1, 0, 0]}}
  flat: {file: wedge.stl, at: {in: base.origin, xyz: 0 0 -200 mm}}
  dense: {file: wedge.stl, at: {in: base.origin, xyz: 0 0 -300 mm}, print: {up: [1, 0, 0]}, process: {infill: 80 %}}
  window: {file: wedge.stl, material: clear, at: {in: base.origin, xyz: 0 0 -400 mm}}
  lens: {file: wedge.stl, at: {in: base.origin, xyz: 0 0 -500 mm}, process: {kind: resin}}
"""
"""The robot with further wedges of other materials, directions, settings and kinds of process."""


def test_prints_of_one_definition_with_other_materials_directions_or_settings_are_objects(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    assert build(tmp_path, capsys, document=VARIED)[0] == 0
    filament, resin = plates(tmp_path)
    assert [path.name for path in sorted((tmp_path / "out/robot/3mf").iterdir())] == ["robot_plate_1.3mf", "robot_resin_plate_1.3mf"]
    names = {"long": 1, "wedge_pla_x3": 3, "wedge_petg": 1, "wedge_pla_2": 1, "wedge_pla_3": 1}
    items = placed(filament)
    assert Counter(name for name, _, _ in items) == names
    sizes = {name: np.ptp(corners, axis=0) for name, corners, _ in items if name != "long"}
    for name, size in sizes.items():
        assert size == pytest.approx((60.0, 50.0, 20.0) if name == "wedge_pla_2" else (20.0, 50.0, 60.0), abs=1e-4)
    assert Counter(name for name, _, _ in placed(resin)) == {"wedge_clear": 1, "wedge_pla_4": 1}, "resin has its own plate"
    model, settings = objects(filament)
    assert model == {**dict.fromkeys(names, "pla"), "wedge_petg": "petg"}
    for infill in ("fill_density", "sparse_infill_density"):  # the names of PrusaSlicer and of OrcaSlicer
        assert {name: (keys.get("layer_height"), keys.get(infill)) for name, keys in settings.items()} == {
            "long": ("0.2", "100%"), "wedge_pla_x3": ("0.2", "15%"), "wedge_pla_2": ("0.2", "15%"), "wedge_pla_3": ("0.2", "80%"),
            "wedge_petg": ("0.3", None),
        }
    walls = [(keys.get("perimeters"), keys.get("wall_loops")) for keys in settings.values()]
    assert all(ours == theirs for ours, theirs in walls) and any(ours for ours, _ in walls)
    with zipfile.ZipFile(BytesIO(filament)) as archive:  # OrcaSlicer and Bambu Studio search for this word before they read settings
        model_xml = ElementTree.fromstring(archive.read("3D/3dmodel.model"))
    assert "PrusaSlicer" in model_xml.findtext("m:metadata[@name='Application']", "", CORE)
    main(["print", str(tmp_path / "robot.yaml"), "--store", str(tmp_path / "store"), "--format", "json"])
    rows = {row["part"]: row for row in json.loads(capsys.readouterr().out)["prints"]}
    assert rows.keys() == {"long", "wedge_pla", "wedge_petg", "wedge_pla_2", "wedge_pla_3", "wedge_clear", "wedge_pla_4"}
    assert {name for name, row in rows.items() if row["filament"] is None} == {"wedge_clear", "wedge_pla_4"}
    assert rows["wedge_pla_4"]["time"] is None and rows["wedge_pla_2"]["time"] > 0.0


def objects(plate: bytes) -> tuple[dict[str, str], dict[str, dict[str, str]]]:
    """Return the material and the settings of each object of a plate, by name. Both files must number the objects equally."""
    with zipfile.ZipFile(BytesIO(plate)) as archive:
        model = ElementTree.fromstring(archive.read("3D/3dmodel.model"))
        config = ElementTree.fromstring(archive.read("Metadata/Slic3r_PE_model.config"))
    bases = [one.attrib["name"] for one in model.iterfind(".//m:base", CORE)]
    materials = {one.attrib["name"]: bases[int(one.attrib["pindex"])] for one in model.iterfind(".//m:object", CORE)}
    numbers = [(one.attrib["id"], one.attrib["name"]) for one in model.iterfind(".//m:object", CORE)]
    settings = [(one.attrib["id"], {key.attrib["key"]: key.attrib["value"] for key in one.iterfind("metadata")}) for one in config]
    assert numbers == [(number, keys["name"]) for number, keys in settings]
    return materials, {keys["name"]: keys for _, keys in settings}


def test_a_part_that_does_not_fit_is_an_error_with_its_size(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = build(tmp_path, capsys, bed='bed = ["0.2 m", "200 mm", "210 mm"]')
    assert code == 1 and "error[TC754]" in said
    assert "(40 x 240 x 10 mm) does not fit on the print bed (200 x 200 x 210 mm, of which 2.5 mm at each edge stay free)" in said
    assert "robot.yaml:10:" in said and not (tmp_path / "out" / "robot").exists()
    assert build(tmp_path, capsys, bed='bed = ["250 mm", "210 mm", "59 mm"]')[0] == 1, "the wedge is 60 mm high"


@pytest.mark.parametrize("bed", ['["1 m", "1 m"]', '["1 m", "1 m", "0 mm"]', '["1 m", "1 m", "1 kg"]', "[1, 2, 3]"])
def test_a_bed_has_three_lengths(tmp_path: Path, capsys: pytest.CaptureFixture[str], bed: str) -> None:
    code, said = build(tmp_path, capsys, bed=f"bed = {bed}")
    assert code == 1 and "thingc.toml:2:" in said


@pytest.mark.skipif(shutil.which("prusa-slicer") is None, reason="PrusaSlicer is not installed")
def test_prusaslicer_reads_all_prints_of_one_definition(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    build(tmp_path, capsys, document=VARIED)
    (tmp_path / "plate.3mf").write_bytes(plates(tmp_path)[0])
    report = subprocess.run(["prusa-slicer", "--info", tmp_path / "plate.3mf"], check=True, capture_output=True, text=True).stdout
    sizes = [tuple(float(size) for size in re.findall(r"size_. = (\S+)", one)) for one in report.split("[plate.3mf]")[1:]]
    assert sorted(sizes) == [(20.0, 50.0, 60.0)] * 3 + [(40.0, 240.0, 10.0), (60.0, 50.0, 20.0)]


@pytest.mark.skipif(shutil.which("prusa-slicer") is None, reason="PrusaSlicer is not installed")
def test_prusaslicer_reads_names_instances_and_settings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """PrusaSlicer uses 15 % infill for the wedges and 100 % for the long part, regardless of the preset. Its printing time is similar."""
    build(tmp_path, capsys)
    plate, code = tmp_path / "plate.3mf", tmp_path / "plate.gcode"
    plate.write_bytes(plates(tmp_path)[0])

    def filament(preset: Mapping[str, str]) -> tuple[float, Counter[str], float]:
        settings = {
            "bed_shape": "0x0,250x0,250x210,0x210", "max_print_height": "210", "skirts": "0", "gcode_label_objects": "1",
            "gcode_comments": "0", **preset,
        }
        (tmp_path / "preset.ini").write_text("".join(f"{key} = {value}\n" for key, value in settings.items()))
        words = ["--load", tmp_path / "preset.ini", "--dont-arrange", "--export-gcode", "-o", code, plate]
        subprocess.run(["prusa-slicer", *map(str, words)], check=True, capture_output=True)
        lines = code.read_text().splitlines()
        used = next(float(line.split("=")[1]) for line in lines if line.startswith("; filament used [cm3]"))
        (time,) = (line.split("=")[1] for line in lines if line.startswith("; estimated printing time (normal mode)"))
        seconds = sum(int(number) * {"h": 3600, "m": 60, "s": 1}[unit] for number, unit in re.findall(r"(\d+)([hms])", time))
        return used, Counter(line.split(" id:")[0] for line in {one for one in lines if one.startswith("; printing object")}), seconds

    used, names, seconds = filament({"fill_density": "0%"})
    assert names == {"; printing object long": 1, "; printing object wedge_x3": 3}
    assert filament({"fill_density": "90%"})[0] == pytest.approx(used, rel=1e-6), "the settings of the parts apply, not the preset"
    solid, wedge = LONG.volume / 1e3, WEDGE.volume / 1e3
    assert solid + 0.3 * 3 * wedge < used < solid + 0.9 * 3 * wedge
    assert main(["print", str(tmp_path / "robot.yaml"), "--store", str(tmp_path / "store"), "--format", "json"]) == 0
    prints = json.loads(capsys.readouterr().out)["prints"]
    assert sum(one["number"] * one["time"] for one in prints) == pytest.approx(seconds, rel=0.2)
