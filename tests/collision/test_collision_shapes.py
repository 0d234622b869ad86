"""Collision shapes declared in documents, in every format, compared with MuJoCo, trimesh and formulas."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.targets.artifact import Artifacts
from thingc.tools.cli.main import main
from thingc.tools.cli.render import with_collision

PARTS = """\
from build123d import Box, Location, Pos
from thingc import MountPoint, Thing

class Bracket(Thing):
    '''An L of two plates.'''
    def __init__(self):
        super().__init__()
        self.top = MountPoint(Location((0, 0, 40)))
    def result(self):
        return Pos(20, 0, 2) * Box(40, 20, 4) + Pos(2, 0, 20) * Box(4, 20, 40)
    def mass(self):
        return 0.006
"""

SHAPES = """\
        - {box: 40 20 4 mm, at: {xyz: 20 0 2 mm, rpy: 0 0 30 deg}}
        - {cylinder: {radius: 3 mm, length: 30 mm}, at: {xyz: 0 0 25 mm, rpy: 90 0 0 deg}}
        - {capsule: {radius: 4 mm, length: 20 mm}, at: {xyz: 30 0 10 mm, rpy: 0 45 0 deg}}
        - {sphere: {radius: 5 mm}, at: {xyz: 2 0 40 mm}, friction: {slide: 0.3}}
        - {mesh: meshes/wedge.stl, at: {xyz: 10 0 4 mm}}
"""

ROBOT = f"""\
thingc: assembly/1
name: robot
components:
  base: {{frame: true}}
  bracket:
    part: parts:Bracket
    at: {{in: base.origin, xyz: 0 0 100 mm, rpy: 0 20 0 deg}}
    collision:
      shapes:
{SHAPES}\
modes:
  free: {{root: base, base: free}}
