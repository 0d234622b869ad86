"""Files of the arm, read by other programs: slicers, CAD programs, spreadsheets and graph readers."""

from __future__ import annotations

import csv
import getpass
import hashlib
import io
import json
import platform
import re
import subprocess
import sys
import zipfile
from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import manifold3d
import numpy as np
import pytest
import trimesh

import thingc
from conformance.conftest import ARM
from conformance.harness import ROOT, tree
from thingc.targets.registry import TARGETS

STEP_READER = ROOT / "tests" / "emit" / "read_step.py"
BOUNDS = """
import json, sys
from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.STEPControl import STEPControl_Reader
reader = STEPControl_Reader()
assert reader.ReadFile(sys.argv[1]).name == "IFSelect_RetDone"
reader.TransferRoots()
box = Bnd_Box()
BRepBndLib.AddOptimal_s(reader.OneShape(), box, False, False)
json.dump([list(box.CornerMin().Coord()), list(box.CornerMax().Coord())], sys.stdout)
"""


@pytest.fixture(scope="module")
def compiled(arm: Path, shared_store: str) -> thingc.Compiled:
    return thingc.compile(str(ROOT / ARM), store=shared_store)


def stem(text: str) -> str:
    """Convert `arm:RotorBrace` to `arm.RotorBrace`. With parameters, 8 hexadecimal digits of the text follow."""
    suffix = f"-{hashlib.sha256(text.encode()).hexdigest()[:8]}" if "(" in text else ""
    return text.partition("(")[0].replace(":", ".") + suffix


@pytest.fixture(scope="module")
def manifest(arm: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((arm / "manifest.json").read_text())
    return found


# --- print files ------------------------------------------------------------------------------------------------------


def test_print_files_are_closed_solids_in_millimetres(arm: Path, compiled: thingc.Compiled) -> None:
    """There is one file per definition of a manufactured part. Its volume is exact within the error of the tessellation."""
    records = {o.definition.text: o.record for o in compiled.assembly.occurrences if o.record is not None}
    made = {text: record for text, record in records.items() if record.bom.get("make") != "buy"}
    files = {path.stem: path for path in (arm / "stl").iterdir()}
    assert set(files) == {stem(text) for text in made} and len(files) == 6
    for text, record in made.items():
        mesh = trimesh.load(files[stem(text)])
        assert mesh.is_watertight and mesh.is_winding_consistent
        assert mesh.volume == pytest.approx(1e9 * record.volume, rel=0.01), "outward, in mm"
        np.testing.assert_allclose(mesh.bounds, 1e3 * np.array(record.box), rtol=0, atol=0.1)
        np.testing.assert_allclose(mesh.center_mass, 1e3 * np.array(record.centre), rtol=0, atol=0.2)
        solid = manifold3d.Manifold(manifold3d.Mesh(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32)))
        assert solid.status() == manifold3d.Error.NoError and len(solid.decompose()) == 1


def test_simulation_meshes_are_the_same_solids_in_metres(arm: Path, compiled: thingc.Compiled) -> None:
    for occurrence in compiled.assembly.occurrences:
        if occurrence.record is not None:
            mesh = trimesh.load(arm / "mjcf" / "assets" / f"{stem(occurrence.definition.text)}.obj", force="mesh")
            mesh.merge_vertices(merge_tex=True, merge_norm=True)
            assert mesh.is_watertight and mesh.volume == pytest.approx(occurrence.record.volume, rel=0.015)


