"""SDF files, read by the rules of the format (`read_sdf`), compared with chains of matrices and with MuJoCo models of the same robot."""

from __future__ import annotations

import itertools
import math
import re
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from msgspec.structs import replace
from scipy.spatial.transform import Rotation

from emit import small_robot
from emit.read_sdf import Model, matrix, number
from graph.builder import as_matrix
from loops.robots import inchworm
from loops.test_holds import MODES as HOLDS, POSES
from loops.test_loop_joints import FOURBAR
from robot.test_spanning_tree_properties import COUNTS, Tree, build, robots, world_of
from thingc.base.diagnostics import Report
from thingc.base.joints.kinds import KINDS
from thingc.base.pose import Pose
from thingc.base.primitives import Primitive
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.geometry.store.local import Store
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Robot
from thingc.targets.artifact import Artifacts
from thingc.targets.request import EmitRequest
from thingc.targets.sdf.emit import emit
from thingc.tools.cli.main import main

Array = Any

trees = st.builds(build, st.integers(0, 2**32 - 1), st.integers(2, 6), st.just(tuple(COUNTS)))


def text_of(made: Artifacts, path: str) -> str:
    content = made.files[path]
    assert isinstance(content, bytes)
    return content.decode()


def values(robot: Robot, model: Model, q: dict[str, float]) -> dict[str, Any]:
    """Convert q by path to joint values of a file. A universal joint lists its axes in the order of the tree."""
    found: dict[str, Any] = {path.replace("/", "_"): value for path, value in q.items()}
    for body in robot.bodies:
        if len(body.joints) == 2 and (name := body.joints[0].path.replace("/", "_")[:-2]) in {joint.name for joint in model.joints}:
            assert model.joint(name).type == "universal"
            found[name] = tuple(q[joint.path] for joint in body.joints)
    return found


def emitted(tree: Tree, emit: Callable[[EmitRequest], Artifacts]) -> tuple[dict[str, Robot], Artifacts]:
    """Emit a random tree, which has no geometry, for a target. Returns the robots by mode and the artifacts, and asserts that there are
    no diagnostics."""
    chosen, report = robots(tree.assembly), Report()
    with tempfile.TemporaryDirectory() as folder:
        made = emit(EmitRequest(
            assembly=tree.assembly, robots=tuple(chosen.values()), store=Store(folder), report=report, geometry=None,  # type: ignore[arg-type]
            workspace=small_robot.WORKSPACE,
        ))
    assert report.diagnostics == []
    return chosen, made


@settings(max_examples=6)
@given(trees)
def test_poses_of_random_trees_match_matrices(tree: Tree) -> None:
    """Poses of all occurrences and frames in random trees equal chains of matrices. Only screws require version 1.11 of SDF."""
    chosen, made = emitted(tree, emit)
    inside = in_link(tree.assembly)
    for name, robot in chosen.items():
        model = Model(text_of(made, f"sdf/tree_{name}/model.sdf"))
        poses, _ = model.placed(values(robot, model, tree.q))
        expected = world_of(tree, name)
        for position, k in enumerate(tree.order):
            link = tree.assembly.links[tree.assembly.link_of[position]].name
            assert poses[link] @ as_matrix(inside[position]) == pytest.approx(expected[k], abs=1e-9)
            assert poses.get(f"c{k}_origin", expected[k]) == pytest.approx(expected[k], abs=1e-9)
        screws = any(twig.kind == "screw" for twig in tree.twigs)
        assert model.root.attrib["version"] == ("1.11" if screws else "1.9")


# --- a document with all of it ------------------------------------------------------------------------------------------