"""


def workspace(folder: Path) -> None:
    folder.joinpath("thingc.toml").write_text('thingc = "workspace/1"\nparts = ["."]\n')
    folder.joinpath("parts.py").write_text(PARTS)
    folder.joinpath("meshes").mkdir()
    wedge = trimesh.creation.extrude_triangulation(np.array([[0.0, 0.0], [12.0, 0.0], [0.0, 8.0]]), np.array([[0, 1, 2]]), 10.0)
    wedge.export(folder / "meshes" / "wedge.stl")
    slot = trimesh.util.concatenate([trimesh.creation.box((30, 10, 4)), trimesh.creation.box((4, 10, 30))])
    whole = trimesh.boolean.union([trimesh.creation.box((30, 10, 4)), trimesh.creation.box((4, 10, 30))], engine="manifold")
    assert whole.is_watertight and slot.volume > whole.volume
    whole.export(folder / "meshes" / "cross.stl")


def built(folder: Path, text: str, store: str, targets: tuple[str, ...] = ("mjcf",)) -> tuple[Compilation, dict[str, Artifacts]]:
    folder.joinpath("robot.yaml").write_text(text)
    with Environment(str(folder / "robot.yaml"), Options(store=store)) as environment:
        compilation = pipeline.compile(environment)
        assert [one.message for one in compilation.report.diagnostics] == []
        artifacts = pipeline.build(environment, compilation, list(targets))
        return compilation, {
            target: Artifacts(files={
                path: content if isinstance(content, bytes) else environment.store.read(content.sha256)
                for path, content in made.files.items()
            }, losses=made.losses)
            for target, made in artifacts.items()
        }


def model_of(made: Artifacts, name: str) -> mujoco.MjModel:
    files = {path.rpartition("/")[2]: data for path, data in made.files.items() if isinstance(data, bytes) and "/assets/" in path}
    return mujoco.MjModel.from_xml_string(made.files[f"mjcf/{name}.xml"].decode(), files)  # type: ignore[union-attr]


@pytest.mark.parametrize(("first", "second"), [("foot", "foot"), ("", "bracket:collision")])
def test_equal_names_are_reported_at_the_shape(tmp_path: Path, shared_store: str, first: str, second: str) -> None:
    workspace(tmp_path)
    body = "{link: true, mass: 1 kg, inertia: {ixx: 1 g*m^2, iyy: 1 g*m^2, izz: 1 g*m^2}, shapes: [\n"
    shape = "    {{box: {} 1 1 m, for: collision{}}},\n"
    named = [f", name: '{name}'" if name else "" for name in (first, "", second)]
    text = f"thingc: assembly/1\nname: robot\ncomponents:\n  bracket: {body}{shape.format(1, named[0])}  ]}}\n"
    text += f"  other: {body}{shape.format(3, named[1])}{shape.format(2, named[2])}  ], at: {{in: bracket.origin}}}}\n"
    (tmp_path / "robot.yaml").write_text(text)
    with Environment(str(tmp_path / "robot.yaml"), Options(store=shared_store)) as environment:
        compilation = pipeline.compile(environment)
        pipeline.build(environment, compilation, ["mjcf"])
    (found,) = compilation.report.diagnostics
    assert found.code.code == "TC702" and second in found.message and found.span is not None
    assert found.span.line == 1 + next(k for k, line in enumerate(text.splitlines()) if "2 1 1 m" in line)


def inside(shape: str, points: np.ndarray) -> np.ndarray:
    """Return which points [mm, in the frame of the bracket] are inside a shape of `SHAPES`, by its definition."""
    def local(xyz: tuple[float, float, float], rpy: tuple[float, float, float]) -> np.ndarray:
        rotation = trimesh.transformations.euler_matrix(*np.radians(rpy), "sxyz")[:3, :3]
        return (points - np.array(xyz)) @ rotation

    if shape == "box":
        return (np.abs(local((20, 0, 2), (0, 0, 30))) <= (20, 10, 2)).all(axis=1)
    if shape == "cylinder":
        p = local((0, 0, 25), (90, 0, 0))
        return (np.hypot(p[:, 0], p[:, 1]) <= 3) & (np.abs(p[:, 2]) <= 15)
    if shape == "capsule":
        p = local((30, 0, 10), (0, 45, 0))
        return np.linalg.norm(p - np.stack([0 * p[:, 2], 0 * p[:, 2], np.clip(p[:, 2], -10, 10)], axis=1), axis=1) <= 4
    if shape == "sphere":
        return np.linalg.norm(local((2, 0, 40), (0, 0, 0)), axis=1) <= 5
    p = local((10, 0, 4), (0, 0, 0))
    return (p[:, 0] >= 0) & (p[:, 1] >= 0) & (p[:, 0] / 12 + p[:, 1] / 8 <= 1) & (p[:, 2] >= 0) & (p[:, 2] <= 10)


def test_probe_touches_only_the_declared_shapes(tmp_path: Path, shared_store: str) -> None:
    """At random points, a small sphere in MuJoCo touches exactly the shapes that contain the point."""
    workspace(tmp_path)
    _, made = built(tmp_path, ROBOT, shared_store)
    spec = mujoco.MjSpec.from_string(
        made["mjcf"].files["mjcf/robot_free.xml"].decode(),  # type: ignore[union-attr]
        assets={path.rpartition("/")[2]: data for path, data in made["mjcf"].files.items() if "/assets/" in path},
    )
    probe = spec.worldbody.add_body(name="probe", mocap=True)
    probe.add_geom(name="probe", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[1e-5, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    colliding = [k for k in range(model.ngeom) if model.geom_contype[k] and model.geom(k).name != "probe"]
    names = [model.geom(k).name for k in colliding]
    assert names == ["bracket:collision", *(f"bracket:collision_{k}" for k in range(1, 5))]
    mujoco.mj_forward(model, data)
    rng = np.random.default_rng(0)
    points = rng.uniform((-8, -18, -1), (45, 18, 46), (4000, 3))
    turn = trimesh.transformations.euler_matrix(0, math.radians(20), 0)[:3, :3]
    world = points / 1000 @ turn.T + (0, 0, 0.1)
    hits = np.zeros((len(points), len(names)), dtype=bool)
    for row, place in enumerate(world):
        data.mocap_pos[0] = place
        mujoco.mj_forward(model, data)
        for contact in data.contact:
            geoms = [model.geom(int(g)).name for g in contact.geom]
            if "probe" in geoms:
                hits[row, names.index(next(g for g in geoms if g != "probe"))] = True
    for column, shape in enumerate(("box", "cylinder", "capsule", "sphere", "mesh")):
        expected = inside(shape, points)
        assert expected.sum() > 10
        assert (hits[:, column] != expected).sum() <= 3, shape  # the probe has a radius of 0.01 mm


def test_every_format_contains_the_shapes(tmp_path: Path, shared_store: str) -> None:
    workspace(tmp_path)
    _, made = built(tmp_path, ROBOT, shared_store, ("mjcf", "urdf", "sdf", "usd"))
    urdf = made["urdf"].files["urdf/robot_free.urdf"].decode()  # type: ignore[union-attr]
    assert urdf.count("<collision ") >= 5 and urdf.count("<visual") == 1
    sdf = next(data for path, data in made["sdf"].files.items() if path.endswith("model.sdf"))
    assert isinstance(sdf, bytes) and sdf.count(b"<collision ") == 5 and b"<capsule>" in sdf
    from pxr import Usd, UsdPhysics

    file = next(path for path in made["usd"].files if path.endswith(".usda"))
    place = tmp_path / "robot.usda"
    place.write_bytes(made["usd"].files[file])  # type: ignore[arg-type]
    stage = Usd.Stage.Open(str(place))
    kinds = sorted(str(prim.GetTypeName()) for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI))
    assert kinds == ["Capsule", "Cube", "Cylinder", "Mesh", "Sphere"]
    assert model_of(made["mjcf"], "robot_free").geom("bracket:collision_3").friction[0] == 0.3


def test_mirrored_part_has_mirrored_shapes(tmp_path: Path, shared_store: str) -> None:
    workspace(tmp_path)
    two = ROBOT.replace("modes:", """\
  image:
    part: parts:Bracket
    mirror: x
    at: {in: base.origin, xyz: 0 200 100 mm, rpy: 0 20 0 deg}
    collision:
      shapes:
