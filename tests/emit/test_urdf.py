"""URDF files read by MuJoCo, compared with chains of matrices and with MJCF models of the same robot."""

from __future__ import annotations

import dataclasses
import math
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from msgspec.structs import replace

from emit import small_robot
from graph.builder import (
    LEAD,
    as_matrix,
    assembly as document,
    box,
    component,
    coordinates_of,
    inv,
    linked,
    mimic,
    mode,
    ref,
    rx,
    t,
    where,
)
from robot.test_spanning_tree_properties import COUNTS, WITHOUT_LEAD, Tree, build, robots, world_of
from thingc.base.diagnostics import Code, Report
from thingc.base.pose import Pose, make_pose, rpy_of
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.coordinates import Dynamics, Limit
from thingc.model.resolve.types import Drive
from thingc.model.robot.kinematic_tree import root as rooted
from thingc.model.robot.tree import in_link
from thingc.targets.artifact import Artifacts
from thingc.targets.geometry import Shape
from thingc.targets.mjcf.emit import emit as emit_mjcf
from thingc.targets.name_mangling import MangledNames
from thingc.targets.request import EmitRequest
from thingc.targets.urdf.emit import emit
from thingc.targets.urdf.links import parts
from thingc.tools.cli.main import main

trees = st.builds(build, st.integers(0, 2**32 - 1), st.integers(2, 6), st.just(tuple(COUNTS)))
PITCH = 0.008 / (2.0 * math.pi)
HELD = ":held"
"""Suffix of MJCF bodies and sites that only hold a mount."""


def asked(assembly: Assembly, folder: str) -> EmitRequest:
    report = Report()
    chosen = tuple(robot for robot in (rooted(assembly, m, report) for m in assembly.modes) if robot is not None)
    assert report.diagnostics == []
    return EmitRequest(
        assembly=assembly, robots=chosen, store=Store(folder), report=report, geometry=None,  # type: ignore[arg-type]
        workspace=small_robot.WORKSPACE,
    )


def read(made: Artifacts, name: str) -> mujoco.MjModel:
    """The MuJoCo model of a file and its meshes."""
    assets = {path.removeprefix("urdf/"): data for path, data in made.files.items() if path.endswith(".obj")}
    text = made.files[f"urdf/{name}.urdf"]
    assert isinstance(text, bytes)
    return mujoco.MjModel.from_xml_string(text.decode(), assets)  # type: ignore[arg-type]


def tree_of(made: Artifacts, name: str) -> ElementTree.Element:
    text = made.files[f"urdf/{name}.urdf"]
    assert isinstance(text, bytes)
    return ElementTree.fromstring(text)