MOUNTS = "mounts: {a: {xyz: 60 10 -20 mm, rpy: 20 -35 70 deg}, b: {xyz: -50 15 25 mm, rpy: -60 25 15 deg}}"
WEIGHT = "mass: 0.4 kg, com: 10 -20 30 mm, inertia: {ixx: 9e-4 kg*m^2, iyy: 7e-4 kg*m^2, izz: 5e-4 kg*m^2, ixy: 1e-4 kg*m^2}"
COMPONENTS = "\n".join(f"  c{k}: {{frame: true, {WEIGHT}, {MOUNTS}}}" for k in range(9))
EVERY = f"""\
thingc: assembly/1
name: every
components:
{COMPONENTS}
  tag: {{frame: true, at: {{in: c3.b, xyz: 1 2 3 mm}}}}
joints:
  turn:
    type: revolute
    parent: c0.a
    child: c1.b
    offset: 20 deg
    limit: {{lower: -1 rad, upper: 2 rad, effort: 3 N*m, velocity: 4 rad/s}}
    dynamics: {{damping: 0.1 N*m*s/rad, friction: 0.2 N*m, armature: 0.3 kg*m^2, stiffness: 0.4 N*m/rad, rest: 0.5 rad}}
    drive: {{kind: position, kp: 5 N*m/rad, kv: 0.5 N*m*s/rad}}
  wheel: {{type: continuous, parent: c1.a, child: c2.b, drive: {{kind: velocity, kv: 2 N*m*s/rad}}}}
  push:
    type: prismatic
    parent: c2.a
    child: c3.b
    limit: {{lower: -100 mm, upper: 50 mm}}
    mimic: {{joint: rail, multiplier: -2, offset: 3 mm}}
  rail: {{type: prismatic, parent: c3.a, child: c4.b, limit: {{lower: -20 mm, upper: 20 mm}}, drive: {{kind: motor}}}}
  spindle: {{type: screw, parent: c0.b, child: c5.b, lead: -4 mm}}
  sleeve: {{type: cylindrical, parent: c5.a, child: c6.b}}
  fork: {{type: universal, parent: c6.a, child: c7.b}}
  hip:
    type: ball
    parent: c2.b
    child: c8.b
    turn: 25 deg
    limit: {{cone: 60 deg}}
    dynamics: {{damping: 0.1 N*m*s/rad}}
    drive: [{{axis: [0, 0, 1], kind: motor, effort: 5 N*m}}]
mounts: {{tip: c8.a}}
poses:
  home: {{turn: 0.5 rad}}
modes:
  first: {{root: c0, at: {{xyz: 10 20 30 mm, rpy: 10 20 30 deg}}, pose: home}}
  last: {{root: c8.a, base: held, at: {{xyz: 10 20 30 mm, rpy: 10 20 30 deg}}, gravity: wall}}
  fork: {{root: c7.b, base: free, at: {{xyz: 0 0 -500 mm}}, actuators: [rail]}}
  rolling: {{root: c4, base: planar, at: {{xyz: 1 2 3 mm, rpy: 40 50 60 deg}}}}
  swinging: {{root: c6, base: ball, contacts: {{exclude: [[c0, c8]]}}}}
sensors:
  eye: {{type: camera, at: tip, fovy: 60 deg}}
  imu: {{type: imu, at: c1.a}}
  wrist: {{type: force, at: c3.b}}
  wheel: {{type: joint}}
simulation: {{timestep: 1 ms, cone: elliptic}}
"""


class Compiled:
    """A compiled document with its output for SDF, or another `target`, and for MJCF."""

    def __init__(self, folder: Path, document: str, target: str = "sdf") -> None:
        folder.mkdir(parents=True, exist_ok=True)
        folder.joinpath("thingc.toml").write_text('thingc = "workspace/1"\n')
        folder.joinpath("robot.yaml").write_text(document)
        with Environment(str(folder / "robot.yaml"), Options(store=str(folder / "store"))) as environment:
            compilation = pipeline.compile(environment)
            assert [d.message for d in compilation.report.diagnostics if d.severity == "error"] == []
            assert compilation.assembly is not None
            self.name = compilation.assembly.name
            self.robots = {robot.mode.name: robot for robot in compilation.robots}
            made = pipeline.build(environment, compilation, ["mjcf", target])
            self.made, self.mjcf = made[target], made["mjcf"]
        assert compilation.report.failed is False

    def model(self, mode: str) -> Model:
        return Model(text_of(self.made, f"sdf/{self.name}_{mode}/model.sdf"))

    def reference(self, mode: str) -> mujoco.MjModel:
        return mujoco.MjModel.from_xml_string(text_of(self.mjcf, f"mjcf/{self.name}_{mode}.xml"))

    def losses(self, mode: str | None) -> list[tuple[str, str, str, int]]:
        return [(one.path, one.what, one.how, one.span.line if one.span else 0) for one in self.made.losses if one.mode == mode]


