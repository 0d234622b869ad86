"""`at: {on: floor}`: the lowest point of the collision shapes is on the plane of the scene, by MuJoCo's own distances."""

from __future__ import annotations

import contextlib
import io
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import trimesh
from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options, with_environment
from thingc.driver.pipeline import Compilation
from thingc.driver.session import Session
from thingc.model.resolve.resolver import Settings
from thingc.model.robot.floor_height import stand
from thingc.modes import Modes
from thingc.tools.cli import info
from thingc.tools.cli.main import main

PARTS = '''
from build123d import Align, Box, Cone, Location, Pos, Sphere

from thingc import Length, MountPoint, Thing


class Lamp(Thing):
    """A cone on a box, off its origin; what it collides as is smaller, a ball and the box, and a wedge that is neither."""

    def __init__(self, size: Length = 40):
        super().__init__(material="stuff")
        self.size = size
        self.shade = MountPoint(Location((0, 0, size), (20, 30, 0)))

    def result(self):
        size = self.size
        return Pos(3, -7, 0) * Cone(size / 2, size / 5, size) + Pos(10, 0, -size / 2) * Box(size, 12, 8)

    def collision(self):
        wedge = Pos(0, 0, 10) * Cone(self.size / 3, 0, 15, rotation=(0, 40, 0))
        return [Pos(3, -7, 10) * Sphere(9), Pos(10, 0, -self.size / 2) * Box(self.size, 12, 8), wedge]


class Bar(Thing):
    """A square bar along x from its hinge `near` to `far`, whose axes are y."""

    def __init__(self, length: Length = 100, width: Length = 20):
        super().__init__(material="stuff")
        self.body = Box(length, width, width, align=(Align.MIN, Align.CENTER, Align.CENTER))
        self.near = MountPoint(Location((0, 0, 0), (90, 0, 90)))
        self.far = MountPoint(Location((length, 0, 0), (-90, 0, 0)))
        self.tip = MountPoint(Location((length, 0, 0), (0, 90, 0)))

    def result(self):
        return self.body
'''
HEAD = "thingc: assembly/1\nname: robot\nmaterials: {stuff: {density: 1000 kg/m^3}}\n"
LAMP = HEAD + """\
components:
  lamp: {part: lamps:Lamp, collision: KIND}
modes:
  flat: {root: lamp, base: free, at: {on: floor}}
  askew: {root: lamp, base: free, at: {on: floor, xyz: 30 -20 0 mm, rpy: 200 35 -70 deg}}
  hung: {root: lamp.shade, at: {on: floor, rpy: 10 -50 130 deg}, gravity: ceiling}
"""
KINDS = ("hull", "box", "cylinder", "capsule", "sphere", "decompose", "mesh", "part")
# Two bars on a hinge, the second one hanging down by `elbow`.
ARM = HEAD + """\
parameters: {length: 60 mm}
components:
  upper: {part: lamps:Bar}
  lower: {part: lamps:Bar, params: {length: =length}}
joints:
  elbow: {type: revolute, parent: upper.far, child: lower.near, limit: {lower: -150 deg, upper: 150 deg},
    drive: {kind: position, kp: 5 N*m/rad, effort: 1 N*m}}
poses:
  level: {}
  bent: {elbow: 30 deg}
  raised: {elbow: -30 deg}
modes:
  afloat: {root: upper, base: free, at: {on: floor, xyz: [10 mm, 0, 0]}, pose: bent}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("standing")
    (found / "parts").mkdir()
    (found / "parts" / "lamps.py").write_text(PARTS)
    (found / "thingc.toml").write_text('thingc = "workspace/1"\n')
    return found


Compiled = Callable[..., Compilation]


@pytest.fixture
def compiled(folder: Path, shared_store: str) -> Compiled:
    def compile(text: str, **options: Any) -> Compilation:
        (folder / "robot.yaml").write_text(text)
        with Environment(str(folder / "robot.yaml"), Options(store=shared_store, **options)) as environment:
            return pipeline.compile(environment)

    return compile


@pytest.fixture
def files_of(folder: Path, shared_store: str) -> Callable[[str], dict[str, bytes]]:
    def build(text: str) -> dict[str, bytes]:
        (folder / "robot.yaml").write_text(text)
        with Environment(str(folder / "robot.yaml"), Options(store=shared_store)) as environment:
            compilation = pipeline.compile(environment)
            assert not compilation.report.failed, compilation.report.sorted_diagnostics()
            files = pipeline.build(environment, compilation, ["mjcf"])["mjcf"].files
            return {path: one if isinstance(one, bytes) else environment.store.read(one.sha256) for path, one in files.items()}

    return build


def scene(files: dict[str, bytes], mode: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(files[f"mjcf/scene_{mode}.xml"].decode(), {os.path.basename(p): d for p, d in files.items()})


def height(data: mujoco.MjData) -> float:
    """Smallest distance [m] of any collision geom from the floor, by MuJoCo."""
    model = data.model
    touching = [g for g in range(model.ngeom) if model.geom_contype[g] and model.geom(g).name != "floor"]
    assert touching
    return min(mujoco.mj_geomDistance(model, data, model.geom("floor").id, geom, 10.0, None) for geom in touching)


def in_pose(model: mujoco.MjModel, pose: str | None = None) -> mujoco.MjData:
    data = mujoco.MjData(model)
    if pose is not None:
        mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
    mujoco.mj_forward(model, data)
    return data


@pytest.mark.parametrize("kind", KINDS)
def test_lowest_collision_point_touches_the_floor(kind: str, files_of: Callable[[str], dict[str, bytes]]) -> None:
    files = files_of(LAMP.replace("KIND", kind))
    for mode in ("flat", "askew", "hung"):
        assert height(in_pose(scene(files, mode))) == pytest.approx(0.0, abs=2e-7), mode


def test_hull_height_matches_the_visual_mesh(files_of: Callable[[str], dict[str, bytes]]) -> None:
    """Computed from the mesh vertices, read by trimesh, and the pose in the model."""
    files = files_of(LAMP.replace("KIND", "hull"))
    data = in_pose(scene(files, "askew"))
    mesh = trimesh.load(io.BytesIO(files["mjcf/assets/lamps.Lamp.obj"]), file_type="obj", process=False)
    placed = mesh.vertices @ data.body("lamp").xmat.reshape(3, 3).T + data.body("lamp").xpos
    assert placed[:, 2].min() == pytest.approx(0.0, abs=2e-7)
    assert data.body("lamp").xpos[:2] == pytest.approx([0.03, -0.02], abs=1e-12)


def bent_height(angle: float, length: float) -> float:
    """Height of the first bar's centre: the far lower corner of the 20 mm bar that hangs down by `angle`, or the lower side of the first
    bar."""
    return max(0.01, length * np.sin(angle) + 0.01 * np.cos(angle))


def test_floating_robot_is_on_the_floor_in_every_keyframe(files_of: Callable[[str], dict[str, bytes]]) -> None:
    files = files_of(ARM)
    model = scene(files, "afloat")
    expected = {"bent": bent_height(np.radians(30.0), 0.06), "level": 0.01, "raised": 0.01}
    modes = Modes.parse(files["modes.json"])
    for pose, z in expected.items():
        data = in_pose(model, pose)
        assert data.body("upper").xpos == pytest.approx([0.01, 0.0, z], abs=1e-7)
        assert height(data) == pytest.approx(0.0, abs=2e-7)
        assert modes["afloat"].state(pose).base_pose[:3, 3] == pytest.approx([0.01, 0.0, z], abs=1e-7)
    assert in_pose(model).body("upper").xpos[2] == pytest.approx(expected["bent"], abs=1e-7)  # at qpos0, too
    assert list(json.loads(files["modes.json"])["afloat"]["bases"]) == ["level", "raised"]


def test_held_base_has_the_height_of_its_start_pose(files_of: Callable[[str], dict[str, bytes]]) -> None:
    files = files_of(ARM.replace("base: free", "base: held"))
    for pose in ("bent", "level"):
        assert in_pose(scene(files, "afloat"), pose).body("upper").xpos[2] == pytest.approx(bent_height(np.radians(30.0), 0.06), abs=1e-7)
    assert "bases" not in json.loads(files["modes.json"])["afloat"]


def test_robot_on_the_floor_starts_at_rest(files_of: Callable[[str], dict[str, bytes]]) -> None:
    """Two boxes on a plane: in the simulation nothing is pushed out of the floor or falls onto it."""
    files = files_of(ARM.replace("pose: bent", "pose: level"))
    data = in_pose(scene(files, "afloat"), "level")
    for _ in range(500):
        mujoco.mj_step(data.model, data)
        assert abs(data.qvel).max() < 0.05
    assert data.body("upper").xpos[2] == pytest.approx(0.01, abs=2e-4)


def test_hold_here_uses_the_floor_height(files_of: Callable[[str], dict[str, bytes]]) -> None:
    files = files_of(ARM + "  held: {extends: afloat, base: fixed, hold: {lower.tip: here}}\n")
    data = in_pose(scene(files, "held"), "bent")
    z = bent_height(np.radians(30.0), 0.06)
    assert data.body("upper").xpos[2] == pytest.approx(z, abs=1e-7)
    held = np.array(json.loads(files["modes.json"])["held"]["holds"]["lower/tip"]["X_WM"])
    assert held[2, 3] == pytest.approx(z - 0.06 * np.sin(np.radians(30.0)), abs=1e-7)


def test_height_is_inherited_and_overridden(compiled: Compiled) -> None:
    """A height or `on: floor` of a mode overrides that of the mode it extends."""
    compilation = compiled(ARM + (
        "  dropped: {extends: afloat, at: {xyz: 0 0 300 mm}}\n"
        "  landed: {extends: dropped, at: {on: floor}}\n"
        "  shifted: {extends: afloat, at: {xyz: [0, 50 mm, 0]}}\n"
    ))
    assert not compilation.report.failed
    at = {robot.mode.name: robot.bodies[0].X_PL.translation for robot in compilation.robots}
    z = pytest.approx(bent_height(np.radians(30.0), 0.06), abs=1e-7)
    assert at["dropped"] == (0.0, 0.0, 0.3)
    assert at["landed"] == (0.0, 0.0, z) and at["shifted"] == (0.0, 0.05, z) and at["afloat"] == (0.01, 0.0, z)


def test_session_recomputes_the_height(folder: Path, shared_store: str) -> None:
    """Lengths change repeatedly; a cached height is never used for another length."""
    (folder / "robot.yaml").write_text(ARM)
    with Session(str(folder / "robot.yaml"), Options(store=shared_store)) as session:
        for length in (60, 80, 60, 70, 80):
            (robot,) = session.compile(Settings(parameters={"length": f"{length} mm"})).robots
            expected = bent_height(np.radians(30.0), length / 1000.0)
            assert robot.bodies[0].X_PL.translation[2] == pytest.approx(expected, abs=1e-7)


def test_check_works_without_meshes(compiled: Compiled, folder: Path) -> None:
    """From the lock file alone with an empty store, the boxes of these parts equal the parts."""
    (folder / "robot.yaml").write_text(ARM)
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.chdir(folder):
        assert main(["lock"]) == 0
        assert main(["check", "robot.yaml", "--no-code"]) == 0, out.getvalue()
        assert main(["check", "robot.yaml", "--store", str(folder / "nothing")]) == 0
    compilation = compiled(ARM, lock=True, code=False)
    z = compilation.robots[0].bodies[0].X_PL.translation[2]
    assert z == pytest.approx(bent_height(np.radians(30.0), 0.06), abs=1e-6)


def test_damaged_mesh_is_rebuilt(folder: Path, tmp_path: Path) -> None:
    (folder / "robot.yaml").write_text(LAMP.replace("KIND", "hull"))
    options = Options(store=str(tmp_path / "store"))
    with Environment(str(folder / "robot.yaml"), options) as environment:
        compilation = pipeline.compile(environment)
        expected = [robot.bodies[0].X_PL for robot in compilation.robots]
        assert compilation.assembly is not None and compilation.assembly.occurrences[0].record is not None
        hull = compilation.assembly.occurrences[0].record.meshes["hull"]
        path = Path(environment.store.path(hull.sha256))
    damaged = bytearray(path.read_bytes())
    damaged[100] ^= 1
    stamp = path.stat()
    path.write_bytes(damaged)
    os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    compilation = with_environment(str(folder / "robot.yaml"), options, pipeline.compile)
    assert [robot.bodies[0].X_PL for robot in compilation.robots] == expected and compilation.modelled == ["lamps:Lamp"]


def test_info_shows_the_floor_height(compiled: Compiled) -> None:
    compilation = compiled(ARM.replace("pose: bent", "pose: level"))
    assert compilation.assembly is not None
    text = "\n".join(info.as_text(compilation.assembly, compilation.robots))
    assert "\nmode afloat: root upper/origin, base free, on the floor with its root at 10 0 10 mm\n" in text


def diagnostics_of(compilation: Compilation) -> list[tuple[str, str, str | None]]:
    return [(d.code.code, d.message, d.help) for d in compilation.report.sorted_diagnostics()]


def test_conflicting_heights_are_reported(compiled: Compiled) -> None:
    found = diagnostics_of(compiled(ARM.replace("xyz: [10 mm, 0, 0]", "xyz: [10 mm, 0, 5 mm]")))
    assert found == [(
        "TC606", "mode `afloat` has both `on: floor` and a height of 5 mm",
        "set z of `at` to `0`, or remove `on: floor`",
    )]
    found = diagnostics_of(compiled(ARM + "  held: {extends: afloat, hold: {lower.tip: {xyz: 100 0 0 mm}}}\n"))
    assert found == [(
        "TC606", "mode `held` has both `on: floor` and a fixed height of `lower.tip` under `hold`",
        "write `lower.tip: here`, or replace `on: floor` with a height in `at`",
    )]


def test_floor_check_requires_exact_parts(compiled: Compiled) -> None:
    """While a part is not exact, no diagnostic about the floor is given."""
    whole = compiled(ARM.replace("part: lamps:Bar", "collision: none, part: lamps:Bar")).assembly
    assert whole is not None and len(whole.occurrences) == 2
    for unknown in ((), (0,), (1,), (0, 1)):
        occurrences = tuple(
            replace(one, record=replace(one.record, exact=number not in unknown)) if one.record is not None else one
            for number, one in enumerate(whole.occurrences)
        )
        report = Report()
        stand(replace(whole, occurrences=occurrences), None, report)
        assert {found.code for found in report.diagnostics} == (set() if unknown else {Code.NOTHING_TOUCHES})


def test_on_floor_without_collision_shapes_is_reported(compiled: Compiled) -> None:
    found = diagnostics_of(compiled(LAMP.replace("KIND", "none")))
    assert found == [
        ("TC607", f"no part can touch the floor in mode `{mode}` (`on: floor`)",
         "set `collision` of a part to a value other than `none`, or write `at: {xyz: ...}`") for mode in ("flat", "askew", "hung")
    ]
