"""Links with listed shapes, compared with a written-out MuJoCo model of the same shapes. No CAD kernel is loaded."""

from __future__ import annotations

import io
import json
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdPhysics

import thingc
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.geometry.service import GeometryService
from thingc.geometry.worker_calls import WorkerCalls
from thingc.model.assembly.types import Assembly
from thingc.targets.artifact import Artifacts, StoredArtifact

DOCUMENT = """\
thingc: assembly/1
name: crane
materials:
  steel: {density: 7800 kg/m^3, color: gray}
  rubber: {density: 1100 kg/m^3, color: black, friction: {slide: 0.7}}
components:
  foot:
    link: true
    mass: 5 kg
    com: 10 0 20 mm
    inertia: {ixx: 0.03 kg*m^2, iyy: 0.04 kg*m^2, izz: 0.05 kg*m^2, ixy: 0.001 kg*m^2}
    shapes:
      - {plane: [4 m, 0 m], for: collision}
      - {box: 400 300 100 mm, at: {xyz: 0 0 50 mm, rpy: 0 0 30 deg}, color: red}
    mounts:
      top: {xyz: 0 0 220 mm, rpy: 90 0 0 deg}
  boom:
    link: true
    material: steel
    shapes:
      - {cylinder: {radius: 20 mm, length: 200 mm}, at: {xyz: 100 0 0 mm, rpy: 0 90 0 deg}}
      - {ellipsoid: 50 30 20 mm, at: {xyz: 0 10 0 mm, rpy: 0 0 20 deg}, for: collision}
      - {ellipsoid: 60 40 30 mm, for: visual, color: '#00ff00'}
    mounts:
      heel: {rpy: 180 0 -90 deg}
      end: {xyz: 200 0 0 mm, rpy: 0 30 0 deg}
  hook:
    link: true
    shapes:
      - {sphere: {radius: 30 mm}, at: {xyz: 0 0 -60 mm}, material: rubber}
      - {capsule: {radius: 15 mm, length: 120 mm}, at: {xyz: 0 0 60 mm, rpy: 10 20 30 deg}, material: steel,
         friction: {slide: 0.3, torsion: 0.01}}
    mounts:
      eye: {rpy: 180 0 -90 deg}
joints:
  lift: {type: continuous, parent: foot.top, child: boom.heel}
  swing: {type: continuous, parent: boom.end, child: hook.eye}
modes:
  standing: {root: foot}
"""

BY_HAND = """\
<mujoco>
  <compiler angle="degree" eulerseq="XYZ"/>
  <worldbody>
    <body name="foot">
      <inertial pos="0.01 0 0.02" mass="5" fullinertia="0.03 0.04 0.05 0.001 0 0"/>
      <geom type="plane" size="2 0 1"/>
      <geom type="box" size="0.2 0.15 0.05" pos="0 0 0.05" euler="0 0 30"/>
      <body name="boom" pos="0 0 0.22" euler="90 0 0">
        <joint name="lift" axis="0 0 1"/>
        <geom type="cylinder" size="0.02 0.1" pos="0.1 0 0" euler="0 90 0" density="7800"/>
        <geom type="ellipsoid" size="0.05 0.03 0.02" pos="0 0.01 0" euler="0 0 20" density="7800"/>
        <body name="hook" pos="0.2 0 0" euler="0 30 0">
          <joint name="swing" axis="0 0 1"/>
          <geom type="sphere" size="0.03" pos="0 0 -0.06" density="1100"/>
          <geom type="capsule" size="0.015 0.06" pos="0 0 0.06" euler="10 20 30" density="7800"/>
        </body>
      </body>
    </body>
  </worldbody>
  <contact><exclude body1="foot" body2="boom"/><exclude body1="boom" body2="hook"/></contact>
</mujoco>
"""


class Crane:
    """The robot, built for all targets with geometry workers disabled."""

    def __init__(self, folder: Path) -> None:
        folder.joinpath("thingc.toml").write_text('thingc = "workspace/1"\n')
        folder.joinpath("crane.yaml").write_text(DOCUMENT)
        with Environment(str(folder / "crane.yaml"), Options(store=str(folder / "store"))) as environment:
            compilation = pipeline.compile(environment)
            assert compilation.report.diagnostics == [] and compilation.assembly is not None
            self.assembly: Assembly = compilation.assembly
            targets = ["mjcf", "urdf", "sdf", "usd", "glb", "html", "step", "bom", "hag"]
            self.made: dict[str, Artifacts] = pipeline.build(environment, compilation, targets)
            assert compilation.report.diagnostics == []

    def file(self, target: str, path: str) -> bytes:
        content = self.made[target].files[path]
        assert not isinstance(content, StoredArtifact)
        return content