@pytest.fixture(scope="module")
def every(tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    return Compiled(tmp_path_factory.mktemp("every"), EVERY)


def test_document_has_every_kind_of_joint() -> None:
    """Free joints are in `tests/robot/test_free_joints.py`, and planar joints in the random trees."""
    assert KINDS.keys() - re.findall(r"type: (\w+)", EVERY) == {"fixed", "free", "planar"}


def posed(reference: mujoco.MjModel, rng: np.random.Generator) -> tuple[mujoco.MjData, dict[str, Any]]:
    """MuJoCo data at a random configuration, and the same configuration for SDF: coordinates by path, balls as matrices."""
    data, q = mujoco.MjData(reference), {}
    for k in range(reference.njnt):
        name, joint = reference.joint(k).name, data.joint(k)
        if reference.jnt_type[k] == mujoco.mjtJoint.mjJNT_BALL:
            turn = Rotation.from_rotvec(rng.uniform(-2, 2, 3))
            joint.qpos, q[name] = turn.as_quat()[[3, 0, 1, 2]], turn.as_matrix()
        elif reference.jnt_type[k] != mujoco.mjtJoint.mjJNT_FREE:
            q[name] = rng.uniform(-1, 1)
            joint.qpos = q[name]
    for k in range(reference.neq):  # screws: MuJoCo's slide goes with the turn
        name = reference.equality(k).name
        if name.endswith(":screw"):
            turn, slide = reference.joint(int(reference.eq_obj1id[k])), reference.joint(int(reference.eq_obj2id[k]))
            data.joint(slide.name).qpos = q[turn.name] / reference.eq_data[k][1]
    mujoco.mj_forward(reference, data)
    return data, q


def mujoco_pose(data: mujoco.MjData, name: str) -> Array:
    pose = np.eye(4)
    names = {data.model.body(k).name for k in range(data.model.nbody)}
    found = data.body(name) if name in names else data.site(name)
    pose[:3, :3], pose[:3, 3] = found.xmat.reshape(3, 3), found.xpos
    return pose


MODES = ("first", "last", "fork", "rolling", "swinging")


@pytest.mark.parametrize("mode", MODES)
def test_all_joint_kinds_match_mujoco(every: Compiled, mode: str) -> None:
    """Links, frames and inertias equal those of the MJCF model at random configurations, with joints in both directions and every kind
    of base."""
    model, reference, robot = every.model(mode), every.reference(mode), every.robots[mode]
    rng = np.random.default_rng(5)
    for _ in range(5):
        data, q = posed(reference, rng)
        poses, apart = model.placed(values(robot, model, q))
        assert apart == {}
        for k in range(1, reference.nbody):
            assert poses[reference.body(k).name] == pytest.approx(mujoco_pose(data, reference.body(k).name), abs=1e-12)
        for k in range(reference.nsite):
            name = reference.site(k).name
            assert poses[name.replace("/", "_")] == pytest.approx(mujoco_pose(data, name), abs=1e-12)
    for k in range(1, reference.nbody):
        mass, centre, inertia = model.inertia(reference.body(k).name)
        turned = Rotation.from_quat(reference.body_iquat[k][[1, 2, 3, 0]]).as_matrix()
        assert mass == pytest.approx(reference.body_mass[k], rel=1e-12)
        assert centre == pytest.approx(reference.body_ipos[k], abs=1e-12)
        assert inertia == pytest.approx(turned @ np.diag(reference.body_inertia[k]) @ turned.T, abs=1e-12)
    between = [link for link in model.links if link not in {reference.body(k).name for k in range(reference.nbody)}]
    assert all(model.inertia(link)[0] == 1e-9 for link in between)
    of_base = ["root_0_link", "root_1_link"] if mode == "rolling" else []
    assert between == [*of_base, f"sleeve_{1 if mode in ('fork', 'swinging') else 0}_link"]


def test_bases_are_joints_named_root(every: Compiled) -> None:
    """Each kind of base is a joint `root` to the world; a floating base has none."""
    found = {mode: [(j.name, j.type, j.child) for j in every.model(mode).joints if j.parent == "world"] for mode in MODES}
    assert found == {
        "first": [("root", "fixed", "c0")], "last": [("root", "fixed", "c8")], "fork": [],
        "rolling": [("root_0", "prismatic", "root_0_link")], "swinging": [("root", "ball", "c6")],
    }
    assert every.model("fork").model.attrib["canonical_link"] == "c7"


def test_limits_dynamics_and_springs_match_document(every: Compiled) -> None:
    """Limits, damping, friction and springs are written for the joint. A joint without a drive has effort 0; a mimic joint has no effort
    limit."""
    axis = every.model("first").element("turn").find("axis")
    assert axis is not None
    said = {one.tag: one.text for part in ("dynamics", "limit") for one in axis.find(part) or ()}
    assert said == {
        "damping": "0.1", "friction": "0.2", "spring_reference": "0.5", "spring_stiffness": "0.4", "lower": "-1", "upper": "2",
        "effort": "3", "velocity": "4",
    }
    efforts = {
        joint.attrib["name"]: limit.findtext("effort") for joint in every.model("fork").model.findall("joint")
        for limit in joint.iterfind("axis/limit")
    }
    # no drive: none of its own; a follower is moved by the one that it follows; what this mode leaves out keeps its limit
    assert efforts == {
        "turn": "3", "wheel": "0", "push": None, "rail": None, "spindle": "0", "sleeve_0": "0", "sleeve_1": "0", "fork": "0",
    }
    types = {joint.name: joint.type for joint in every.model("first").joints}
    assert types == {
        "root": "fixed", "turn": "revolute", "wheel": "continuous", "push": "prismatic", "rail": "prismatic", "spindle": "screw",
        "sleeve_0": "continuous", "sleeve_1": "prismatic", "fork": "universal", "hip": "ball",
    }


def test_mimic_is_written_for_sdformat_and_drake(every: Compiled) -> None:
    """A mimic is written as the `mimic` element of SDF 1.11 and as `drake:mimic`."""
    model = every.model("last")
    assert model.root.attrib["version"] == "1.11"
    assert model.mimics() == {("push", "axis"): ("rail", "axis", -2.0, 0.003)}
    (drakes,) = model.model.iterfind("joint/{http://drake.mit.edu}mimic")
    assert drakes.attrib == {"joint": "rail", "multiplier": "-2", "offset": "0.003"}


def test_drives_have_gazebo_controllers(every: Compiled) -> None:
    """Each drive of a mode becomes a controller plugin of Gazebo with its gains and limits."""
    plugins = {plugin.findtext("joint_name"): plugin for plugin in every.model("first").model.findall("plugin")}
    assert {name: plugin.attrib["filename"] for name, plugin in plugins.items()} == {
        "turn": "gz-sim-joint-position-controller-system", "wheel": "gz-sim-joint-controller-system",
        "rail": "gz-sim-apply-joint-force-system",
    }
    assert {one.tag: one.text for one in plugins["turn"]} == {
        "joint_name": "turn", "p_gain": "5", "i_gain": "0", "d_gain": "0.5", "cmd_max": "3", "cmd_min": "-3", "initial_position": "0.5",
    }
    assert {one.tag: one.text for one in plugins["wheel"]} == {
        "joint_name": "wheel", "use_force_commands": "true", "p_gain": "2", "i_gain": "0", "d_gain": "0", "cmd_max": "1000000000",
        "cmd_min": "-1000000000",
    }
    assert [plugin.findtext("joint_name") for plugin in every.model("fork").model.findall("plugin")] == ["rail"]


def test_sensor_poses_match_mujoco(every: Compiled) -> None:
    """MuJoCo cameras look along -z with y up, SDF cameras along x with z up. A force is measured in the joint."""
    for mode in MODES:
        model, reference = every.model(mode), every.reference(mode)
        data = mujoco.MjData(reference)
        mujoco.mj_forward(reference, data)
        poses, _ = model.placed({})
        found = {one.attrib["name"]: (owner, one) for owner in model.model for one in owner.findall("sensor")}
        camera = poses["c8"] @ matrix(found["eye"][1].find("pose"))
        seen = data.camera("eye").xmat.reshape(3, 3)
        assert camera[:3, 0] == pytest.approx(-seen[:, 2], abs=1e-12) and camera[:3, 2] == pytest.approx(seen[:, 1], abs=1e-12)
        assert camera[:3, 3] == pytest.approx(data.camera("eye").xpos, abs=1e-12)
        imu = poses["c1"] @ matrix(found["imu"][1].find("pose"))
        assert imu == pytest.approx(mujoco_pose(data, "c1/a"), abs=1e-12)
        owner, force = found["wrist"]
        joint = model.joint(owner.attrib["name"])
        assert joint.child == "c3" and force.findtext("force_torque/frame") == "sensor"
        assert force.findtext("force_torque/measure_direction") == "child_to_parent"
        assert model.at_zero(joint.name) @ matrix(force.find("pose")) == pytest.approx(mujoco_pose(data, "c3/b"), abs=1e-12)
    lens = found["eye"][1].find("camera")
    assert lens is not None
    wide, high = float(lens.findtext("image/width") or 0), float(lens.findtext("image/height") or 0)
    assert 2 * math.atan(math.tan(number(lens, "horizontal_fov") / 2) * high / wide) == pytest.approx(math.radians(60), abs=1e-12)


def test_world_file_has_gravity_floor_light_and_model(every: Compiled) -> None:
    """The world file includes the model and the systems of its sensors; `model.config` names the SDF file and version."""
    for mode, gravity in (("first", "0 0 -9.81"), ("last", "-9.81 0 0")):
        world = ElementTree.fromstring(text_of(every.made, f"sdf/world_{mode}.sdf")).find("world")
        assert world is not None
        assert world.findtext("gravity") == gravity and world.findtext("physics/max_step_size") == "0.001"
        assert world.findtext("include/uri") == f"model://every_{mode}" and world.find("include/pose") is None
        assert world.find("light") is not None
        floor = world.find("model/link")
        assert floor is not None and world.findtext("model/static") == "true"
        assert {one.tag: {child.tag for child in one} for one in floor} == {
            "collision": {"geometry", "surface"}, "visual": {"geometry", "material"},
        }
        for word in ("collision", "visual"):
            assert floor.findtext(f"{word}/geometry/plane/normal") == "0 0 1"
        ode = floor.find("collision/surface/friction/ode")
        assert ode is not None and ode.findtext("mu") == ode.findtext("mu2") == "100"
        systems = [plugin.attrib["name"].rpartition("::")[2] for plugin in world.findall("plugin")]
        assert systems == ["Physics", "UserCommands", "SceneBroadcaster", "Imu", "ForceTorque", "Sensors"]
        config = ElementTree.fromstring(text_of(every.made, f"sdf/every_{mode}/model.config"))
        sdf = config.find("sdf")
        assert sdf is not None and sdf.text == "model.sdf" and f"sdf/every_{mode}/{sdf.text}" in every.made.files
        assert sdf.attrib["version"] == every.model(mode).root.attrib["version"] and config.findtext("name") == f"every_{mode}"


@pytest.mark.parametrize("name", ["sun", "floor"])
def test_robot_may_be_named_sun_or_floor(tmp_path: Path, name: str) -> None:
    """The light and the floor of the world get other names if the robot has their name."""
    made = Compiled(tmp_path, f"thingc: assembly/1\nname: {name}\ncomponents: {{base: {{frame: true}}}}\n").made
    world = ElementTree.fromstring(text_of(made, "sdf/world_default.sdf")).find("world")
    assert world is not None
    assert name not in [one.get("name") for one in (*world.findall("light"), *world.findall("model"))]


ALIKE = """\
thingc: assembly/1
name: alike
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}
  arm: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}, mounts: {tip: {xyz: 0 0 100 mm}}}
  hand: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}
joints:
  arm: {type: continuous, parent: base.origin, child: arm.origin, axis: [0, 0, 1], drive: {kind: motor, effort: 1 N*m}}
  tip: {type: continuous, parent: arm.tip, child: hand.origin, axis: [0, 0, 1], mimic: {joint: arm}}
mounts: {tip: arm.tip}
"""


def test_clashing_names_get_a_suffix(tmp_path: Path) -> None:
    """Links, joints and frames share one namespace in SDF. Clashing names get their kind as a suffix, in references too, and are listed
    as losses."""
    made = Compiled(tmp_path, ALIKE)
    model = made.model("default").model
    names = [child.attrib["name"] for child in model if child.tag in ("link", "joint", "frame")]
    assert sorted(names) == ["arm", "arm_joint", "base", "base_origin", "hand", "root", "tip", "tip_frame"]
    assert [mimic.attrib["joint"] for mimic in model.iter("mimic")] == ["arm_joint"]
    assert [plugin.findtext("joint_name") for plugin in model.findall("plugin")] == ["arm_joint"]
    assert [(path, line) for path, what, _, line in made.losses(None) if "the name" in what] == [("arm", 8), ("tip", 10)]


def test_robot_named_world_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "robot.yaml").write_text("thingc: assembly/1\nname: world\ncomponents: {base: {frame: true}}\n")
    assert main(["build", str(tmp_path / "robot.yaml"), "-o", str(tmp_path / "build"), "--emit", "sdf"]) == 1
    said = capsys.readouterr().err
    assert "error[TC709]: the robot and the world have the same name in SDF (`world`)" in said and "robot.yaml:2:7" in said


