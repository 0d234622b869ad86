"""STEP assemblies are imported unchanged. The oracle is build123d, which wrote them: the poses, volumes and boxes of all solids."""

from __future__ import annotations

import copy
import gzip
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
from build123d import Box, Color, Compound, Cylinder, Location, Plane, Pos, Rot, Solid, Vector, export_step, import_step, mirror
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf
from OCP.Interface import Interface_Static
from OCP.TCollection import TCollection_ExtendedString, TCollection_HAsciiString
from OCP.TDataStd import TDataStd_Name
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool
from pxr import Usd

import thingc
from thingc.base.pose import Pose
from thingc.geometry.worker.kernel.integrals import at_origin
from thingc.geometry.worker.kernel.step_assembly import new_document, write_document

Write = Callable[[Any, str], Path]


BASE = Pose(translation=(-0.05, -0.03, -0.002))
"""The pose of the first part, whose frame is the frame of the document."""


def solid(shape: Any, label: str, color: str | None = None, at: Location | None = None) -> Solid:
    """Return a solid with a name, a colour and a location. Copies share the shape."""
    one = copy.copy(shape if isinstance(shape, Solid) else shape.solid())
    one = one if at is None else at * one
    one.label = label
    one.color = None if color is None else Color(color)
    return one


def wedge() -> Solid:
    """Return a solid that differs from its mirror image: a block with a step and an off-centre hole."""
    return (Box(30, 20, 10) + Pos(10, 4, 8) * Box(6, 5, 8) - Pos(-8, 3, 0) * Cylinder(2, 10)).solid()


def robot() -> Compound:
    """Return nested assemblies with repeated parts, unusual names, a rotated copy with its own coordinates, and a mirror image."""
    screw, block = (Cylinder(1.5, 12) + Pos(0, 0, 7) * Cylinder(3, 2)).solid(), wedge()
    turned = Location(Vector(40, 10, 5), Vector(20, 30, 40)) * block
    baked = Solid(turned.moved(Location()).wrapped)
    hands = [Compound(label="Hand/links", children=[
        solid(block, "Träger", "orange"), solid(screw, "M3x12", "gray", Location(Vector(3, 0, 12))),
        solid(screw, "M3x12", "gray", Location(Vector(-3, 0, 12), Vector(90, 0, 0))),
    ]) for _ in range(2)]
    return Compound(label="my robot", children=[
        solid(Box(100, 60, 4), "アーム", "steelblue"), Location(Vector(0, 0, 20)) * hands[0],
        Location(Vector(50, 0, 20), Vector(0, 90, 30)) * hands[1],
        solid(screw, "", "gray", Location(Vector(0, 20, 7))), solid(baked, "null", "orange"),
        solid(mirror(block, Plane.YZ), "mirrored", "orange", Location(Vector(-60, 0, 0))),
    ])


def measured(shape: Compound) -> list[list[float]]:
    """Return the volume, the centre and the box of each solid of an assembly [mm], sorted."""
    rows = []
    for one in shape.solids():
        box = one.bounding_box()
        rows.append([one.volume, *one.center(), *box.min, *box.max])
    return sorted([round(value, 3) for value in row] for row in rows)


def imported_rows(document: Path, into: Pose, store: str) -> list[list[float]]:
    """Return the same rows for the occurrences of a document whose frame is at `into` in the source."""
    rows = []
    compiled = thingc.compile(str(document), store=store)
    assembly = compiled.assembly
    for one in assembly.occurrences:
        pose, record = into @ assembly.rest[one.index], one.record
        assert record is not None and record.brep is not None
        shape = brep(record.brep, store)
        box = (Location(transformation(pose)) * shape).bounding_box()
        rows.append([1e9 * record.volume, *(1000 * value for value in pose.apply(record.centre)), *box.min, *box.max])
    return sorted([round(value, 3) for value in row] for row in rows)


def brep(sha256: str, store: str) -> Compound:
    """Return the shape of a part in the store."""
    from thingc.geometry.store.local import Store
    from thingc.geometry.worker.kernel.step_assembly import load_shape

    return Compound(load_shape(Store(store), sha256))


def transformation(pose: Pose) -> Any:
    from thingc.geometry.worker.kernel.convert import transformation as of_pose

    return of_pose(pose)