""" + SHAPES + "modes:")
    _, made = built(tmp_path, two, shared_store)
    model = model_of(made["mjcf"], "robot_free")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    turn = trimesh.transformations.euler_matrix(0, math.radians(20), 0)[:3, :3]
    for suffix in ("", "_1", "_2", "_3"):
        one, other = (data.geom(f"{name}:collision{suffix}") for name in ("bracket", "image"))
        at, axis = (one.xpos - (0, 0, 0.1)) @ turn, one.xmat.reshape(3, 3)[:, 2] @ turn
        image_at, image_axis = (other.xpos - (0, 0.2, 0.1)) @ turn, other.xmat.reshape(3, 3)[:, 2] @ turn
        assert image_at == pytest.approx(at * (-1, 1, 1), abs=1e-9)
        assert abs(float(image_axis @ (axis * (-1, 1, 1)))) == pytest.approx(1.0)


def pieces_of(made: Artifacts) -> list[trimesh.Trimesh]:
    return [
        trimesh.load(trimesh.util.wrap_as_stream(data), file_type="obj", process=False) for path, data in sorted(made.files.items())
        if "convex" in path and isinstance(data, bytes)
    ]


@pytest.mark.parametrize("form", ["part", "link", "shapes"])
@pytest.mark.parametrize("most", [2, 3])
def test_pieces_are_convex_and_cover_the_shape(tmp_path: Path, shared_store: str, form: str, most: int) -> None:
    workspace(tmp_path)
    mesh = f"{{mesh: meshes/cross.stl, decompose: {{pieces: {most}}}}}"
    component = {
        "part": f"{{file: meshes/cross.stl, mass: 5 g, collision: {{decompose: {{pieces: {most}}}}}}}",
        "link": f"{{link: true, mass: 5 g, shapes: [{mesh}]}}",
        "shapes": f"{{file: meshes/cross.stl, mass: 5 g, collision: {{shapes: [{mesh}]}}}}",
    }[form]
    text = f"thingc: assembly/1\nname: robot\ncomponents:\n  one: {component}\nmodes: {{free: {{root: one, base: free}}}}\n"
    _, made = built(tmp_path, text, shared_store)
    pieces = pieces_of(made["mjcf"])
    assert 0 < len(pieces) <= most
    points = trimesh.load(tmp_path / "meshes" / "cross.stl").vertices / 1000
    for piece in pieces:
        assert piece.convex_hull.volume == pytest.approx(abs(piece.volume), rel=1e-6)
    covered = np.zeros(len(points), dtype=bool)
    for piece in pieces:
        hull = piece.convex_hull
        covered |= ((points[:, None] - hull.triangles[:, 0]) * hull.face_normals).sum(axis=2).max(axis=1) < 1e-3
    assert covered.all()
    assert model_of(made["mjcf"], "robot_free").nmesh >= len(pieces)


def test_two_limits_for_one_part_do_not_share_files(tmp_path: Path, shared_store: str) -> None:
    workspace(tmp_path)
    text = """\
thingc: assembly/1
name: robot
components:
  one: {file: meshes/cross.stl, mass: 5 g, collision: {decompose: {pieces: 1}}}
  two: {file: meshes/cross.stl, mass: 5 g, at: {in: one.origin, xyz: 100 0 0 mm}, collision: decompose}
modes: {free: {root: one, base: free}}
"""
    _, made = built(tmp_path, text, shared_store)
    model = model_of(made["mjcf"], "robot_free")
    names = [model.geom(k).name for k in range(model.ngeom)]
    assert sum(name.startswith("one:collision") for name in names) == 1
    assert sum(name.startswith("two:collision") for name in names) >= 2


MODES = """\
thingc: assembly/1
name: robot
components:
  base: {frame: true}
  bracket:
    part: parts:Bracket
    at: {in: base.origin, xyz: 0 0 100 mm}
    collision:
      kind: hull
      targets: {mjcf: box}
      modes:
        ball: {shapes: [{sphere: {radius: 60 mm}, at: {xyz: 20 0 20 mm}}]}
        pieces: {decompose: {pieces: 2}}
        ghost: none
modes:
  plain: {root: base, base: free, at: {on: floor}}
  ball: {root: base, base: free, at: {on: floor}}
  pieces: {root: base, base: free}
  ghost: {root: base, base: free}
"""


def test_modes_have_their_own_shapes_in_every_format(tmp_path: Path, shared_store: str) -> None:
    """The shapes of a mode replace those of the format. The height at which the robot stands follows from the lowest shape of the mode."""
    workspace(tmp_path)
    compilation, made = built(tmp_path, MODES, shared_store, ("mjcf", "urdf", "sdf", "usd", "ros"))
    geoms, heights = {}, {}
    for mode in ("plain", "ball", "pieces", "ghost"):
        model = model_of(made["mjcf"], f"robot_{mode}")
        geoms[mode] = [(int(model.geom_type[k]), *model.geom_size[k].round(9)) for k in range(model.ngeom) if model.geom_contype[k]]
        heights[mode] = float(model.qpos0[2])
    sphere, box, mesh = (int(kind) for kind in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_MESH))
    assert [one[0] for one in geoms["plain"]] == [box] and geoms["ball"] == [(sphere, 0.06, 0.0, 0.0)] and geoms["ghost"] == []
    assert [one[0] for one in geoms["pieces"]] == [mesh] * 2
    assert heights == pytest.approx({"plain": -0.1, "ball": -0.06, "pieces": 0.0, "ghost": 0.0}, abs=1e-6)
    files = {"urdf": "urdf/robot_{}.urdf", "ros": "ros/robot_description/urdf/robot_{}.urdf", "sdf": "sdf/robot_{}/model.sdf"}
    for path, kinds in files.items():
        texts = {mode: bytes(made[path].files[kinds.format(mode)]).decode() for mode in geoms}  # type: ignore[arg-type]
        shapes = {mode: re.findall(r"<collision.*?<geometry>\s*<(\w+)", text, re.DOTALL) for mode, text in texts.items()}
        assert shapes == {"plain": ["mesh"], "ball": ["sphere"], "pieces": ["mesh"] * 2, "ghost": []}
    stages = {mode: bytes(made["usd"].files[f"usd/robot_{mode}.usda"]) for mode in geoms}  # type: ignore[arg-type]
    assert {mode: stage.count(b"PhysicsCollisionAPI") for mode, stage in stages.items()} == {"plain": 1, "ball": 1, "pieces": 2, "ghost": 0}
    assert {robot.mode.name: len(robot.assembly.occurrences[1].touching) for robot in compilation.robots} == {
        "plain": 1, "ball": 1, "pieces": 2, "ghost": 0,
    }


@pytest.mark.parametrize(("mode", "kinds"), [("", ["mesh", "mesh"]), (", mode: ball", ["sphere", "sphere"])])
def test_nested_documents_have_the_shapes_of_their_own_mode(tmp_path: Path, shared_store: str, mode: str, kinds: list[str]) -> None:
    """The modes of the outer document do not select shapes in the nested document, even if they have the same names."""
    workspace(tmp_path)
    (tmp_path / "inner.yaml").write_text(MODES.replace("{on: floor}", "{xyz: 0 0 1 m}").replace("name: robot", "name: inner"))
    outer = f"""\
