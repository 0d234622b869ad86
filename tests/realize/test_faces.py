"""The `faces` limit on the triangles of simulation meshes: the result, its deviation, and that all other properties use the whole file."""

from __future__ import annotations

import hashlib
import io
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import trimesh
from build123d import Cylinder, export_step

from graph import builder
from thingc.geometry.key import versions
from thingc.geometry.record import Mesh, PartDefinition, PartFailure, PartRecord, definition_text
from thingc.geometry.worker.kernel.meshing import Triangles
from thingc.geometry.worker.kernel.simplifying import deviation, simplify
from thingc.geometry.worker.part_session import NoPart
from thingc.model.resolve.types import Overrides


def filed(name: str, faces: int | None) -> PartDefinition:
    given = {} if faces is None else {"faces": faces}
    return PartDefinition(
        reference=name, kind="file", parameters=tuple(given.items()), text=definition_text(name, dict(given), {}), label=name,
    )


def bumpy(subdivisions: int = 2) -> Any:
    """Return a sphere of 50 mm with bumps, by default 320 triangles."""
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=50.0)
    x, y, z = (sphere.vertices / 50.0).T
    return trimesh.Trimesh(sphere.vertices * (1.0 + 0.1 * np.sin(5 * x) * np.cos(4 * y) + 0.05 * np.sin(7 * z))[:, None], sphere.faces)


def plate() -> Any:
    """Return a box of 100 mm by 60 mm by 20 mm whose sides are divided into 12 288 triangles."""
    found = trimesh.creation.box((100.0, 60.0, 20.0))
    for _ in range(5):
        found = found.subdivide()
    return found


def ring() -> Any:
    """Return a ring with an outer radius of 40 mm: 1600 triangles, many of them long and thin."""
    return trimesh.creation.annulus(20.0, 40.0, 10.0, sections=200)


def of(mesh: Any) -> Triangles:
    return Triangles(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64))


def read(store: Any, mesh: Mesh) -> Any:
    """Read a mesh of the store with trimesh."""
    return trimesh.load_mesh(io.BytesIO(store.read(mesh.sha256)), file_type="obj")


@pytest.fixture(scope="module")
def records(module_place: Any) -> dict[str, PartRecord | PartFailure]:
    bumpy().export(module_place.root / "scan.stl")
    export_step(Cylinder(10.0, 40.0), module_place.root / "rod.step")
    wanted = [
        filed("scan.stl", None), filed("scan.stl", 280), filed("scan.stl", 60), filed("scan.stl", 400), filed("rod.step", 60),
        filed("scan.stl", 280).mirror_image("x"),
    ]
    with module_place.service() as service:
        found: dict[str, PartRecord | PartFailure] = service.realize(wanted, convex={"scan.stl(faces=60)": (0,)})
    return found


def record(records: dict[str, PartRecord | PartFailure], text: str) -> PartRecord:
    found = records[text]
    assert isinstance(found, PartRecord), found
    return found


def test_simulation_meshes_are_limited_and_closed(records: dict[str, PartRecord | PartFailure], module_place: Any) -> None:
    scan = record(records, "scan.stl(faces=280)")
    assert scan.warnings == ()
    for name in ("visual", "simulation", "hull"):
        mesh = read(module_place.store, scan.meshes[name])
        assert mesh.is_watertight and mesh.is_winding_consistent and len(mesh.faces) == scan.meshes[name].faces <= 280
    coarse = read(module_place.store, scan.meshes["simulation"])
    assert coarse.volume == pytest.approx(bumpy().volume * 1e-9, rel=0.02) and len(coarse.faces) > 260
    near = trimesh.triangles.closest_point  # every corner of the file to every triangle of these
    corners, triangles = bumpy().vertices / 1000.0, coarse.triangles
    apart = [np.linalg.norm(near(triangles, np.tile(corner, (len(triangles), 1))) - corner, axis=1).min() for corner in corners[::4]]
    assert max(apart) < 0.01 * 0.11