def at(model: mujoco.MjModel, q: dict[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for path, value in q.items():
        data.joint(path).qpos = value
    mujoco.mj_forward(model, data)
    return data


def body_pose(data: mujoco.MjData, name: str) -> Any:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = data.body(name).xmat.reshape(3, 3), data.body(name).xpos
    return matrix


def frame_body(model: mujoco.MjModel, link: str) -> str:
    """Name of the body that corresponds to the frame of a link in MJCF."""
    return f"{link}_frame" if f"{link}_frame" in {model.body(k).name for k in range(model.nbody)} else link


def with_mimic_positions(made: Artifacts, name: str, q: dict[str, float]) -> dict[str, float]:
    """Add the positions of mimic joints to q, because MuJoCo does not enforce them: a screw's slide follows its thread."""
    q = dict(q)
    for joint in tree_of(made, name).iter("joint"):
        follows = joint.find("mimic")
        if follows is not None:
            q[joint.attrib["name"]] = float(follows.attrib["multiplier"]) * q[follows.attrib["joint"]] + float(follows.attrib["offset"])
    return q


@settings(max_examples=10)
@given(trees)
def test_poses_of_random_trees_match_matrices(tree: Tree) -> None:
    """MuJoCo loads URDF files of random trees. Poses of occurrences and frames equal chains of matrices."""
    with tempfile.TemporaryDirectory() as folder:
        made = emit(asked(tree.assembly, folder))
    inside = in_link(tree.assembly)
    for name, robot in robots(tree.assembly).items():
        model = read(made, f"tree_{name}")
        data = at(model, with_mimic_positions(made, f"tree_{name}", tree.q))
        expected = world_of(tree, name)
        first = tree.assembly.links[robot.bodies[0].link]
        # A floating base begins where the reader puts it.
        start = next(expected[k] @ inv(as_matrix(inside[p])) for p, k in enumerate(tree.order) if tree.assembly.link_of[p] == first.index)
        moved = np.eye(4) if robot.base == "fixed" else inv(start)
        for position, k in enumerate(tree.order):
            link = tree.assembly.links[tree.assembly.link_of[position]].name
            frame = body_pose(data, frame_body(model, link))
            assert frame @ as_matrix(inside[position]) == pytest.approx(moved @ expected[k], abs=1e-9)
            assert body_pose(data, f"c{k}_origin") == pytest.approx(moved @ expected[k], abs=1e-9)


@settings(max_examples=8)
@given(trees)
def test_every_link_has_a_mass_and_moving_children_come_first(tree: Tree) -> None:
    """PyBullet gives 1 kg to a link without `<inertial>`, and ikpy follows the first joint of a link."""
    with tempfile.TemporaryDirectory() as folder:
        request = asked(tree.assembly, folder)
        made = emit(request)
    for robot in request.robots:
        root = tree_of(made, f"tree_{robot.mode.name}")
        masses = [float(link.find("inertial/mass").attrib["value"]) for link in root.findall("link") if link.attrib["name"] != "world"]  # type: ignore[union-attr]
        assert math.fsum(masses) == pytest.approx(math.fsum(link.properties.mass for link in tree.assembly.links), abs=1e-7)
        first: dict[str, str] = {}
        kinds: dict[str, set[str]] = {}
        for joint in root.findall("joint"):
            parent = joint.find("parent").attrib["link"]  # type: ignore[union-attr]
            first.setdefault(parent, joint.attrib["type"])
            kinds.setdefault(parent, set()).add(joint.attrib["type"])
        assert all(kind != "fixed" or kinds[parent] == {"fixed"} for parent, kind in first.items())


@settings(max_examples=8)
@given(st.builds(build, st.integers(0, 2**32 - 1), st.integers(2, 6), st.just(WITHOUT_LEAD)))
def test_mass_matrix_and_gravity_match_mjcf(tree: Tree) -> None:
    """Total mass, mass matrix and gravity torque equal those of the MJCF model of the same tree."""
    with tempfile.TemporaryDirectory() as folder:
        request = asked(tree.assembly, folder)
        made, other = emit(request), emit_mjcf(request)
    between = sum(1 for loss in made.losses if ": a joint for each coordinate, with links of 1e-9 kg" in loss.what)
    for robot in request.robots:
        name = f"tree_{robot.mode.name}"
        model = read(made, name)
        text = other.files[f"mjcf/{name}.xml"]
        assert isinstance(text, bytes)
        reference = mujoco.MjModel.from_xml_string(text.decode())
        data, expected = at(model, tree.q), at(reference, tree.q)
        assert model.body_mass.sum() == pytest.approx(reference.body_mass.sum(), abs=2.5e-9 * max(1, between))
        if robot.base != "fixed" or not tree.q:
            continue
        joints = [model.joint(path).dofadr[0] for path in tree.q], [reference.joint(path).dofadr[0] for path in tree.q]
        full, wanted = np.zeros((model.nv, model.nv)), np.zeros((reference.nv, reference.nv))
        mujoco.mj_fullM(model, data, full)
        mujoco.mj_fullM(reference, expected, wanted)
        wanted = wanted[np.ix_(joints[1], joints[1])]
        assert full[np.ix_(joints[0], joints[0])] == pytest.approx(wanted, rel=1e-6, abs=1e-6 * np.abs(wanted).max())
        torque = expected.qfrc_bias[joints[1]]
        assert data.qfrc_bias[joints[0]] == pytest.approx(torque, rel=1e-6, abs=1e-6 * max(np.abs(torque).max(), 1e-3))


@settings(max_examples=150)
@given(*[st.floats(-math.pi, math.pi) | st.sampled_from([0.0, math.pi / 2, -math.pi / 2, math.pi / 2 - 1e-9, math.pi])] * 3)
def test_rpy_round_trips_to_the_rotation(roll: float, pitch: float, yaw: float) -> None:
    """`rpy_of` returns angles with the same rotation, at gimbal lock too."""
    rotation = make_pose((0.0, 0.0, 0.0), (roll, pitch, yaw)).rotation
    assert np.array(make_pose((0.0, 0.0, 0.0), rpy_of(rotation)).rotation) == pytest.approx(np.array(rotation), abs=1e-15)


# --- the small robot, by hand -----------------------------------------------------------------------------------------


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(str(tmp_path / "store"))


def test_visuals_and_materials_are_written(store: Store) -> None:
    """Each drawn occurrence has one visual with a material, and the mesh files are exactly those that the file refers to."""
    whole = small_robot.assembly(store)
    bare = tuple(replace(one, overrides=replace(one.overrides, collision="none")) for one in whole.occurrences)
    request = small_robot.request(replace(whole, occurrences=bare), store)
    made = emit(request)
    assert request.report.diagnostics == []
    bench = tree_of(made, "arm_bench")
    drawn = {visual.attrib["name"] for visual in bench.iter("visual")}
    assert drawn and drawn == {o.path for o in request.assembly.occurrences if o.drawn}
    files = {mesh.attrib["filename"] for mesh in bench.iter("mesh")}
    assert files == {path.removeprefix("urdf/") for path in made.files if path.endswith(".obj")}
    colours = {one.attrib["name"] for one in bench.findall("material")}
    assert colours and {one.attrib["name"] for one in bench.iterfind("link/visual/material")} <= colours
    assert emit(request).files == made.files


def test_mesh_uris_follow_the_workspace(store: Store, tmp_path: Path) -> None:
    """`mesh_uri` selects relative, `package://` or absolute paths of meshes. Without a folder, absolute paths become relative."""
    whole = replace(small_robot.assembly(store), name="My__Arm")
    bare = tuple(replace(one, overrides=replace(one.overrides, collision="none")) for one in whole.occurrences)
    asked_for = replace(small_robot.request(replace(whole, occurrences=bare), store), folder=str(tmp_path / "a b" / "My__Arm"))
    relative = emit(asked_for).files["urdf/My__Arm_bench.urdf"]
    assert isinstance(relative, bytes) and relative.count(b'filename="meshes/') > 3
    for word, folder in (
        ("package", "package://my_arm_description/meshes"), ("absolute", (tmp_path / "a b" / "My__Arm" / "urdf" / "meshes").as_uri()),
    ):
        made = emit(replace(asked_for, workspace=dataclasses.replace(asked_for.workspace, mesh_uri=word)))
        assert made.files["urdf/My__Arm_bench.urdf"] == relative.replace(b'filename="meshes/', f'filename="{folder}/'.encode())
    nowhere = replace(asked_for, folder=None, workspace=dataclasses.replace(asked_for.workspace, mesh_uri="absolute"))
    assert emit(nowhere).files["urdf/My__Arm_bench.urdf"] == relative


def test_absolute_mesh_uris_point_into_the_build(tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """With `mesh_uri = "absolute"`, the URIs point to the meshes in the output folder of the build."""
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\nmesh_uri = "absolute"\n')
    corners = ("0 0 0", "1 0 0", "0 1 0", "0 0 1")
    facets = ("f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4")
    (tmp_path / "corner.obj").write_text("\n".join([*(f"v {corner}" for corner in corners), *facets, ""]))
    (tmp_path / "r.yaml").write_text(
        "thingc: assembly/1\nname: r\ncomponents: {base: {file: corner.obj, unit: m, mass: 1 kg}}\nmodes: {m: {root: base, base: fixed}}\n",
    )
    for words, folder in (([], tmp_path / "build"), (["-o", str(tmp_path / "out")], tmp_path / "out")):
        assert main(["build", str(tmp_path / "r.yaml"), "--emit", "urdf", "--store", shared_store, *words]) == 0, capsys.readouterr().err
        named = {mesh.attrib["filename"] for mesh in ElementTree.parse(folder / "r" / "urdf" / "r_m.urdf").iter("mesh")}
        assert named and named <= {path.as_uri() for path in (folder / "r" / "urdf" / "meshes").iterdir()}


@pytest.mark.parametrize("document", ["assemblies/arm.yaml", "assemblies/minchw/minchw.yaml"])
def test_example_robots_match_mjcf(
    root: Path, tmp_path: Path, shared_store: str, document: str, capsys: pytest.CaptureFixture[str],
) -> None:
    """Frames, masses, mass matrix, gravity, limits, meshes and shapes of every mode equal those of MJCF at 20 random configurations."""
    assert main(["build", str(root / document), "--emit", "urdf,mjcf", "-o", str(tmp_path), "--store", shared_store]) == 0
    folder = tmp_path / Path(document).stem
    files = sorted((folder / "urdf").glob("*.urdf"))
    assert len(files) >= 3
    for file in files:
        model, reference = (mujoco.MjModel.from_xml_path(str(path)) for path in (file, folder / "mjcf" / f"{file.stem}.xml"))
        compare_with_mjcf(model, reference)
    meshes = [sorted((path.name, path.read_bytes()) for path in (folder / name).iterdir()) for name in ("mjcf/assets", "urdf/meshes")]
    assert meshes[0] == meshes[1]


def compare_with_mjcf(model: mujoco.MjModel, reference: mujoco.MjModel) -> None:
    """Compare a URDF model with its MJCF model. Mimic joints are set to given values, and a floating base is welded in URDF."""
    assert model.ngeom == reference.ngeom and (model.opt.gravity == reference.opt.gravity).all()
    assert model.body_mass.sum() == pytest.approx(reference.body_mass.sum(), rel=1e-12)
    paths = [reference.joint(k).name for k in range(reference.njnt) if reference.jnt_type[k] != mujoco.mjtJoint.mjJNT_FREE]
    names = [path.replace("/", "_") for path in paths]
    assert {model.joint(k).name for k in range(model.njnt)} == set(names)
    rows = [[one.joint(name).dofadr[0] for name in of] for one, of in ((model, names), (reference, paths))]
    for path, name in zip(paths, names):
        assert model.joint(name).range == pytest.approx(reference.joint(path).range, abs=1e-15)
        assert model.joint(name).damping == pytest.approx(reference.joint(path).damping)
        assert model.joint(name).frictionloss == pytest.approx(reference.joint(path).frictionloss)
    links = [name for k in range(1, reference.nbody) if not (name := reference.body(k).name).endswith(HELD)]
    sites = [name for k in range(reference.nsite) if not (name := reference.site(k).name).endswith(HELD)]
    bodies = [model.body(frame_body(model, link.replace("/", "_"))).id for link in links], [reference.body(link).id for link in links]
    frames = [model.body(site.replace("/", "_")).id for site in sites], [reference.site(site).id for site in sites]
    rng = np.random.default_rng(4)
    for _ in range(20):
        q = rng.uniform(-1.0, 1.0, len(paths))
        data, expected = mujoco.MjData(model), mujoco.MjData(reference)
        for path, name, value in zip(paths, names, q):
            data.joint(name).qpos, expected.joint(path).qpos = value, value
        if reference.njnt > len(paths):
            expected.qpos[:7] = (0, 0, 0, 1, 0, 0, 0)
        mujoco.mj_forward(model, data)
        mujoco.mj_forward(reference, expected)
        for found, wanted in (
            (data.xpos[bodies[0]], expected.xpos[bodies[1]]), (data.xmat[bodies[0]], expected.xmat[bodies[1]]),
            (data.xpos[frames[0]], expected.site_xpos[frames[1]]), (data.xmat[frames[0]], expected.site_xmat[frames[1]]),
        ):
            np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-12)
        full, wanted = np.zeros((model.nv, model.nv)), np.zeros((reference.nv, reference.nv))
        mujoco.mj_fullM(model, data, full)
        mujoco.mj_fullM(reference, expected, wanted)
        wanted -= np.diag(reference.dof_armature)  # URDF has none, which is a loss
        largest = np.abs(wanted[np.ix_(rows[1], rows[1])]).max()
        assert full[np.ix_(rows[0], rows[0])] == pytest.approx(wanted[np.ix_(rows[1], rows[1])], abs=1e-12 * largest)
        torque = expected.qfrc_bias[rows[1]]
        assert data.qfrc_bias[rows[0]] == pytest.approx(torque, abs=1e-12 * max(1e-3, np.abs(torque).max()))


# --- joints, limits, names --------------------------------------------------------------------------------------------

MOUNTS = {"a": t(0.1, 0, 0), "b": t(-0.1, 0, 0.02) @ rx(0.3)}


def robot_of(joints: list[Any], **over: Any) -> EmitRequest:
    """A base box and one more box after each joint `jK`."""
    count = 1 + len({joint.name.joint for joint in joints})
    records = [box(f"p:B{k}", (0.1, 0.04, 0.03), mounts=MOUNTS) for k in range(count)]
    components = [component(f"c{k}", f"p:B{k}") for k in range(count)]
    made = document("robot", components, joints, modes=[mode("m", ref("c0.b"))], **over)
    return asked(linked(made, *records), tempfile.mkdtemp())


def element(made: Artifacts, name: str) -> ElementTree.Element:
    return next(joint for joint in tree_of(made, "robot_m").iter("joint") if joint.attrib["name"] == name)


def said(made: Artifacts) -> Iterator[tuple[str, str, str]]:
    return ((loss.path, loss.what, loss.how) for loss in made.losses)


@pytest.mark.parametrize("dynamics", [{"damping": 0.3}, {"friction": 0.2}, {"damping": 0.3, "friction": 0.2}, {"stiffness": 1.0}])
def test_dynamics_are_written_only_if_given(dynamics: dict[str, float]) -> None:
    """`<dynamics>` contains damping and friction, and is omitted without either."""
    found = element(emit(robot_of(coordinates_of("j1", "c0.a", "c1.b", "revolute", **dynamics))), "j1").find("dynamics")
    expected = {name: f"{value:g}" for name, value in dynamics.items() if name != "stiffness"}
    assert (found.attrib if found is not None else {}) == expected and (found is None) == (not expected)


def test_mimic_chains_refer_to_the_independent_joint() -> None:
    """pinocchio rejects a mimic of a mimic, so j1 = 2 j2 + 0.1 and j2 = 3 j3 - 0.5 are both written as mimics of j3, after it."""
    joints = [
        *coordinates_of("j1", "c0.a", "c1.b", "revolute", mimic=mimic("j2", 2.0, 0.1)),
        *coordinates_of("j2", "c1.a", "c2.b", "revolute", mimic=mimic("j3", 3.0, -0.5)),
        *coordinates_of("j3", "c2.a", "c3.b", "revolute", lower=-1, upper=1),
    ]
    made = emit(robot_of(joints))
    moving = [joint.attrib["name"] for joint in tree_of(made, "robot_m").iter("joint") if joint.attrib["type"] != "fixed"]
    assert moving == ["j3", "j1", "j2"]
    follows = [follows.attrib for name in ("j1", "j2") if (follows := element(made, name).find("mimic")) is not None]
    assert follows == [
        {"joint": "j3", "multiplier": "6", "offset": "-0.9"}, {"joint": "j3", "multiplier": "3", "offset": "-0.5"},
    ]


def test_mimic_limits_follow_from_the_leader() -> None:
    """A mimic joint without limits gets the range that the limits of its leader allow."""
    leader = coordinates_of("j1", "c0.a", "c1.b", "revolute", lower=-1, upper=2)
    follower = coordinates_of("j2", "c1.a", "c2.b", "revolute", mimic=mimic("j1", -2.0, 0.5))
    joints = [*leader, *(replace(one, limit=Limit(velocity=7.0)) for one in follower)]
    joint = element(emit(robot_of(joints)), "j2")
    limit = joint.find("limit")
    assert joint.attrib["type"] == "revolute" and limit is not None
    assert limit.attrib == {"lower": "-3.5", "upper": "2.5", "effort": "0", "velocity": "7"}


@pytest.mark.parametrize("follower", ["prismatic", "continuous"])
def test_leaders_of_mimics_are_not_continuous(follower: str) -> None:
    """Readers treat positions of a `continuous` joint as equal modulo one turn, which would move its mimic joints. A leader is
    `revolute` instead."""
    joints = [
        *coordinates_of("j1", "c0.a", "c1.b", "continuous"), *coordinates_of("j2", "c1.a", "c2.b", follower, mimic=mimic("j1", 0.3)),
        *coordinates_of("j3", "c2.a", "c3.b", "screw"), *coordinates_of("j4", "c3.a", "c4.b", "continuous"),
    ]
    made = emit(robot_of([replace(one, limit=Limit()) for one in joints]))
    types = {joint.attrib["name"]: joint.attrib["type"] for joint in tree_of(made, "robot_m").iter("joint")}
    second = "prismatic" if follower == "prismatic" else "revolute"
    assert [types[name] for name in ("j1", "j2", "j3", "j4")] == ["revolute", second, "revolute", "continuous"]


def test_intermediate_links_have_unique_names() -> None:
    """The spindle has the name of its joint `spindle`, as is common in documents."""
    request = robot_of([*coordinates_of("c1", "c0.a", "c1.b", "screw"), *coordinates_of("c", "c1.a", "c2.b", "universal")])
    tree = tree_of(emit(request), "robot_m")
    assert request.report.diagnostics == []
    links = [link.attrib["name"] for link in tree.findall("link")]
    assert {"c1", "c1_link", "c_0_link"} < set(links) and len(set(links)) == len(links)


def test_screw_is_a_hinge_and_a_mimic_slide() -> None:
    """A screw is written as a revolute joint and a prismatic joint that mimics it, with limits from the lead."""
    screw = [replace(one, limit=Limit(lower=-1.0, upper=2.0)) for one in coordinates_of("j1", "c0.a", "c1.b", "screw")]
    made = emit(robot_of(screw))
    turn, slide = element(made, "j1"), element(made, "j1_slide")
    assert (turn.attrib["type"], slide.attrib["type"]) == ("revolute", "prismatic")
    follows, ends = slide.find("mimic"), slide.find("limit")
    assert follows is not None and ends is not None and follows.attrib["joint"] == "j1"
    thread = float(follows.attrib["multiplier"])
    assert sorted([-thread, 2 * thread]) == [float(ends.attrib["lower"]), float(ends.attrib["upper"])]
    lost = "the thread: a prismatic joint that mimics the rotation"
    assert ("j1", lost, "approximated") in set(said(made))


def test_slide_of_a_mimic_screw_follows_the_leader() -> None:
    """The rotation is 2 q + 0.25, so the slide is (2 q + 0.25) LEAD / (2 pi)."""
    leader, pitch = coordinates_of("j1", "c0.a", "c1.b", "revolute", lower=-1, upper=2), LEAD / (2.0 * math.pi)
    made = emit(robot_of([*leader, *coordinates_of("j2", "c1.a", "c2.b", "screw", mimic=mimic("j1", 2.0, 0.25))]))
    follows = [follows.attrib for name in ("j2", "j2_slide") if (follows := element(made, name).find("mimic")) is not None]
    assert [one["joint"] for one in follows] == ["j1", "j1"]
    found = [(abs(float(one["multiplier"])), abs(float(one["offset"]))) for one in follows]
    assert found == [(2.0, 0.25), (pytest.approx(2.0 * pitch), pytest.approx(0.25 * pitch))]
    assert float(follows[1]["multiplier"]) / float(follows[1]["offset"]) == pytest.approx(8.0)


def test_ball_is_three_hinges_with_a_loss() -> None:
    """A ball joint is written as three perpendicular hinges, which is listed as an approximation."""
    made = emit(robot_of(coordinates_of("j1", "c0.a", "c1.b", "ball")))
    model = read(made, "robot_m")
    assert [model.joint(k).name for k in range(model.njnt)] == ["j1_0", "j1_1", "j1_2"]
    axes = np.array([model.joint(k).axis for k in range(3)])
    assert np.abs(axes @ axes.T) == pytest.approx(np.eye(3), abs=1e-12)
    assert (
        "j1", "the motion: three hinges in series, with different coordinates", "approximated",
    ) in set(said(made))


def test_ball_hinges_have_the_effort_of_its_drives() -> None:
    """One drive about (0.6, 0, 0.8) has 5 N m at up to 2 rad/s, and one about y has 1 N m."""
    ball = coordinates_of("j1", "c0.a", "c1.b", "ball")
    drives = ((5.0, 2.0, (0.6, 0.0, 0.8)), (1.0, None, (0.0, 1.0, 0.0)))
    driven = [
        replace(one, drive=Drive(component=None, kind="motor", effort=effort, velocity=velocity, axis=axis))
        for one, (effort, velocity, axis) in zip(ball, drives, strict=False)
    ]
    made = emit(robot_of([*driven, *ball[2:]]))
    ends = [limit for name in ("j1_0", "j1_1", "j1_2") if (limit := element(made, name).find("limit")) is not None]
    assert [float(limit.attrib["effort"]) for limit in ends] == pytest.approx([3.0, 1.0, 4.0])
    assert [float(limit.attrib["velocity"]) for limit in ends] == pytest.approx([2.0 / 0.6, 1e9, 2.0 / 0.8])
    assert ("j1_0", "the drive: motor about 0.6, 0, 0.8: no joint in the file has this axis", "omitted") in set(said(made))
    assert tree_of(made, "robot_m").find("transmission") is None


def test_drives_are_written_as_transmissions() -> None:
    """The hardware interface follows the kind of the drive. The drive of a screw is on its rotation only."""
    position, velocity, motor = (
        Drive(component=None, kind=kind, kp=kp, kv=kv, origin=where(30))
        for kind, kp, kv in (("position", 2.0, None), ("velocity", None, 3.0), ("motor", None, None))
    )
    joints = [
        *coordinates_of("j1", "c0.a", "c1.b", "revolute", lower=-1.0, upper=1.0, drive=position),
        *coordinates_of("j2", "c1.a", "c2.b", "prismatic", lower=-1.0, upper=1.0, drive=velocity),
        *coordinates_of("j3", "c2.a", "c3.b", "screw", drive=motor), *coordinates_of("j4", "c3.a", "c4.b", "continuous"),
    ]
    made = emit(robot_of(joints))
    found = [
        (one.attrib["name"], one.findtext("type"), [joint.attrib["name"] for joint in one.findall("joint")],
         one.findtext("joint/hardwareInterface"), [actuator.attrib["name"] for actuator in one.findall("actuator")],
         one.findtext("actuator/mechanicalReduction"))
        for one in tree_of(made, "robot_m").findall("transmission")
    ]
    assert found == [
        (f"{name}_transmission", "transmission_interface/SimpleTransmission", [name], f"hardware_interface/{interface}JointInterface",
         [name], "1") for name, interface in (("j1", "Position"), ("j2", "Velocity"), ("j3", "Effort"))
    ]
    lost = [one for one in said(made) if "drive" in one[1]]
    assert lost == [
        ("j1", "the drive: position, kp 2: a transmission without gains", "approximated"),
        ("j2", "the drive: velocity, kv 3: a transmission without gains", "approximated"),
    ]


def test_losses_of_modes_are_listed() -> None:
    """Losses of joints are listed once, losses of bases and settings by mode."""
    joints = coordinates_of("j1", "c0.a", "c1.b", "ball")
    joints = [replace(one, limit=Limit(cone=0.5), dynamics=Dynamics(armature=0.1)) for one in joints]
    components = [component(f"c{k}", f"p:B{k}") for k in range(2)]
    modes = [mode("m", ref("c0.b"), "planar", simulation={"timestep": 0.001}), mode("n", ref("c0.b"), "ball")]
    records = [box(f"p:B{k}", (0.1, 0.04, 0.03), mounts=MOUNTS) for k in range(2)]
    made = emit(asked(linked(document("robot", components, joints, modes=modes), *records), tempfile.mkdtemp()))
    assert [(loss.mode, loss.path, loss.what) for loss in made.losses] == [
        (None, "j1", "the motion: three hinges in series, with different coordinates"),
        (None, "j1", "the armature of 0.1 kg m^2"),
        (None, "j1", "the cone of 0.5 rad"),
        ("m", "m", "the motion of the base: a joint for each coordinate, with links of 1e-9 kg between the joints"),
        ("m", "m", "the time step"),
        ("n", "n", "the motion of the base: three hinges in series, with different coordinates"),
    ]


def test_missing_limits_are_written_as_large_numbers() -> None:
    """Limits of the document are kept. A missing position or velocity limit is 1e9. Without a drive, a missing effort limit is 0."""
    joints = [
        replace(one, limit=limit) for one, limit in (
            (*coordinates_of("j1", "c0.a", "c1.b", "revolute"), Limit(lower=-1.0, effort=3.0, velocity=2.0)),
            (*coordinates_of("j2", "c1.a", "c2.b", "continuous"), Limit()),
            (*coordinates_of("j3", "c2.a", "c3.b", "prismatic"), Limit(lower=0.0, upper=0.1)),
        )
    ]
    made = emit(robot_of(joints))
    ends = {name: element(made, name).find("limit") for name in ("j1", "j2", "j3")}
    assert {name: limit.attrib for name, limit in ends.items() if limit is not None} == {
        "j1": {"lower": "-1", "upper": "1000000000", "effort": "3", "velocity": "2"},
        "j2": {"effort": "0", "velocity": "1000000000"},
        "j3": {"lower": "0", "upper": "0.1", "effort": "0", "velocity": "1000000000"},
    }
    assert element(made, "j2").attrib["type"] == "continuous"


def test_capsule_is_a_cylinder_and_two_spheres() -> None:
    at = Pose(translation=(0.01, 0.0, 0.0), rotation=make_pose((0, 0, 0), (0.0, math.pi / 2, 0.0)).rotation)
    shapes = parts(Shape(kind="capsule", size=(0.01, 0.05), pose=at))
    assert [shape.kind for shape in shapes] == ["cylinder", "sphere", "sphere"]
    ends = [shape.pose.translation for shape in shapes[1:]]
    assert np.array(ends) == pytest.approx(np.array([(-0.04, 0, 0), (0.06, 0, 0)]), abs=1e-15)


def test_name_clashes_are_reported() -> None:
    """A joint `a_b` clashes with `a/b`, and `c_frame` with the frame of `c`."""
    report = Report()
    names = MangledNames("joint name", "URDF", report)
    origin, other = (where(line) for line in (3, 7))
    assert [names.take("a/b", origin), names.take("a_b", other), names.take("a/b", origin)] == ["a_b"] * 3
    names.take("c_frame", origin, "the frame of link `c`")
    names.take("c_frame", other)
    assert [(one.code, one.message) for one in report.diagnostics] == [
        (Code.SAME_NAME, "`a_b` and `a/b` have the same joint name in URDF (`a_b`)"),
        (Code.SAME_NAME, "`c_frame` and the frame of link `c` have the same joint name in URDF (`c_frame`)"),
    ]