thingc: assembly/1
name: robot
components:
  base: {{frame: true}}
  inner: {{assembly: inner.yaml, at: {{in: base.origin}}{mode}}}
modes: {{plain: {{root: base}}, ball: {{root: base, gravity: wall}}}}
"""
    _, made = built(tmp_path, outer, shared_store, ("urdf",))
    texts = [bytes(made["urdf"].files[f"urdf/robot_{name}.urdf"]).decode() for name in ("plain", "ball")]  # type: ignore[arg-type]
    assert [kind for text in texts for kind in re.findall(r"<collision.*?<geometry>\s*<(\w+)", text, re.DOTALL)] == kinds


LINK = """\
thingc: assembly/1
name: robot
components:
  base: {frame: true}
  foot:
    link: true
    mass: 1 kg
    shapes: [{box: 40 20 10 mm}]
    at: {in: base.origin, xyz: 0 0 100 mm}
    collision:
      targets: {urdf: {shapes: [{cylinder: {radius: 8 mm, length: 30 mm}}]}}
      modes:
        ball: {shapes: [{sphere: {radius: 60 mm}}]}
        ghost: none
modes:
  plain: {root: base, base: free, at: {on: floor}}
  ball: {root: base, base: free, at: {on: floor}}
  ghost: {root: base, base: free}
"""


def test_modes_and_formats_replace_the_collision_shapes_of_a_link(
    tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str],
) -> None:
    """Also in the viewer and in `thingc collision`. The mass and the drawn shape do not change."""
    compilation, made = built(tmp_path, LINK, shared_store, ("mjcf", "urdf", "html"))
    assert [robot.assembly.occurrences[1].collides for robot in compilation.robots] == [True, True, False]
    kinds, heights = {}, {}
    for mode in ("plain", "ball", "ghost"):
        model = model_of(made["mjcf"], f"robot_{mode}")
        kinds[mode] = [mujoco.mjtGeom(int(model.geom_type[k])).name[7:] for k in range(model.ngeom) if model.geom_contype[k]]
        heights[mode] = float(model.qpos0[2])
        assert model.ngeom == 1 + len(kinds[mode]) and model.body_mass.sum() == pytest.approx(1.0)
    assert kinds == {"plain": ["BOX"], "ball": ["SPHERE"], "ghost": []}
    assert heights == pytest.approx({"plain": -0.095, "ball": -0.04, "ghost": 0.0}, abs=1e-9)
    urdf = {mode: bytes(made["urdf"].files[f"urdf/robot_{mode}.urdf"]).decode() for mode in kinds}  # type: ignore[arg-type]
    found = {mode: re.findall(r"<collision.*?<geometry>\s*<(\w+)", text, re.DOTALL) for mode, text in urdf.items()}
    assert found == {"plain": ["cylinder"], "ball": ["sphere"], "ghost": []}
    page = bytes(made["html"].files["html/robot.html"]).decode()  # type: ignore[arg-type]
    robot = json.loads(re.search(r'<script id="thingc-robot"[^>]*>(.*?)</script>', page, re.DOTALL)[1])  # type: ignore[index]
    assert [shape["shape"] for shape in robot["occurrences"][1]["collision"]] == ["box"]
    replaced = [{key: [one["shape"] for one in shapes] for key, shapes in mode.get("collision", {}).items()} for mode in robot["modes"]]
    assert replaced == [{}, {"1": ["sphere"]}, {"1": []}]
    box, sphere, cylinder = 40 * 20 * 10, 4 / 3 * math.pi * 60**3, math.pi * 8**2 * 30
    for words, volume in (("", box), ("plain", box), ("ball", sphere), ("ghost", None), ("plain --target urdf", cylinder)):
        words = f"--mode {words}" if words else ""
        assert main(["collision", str(tmp_path / "robot.yaml"), "--format", "json", *words.split()]) == 0
        (measured,) = json.loads(capsys.readouterr().out)["collision"]
        assert measured["ratio"] == (None if volume is None else pytest.approx(volume / box, rel=0.02)), words


def test_unknown_mode_is_reported_at_its_shapes(tmp_path: Path, shared_store: str) -> None:
    workspace(tmp_path)
    (tmp_path / "robot.yaml").write_text(MODES.replace("pieces: {decompose", "peices: {decompose"))
    with Environment(str(tmp_path / "robot.yaml"), Options(store=shared_store)) as environment:
        (found,) = pipeline.compile(environment).report.diagnostics
    assert (found.code.code, found.message, found.help) == ("TC308", "there is no mode `peices`", "did you mean `pieces`?")
    assert found.span is not None and MODES.splitlines()[found.span.line - 1].strip().startswith("pieces:")


COARSE = """\
from build123d import Box, Pos
from thingc import Thing

class Bracket(Thing):
    "An L of two plates, with a simpler shape for contacts."
    def result(self):
        return Pos(20, 0, 2) * Box(40, 20, 4) + Pos(2, 0, 20) * Box(4, 20, 40)
    def mass(self):
        return 0.006
    def collision(self):
        return RETURNED