# --- STEP -------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def step(arm: Path) -> dict[str, Any]:
    done = subprocess.run([sys.executable, STEP_READER, arm / "step" / "arm.step"], capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_step_file_has_names_poses_and_colours(step: dict[str, Any], compiled: thingc.Compiled) -> None:
    assembly = compiled.assembly
    solid = {o.path: o for o in assembly.occurrences if o.record is not None}
    assert step["name"] == "arm" and set(step["leaves"]) == set(solid)
    for path, occurrence in solid.items():
        leaf, record = step["leaves"][path], occurrence.record
        assert record is not None
        assert leaf["definition"] == occurrence.definition.text.replace("'", "")
        assert leaf["volume"] == pytest.approx(1e9 * record.volume, rel=1e-6)
        centre = np.array(assembly.rest[occurrence.index].rows()) @ [*record.centre, 1]
        np.testing.assert_allclose(leaf["centre"], 1e3 * centre[:3], rtol=0, atol=1e-4)
        assert occurrence.color is not None
        wanted = [int(occurrence.color[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        np.testing.assert_allclose(leaf["color"], wanted, atol=2e-3)


def test_equal_parts_share_one_shape(arm: Path, compiled: thingc.Compiled) -> None:
    definitions = {o.definition.text for o in compiled.assembly.occurrences if o.record is not None}
    assert (arm / "step" / "arm.step").read_bytes().count(b"MANIFOLD_SOLID_BREP(") == len(definitions) == 9


def test_step_file_has_the_size_of_the_robot(arm: Path, compiled: thingc.Compiled) -> None:
    """The bounding box of the STEP file equals that of all placed meshes."""
    done = subprocess.run([sys.executable, "-c", BOUNDS, arm / "step" / "arm.step"], capture_output=True, text=True, check=True)
    points = []
    for occurrence in compiled.assembly.occurrences:
        if occurrence.record is not None:
            file = arm / "mjcf" / "assets" / f"{stem(occurrence.definition.text)}.obj"
            pose = np.array(compiled.assembly.rest[occurrence.index].rows())
            points.append(trimesh.load(file, force="mesh").vertices @ pose[:3, :3].T + pose[:3, 3])
    together = 1e3 * np.vstack(points)
    np.testing.assert_allclose(json.loads(done.stdout), [together.min(axis=0), together.max(axis=0)], rtol=0, atol=0.15)


# --- lists ------------------------------------------------------------------------------------------------------------


def test_bill_of_materials_has_the_mass_of_the_robot(arm: Path, compiled: thingc.Compiled) -> None:
    rows = list(csv.DictReader(io.StringIO((arm / "bom.csv").read_text())))
    assert ",".join(rows[0]) == "number,name,definition,quantity,make,material,mass,mass_source,supplier,cost,total,link,picture"
    assert sum(int(row["quantity"]) * float(row["mass"]) for row in rows) == pytest.approx(compiled.properties.mass, rel=1e-12)
    wanted = Counter(o.definition.text for o in compiled.assembly.occurrences)
    assert {row["definition"]: int(row["quantity"]) for row in rows} == wanted
    entries = json.loads((arm / "bom.json").read_text())
    assert [{key: "" if value is None else str(value) for key, value in entry.items()} for entry in entries] == rows
    assert {row["make"] for row in rows if row["name"] in ("XM430", "Screw")} == {"buy"}
    assert {row["quantity"] for row in rows if "XM430" in row["definition"]} == {"4"}
    assert {row["mass_source"] for row in rows} <= {"measured", "vendor", "stated", "derived", "estimated"}


def test_manifest_lists_every_file(arm: Path, manifest: dict[str, Any], compiled: thingc.Compiled) -> None:
    files = tree(arm)
    del files["manifest.json"]
    assert manifest["files"] == {path: hashlib.sha256(data).hexdigest() for path, data in files.items()}
    assert list(manifest) == ["name", "document", "choice", "versions", "documents", "files", "occurrences", "losses"]
    assert (manifest["name"], manifest["document"]) == ("arm", ARM)
    assert manifest["documents"] == {
        path: hashlib.sha256((ROOT / path).read_bytes()).hexdigest()
        for path in (ARM, "assemblies/end_effector.yaml", "assemblies/materials.yaml")
    }
    assert manifest["choice"] == {
        "modes": ["bench", "drawing", "adrift"], "emit": [name for name, target in TARGETS.items() if target.unasked],
        "parameters": {}, "choices": {},
    }
    assert {entry["path"]: entry["mass"] for entry in manifest["occurrences"]} == {
        o.path: o.properties.mass for o in compiled.assembly.occurrences
    }
    assert all(set(entry) == {"path", "definition", "link", "mass", "mass_source"} for entry in manifest["occurrences"])
    assert {"thingc", "python", "build123d", "mujoco"} <= set(manifest["versions"])


def test_manifest_contains_export_losses(arm: Path, manifest: dict[str, Any]) -> None:
    """The speed limits of the four joints, with their lines in the document. The model contains them as custom data."""
    lines = (ROOT / ARM).read_text().splitlines()
    assert {loss["path"] for loss in manifest["losses"]} == {"yaw", "shoulder", "elbow", "wrist"}
    for loss in manifest["losses"]:
        assert list(loss) == ["target", "mode", "path", "what", "how", "file", "line"]
        assert (loss["target"], loss["how"], loss["file"]) == ("mjcf", "carried as custom data", ARM)
        assert lines[loss["line"] - 1].strip().startswith(f"{loss['path']}:")
        assert f'name="{loss["path"]}:velocity"' in (arm / "mjcf" / "arm_bench.xml").read_text()


def test_files_do_not_depend_on_place_time_or_user(arm: Path, shared_store: str) -> None:
    """Texts, geometry and archives contain no folder of this machine, no user, no host and no date."""
    texts = tree(arm)
    for path in [path for path in texts if path.endswith(".mjz")]:
        with zipfile.ZipFile(io.BytesIO(texts.pop(path))) as archive:
            assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
            assert archive.namelist() == sorted(archive.namelist())
            texts.update({f"{path}/{name}": archive.read(name) for name in archive.namelist()})
    folders = [str(ROOT), str(arm.parent), shared_store, str(Path.home()), sys.prefix, "/tmp/", "/home/", "/root/"]
    people = [name for name in (platform.node(), getpass.getuser()) if len(name) > 4]
    for path, data in texts.items():
        for word in (*folders, *people):
            assert word.encode() not in data, (path, word)
        if not path.endswith((".stl", ".obj")):  # STEP wants a date, and gets the first of the century
            assert set(re.findall(rb"\b20[0-9][0-9]-[01][0-9]-[0-3][0-9]", data)) <= {b"2000-01-01"}, path


# --- the assembly graph -----------------------------------------------------------------------------------------------

USES = Counter({
    ("arm", "arm:BasePlate"): 1,
    ("arm", "thingc_stock.dynamixel:XM430"): 4,
    ("arm", "thingc_stock.fasteners:Screw"): 8,
    ("arm", "arm:YawPitchBracket"): 1,
    ("arm", "frame"): 1,
    ("arm", "arm:RotorBrace"): 4,
    ("arm", "end_effector"): 1,
    ("end_effector", "arm:Hand"): 1,
    ("end_effector", "arm:OmegaCap"): 1,
    ("end_effector", "thingc_stock.fasteners:Screw(size='M3')"): 2,
    ("end_effector", "arm:PenDummy"): 1,
})
"""The number of direct uses of a definition in another one, as in the documents."""


def test_dot_has_every_use(arm: Path) -> None:
    text = (arm / "hag.dot").read_text()
    assert text.startswith("digraph") and text.count("{") == text.count("}")
    nodes = dict(re.findall(r'^  (\w+) \[label="([^"]*)"', text, re.MULTILINE))
    assert len(nodes) == len(set(nodes.values())) == 12, "equal definitions are one node"
    assert Counter((nodes[a], nodes[b]) for a, b in re.findall(r"^  (\w+) -> (\w+) ", text, re.MULTILINE)) == USES
    moved = re.findall(r'label="(\w+)\\njoint (\w+):', text)
    assert moved == [("bracket", "yaw"), ("humerus", "shoulder"), ("forearm", "elbow"), ("hand", "wrist")]


def test_mermaid_has_every_pair(arm: Path) -> None:
    text = (arm / "hag.mmd").read_text()
    assert text.startswith("flowchart ")
    nodes = dict(re.findall(r'^  (\w+)[\[({]+"([^"]*)"', text, re.MULTILINE))
    assert {(nodes[a], nodes[b]) for a, b in re.findall(r'^  (\w+) -->\|"[^|]*"\| (\w+)$', text, re.MULTILINE)} == set(USES)


def test_svg_contains_every_label(arm: Path) -> None:
    picture = ElementTree.parse(arm / "hag.svg").getroot()
    assert picture.tag == "{http://www.w3.org/2000/svg}svg"
    words = " ".join(picture.itertext())
    for pair in USES:
        for name in pair:
            assert name.partition("(")[0].rpartition(":")[2] in words, name