def test_assembly_structure_and_geometry_are_imported(run: Any, tmp_path: Path, shared_store: str) -> None:
    source = robot()
    export_step(source, tmp_path / "robot.step")
    code, said = run("import", "robot.step", "-o", "out")
    assert code == 0, said
    assert "4 documents" not in said and "2 documents, 9 components and 4 parts" in said
    assert run("check", "out/my_robot.yaml")[0] == 0
    text, record = (tmp_path / "out/my_robot.yaml").read_text(), json.loads((tmp_path / "out/import.json").read_text())
    assert text.count("assembly: Hand_links.yaml") == 2 and "'アーム' in the source" in text and "'Hand/links' in the source" in text
    assert (tmp_path / "out/Hand_links.yaml").read_text().count("file: parts/M3x12.step") == 2
    assert {part["name"]: part["also"] for part in record["parts"]}["Träger"] == ["null"]
    assert imported_rows(tmp_path / "out/my_robot.yaml", BASE, shared_store) == measured(import_step(tmp_path / "robot.step"))
    assert measured(import_step(tmp_path / "robot.step")) == measured(source)
    again = {path: path.read_bytes() for path in (tmp_path / "out").rglob("*.*")}
    assert run("import", "robot.step", "-o", "two")[0] == 0
    assert again == {tmp_path / "out" / path.relative_to(tmp_path / "two"): path.read_bytes() for path in (tmp_path / "two").rglob("*.*")}


def test_file_unit_is_respected(run: Any, tmp_path: Path, shared_store: str) -> None:
    source = robot()
    Interface_Static.SetCVal_s("write.step.unit", "INCH")
    try:
        export_step(source, tmp_path / "robot.step", write_pcurves=False)
    finally:
        Interface_Static.SetCVal_s("write.step.unit", "MM")
    assert run("import", "robot.step", "-o", "out")[0] == 0
    rows = imported_rows(tmp_path / "out/my_robot.yaml", BASE, shared_store)
    assert np.allclose(rows, measured(source), atol=2e-3)


def test_colours_reach_every_target(run: Any, tmp_path: Path) -> None:
    colors = {"#4682b4": "steelblue", "#ffa500": "orange", "#808080": "gray"}
    export_step(robot(), tmp_path / "robot.step")
    assert run("import", "robot.step", "-o", "out")[0] == 0
    code, said = run("build", "out/my_robot.yaml", "--emit", "mjcf,urdf,sdf,usd,glb,step", "-o", "build")
    assert code == 0, said
    wanted = {tuple(round(int(color[k : k + 2], 16) / 255, 2) for k in (1, 3, 5)) for color in colors}
    for name in ("*.xml", "*.urdf", "*.sdf"):
        text = "\n".join(path.read_text() for path in (tmp_path / "build").rglob(name))
        values = [words.split()[:3] for words in re.findall(r'(?:rgba="|<diffuse>)([\d. ]+)', text)]
        found = {tuple(round(float(value), 2) for value in words) for words in values}
        assert wanted <= found, (name, found)
    linear = {tuple(round(value / 12.92 if value < 0.04 else ((value + 0.055) / 1.055) ** 2.4, 1) for value in one) for one in wanted}
    stage = Usd.Stage.Open(str(next((tmp_path / "build").rglob("*.usda"))))
    inputs = [prim.GetAttribute("inputs:diffuseColor").Get() for prim in stage.Traverse() if prim.HasAttribute("inputs:diffuseColor")]
    assert linear <= {tuple(round(value, 1) for value in color) for color in inputs}
    materials = pygltflib.GLTF2().load(str(next((tmp_path / "build").rglob("*.glb")))).materials
    assert linear <= {tuple(round(value, 1) for value in one.pbrMetallicRoughness.baseColorFactor[:3]) for one in materials}
    shape = import_step(next((tmp_path / "build").rglob("*.step")))
    found = {tuple(round(value, 2) for value in tuple(one.color)[:3]) for one in shape.descendants if one.color is not None}
    assert wanted <= found