"""


@pytest.mark.parametrize(("returned", "found"), [
    ("[Pos(20, 0, 2) * Box(40, 20, 4), Pos(2, 0, 20) * Box(4, 20, 40)]", []),
    ("self.result()", [("TC406", "solid 1 of collision() is not convex (68.1% of its hull is empty)")]),
    ("1 / 0", [("TC401", "ZeroDivisionError")]),
])
def test_solids_of_the_method_collision_are_convex(
    tmp_path: Path, shared_store: str, returned: str, found: list[tuple[str, str]],
) -> None:
    """The hull of the L is a prism over a polygon of five corners, whose area is 40 x 40 - 36 x 36 / 2 = 952 mm^2; the L has 304 mm^2."""
    workspace(tmp_path)
    (tmp_path / "parts.py").write_text(COARSE.replace("RETURNED", returned))
    (tmp_path / "robot.yaml").write_text("thingc: assembly/1\nname: robot\ncomponents:\n  one: {part: parts:Bracket, collision: part}\n")
    with Environment(str(tmp_path / "robot.yaml"), Options(store=shared_store)) as environment:
        compilation = pipeline.compile(environment)
    diagnostics = compilation.report.diagnostics
    assert [one.code.code for one in diagnostics] == [code for code, _ in found]
    for one, (_, text) in zip(diagnostics, found, strict=True):
        assert text in one.message and one.span is not None and one.span.line == 4
    if not diagnostics:
        assert compilation.assembly is not None
        sizes = [piece.solid.size for piece in compilation.assembly.occurrences[0].touching]  # type: ignore[union-attr]
        assert sizes == [pytest.approx((0.02, 0.01, 0.002)), pytest.approx((0.002, 0.01, 0.02))]


PAIRS = """\
thingc: assembly/1
name: robot
components:
  floor: {link: true, shapes: [{box: 1 1 0.1 m, friction: {slide: 0.4}}]}
  left: {link: true, mass: 1 kg, shapes: [{sphere: {radius: 50 mm}}, {sphere: {radius: 10 mm}, at: {xyz: 0 0 300 mm}}]}
  right: {link: true, mass: 1 kg, shapes: [{sphere: {radius: 50 mm}}]}
joints:
  slide_l: {type: prismatic, parent: floor.origin, child: left.origin, axis: [0, 0, 1], limit: {lower: 0 m, upper: 1 m}}
  slide_r: {type: prismatic, parent: left.origin, child: right.origin, axis: [0, 1, 0], limit: {lower: 0 m, upper: 1 m}}
modes:
  m:
    root: floor
    contacts: CONTACTS
"""


def contacts_of(folder: Path, store: str, contacts: str, qpos: list[float]) -> tuple[mujoco.MjModel, mujoco.MjData]:
    workspace(folder)
    _, made = built(folder, PAIRS.replace("CONTACTS", contacts), store)
    model = model_of(made["mjcf"], "robot_m")
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return model, data


def test_a_pair_has_its_friction_and_margin_in_mujoco(tmp_path: Path, shared_store: str) -> None:
    entry = "{between: [left, right], friction: {slide: 1.5, torsion: 2 mm}, margin: 4 mm, gap: 1 mm}"
    model, data = contacts_of(tmp_path, shared_store, f"{{pairs: [{entry}]}}", [0.5, 0.098])
    assert model.npair == 2
    (contact,) = data.contact  # the two spheres overlap by 2 mm; a joint connects their links, so only the pair collides
    assert {model.geom(int(g)).name for g in contact.geom} == {"left:collision", "right:collision"}
    assert contact.dist == pytest.approx(-0.002)
    assert list(contact.friction) == pytest.approx([1.5, 1.5, 0.002, 0.0001, 0.0001]) and contact.dim == 4
    assert set(model.pair_margin) == {0.004} and set(model.pair_gap) == {0.001}
    data.qpos[:] = [0.5, 0.1025]  # 2.5 mm apart, within the margin
    mujoco.mj_forward(model, data)
    assert len(data.contact) == 1 and data.contact[0].dist == pytest.approx(0.0025)
    data.qpos[:] = [0.5, 0.11]
    mujoco.mj_forward(model, data)
    assert len(data.contact) == 0


def test_without_friction_a_pair_has_the_friction_of_the_shapes(tmp_path: Path, shared_store: str) -> None:
    model, data = contacts_of(tmp_path, shared_store, "{pairs: [{between: [left, floor]}]}", [0.09, 0.5])
    touching = {frozenset(model.geom(int(g)).name for g in contact.geom): contact.friction[0] for contact in data.contact}
    assert touching == {frozenset({"floor:collision", f"{name}:collision"}): 0.4 for name in ("left", "right")}


GROUPS = """\
thingc: assembly/1
name: robot
components:
  floor: {link: true, shapes: [{box: 1 1 0.1 m}]}
  a: {link: true, mass: 1 kg, shapes: [{sphere: {radius: 50 mm}}]}
  b: {link: true, mass: 1 kg, shapes: [{sphere: {radius: 50 mm}}]}
  c: {link: true, mass: 1 kg, shapes: [{sphere: {radius: 50 mm}}]}
  m_1: {link: true, mass: 1 kg, inertia: {ixx: 1 g*m^2, iyy: 1 g*m^2, izz: 1 g*m^2}}
  m_2: {link: true, mass: 1 kg, inertia: {ixx: 1 g*m^2, iyy: 1 g*m^2, izz: 1 g*m^2}}
  m_3: {link: true, mass: 1 kg, inertia: {ixx: 1 g*m^2, iyy: 1 g*m^2, izz: 1 g*m^2}}
joints:
  p_1: {type: prismatic, parent: floor.origin, child: m_1.origin, axis: [0, 0, 1], limit: {lower: 0 m, upper: 1 m}}
  p_2: {type: prismatic, parent: floor.origin, child: m_2.origin, axis: [0, 0, 1], limit: {lower: 0 m, upper: 1 m}}
  p_3: {type: prismatic, parent: floor.origin, child: m_3.origin, axis: [0, 0, 1], limit: {lower: 0 m, upper: 1 m}}
  q_1: {type: prismatic, parent: m_1.origin, child: a.origin, axis: [0, 1, 0], limit: {lower: 0 m, upper: 1 m}}
  q_2: {type: prismatic, parent: m_2.origin, child: b.origin, axis: [0, 1, 0], limit: {lower: 0 m, upper: 1 m}}
  q_3: {type: prismatic, parent: m_3.origin, child: c.origin, axis: [0, 1, 0], limit: {lower: 0 m, upper: 1 m}}