@pytest.fixture(scope="module")
def crane(tmp_path_factory: pytest.TempPathFactory) -> Crane:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(GeometryService, "warm", lambda self: pytest.fail("the kernel was begun"))
        patch.setattr(WorkerCalls, "pool", lambda self: pytest.fail("a worker was asked"))
        return Crane(tmp_path_factory.mktemp("crane"))


@pytest.fixture(scope="module")
def ours(crane: Crane) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(crane.file("mjcf", "mjcf/crane_standing.xml").decode())


@pytest.fixture(scope="module")
def by_hand() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(BY_HAND)


def touching(model: mujoco.MjModel) -> list[int]:
    return [geom for geom in range(model.ngeom) if model.geom_contype[geom]]


def test_collision_geoms_match_written_model(ours: mujoco.MjModel, by_hand: mujoco.MjModel) -> None:
    mine, theirs = touching(ours), touching(by_hand)
    assert [ours.geom_type[k] for k in mine] == [by_hand.geom_type[k] for k in theirs] and len(mine) == 6
    for one, other in zip(mine, theirs, strict=True):
        assert ours.geom_size[one][:2] == pytest.approx(by_hand.geom_size[other][:2], abs=1e-12)
        assert ours.geom_pos[one] == pytest.approx(by_hand.geom_pos[other], abs=1e-12)
        turned = abs(ours.geom_quat[one] @ by_hand.geom_quat[other])
        assert turned == pytest.approx(1.0, abs=1e-12), ours.geom(one).name


def test_mass_matrix_and_contacts_match_written_model(ours: mujoco.MjModel, by_hand: mujoco.MjModel) -> None:
    rng = np.random.default_rng(3)
    met = 0
    for _ in range(40):
        q = rng.uniform(-np.pi, np.pi, 2)
        answers = []
        for model in (ours, by_hand):
            data = mujoco.MjData(model)
            data.qpos[:] = q
            data.qvel[:] = (0.3, -0.7)
            mujoco.mj_forward(model, data)
            whole = np.zeros((2, 2))
            mujoco.mj_fullM(model, data, whole)
            answers.append((whole, data.qfrc_bias.copy(), sorted(float(contact.dist) for contact in data.contact)))
        (mass, bias, near), (mass_, bias_, near_) = answers
        assert mass == pytest.approx(mass_, rel=1e-9) and bias == pytest.approx(bias_, rel=1e-9, abs=1e-12)
        assert near == pytest.approx(near_, abs=1e-9)
        met += len(near)
    assert met > 10


def test_given_and_derived_masses(crane: Crane, by_hand: mujoco.MjModel) -> None:
    """A given mass is used unchanged. Other masses are the sum over the shapes."""
    foot, boom, hook = crane.assembly.occurrences
    assert (foot.properties.mass, foot.mass_source) == (5.0, "stated") and boom.mass_source == "derived"
    for one in (boom, hook):
        assert one.properties.mass == pytest.approx(by_hand.body(one.path).mass[0], rel=1e-12)
        assert one.properties.centre == pytest.approx(by_hand.body(one.path).ipos, abs=1e-12)
    assert hook.touching[0].material is not None and hook.touching[0].material.slide == 0.7


def test_bounding_boxes_contain_all_shapes_but_planes(crane: Crane) -> None:
    for one in crane.assembly.occurrences:
        solids = [surface.solid for surface in (*one.drawn, *one.touching) if surface.solid.shape != "plane"]  # type: ignore[union-attr]
        points = np.concatenate([points_of(solid) for solid in solids])
        assert one.box is not None
        assert np.allclose(one.box, (points.min(axis=0), points.max(axis=0)), atol=3e-4), one.path


def points_of(solid: object) -> np.ndarray:
    """Points on the surface of a primitive, generated by trimesh."""
    shape, size, pose = solid.shape, solid.size, np.array(solid.pose.rows())  # type: ignore[attr-defined]
    made = {
        "box": lambda: trimesh.creation.box(extents=[2 * side for side in size]),
        "sphere": lambda: trimesh.creation.icosphere(subdivisions=5, radius=size[0]),
        "ellipsoid": lambda: trimesh.creation.icosphere(subdivisions=5, radius=1.0).apply_scale(size),
        "cylinder": lambda: trimesh.creation.cylinder(radius=size[0], height=2 * size[1], sections=256),
        "capsule": lambda: trimesh.creation.capsule(radius=size[0], height=2 * size[1], count=[256, 256]),
    }[shape]()
    if shape == "capsule":
        made.apply_translation(-made.bounds.mean(axis=0))
    return np.asarray(made.apply_transform(np.vstack([pose[:3], (0, 0, 0, 1)])).vertices)