def written(path: Path, parts: list[tuple[Any, gp_Trsf | None, str, float, str]]) -> None:
    """Write an assembly with the kernel; each part has a transformation, a material, a density [g/cm^3] and a colour of each solid."""
    document = new_document()
    shapes, materials = XCAFDoc_DocumentTool.ShapeTool_s(document.Main()), XCAFDoc_DocumentTool.MaterialTool_s(document.Main())
    root = shapes.NewShape()
    TDataStd_Name.Set_s(root, TCollection_ExtendedString("rig"))
    for number, (shape, motion, material, density, colors) in enumerate(parts):
        label = shapes.AddShape(at_origin(shape.wrapped), False)
        TDataStd_Name.Set_s(label, TCollection_ExtendedString(f"part {number}"))
        for one, color in zip(shape.solids(), colors.split(), strict=False):
            own = shapes.AddSubShape(label, one.wrapped) if len(shape.solids()) > 1 else label
            value = Color(color).wrapped
            XCAFDoc_DocumentTool.ColorTool_s(document.Main()).SetColor(own, value, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
        if material:
            words = (TCollection_HAsciiString(word) for word in (material, "", "density", "POSITIVE_RATIO_MEASURE"))
            name, about, what, kind = words
            materials.SetMaterial(label, name, about, density, what, kind)
        shapes.AddComponent(root, label, TopLoc_Location(motion or gp_Trsf()))
    shapes.UpdateAssemblies()
    path.write_bytes(write_document(document, "rig"))


def test_part_with_several_colours_becomes_a_nested_document(run: Any, tmp_path: Path) -> None:
    motor = Compound([Box(10, 10, 10).solid(), (Pos(0, 0, 8) * Cylinder(2, 6)).solid()])
    plate = (Pos(0, 0, -7) * Box(30, 30, 4)).solid()
    written(tmp_path / "rig.step", [(motor, None, "", 0.0, "black silver"), (plate, None, "", 0.0, "red")])
    code, said = run("import", "rig.step", "-o", "out")
    assert code == 0 and "2 documents, 4 components and 3 parts" in said
    record = json.loads((tmp_path / "out/import.json").read_text())
    assert sorted(part["colors"][0] for part in record["parts"]) == ["#000000", "#c0c0c0", "#ff0000"]
    assert run("check", f"out/{record['documents'][-1]['file']}")[0] == 0


def test_mirrored_and_scaled_placements(run: Any, tmp_path: Path, shared_store: str) -> None:
    mirrored, larger = gp_Trsf(), gp_Trsf()
    mirrored.SetMirror(gp_Ax2(gp_Pnt(50, 0, 0), gp_Dir(1, 0, 0)))
    larger.SetScale(gp_Pnt(0, 0, 100), 2.0)
    block = wedge()
    written(tmp_path / "rig.step", [(block, motion, "", 0.0, "") for motion in (None, mirrored, larger)])
    assert run("import", "rig.step", "-o", "out")[0] == 0
    image = mirror(block, Plane(origin=(50, 0, 0), z_dir=(1, 0, 0)))
    source = Compound([block, image.solid(), (Pos(0, 0, -100) * block.scale(2.0)).solid()])
    assert imported_rows(tmp_path / "out/rig.yaml", Pose(), shared_store) == measured(source)
    assert len(json.loads((tmp_path / "out/import.json").read_text())["parts"]) == 3


def test_materials_and_densities(run: Any, tmp_path: Path) -> None:
    rows = [("Steel", 7.85), ("Unobtainium", 1.234), ("PLA", 0.0), ("", 0.0), ("Häßlich", 0.0)]
    written(tmp_path / "rig.step", [(Box(10 + k, 9, 8).solid(), None, *row, "") for k, row in enumerate(rows)])
    code, said = run("import", "rig.step", "-o", "out")
    assert code == 0 and "assumed density of 1000 kg/m^3" in said and "`part_3`, `part_4 (Häßlich)`" in said, said
    found = re.findall("    material: (.*)", (tmp_path / "out/rig.yaml").read_text())
    assert found == ["steel", "unobtainium", "pla", "unspecified", "unspecified"]
    assert "unobtainium: {density: 1234 kg/m^3}" in (tmp_path / "out/materials.yaml").read_text() and run("check", "out/rig.yaml")[0] == 0


def test_mounts_are_created_at_features(run: Any, tmp_path: Path) -> None:
    flange = Cylinder(20, 5) - Cylinder(4, 5)
    for k in range(6):
        flange -= Rot(0, 0, 60 * k) * Pos(14, 0, 0) * Cylinder(1.5, 5)
    blind = Box(20, 20, 20) - Pos(0, 0, 7) * Cylinder(3, 6)
    export_step(Compound(label="rig", children=[solid(flange, "flange"), solid(Pos(0, 0, 12.5) * blind, "blind")]), tmp_path / "rig.step")
    assert run("import", "rig.step", "-o", "out")[0] == 0
    mounts = {part["name"]: part["mounts"] for part in json.loads((tmp_path / "out/import.json").read_text())["parts"]}
    assert mounts["flange"]["bolts_1"] == "bolt circle: 6 holes of 3 mm on 28 mm"
    assert mounts["flange"]["hole_1"] == "through hole of 8 mm" and len(mounts["flange"]) == 4
    assert [name for name in mounts["blind"] if not name.startswith("face")] == []
    text = (tmp_path / "out/rig.yaml").read_text()
    assert re.search(r"bolts_1: \{xyz: 0 0 2.5 mm\}", text) and run("check", "out/rig.yaml")[0] == 0


@pytest.mark.parametrize(("content", "options", "code", "expected"), [
    ("one", [], 1, "no assembly structure: it contains one part"), ("damaged", [], 1, "damaged, or is not STEP"),
    ("empty", [], 1, "damaged, or is not STEP"), ("robot", ["--root", "x"], 2, "--root cannot be used with a STEP file"),
    ("missing", [], 2, "cannot read `a.step`: no such file"),
])
def test_file_without_an_assembly_is_an_error(run: Any, tmp_path: Path, content: str, options: list[str], code: int, expected: str) -> None:
    path = tmp_path / "a.step"
    if content in ("one", "robot"):
        export_step(solid(Box(1, 2, 3), "box"), path)
    elif content != "missing":
        path.write_text("ISO-10303-21;\nHEADER;\n" if content == "damaged" else "")
    got, said = run("import", "a.step", "-o", "out", *options)
    assert got == code and expected in said and said.count("error[") == 1 and not (tmp_path / "out").exists()


CADQUERY = [
    [735.1327, 0.0, 0.0, 26.0], [2560.0, 0.0, 0.0, 98.0], [3430.354, -10.0, 0.0, 20.7527], [3430.354, 10.0, 0.0, 20.7527],
    [3960.0, 0.0, 0.0, 91.0], [14206.9805, 0.0, 0.0, 3.0], [16404.1593, 0.0, 0.0, 46.4826],
]
"""Volumes and centres of the solids of `cadquery.step`, as CadQuery computed them [mm]."""


def test_cadquery_assembly_is_imported(run: Any, tmp_path: Path, shared_store: str) -> None:
    """A fork of two separate legs, one with its own coordinates, a pin, and a nested assembly with a slide."""
    (tmp_path / "crane.step").write_bytes(gzip.decompress((Path(__file__).parent / "step" / "cadquery.step.gz").read_bytes()))
    assert run("import", "crane.step")[0] == 0
    rows = imported_rows(tmp_path / "crane/crane.yaml", Pose(), shared_store)
    assert np.allclose(sorted(row[:4] for row in rows), CADQUERY, atol=1e-3)
    parts = json.loads((tmp_path / "crane/import.json").read_text())["parts"]
    assert {part["name"]: (part["colors"], part["also"]) for part in parts}["leg/left"] == (["#ffa500"], ["Bein rechts ü"])
    for document, joint in (("arm", "tube_to_bar"), ("crane", "leg_left_to_arm")):
        code, said = run("joints", f"crane/{document}.yaml", "--write")
        assert code == 0 and said.startswith(f"joints.{joint}: ") and said.count("joints.") == 1
    assert run("check", "crane/crane.yaml")[0] == 0
    assert len(thingc.compile("crane/crane.yaml", store=shared_store).assembly.links) == 3


FREECAD = [
    [72.3823, 17.3205, 10.0, 13.0], [72.3823, 29.4449, 17.0, 13.0], [5206.1451, 11.5435, 6.6646, 12.2276], [23497.3452, 0.0, 0.0, 5.0],
]
"""Volumes and centres of the solids of `freecad.step`, as FreeCAD computed them [mm]."""


def test_freecad_assembly_is_imported(run: Any, tmp_path: Path, shared_store: str) -> None:
    """A base and a nested arm that is rotated by 30 degrees, with two pins, of which the second is a link to the first."""
    (tmp_path / "lift.step").write_bytes(gzip.decompress((Path(__file__).parent / "step" / "freecad.step.gz").read_bytes()))
    assert run("import", "lift.step")[0] == 0
    rows = imported_rows(tmp_path / "lift/lift.yaml", Pose(), shared_store)
    assert np.allclose(sorted(row[:4] for row in rows), FREECAD, atol=1e-3)
    imported = json.loads((tmp_path / "lift/import.json").read_text())
    assert imported["documents"][0]["components"] == {"plate": "plate", "pin": "pin", "pin_2": "pin 2"} and len(imported["parts"]) == 3
    code, said = run("joints", "lift/lift.yaml", "--write")
    assert code == 0 and said.startswith("joints.Sockel_to_Ausleger: ") and said.count("joints.") == 1