modes:
  m:
    root: floor
    contacts:
      groups: CONTACTS
"""


@pytest.mark.parametrize(("groups", "expected"), [
    ("{}", {"a b", "a c", "b c", "a floor", "b floor", "c floor"}),
    ("{g: {components: [a, b], collide: [others]}}", {"a c", "b c", "a floor", "b floor", "c floor"}),
    ("{g: {components: [a, b], collide: [g]}}", {"a b", "c floor"}),
    ("{g: {components: [a], collide: [h]}, h: {components: [b], collide: []}}", {"a b", "c floor"}),
    ("{g: {components: ['?'], collide: []}}", set()),
])
def test_groups_collide_as_listed(tmp_path: Path, shared_store: str, groups: str, expected: set[str]) -> None:
    workspace(tmp_path)
    _, made = built(tmp_path, GROUPS.replace("CONTACTS", groups), shared_store)
    model = model_of(made["mjcf"], "robot_m")
    data = mujoco.MjData(model)
    data.qpos[:] = [0.08, 0.0, 0.08, 0.01, 0.08, 0.02]
    mujoco.mj_forward(model, data)
    pairs = {" ".join(sorted(model.geom(int(g)).name.partition(":")[0] for g in contact.geom)) for contact in data.contact}
    assert pairs == expected


def test_contacts_of_a_nested_robot_come_with_its_mode(tmp_path: Path, shared_store: str) -> None:
    workspace(tmp_path)
    tmp_path.joinpath("hand.yaml").write_text(PAIRS.replace("name: robot", "name: hand").replace("CONTACTS", (
        "{pairs: [{between: [left, right], margin: 4 mm}], groups: {g: {components: [left, right], collide: [others]}}}"
    )))
    scene = """\
thingc: assembly/1
name: robot
components:
  ground: {frame: true}
  one: {assembly: hand.yaml, mode: m, at: {in: ground.origin}}
  two: {assembly: hand.yaml, mode: m, at: {in: ground.origin, xyz: 3 0 0 m}}
