"""Print files: one STL per manufactured definition, in millimetres, closed and facing outwards."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
import trimesh
from msgspec.structs import replace

from emit.small_robot import assembly, part, request
from thingc.base.diagnostics import Code
from thingc.geometry.store.local import Store
from thingc.model.assembly.hag import Definition
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.types import BomEntry, Overrides
from thingc.targets.artifact import Loss, StoredArtifact
from thingc.targets.stl.emit import emit

BRACE = f"stl/arm.Brace-{hashlib.sha256(b'arm:Brace(length=0.12)').hexdigest()[:8]}.stl"


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(str(tmp_path))


def with_changes(whole: Assembly, path: str, **more: object) -> Assembly:
    return replace(whole, occurrences=tuple(replace(o, **more) if o.path == path else o for o in whole.occurrences))  # type: ignore[arg-type]


def test_one_file_per_manufactured_definition(store: Store) -> None:
    asked = request(assembly(store), store)
    made = emit(asked)
    assert list(made.files) == [BRACE, "stl/arm.Cap.stl", "stl/arm.Palm.stl", "stl/arm.Plate.stl", "stl/cad.motor.step.stl"]
    assert made.losses == () and asked.report.diagnostics == []


def test_files_are_closed_solids_in_millimetres(store: Store, tmp_path: Path) -> None:
    """trimesh reads a watertight mesh with the volume and extents of the brace."""
    made = emit(request(assembly(store), store)).files[BRACE]
    assert isinstance(made, StoredArtifact)
    data = store.read(made.sha256)
    assert len(data) == made.size
    (tmp_path / "brace.stl").write_bytes(data)
    mesh = trimesh.load_mesh(tmp_path / "brace.stl")
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(120 * 30 * 4)
    assert list(mesh.extents) == [120, 30, 4]


def test_part_bought_in_the_document_has_no_file(store: Store) -> None:
    """`make: buy` in the document removes the print file."""
    whole = with_changes(assembly(store), "plate", bom=BomEntry(make="buy"))
    assert "stl/arm.Plate.stl" not in emit(request(whole, store)).files


def test_file_exists_if_any_occurrence_is_printed(store: Store) -> None:
    whole = with_changes(assembly(store), "brace_a", bom=BomEntry(make="buy"))
    assert BRACE in emit(request(whole, store)).files
    assert BRACE not in emit(request(with_changes(whole, "brace_b", bom=BomEntry(make="buy")), store)).files
    printed_servo = with_changes(assembly(store), "servo_b", bom=BomEntry(make="print"))
    assert "stl/stock.XM430.stl" in emit(request(printed_servo, store)).files


def test_open_mesh_is_a_loss(store: Store) -> None:
    """A mesh that is not closed is still written, with an export loss."""
    whole = assembly(store)
    motor = next(o for o in whole.occurrences if o.path == "motor")
    assert motor.record is not None
    mesh = replace(motor.record.meshes["print"], closed=False)
    made = emit(request(with_changes(whole, "motor", record=replace(motor.record, meshes={"print": mesh})), store))
    assert "stl/cad.motor.step.stl" in made.files
    assert made.losses == (Loss(
        target="stl", mode=None, path="motor", how="approximated", origin=motor.origin,
        what="the surface of `cad/motor.step` is not closed",
    ),)


def test_clashing_file_names_are_an_error(store: Store) -> None:
    """Two definitions with the same file name are an error with the positions of both."""
    whole = assembly(store)
    other = part("cad.Motor/step")
    cap = next(o for o in whole.occurrences if o.path == "hand/cap")
    whole = with_changes(
        whole, "hand/cap", component=replace(cap.component, definition=other),
        definition=Definition(text=other.text, label=other.text, reference=other.reference, kind="file"),
    )
    asked = request(whole, store)
    emit(asked)
    (said,) = asked.report.diagnostics
    assert said.code is Code.SAME_FILE
    assert said.message == "`cad/motor.step` and `cad.Motor/step` have the same file name (`stl/cad.motor.step.stl`)"
    assert said.help == "rename one of the two files"
    assert said.span is not None and said.span.line == 19
    (note,) = said.notes
    assert note.message == "`cad.Motor/step` is used here" and note.span == cap.origin[0]


@pytest.mark.parametrize("up", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (0.6, 0.0, 0.8), (0.48, -0.6, -0.64)])
def test_print_orientation_is_applied(store: Store, tmp_path: Path, up: tuple[float, float, float]) -> None:
    """A box of 120 x 30 x 4 mm with `up`: the edge lengths are unchanged, and `up` is z in the file."""
    def mesh_of(whole: Assembly) -> trimesh.Trimesh:
        content = emit(request(whole, store)).files[BRACE]
        path = tmp_path / "brace.stl"
        path.write_bytes(content if isinstance(content, bytes) else store.read(content.sha256))
        return trimesh.load_mesh(path)

    whole = assembly(store)
    plain = mesh_of(whole)
    turned = mesh_of(with_changes(with_changes(whole, "brace_a", overrides=Overrides(up=up)), "brace_b", overrides=Overrides(up=up)))
    assert turned.is_watertight and turned.volume == pytest.approx(plain.volume, rel=1e-6)
    assert np.allclose(turned.triangles[:, :, 2], plain.triangles @ np.array(up), atol=1e-4)
    for one, other in ((0, 1), (1, 2), (0, 2)):
        before, after = (np.linalg.norm(mesh.triangles[:, one] - mesh.triangles[:, other], axis=1) for mesh in (plain, turned))
        assert np.allclose(before, after, atol=1e-4)
    assert np.allclose(turned.face_normals @ [0, 0, 1], plain.face_normals @ np.array(up), atol=1e-5)


def test_second_print_orientation_is_a_loss(store: Store) -> None:
    """If two occurrences have different print orientations, the file uses the first one and the other is an export loss."""
    whole = with_changes(assembly(store), "brace_b", overrides=Overrides(up=(1.0, 0.0, 0.0)))
    (loss,) = emit(request(whole, store)).losses
    assert loss.path == "brace_b" and loss.how == "omitted"
    assert loss.what == f"`arm:Brace(length=0.12)` is printed in two orientations (`{BRACE}` has the orientation of `brace_a`)"
