"""The HTML file of a page: its data, how meshes are packed, and that text of documents is never interpreted as HTML."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from msgspec.structs import replace

from conformance.harness import ROOT
from emit import small_robot
from thingc.geometry.store.local import Store
from thingc.geometry.store.meshes import arrays
from thingc.targets.artifact import Artifacts
from thingc.targets.html.emit import emit
from thingc.targets.html.mesh_packing import PackedMeshes
from viewer.conftest import Pages


def element(page: str, name: str) -> str:
    """Return the content of the script element with this id."""
    match = re.search(rf'<script id="{name}"[^>]*>(.*?)</script>', page, re.DOTALL)
    assert match is not None
    return match[1]


def told(made: Artifacts) -> tuple[str, dict[str, Any], bytes]:
    """Return the only page, its data, and its meshes."""
    ((path, data),) = made.files.items()
    assert path == "html/arm.html" and isinstance(data, bytes)
    page = data.decode()
    return page, json.loads(element(page, "thingc-robot")), base64.b64decode(element(page, "thingc-geometry"))


def test_packed_meshes_are_accurate_to_micrometres(tmp_path: Path) -> None:
    """trimesh reads the packed file, including the node that undoes the packing: vertices equal those of the store to half a step of 16
    bits."""
    store = Store(str(tmp_path))
    asked = small_robot.request(small_robot.assembly(store), store)
    packed = PackedMeshes(store)
    meshes = list({surface.solid.sha256: surface.solid for one in asked.assembly.occurrences for surface in one.drawn}.values())
    assert len(meshes) > 1 and [packed.number(mesh) for mesh in (*meshes, meshes[0])] == [*range(len(meshes)), 0]
    scene = trimesh.load_scene(io.BytesIO(packed.glb()), file_type="glb", process=False)
    for mesh in meshes:
        vertices, faces = arrays(store.read(mesh.sha256))
        node = next(node for node in scene.graph.nodes_geometry if scene.graph.get(node)[1] == mesh.sha256)
        scale = np.array(scene.graph.get(node)[0])
        raw = np.asarray(scene.geometry[mesh.sha256].vertices) / (32767 if np.abs(scene.geometry[mesh.sha256].vertices).max() > 1 else 1)
        found = raw @ scale[:3, :3].T + scale[:3, 3]
        half = np.ptp(vertices, axis=0).max() / 2
        assert np.abs(found - vertices).max() <= half / 32767 / 2 * 1.01
        assert np.array_equal(scene.geometry[mesh.sha256].faces, faces)


def test_names_are_escaped(tmp_path: Path) -> None:
    """A name that looks like HTML, ends a script or looks like a placeholder of the template stays plain data in the page."""
    store = Store(str(tmp_path))
    whole = small_robot.assembly(store)
    evil = '</script><img src=x onerror="alert(1)">@SCRIPT@&amp;'
    first, *others = whole.occurrences
    page, data, _ = told(emit(small_robot.request(replace(whole, occurrences=(replace(first, path=evil), *others)), store)))
    assert data["occurrences"][0]["path"] == evil
    assert "<img" not in page and page.count("</script>") == 3


def test_page_is_deterministic_and_loads_nothing(tmp_path: Path) -> None:
    store = Store(str(tmp_path))
    asked = small_robot.request(small_robot.assembly(store), store)
    page, data, _ = told(emit(asked))
    assert told(emit(asked))[0] == page
    assert "@" not in re.sub(r"<script.*?</script>|<style>.*?</style>", "", page, flags=re.DOTALL)
    assert "connect-src 'none'" in page and "default-src 'none'" in page and not re.search(r'(?:src|href)="', page)
    assert [mode["name"] for mode in data["modes"]] == [robot.mode.name for robot in asked.robots]


def test_page_shows_source_locations(pages: Pages) -> None:
    """Document and part file with their lines, relative to the workspace, as found by searching the files."""
    data = json.loads(element((pages.arm / "html/arm.html").read_text(), "thingc-robot"))
    document = (ROOT / "assemblies/arm.yaml").read_text().splitlines()
    plate = next(one for one in data["occurrences"] if one["path"] == "plate")
    assert plate["file"] == "assemblies/arm.yaml" and document[plate["line"] - 1].strip().startswith("plate:")
    made = data["definitions"][plate["definition"]]
    assert made["file"] == "parts/arm.py" and (ROOT / made["file"]).read_text().splitlines()[made["line"] - 1].startswith("class BasePlate")
    cap = next(one for one in data["occurrences"] if one["path"] == "hand/cap")
    assert cap["file"] == "assemblies/end_effector.yaml"
    assert str(ROOT) not in json.dumps(data)


@pytest.mark.parametrize(("robot", "most"), [("arm", 1.5e6), ("minchw", 2e6)])
def test_pages_are_small(pages: Pages, robot: str, most: float) -> None:
    assert (getattr(pages, robot) / f"html/{robot}.html").stat().st_size < most


def test_bundled_script_matches_its_sources() -> None:
    """`make viewer` must be run after the last change of `viewer/`: the digest is computed as in viewer/build.mjs."""
    folder = ROOT / "viewer"
    digest = hashlib.sha256()
    names = [str(path.relative_to(folder)) for path in (folder / "src").rglob("*.ts")]
    for name in sorted([*names, "package-lock.json"]):
        digest.update(f"{name}\n".encode() + (folder / name).read_bytes())
    first = (ROOT / "compiler/thingc/targets/html/page/viewer.js").read_text().partition("\n")[0]
    assert first.endswith(f"sources {digest.hexdigest()}"), "run `make viewer`"


def test_page_contains_the_licence_of_three(pages: Pages) -> None:
    """The MIT licence requires its text in every copy."""
    version = json.loads((ROOT / "viewer/package.json").read_text())["dependencies"]["three"]
    page = (pages.arm / "html/arm.html").read_text()
    assert f"\nthree {version}\n\nThe MIT License\n\nCopyright ©" in page
    assert "The above copyright notice and this permission notice shall be included in" in page