def test_other_properties_use_the_whole_file(records: dict[str, PartRecord | PartFailure], module_place: Any) -> None:
    whole, fewer = record(records, "scan.stl"), record(records, "scan.stl(faces=280)")
    assert fewer.volume == pytest.approx(bumpy().volume * 1e-9, rel=1e-6)
    for name in ("print", "mesh"):
        assert fewer.meshes[name] == whole.meshes[name] and fewer.meshes[name].faces == 320
    assert (fewer.brep, fewer.inertia, fewer.box, fewer.fits) == (whole.brep, whole.inertia, whole.box, whole.fits)
    assert "simulation" not in whole.meshes and whole.meshes["visual"].faces == 320


def test_limit_above_the_face_count_changes_no_mesh(records: dict[str, PartRecord | PartFailure]) -> None:
    whole, same = record(records, "scan.stl"), record(records, "scan.stl(faces=400)")
    assert same.meshes == {**whole.meshes, "simulation": whole.meshes["mesh"]}


def test_contact_geometry_uses_the_limited_mesh(records: dict[str, PartRecord | PartFailure], module_place: Any) -> None:
    """`collision: mesh` and the convex pieces use the limited mesh: the corners of the pieces are inside it. MuJoCo loads all triangles."""
    scan, coarsest = record(records, "scan.stl(faces=280)"), record(records, "scan.stl(faces=60)")
    chosen = Overrides(collision="mesh")
    occurrence = builder.occurrence(0, "scan", filed("scan.stl", 280), scan, overrides=chosen, origin=builder.where(1))
    assert [surface.solid for surface in occurrence.touching] == [scan.meshes["simulation"]]
    low, high = read(module_place.store, coarsest.meshes["simulation"]).bounds
    pieces = [read(module_place.store, piece) for piece in coarsest.convex.get(0, ())]
    assert pieces and all((low - 1e-6 <= piece.bounds[0]).all() and (piece.bounds[1] <= high + 1e-6).all() for piece in pieces)
    assets = {"seen.obj": module_place.store.read(scan.meshes["visual"].sha256)}
    assets["touched.obj"] = module_place.store.read(scan.meshes["simulation"].sha256)
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><mesh file="seen.obj"/><mesh file="touched.obj"/></asset><worldbody><body><geom type="mesh" mesh="seen"/>'
        '<geom type="mesh" mesh="touched"/></body></worldbody></mujoco>', assets,
    )
    assert model.mesh_facenum.tolist() == [scan.meshes["visual"].faces, scan.meshes["simulation"].faces]
    assert model.body_mass[1] / 2000.0 == pytest.approx(bumpy().volume * 1e-9, rel=0.02)


def test_curved_surfaces_of_step_files_are_limited(records: dict[str, PartRecord | PartFailure], module_place: Any) -> None:
    rod = record(records, "rod.step(faces=60)")
    coarse = read(module_place.store, rod.meshes["simulation"])
    assert len(coarse.faces) <= 60 and coarse.is_watertight
    assert rod.volume == pytest.approx(np.pi * 0.01**2 * 0.04, rel=1e-9)


def test_mirror_image_is_limited(records: dict[str, PartRecord | PartFailure], module_place: Any) -> None:
    image = record(records, "scan.stl(faces=280, mirror=x)")
    mesh = read(module_place.store, image.meshes["simulation"])
    assert len(mesh.faces) <= 280 and mesh.is_watertight and mesh.volume > 0.0


def test_large_deviation_is_reported(records: dict[str, PartRecord | PartFailure], module_place: Any) -> None:
    """The reported deviation is compared with the distances from all corners of each mesh to all triangles of the other."""
    scan = record(records, "scan.stl(faces=60)")
    coarse = read(module_place.store, scan.meshes["simulation"])
    (warning,) = scan.warnings
    said = re.fullmatch(
        r"the simulation mesh \((\d+) triangles\) deviates from the part by up to ([\d.]+) mm; increase `faces`", warning.message,
    )
    assert said is not None and int(said[1]) == len(coarse.faces) <= 60
    metres = bumpy().apply_scale(0.001)
    apart = [
        np.linalg.norm(trimesh.triangles.closest_point(to.triangles, np.tile(corner, (len(to.faces), 1))) - corner, axis=1).min()
        for of_, to in ((metres, coarse), (coarse, metres)) for corner in of_.vertices
    ]
    assert float(said[2]) == pytest.approx(max(apart) * 1000.0, rel=0.06)