modes: {m: {root: ground}}
"""
    _, made = built(tmp_path, scene, shared_store)
    model = model_of(made["mjcf"], "robot_m")
    ends = [(model.geom(int(model.pair_geom1[k])).name, model.geom(int(model.pair_geom2[k])).name) for k in range(model.npair)]
    assert ends == [(f"{hand}/left:collision{k}", f"{hand}/right:collision") for hand in ("one", "two") for k in ("", "_1")]
    assert set(model.pair_margin) == {0.004}
    types = {hand: int(model.geom(f"{hand}/left:collision").contype[0]) for hand in ("one", "two")}
    assert types == {"one": 2, "two": 4} and model.geom("one/floor:collision").contype[0] == 1


@pytest.mark.parametrize(("contacts", "words"), [
    ("{pairs: [{between: [left, nobody]}]}", "no component `nobody`"),
    ("{pairs: [{between: [left, left]}]}", "`left` cannot collide with itself"),
    ("{pairs: [{between: [left, right]}, {between: [right, left]}]}", "the contact pair of `right` and `left` is listed twice"),
    ("{pairs: [{between: [left, right]}], exclude: [[right, left]]}", "`left` and `right` are in both `pairs` and `exclude`"),
    ("{pairs: [{between: [left, right], margin: 1 mm, gap: 2 mm}]}", "`gap` is larger than `margin`"),
    ("{pairs: [{between: [left, right], margin: -1 mm, gap: 2 mm}]}", "`margin` must be at least 0"),
    ("{pairs: [{between: [left, right], margin: -1 mm}]}", "`margin` must be at least 0"),
    ("{groups: {g: {components: [left], collide: [fingers]}}}", "there is no contact group `fingers`"),
    ("{groups: {others: {components: [left], collide: []}}}", "a contact group cannot have the reserved name `others`"),
    ("{groups: {g: {components: [left], collide: []}, h: {components: ['l*'], collide: []}}}", "`left` is in both contact groups"),
])
def test_wrong_contacts_get_one_error_at_their_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], contacts: str, words: str,
) -> None:
    workspace(tmp_path)
    tmp_path.joinpath("robot.yaml").write_text(PAIRS.replace("CONTACTS", contacts))
    assert main(["check", str(tmp_path / "robot.yaml"), "--format", "json"]) == 1
    (diagnostic,) = json.loads(capsys.readouterr().out)["diagnostics"]
    assert words in diagnostic["message"] and diagnostic["line"] == 13, diagnostic


@pytest.mark.parametrize("collision", ["hull", "none", "{kind: box}", "{shapes: [{box: 1 1 1 mm}]}", "{modes: {m: {decompose: {}}}}"])
def test_collision_of_a_link_only_replaces_its_shapes(tmp_path: Path, capsys: pytest.CaptureFixture[str], collision: str) -> None:
    link = "{link: true, mass: 1 kg, shapes: [{sphere: {radius: 1 cm}}],"
    text = f"thingc: assembly/1\nname: robot\ncomponents:\n  b: {link}\n    collision: {collision}}}\nmodes: {{m: {{root: b}}}}\n"
    tmp_path.joinpath("robot.yaml").write_text(text)
    assert main(["check", str(tmp_path / "robot.yaml"), "--format", "json"]) == 1
    (diagnostic,) = json.loads(capsys.readouterr().out)["diagnostics"]
    assert "`collision` of a link can only be set" in diagnostic["message"] and diagnostic["line"] == 5


@pytest.mark.parametrize(("collision", "words"), [
    ("{shapes: [{box: 80 10 6 cm}]}", "the collision shape `box` extends"),
    ("{shapes: [{sphere: {radius: 1 mm}, at: {xyz: 1 0 0 m}}]}", "the collision shape `sphere` extends"),
    ("{shapes: []}", "at least one item"),
    ("{shapes: [{box: 0 10 6 mm}]}", "must be above 0"),
    ("{shapes: [{cone: {radius: 1 mm}}]}", "`cone`"),
    ("{shapes: [{box: 1 1 1 mm, decompose: true}]}", "`decompose` can only be used with `mesh`"),
    ("{shapes: [{box: 1 1 1 mm, for: visual}]}", "`for`"),
    ("{decompose: {pieces: 0}}", "`pieces` must be at least 1"),
    ("{decompose: {pieces: 2.5}}", "whole number"),
    ("{decompose: {}, shapes: [{box: 1 1 1 mm}]}", "found `shapes` and `decompose`"),
    ("{shapes: [{mesh: meshes/none.stl}]}", "meshes/none.stl"),
    ("boxes", "expected `hull`"),
    ("{targets: {ros: box}}", "unknown key `ros`"),
    ("{kind: box, decompose: {}}", "found `kind` and `decompose`"),
])
def test_wrong_shapes_get_one_diagnostic(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], collision: str, words: str, shared_store: str,
) -> None:
    workspace(tmp_path)
    text = f"thingc: assembly/1\nname: robot\ncomponents:\n  b:\n    part: parts:Bracket\n    collision: {collision}\n"
    tmp_path.joinpath("robot.yaml").write_text(text)
    main(["check", str(tmp_path / "robot.yaml"), "--format", "json", "--store", shared_store])
    (diagnostic,) = json.loads(capsys.readouterr().out)["diagnostics"]
    assert words in diagnostic["message"] and diagnostic["line"] == 6, diagnostic


def test_shapes_survive_a_round_trip_through_urdf_and_mjcf(tmp_path: Path, shared_store: str) -> None:
    workspace(tmp_path)
    tmp_path.joinpath("robot.yaml").write_text(ROBOT.replace("      - {capsule: {radius: 4 mm, length: 20 mm}", "      - {box: 4 4 20 mm"))
    words = ["--emit", "mjcf", "--emit", "urdf", "--store", shared_store, "-o", str(tmp_path / "out")]
    assert main(["build", str(tmp_path / "robot.yaml"), *words]) == 0
    original = mujoco.MjModel.from_xml_path(str(next((tmp_path / "out").rglob("robot_free.xml"))))
    for source in ("mjcf/robot_free.xml", "urdf/robot_free.urdf"):
        folder = tmp_path / source[:4]
        folder.mkdir()
        assert main(["import", str(next((tmp_path / "out").rglob(source.rpartition("/")[2]))), "-o", str(folder)]) == 0
        document = next(one for one in folder.rglob("*.yaml") if "build" not in one.parts)
        assert main(["build", str(document), "--emit", "mjcf", "--store", shared_store, "-o", str(folder / "out")]) == 0
        model = mujoco.MjModel.from_xml_path(str(next((folder / "out").rglob("mjcf/robot*_*.xml"))))
        shapes = []
        for one in (original, model):
            data = mujoco.MjData(one)
            mujoco.mj_forward(one, data)
            body = data.body(one.body(1).name)
            centre = [
                (int(one.geom_type[k]), *np.round((data.geom_xpos[k] - body.xpos) @ body.xmat.reshape(3, 3), 5))
                for k in range(one.ngeom) if one.geom_contype[k]
            ]
            shapes.append(sorted(centre))
        assert np.array(shapes[0]) == pytest.approx(np.array(shapes[1]), abs=2e-5)


def test_deviations_of_a_box_around_an_l_shape(tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The bounding box of an L of two plates extends up to 36 mm / sqrt(2) beyond the part, and has a known volume."""
    workspace(tmp_path)
    for collision, outside, beyond, ratio in (
        ("box", 0.0, 0.036, 40 * 20 * 40 / (40 * 20 * 4 + 4 * 20 * 36)), ("mesh", 0.0, 0.0, 1.0),
        ("{shapes: [{box: 40 20 4 mm, at: {xyz: 20 0 2 mm}}]}", 0.036, 0.0, 40 * 20 * 4 / (40 * 20 * 4 + 4 * 20 * 36)),
    ):
        text = f"thingc: assembly/1\nname: robot\ncomponents:\n  b:\n    part: parts:Bracket\n    collision: {collision}\n"
        tmp_path.joinpath("robot.yaml").write_text(text)
        assert main(["collision", str(tmp_path / "robot.yaml"), "--format", "json", "--store", shared_store]) == 0
        (found,) = json.loads(capsys.readouterr().out)["collision"]
        assert found["outside"] == pytest.approx(outside, abs=1e-6) and found["beyond"] == pytest.approx(beyond, abs=1e-6)
        assert found["ratio"] == pytest.approx(ratio, rel=1e-4) and found["paths"] == ["b"]


