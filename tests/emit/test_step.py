"""The STEP file of an assembly, written by the geometry service and read by the CAD kernel."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from emit.small_robot import assembly, occurrence, part, request
from thingc.base.diagnostics import Code
from thingc.base.pose import NO_POSE, make_pose
from thingc.documents.workspace import DEFAULT_MESH, DEFAULT_SIMULATION, Workspace
from thingc.geometry.record import PartDefinition, PartRecord, Value
from thingc.geometry.service import GeometryService
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly
from thingc.targets.artifact import Loss, StoredArtifact
from thingc.targets.step.emit import emit

PARTS = '''
from build123d import Box
from thingc import Thing, Length

class Block(Thing):
    """A block, 10 mm by 20 mm by `height`."""

    def __init__(self, height: Length = 30, engraved: str = ""):
        super().__init__(material="petg")
        self.body = Box(10, 20, height)

    def result(self):
        return self.body
'''

READER = Path(__file__).with_name("read_step.py")


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Any:
    root = tmp_path_factory.mktemp("workspace")
    (root / "parts").mkdir()
    (root / "parts" / "blocks.py").write_text(PARTS)
    workspace = Workspace(
        root=str(root), parts=(str(root / "parts"),), packages=(), build=str(root / "build"), part_timeout=120.0,
        mesh=DEFAULT_MESH, simulation=DEFAULT_SIMULATION,
    )
    with GeometryService(workspace, Store(shared_store), jobs=1, timeout=120.0) as geometry:
        yield geometry


def blocks(store: Store, service: GeometryService) -> Assembly:
    """Two equal blocks and a tall one (in `hand`) at different poses, and a frame."""
    usual: dict[str, Value] = {"height": 0.03, "engraved": ""}
    short, tall = part("blocks:Block", {}, usual), part("blocks:Block", {"height": 0.05, "engraved": "M3 x 8"}, usual)
    records = service.realize([short, tall])

    def block(index: int, path: str, definition: PartDefinition, color: str) -> Any:
        found = records[definition.text]
        assert isinstance(found, PartRecord), found
        return replace(occurrence(index, path, definition, found, mass=0.01), color=color)

    return replace(
        assembly(store),
        occurrences=(
            block(0, "left", short, "#ff0000"), occurrence(1, "marker", None, None), block(2, "right", short, "#0000ff"),
            block(3, "hand/tall", tall, "#00ff00"),
        ),
        rest=(NO_POSE, NO_POSE, make_pose((0.1, 0, 0), (0, 0, 0)), make_pose((0.0, 0.2, 0.0), (1.5707963267948966, 0, 0))),
        link_of=(0, 0, 0, 0), mates=(), modes=(), links=(),
    )


def test_cad_kernel_reads_names_volumes_and_colours(service: GeometryService, shared_store: str, tmp_path: Path) -> None:
    """The CAD kernel reads the component tree, definitions, volumes, centres and colours. Equal definitions share their shape."""
    store = Store(shared_store)
    made = emit(request(blocks(store, service), store, service))
    assert list(made.files) == ["step/arm.step"] and made.losses == ()
    written = made.files["step/arm.step"]
    assert isinstance(written, StoredArtifact)
    data = store.read(written.sha256)
    assert len(data) == written.size
    assert data.count(b"MANIFOLD_SOLID_BREP(") == 2, "equal definitions share their shape"
    (tmp_path / "arm.step").write_bytes(data)
    done = subprocess.run(
        [sys.executable, str(READER), str(tmp_path / "arm.step")], capture_output=True, text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "ERR" not in done.stdout + done.stderr, "the kernel reads it without complaint"
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["name"] == "arm"
    leaves = found["leaves"]
    assert {path: leaf["definition"] for path, leaf in leaves.items()} == {
        "left": "blocks:Block", "right": "blocks:Block", "hand/tall": "blocks:Block(engraved=M3 x 8, height=0.05)",
    }
    assert {path: leaf["volume"] for path, leaf in leaves.items()} == pytest.approx(
        {"left": 6000, "right": 6000, "hand/tall": 10000}, rel=1e-9
    )
    for path, centre in (("left", (0, 0, 0)), ("right", (100, 0, 0)), ("hand/tall", (0, 200, 0))):
        assert leaves[path]["centre"] == pytest.approx(centre, abs=1e-6)
    for path, color in (("left", (1, 0, 0)), ("right", (0, 0, 1)), ("hand/tall", (0, 1, 0))):
        assert leaves[path]["color"] == pytest.approx(color, abs=0.01)


def test_shapes_of_part_files_have_the_name_of_their_component(service: GeometryService, shared_store: str, tmp_path: Path) -> None:
    """Not the path of the file. Two components with one file share its shape."""
    store = Store(shared_store)
    whole = blocks(store, service)
    plate, wedge = part("cad/base plate.step"), part("cad/sub/w-7.step")
    record = {index: whole.occurrences[index].record for index in (0, 3)}
    parts = ((0, "plate", plate, record[0]), (1, "hand/spare", plate, record[0]), (2, "hand/wedge", wedge, record[3]))
    made = emit(request(replace(whole, occurrences=tuple(occurrence(*one, mass=0.1) for one in parts)), store, service))
    written = made.files["step/arm.step"]
    assert isinstance(written, StoredArtifact)
    (tmp_path / "arm.step").write_bytes(store.read(written.sha256))
    done = subprocess.run([sys.executable, str(READER), str(tmp_path / "arm.step")], capture_output=True, text=True, check=True)
    leaves = json.loads(done.stdout.splitlines()[-1])["leaves"]
    assert {path: leaf["definition"] for path, leaf in leaves.items()} == {"plate": "plate", "hand/spare": "plate", "hand/wedge": "wedge"}
    assert {path: round(leaf["volume"]) for path, leaf in leaves.items()} == {"plate": 6000, "hand/spare": 6000, "hand/wedge": 10000}


def test_output_is_deterministic(service: GeometryService, shared_store: str) -> None:
    store = Store(shared_store)
    whole = blocks(store, service)
    assert emit(request(whole, store, service)).files == emit(request(whole, store, service)).files


def test_invalid_brep_is_an_error(service: GeometryService, tmp_path: Path) -> None:
    """The B-reps of `small_robot` are invalid data, so the export fails with `STEP_FAILED` and without a traceback."""
    store = Store(str(tmp_path))
    asked = request(assembly(store), store, service)
    made = emit(asked)
    assert made.files == {}
    (said,) = asked.report.diagnostics
    assert said.code is Code.STEP_FAILED
    assert said.message.startswith("cannot write the STEP file of `arm`: ")
    assert "Traceback" not in said.message and said.detail
    assert said.help == "select targets other than `step` with --emit"


def test_robot_without_geometry_has_no_file(tmp_path: Path) -> None:
    """A robot without geometry produces no file and one export loss."""
    store = Store(str(tmp_path))
    whole = assembly(store)
    frames = replace(whole, occurrences=tuple(o if o.record is None else replace(o, record=None) for o in whole.occurrences))
    made = emit(request(frames, store))
    assert made.files == {}
    assert made.losses == (Loss(
        target="step", mode=None, path="arm", what="no part of the robot has geometry", how="omitted",
        origin=whole.definition.origin,
    ),)


def test_meshes_are_a_loss(tmp_path: Path) -> None:
    """Parts that are meshes cannot be written to STEP. Each is an export loss."""
    store = Store(str(tmp_path))
    whole = assembly(store)
    meshes = replace(whole, occurrences=tuple(
        o if o.record is None else replace(o, record=replace(o.record, brep=None)) for o in whole.occurrences
    ))
    made = emit(request(meshes, store))
    assert made.files == {}
    assert [(loss.path, loss.what) for loss in made.losses[-2:]] == [
        ("motor", "`cad/motor.step` is a mesh without exact surfaces"), ("arm", "no part of the robot has exact geometry"),
    ]