def test_floating_robot_starts_on_the_floor(tmp_path: Path) -> None:
    """The mode is 1 m below the floor. The world lifts the robot until its lowest corner touches the floor."""
    request = small_robot.request(small_robot.assembly(Store(str(tmp_path))), Store(str(tmp_path)))
    adrift = next(robot for robot in request.robots if robot.base == "free")
    root = adrift.bodies[0]
    low = replace(adrift, bodies=(replace(root, X_PL=Pose(translation=(0.0, 0.0, -1.0)) @ root.X_PL), *adrift.bodies[1:]))
    made = emit(replace(request, robots=(low,)))
    pose = ElementTree.fromstring(text_of(made, "sdf/world_adrift.sdf")).find("world/include/pose")
    lift = matrix(pose)
    poses, _ = Model(text_of(made, "sdf/arm_adrift/model.sdf")).placed({})
    assembly, heights = request.assembly, []
    for occurrence, link, inside in zip(assembly.occurrences, assembly.link_of, in_link(assembly), strict=True):
        if occurrence.record is not None and occurrence.record.box is not None:
            corners = np.array([(*corner, 1.0) for corner in itertools.product(*zip(*occurrence.record.box, strict=True))])
            heights.append((lift @ poses[assembly.links[link].name] @ as_matrix(inside) @ corners.T)[2].min())
    assert min(heights) == pytest.approx(0.0, abs=1e-12) and lift[2, 3] > 0.5