def test_formats_can_have_different_shapes(tmp_path: Path, shared_store: str) -> None:
    workspace(tmp_path)
    text = """\
thingc: assembly/1
name: robot
components:
  b:
    part: parts:Bracket
    collision:
      kind: box
      targets: {mjcf: {shapes: [{sphere: {radius: 5 mm}}, {mesh: meshes/wedge.stl}]}, urdf: sphere, sdf: none}
modes: {free: {root: b, base: free}}
"""
    _, made = built(tmp_path, text, shared_store, ("mjcf", "urdf", "sdf", "usd", "ros"))
    model = model_of(made["mjcf"], "robot_free")
    kinds = [int(model.geom_type[k]) for k in range(model.ngeom) if model.geom_contype[k]]
    assert kinds == [mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_MESH]
    for target in ("urdf", "ros"):
        (urdf,) = (data for path, data in made[target].files.items() if path.endswith(".urdf"))
        assert isinstance(urdf, bytes) and urdf.count(b"<collision") == 1 and b"<sphere" in urdf
    sdf = [data for path, data in made["sdf"].files.items() if path.endswith("model.sdf")]
    assert isinstance(sdf[0], bytes) and b"<collision" not in sdf[0]
    (usd,) = (data for path, data in made["usd"].files.items() if path.endswith(".usda"))
    assert isinstance(usd, bytes) and usd.count(b"def Cube") == 1


@pytest.mark.parametrize(("contacts", "loads"), [
    ("{}", False), ("{groups: {g: {components: [a, b], collide: [others]}}}", True),
    ("{groups: {g: {components: [a, b], collide: [others]}}, pairs: [{between: [a, b]}]}", False),
])
def test_mjx_check_uses_groups_and_pairs(
    tmp_path: Path, shared_store: str, contacts: str, loads: bool,
) -> None:
    """MJX has no contacts between a cylinder and a box. thingc replaces the cylinder exactly if `mjx.put_model` rejects the model."""
    from mujoco import mjx

    workspace(tmp_path)
    text = GROUPS.replace("  a: {link: true, mass: 1 kg, shapes: [{sphere: {radius: 50 mm}}]}", (
        "  a: {link: true, mass: 1 kg, shapes: [{cylinder: {radius: 50 mm, length: 100 mm}}]}"
    )).replace("  b: {link: true, mass: 1 kg, shapes: [{sphere: {radius: 50 mm}}]}", (
        "  b: {link: true, mass: 1 kg, shapes: [{box: 100 100 100 mm}]}"
    )).replace("  floor: {link: true, shapes: [{box: 1 1 0.1 m}]}", "  floor: {frame: true}").replace("contacts:\n      groups: CONTACTS", (
        f"contacts: {contacts}"
    ))
    tmp_path.joinpath("robot.yaml").write_text(text)
    words = ["--emit", "mjcf", "--store", shared_store, "-o", str(tmp_path / "out")]
    assert main(["build", str(tmp_path / "robot.yaml"), *words]) == 0
    model = mujoco.MjModel.from_xml_path(str(next((tmp_path / "out").rglob("robot_m.xml"))))
    if loads:
        mjx.put_model(model)
    else:
        with pytest.raises(NotImplementedError):
            mjx.put_model(model)
    assert main(["build", str(tmp_path / "robot.yaml"), *words, "--compat", "mjx"]) == 0
    suited = mujoco.MjModel.from_xml_path(str(next((tmp_path / "out").rglob("robot_m.xml"))))
    mjx.put_model(suited)
    replaced = suited.geom("a:collision").type[0] == mujoco.mjtGeom.mjGEOM_MESH
    assert replaced is not loads  # a cylinder becomes a prism only if MJX needs it


def test_picture_shows_transparent_collision_shapes(tmp_path: Path, shared_store: str) -> None:
    workspace(tmp_path)
    _, made = built(tmp_path, ROBOT, shared_store)
    files = made["mjcf"].files
    text = with_collision(files["mjcf/robot_free.xml"].decode())  # type: ignore[union-attr]
    model = model_of(Artifacts(files={**files, "mjcf/robot_free.xml": text.encode()}), "robot_free")
    shown = {model.geom(k).name: (int(model.geom_group[k]), round(float(model.geom_rgba[k][3]), 6)) for k in range(model.ngeom)}
    assert shown == {"bracket": (2, 1.0), "bracket:collision": (1, 0.4), **{f"bracket:collision_{k}": (1, 0.4) for k in range(1, 5)}}


def test_shapes_are_measured_in_the_given_format(
    tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str],
) -> None:
    workspace(tmp_path)
    component = "{part: parts:Bracket, collision: {kind: mesh, targets: {urdf: box, sdf: none}}}"
    tmp_path.joinpath("robot.yaml").write_text(f"thingc: assembly/1\nname: robot\ncomponents: {{b: {component}}}\n")
    ratios = {}
    for target in ("mjcf", "urdf", "sdf"):
        words = ["--target", target, "--format", "json", "--store", shared_store]
        assert main(["collision", str(tmp_path / "robot.yaml"), *words]) == 0
        (found,) = json.loads(capsys.readouterr().out)["collision"]
        ratios[target] = found["ratio"]
    assert ratios == {"mjcf": pytest.approx(1.0), "urdf": pytest.approx(40 * 20 * 40 / (40 * 20 * 4 + 4 * 20 * 36), rel=1e-4), "sdf": None}


def test_a_mode_has_at_most_31_groups(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    workspace(tmp_path)
    for count, code in ((31, 0), (32, 1)):
        members = ["left", "right", *(f"f{k}" for k in range(2, count))]
        groups = ", ".join(f"g{k}: {{components: [{member}], collide: []}}" for k, member in enumerate(members))
        frames = "".join(f"  f{k}: {{link: true, at: {{in: floor.origin}}}}\n" for k in range(2, count))
        text = PAIRS.replace("CONTACTS", f"{{groups: {{{groups}}}}}").replace("joints:\n", f"{frames}joints:\n")
        tmp_path.joinpath("robot.yaml").write_text(text)
        assert main(["check", str(tmp_path / "robot.yaml"), "--format", "json"]) == code
        messages = [one["message"] for one in json.loads(capsys.readouterr().out)["diagnostics"]]
        assert messages == ([] if code == 0 else ["mode `m` has 32 contact groups (at most 31 are supported)"])