# --- meshes that are hard to simplify ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("made", "faces", "off"), [(plate(), 500, 0.0), (ring(), 300, 0.6), (bumpy(3), 300, 2.5)])
def test_simplified_surfaces_stay_closed(made: Any, faces: int, off: float) -> None:
    found = simplify(of(made), faces)
    mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
    assert len(mesh.faces) <= faces and mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(made.volume, rel=0.03)
    assert deviation(of(made), found) <= off + 1e-9


def test_touching_bodies_stay_closed() -> None:
    """Two boxes share an edge, which then has four triangles."""
    one, other = trimesh.creation.box((1, 1, 1)).subdivide().subdivide(), trimesh.creation.box((1, 1, 1)).subdivide().subdivide()
    other.apply_translation((1, 1, 0))
    both = trimesh.util.concatenate([one, other])
    both.merge_vertices()
    found = simplify(of(both), 200)
    assert found.closed and len(found.faces) <= 200 and found.volume == pytest.approx(2.0, rel=1e-6)


def test_limit_that_cannot_be_reached_is_an_error() -> None:
    """A torus needs more triangles to keep its hole."""
    torus = of(trimesh.creation.torus(10.0, 3.0))
    with pytest.raises(NoPart, match=r"8 triangles would leave gaps in the surface") as refused:
        simplify(torus, 8)
    assert refused.value.kind == "unbounded"


def test_deviation_between_two_cubes() -> None:
    """One cube is inside a larger one: the corners are sqrt(3) apart, the faces 1."""
    small, large = trimesh.creation.box((10, 10, 10)), trimesh.creation.box((12, 12, 12))
    assert deviation(of(small), of(large)) == pytest.approx(np.sqrt(3.0), abs=1e-9)
    assert deviation(of(small), of(small)) == pytest.approx(0.0, abs=1e-9)


SIMPLIFIED = """
import hashlib, sys
import numpy as np
from thingc.geometry.worker.lazy_build123d import import_cheaply
import_cheaply("build123d")
from thingc.geometry.worker.kernel.meshing import Triangles
from thingc.geometry.worker.kernel.simplifying import simplify
mesh = np.load(sys.argv[1])
found = simplify(Triangles(mesh["vertices"], mesh["faces"]), 170)
print(hashlib.sha256(found.vertices.tobytes() + found.faces.tobytes()).hexdigest())
"""


def test_simplification_is_deterministic(tmp_path: Path) -> None:
    """The mesh is also simplified in another process with a different hash seed."""
    mesh = of(bumpy())
    np.savez(tmp_path / "mesh.npz", vertices=mesh.vertices, faces=mesh.faces)
    here = simplify(mesh, 170)
    digest = hashlib.sha256(here.vertices.tobytes() + here.faces.tobytes()).hexdigest()
    command = [sys.executable, "-c", SIMPLIFIED, str(tmp_path / "mesh.npz")]
    done = subprocess.run(command, env={"PYTHONHASHSEED": "1"}, check=True, capture_output=True, text=True)
    assert done.stdout.strip() == digest


def test_new_trimesh_version_rebuilds_file_parts(module_place: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    (module_place.root / "crumb.stl").write_bytes(trimesh.creation.box((4, 5, 6)).export(file_type="stl"))
    with module_place.service() as service:
        service.realize([filed("crumb.stl", None)])
        assert service.in_store(filed("crumb.stl", None))
    there = {**versions._installed_versions(), "trimesh": "99"}
    monkeypatch.setattr(versions, "_installed_versions", lambda: there)
    with module_place.service() as service:
        service.realize([filed("crumb.stl", None)])
        assert service.decisions["crumb.stl"].reason == f"trimesh changed from {trimesh.__version__} to 99"