def test_losses_have_the_line_of_their_cause(every: Compiled) -> None:
    """Every export loss of the document has the line of its element in the document."""
    def lost(mode: str | None) -> set[tuple[str, str, str, str]]:
        lines = ["", *(line.strip() for line in EVERY.split("\n"))]
        return {(path, what, how, re.split(r"[:{]", lines[line])[0]) for path, what, how, line in every.losses(mode)}

    assert lost(None) == {
        ("turn", "the armature of 0.3 kg m^2", "omitted", "turn"),
        ("turn", "the drive: position, kp 5, kv 0.5: only read by Gazebo", "carried as custom data", "drive"),
        ("wheel", "the drive: velocity, kv 2: only read by Gazebo", "carried as custom data", "wheel"),
        ("rail", "the drive: motor: only read by Gazebo", "carried as custom data", "rail"),
        ("hip", "the cone of 1.0472 rad", "omitted", "hip"),
        ("hip", "the damping of 0.1 N m s/rad: not supported by SDF for ball joints", "omitted", "hip"),
        ("hip_0", "the drive: motor about 0, 0, 1", "omitted", "drive"),
        ("sleeve", "the motion: a joint for each coordinate, with links of 1e-9 kg between the joints", "approximated", "sleeve"),
        ("sleeve", "the excluded contact between the links of the joint", "omitted", "sleeve"),
        ("home", "the pose: not supported by SDF", "omitted", "home"),
        ("every", "the `simulation` settings", "omitted", "simulation"),
        ("wheel", "the sensor: SDF has no joint sensor", "omitted", "wheel"),
    }
    assert lost("first") == lost("fork") == set()
    assert lost("last") == {
        ("last", "the gravity: only written to the world file", "carried as custom data", "last"),
        ("last", "the motion of the held base: the base is fixed in the file", "approximated", "last"),
    }
    base = "the motion of the base: a joint for each coordinate, with links of 1e-9 kg between the joints"
    assert lost("rolling") == {
        ("wrist", "the force at the mount: the sensor measures the force through joint `rail`", "approximated", "wrist"),
        ("rolling", base, "approximated", "rolling"),
    }
    assert lost("swinging") == {("swinging", "excluded contacts of links without a common joint", "omitted", "swinging")}