def test_shape_colour_and_friction_override_the_material(ours: mujoco.MjModel) -> None:
    seen = {ours.geom(k).name: tuple(ours.mat_rgba[ours.geom_matid[k]]) for k in range(ours.ngeom) if ours.geom_matid[k] >= 0}
    assert seen["foot"] == (1, 0, 0, 1) and seen["boom:visual_1"] == (0, 1, 0, 1) and seen["hook"] == (0, 0, 0, 1)
    assert ours.geom("hook:collision").friction[0] == 0.7
    assert tuple(ours.geom("hook:collision_1").friction[:2]) == (0.3, 0.01), "its own goes before that of the steel"


def test_geom_names_of_similar_components_are_unique(tmp_path: Path) -> None:
    """The second shape of `cap` must not have the name of the component `cap_1`."""
    link = "{link: true, mass: 1 kg, shapes: [{sphere: {radius: 10 mm}}, {box: 9 9 90 mm}]}"
    components = f"  cap: {link}\n  cap_1: {link.removesuffix('}')}, at: {{in: cap.origin}}}}\n"
    modes = "modes:\n  fixed: {root: cap, base: fixed}\n"
    (tmp_path / "caps.yaml").write_text(f"thingc: assembly/1\nname: caps\ncomponents:\n{components}{modes}")
    model = thingc.compile(tmp_path / "caps.yaml").modes["fixed"].model()
    drawn = [model.geom(k).name for k in range(model.ngeom) if not model.geom_contype[k]]
    assert drawn == ["cap", "cap:visual_1", "cap_1", "cap_1:visual_1"]


def test_primitives_are_written_or_listed_as_losses(crane: Crane) -> None:
    urdf = ET.fromstring(crane.file("urdf", "urdf/crane_standing.urdf"))
    assert len(urdf.findall(".//collision/geometry/sphere")) == 3, "a sphere, and the ends of a capsule"
    lost = {(loss.path, loss.what) for loss in crane.made["urdf"].losses}
    assert ("boom", "the collision ellipsoid: not supported by URDF") in lost
    assert ("boom", "the visual ellipsoid: not supported by URDF") in lost
    assert ("foot", "the collision plane: not supported by URDF") in lost
    sdf = ET.fromstring(crane.file("sdf", "sdf/crane_standing/model.sdf"))
    assert [one.text for one in sdf.findall(".//collision/geometry/ellipsoid/radii")] == ["0.05 0.03 0.02"]
    assert len(sdf.findall(".//collision/geometry/capsule")) == 1
    assert [one.text for one in sdf.findall(".//collision/geometry/plane/normal")] == ["0 0 1"]
    assert [loss.what for loss in crane.made["step"].losses][:1] == ["`link (plane, box)` consists of shapes without exact surfaces"]


def test_usd_writes_primitives_as_gprims(crane: Crane) -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(crane.file("usd", "usd/crane_standing.usda").decode())
    kinds = [prim.GetTypeName() for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI)]
    assert sorted(kinds) == ["Capsule", "Cube", "Cylinder", "Plane", "Sphere", "Sphere"]


def test_glb_and_viewer_contain_every_visual_shape(crane: Crane) -> None:
    scene = trimesh.load_scene(io.BytesIO(crane.file("glb", "glb/crane_standing.glb")), file_type="glb")
    assert sorted(node for node in scene.graph.nodes_geometry) == [
        "boom:visual", "boom:visual_1", "foot:visual", "hook:visual", "hook:visual_1",
    ]
    radii = scene.geometry[scene.graph["boom:visual_1"][1]].extents / 2.0
    assert radii == pytest.approx((0.06, 0.04, 0.03), rel=0.03)
    page = crane.file("html", next(iter(crane.made["html"].files))).decode()
    assert '"shape":"ellipsoid"' in page.replace(" ", "")


def test_bom_and_graph_list_links(crane: Crane) -> None:
    rows = json.loads(crane.file("bom", "bom.json"))
    assert [(row["name"], row["make"], row["quantity"]) for row in rows] == [("foot", "buy", 1), ("boom", "buy", 1), ("hook", "buy", 1)]
    assert {one.kind for one in crane.assembly.hag.definitions} == {"assembly", "link"}
    assert "link (sphere, capsule)" in {one.label for one in crane.assembly.hag.definitions}