# --- loops and holds ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fourbar(tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    return Compiled(tmp_path_factory.mktemp("fourbar"), FOURBAR)


@pytest.mark.parametrize("mode", ["bench", "by_coupler", "other", "third"])
def test_loops_are_closed_at_zero(fourbar: Compiled, mode: str) -> None:
    """The loop is open at q = 0 of the document, so joint positions in the file are relative to the first pose."""
    model, robot, reference = fourbar.model(mode), fourbar.robots[mode], fourbar.reference(mode)
    assert {joint.name for joint in model.joints} == {"drive", "elbow", "pivot", "wrist", *(["root"] if robot.base != "free" else [])}
    start = robot.keyframes[0]
    for frame in robot.keyframes:
        q = {path: value - start.q[path] for path, value in frame.q.items()}
        poses, apart = model.placed(q)
        assert len(apart) == 1
        for gap in apart.values():
            assert gap == pytest.approx(np.eye(4), abs=1e-9)
        data = mujoco.MjData(reference)
        mujoco.mj_resetDataKeyframe(reference, data, reference.key(frame.name).id)
        mujoco.mj_forward(reference, data)
        for link in model.links:
            assert poses[link] == pytest.approx(mujoco_pose(data, link), abs=1e-9)
    limit = model.element("pivot").find("axis/limit")
    assert limit is not None
    assert number(limit, "lower") == pytest.approx(math.radians(5) - start.q["pivot"], abs=1e-12)
    what = "the zero pose: position 0 of each joint in the file corresponds to the pose `at_20`"
    assert (mode, what, "approximated") in [loss[:3] for loss in fourbar.losses(mode)]


@pytest.fixture(scope="module")
def worm(tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    return Compiled(tmp_path_factory.mktemp("worm"), inchworm(modes=HOLDS, poses=POSES))


@pytest.mark.parametrize(("mode", "held", "kind"), [
    ("hanging", "front_sole", "fixed"), ("dangling", "front_sole", "ball"), ("stay", "rear_sole", "fixed"), ("pinned", "rear_sole", "ball"),
])
def test_holds_are_joints_to_the_world(worm: Compiled, mode: str, held: str, kind: str) -> None:
    """The held mount is at the pose of MuJoCo's keyframe. If the only support is one hold, the file has this pose at joint positions of
    0."""
    model, robot, reference = worm.model(mode), worm.robots[mode], worm.reference(mode)
    joint = model.joint(f"{held}_hold")
    assert (joint.parent, joint.type) == ("world", kind)
    assert model.at_zero(held)[:3, 3] == pytest.approx(model.at_zero(joint.name)[:3, 3], abs=1e-12)
    data = mujoco.MjData(reference)
    mujoco.mj_resetDataKeyframe(reference, data, 0)
    mujoco.mj_forward(reference, data)
    assert model.at_zero(held)[:3, 3] == pytest.approx(data.site(held.replace("_", "/", 1)).xpos, abs=1e-9)
    if kind == "fixed":
        assert model.at_zero(held) == pytest.approx(mujoco_pose(data, held.replace("_", "/", 1)), abs=1e-9)
    counted = [loss for loss in worm.losses(mode) if loss[1].startswith("the zero pose")]
    assert len(counted) == (0 if robot.base == "free" else 1)


# --- shapes, names ------------------------------------------------------------------------------------------------------


def test_visuals_have_names_meshes_and_colours(tmp_path: Path) -> None:
    """Each drawn occurrence has one visual with a colour. The mesh files are exactly those that the model refers to."""
    store = Store(str(tmp_path))
    whole = small_robot.assembly(store)
    bare = tuple(replace(one, overrides=replace(one.overrides, collision="none")) for one in whole.occurrences)
    request = small_robot.request(replace(whole, occurrences=bare), store)
    made = emit(request)
    assert request.report.diagnostics == [] and emit(request).files == made.files
    model = Model(text_of(made, "sdf/arm_bench/model.sdf"))
    drawn = {visual.attrib["name"] for visual in model.model.iter("visual")}
    assert drawn and drawn == {f"{o.path.replace('/', '_')}_visual" for o in request.assembly.occurrences if o.drawn}
    for robot in request.robots:
        folder = f"sdf/arm_{robot.mode.name}/"
        files = {uri.text for uri in Model(text_of(made, f"{folder}model.sdf")).model.iter("uri")}
        assert files == {path.removeprefix(folder) for path in made.files if path.startswith(f"{folder}meshes/")}
    colours = {one.findtext("diffuse") for one in model.model.iterfind("link/visual/material")}
    assert colours and None not in colours


def test_shapes_and_friction_match_the_material(tmp_path: Path) -> None:
    """Primitives keep their kind and size. The torsional friction of ODE is 3 pi / 16 times its coefficient times the patch radius and
    the force; in MuJoCo it is a length times the force."""
    store = Store(str(tmp_path))
    whole = small_robot.assembly(store)
    at = Pose(translation=(0.01, 0.02, 0.03))
    pieces = tuple(
        Primitive(shape=shape, size=size, pose=at)  # type: ignore[arg-type]
        for shape, size in (("box", (0.01, 0.02, 0.03)), ("sphere", (0.04,)), ("cylinder", (0.05, 0.06)), ("capsule", (0.07, 0.08)))
    )
    first = next(one for one in whole.occurrences if one.record is not None and one.record.meshes and one.material is not None)
    assert first.record is not None and first.material is not None
    changed = replace(
        first, record=replace(first.record, pieces=pieces), overrides=replace(first.overrides, collision="part"),
        material=replace(first.material, slide=0.7, torsion=0.01, roll=0.001),
    )
    others = tuple(replace(one, overrides=replace(one.overrides, collision="none")) for one in whole.occurrences)
    occurrences = tuple(changed if one.path == first.path else one for one in others)
    made = emit(small_robot.request(replace(whole, occurrences=occurrences), store))
    collisions = list(Model(text_of(made, "sdf/arm_bench/model.sdf")).model.iter("collision"))
    assert [one.attrib["name"] for one in collisions] == [f"{first.path}_collision{mark}" for mark in ("", "_1", "_2", "_3")]
    said = [{leaf.tag: leaf.text for leaf in shape} | {"": shape.tag} for one in collisions for shape in one.iterfind("geometry/*")]
    assert said == [
        {"": "box", "size": "0.02 0.04 0.06"}, {"": "sphere", "radius": "0.04"}, {"": "cylinder", "radius": "0.05", "length": "0.12"},
        {"": "capsule", "radius": "0.07", "length": "0.16"},
    ]
    friction = collisions[0].find("surface/friction")
    assert friction is not None and friction.findtext("ode/mu") == friction.findtext("ode/mu2") == "0.7"
    torque = 3 * math.pi / 16 * number(friction, "torsional/coefficient") * number(friction, "torsional/patch_radius")
    assert torque == pytest.approx(0.01) and friction.findtext("torsional/use_patch_radius") == "true"
    assert (first.material.name, "the rolling friction", "omitted") in {(one.path, one.what, one.how) for one in made.losses}
