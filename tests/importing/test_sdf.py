"""SDF import: the robot equals Drake's reading of the same file, and errors are reported at their line."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy
import pytest
from trimesh.transformations import rotation_matrix

import thingc
from importing.as_original import in_files
from importing.imports import import_cleanly, write_import
from thingc.base.diagnostics import Report
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import Imported, import_robot

HERE = Path(__file__).parent
SOURCE = HERE / "robots" / "constructs.sdf"
DRAKE = json.loads((HERE / "robots" / "constructs.sdf.json").read_text())
"""The output of `benchmarks/importing/ask_drake.py` for the file (Drake 1.51)."""


@pytest.fixture(scope="module")
def imported() -> Imported:
    return import_cleanly(SOURCE, ImportRequest(roots=DRAKE["asked"]["roots"]))


@pytest.fixture(scope="module")
def models(imported: Imported, tmp_path_factory: pytest.TempPathFactory) -> dict[str, mujoco.MjModel]:
    document = write_import(imported, tmp_path_factory.mktemp("imported"))
    return {name: mode.model() for name, mode in thingc.compile(document).modes.items()}


def test_imported_robot_matches_drake(imported: Imported, models: dict[str, mujoco.MjModel]) -> None:
    names, words = in_files(imported), json.loads(imported.files["import.json"])["names"]["links"]
    known, asked = names["links"] | names["frames"] | names["sites"], DRAKE["asked"]
    joints = [names["joints"][name] for name in asked["joints"]]
    for mode, model in models.items():
        data = mujoco.MjData(model)
        dofs = [int(model.joint(word).dofadr[0]) for word in joints]
        for (q, v), theirs in zip(asked["states"], DRAKE["answer"]["states"], strict=True):
            for word, here, speed in zip(joints, q, v, strict=True):
                data.joint(word).qpos[0], data.joint(word).qvel[0] = here, speed
            mujoco.mj_forward(model, data)
            full = numpy.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, full)
            ours, frames = full[numpy.ix_(dofs, dofs)], {name: numpy.array(pose) for name, pose in theirs["frames"].items()}
            if mode == "source":
                for name, frame in frames.items():
                    assert numpy.abs(pose(data, known[name]) - frame).max() < 1e-9, name
                close(ours, theirs["mass_matrix"])
                close(data.qfrc_bias[dofs], theirs["bias"])
                data.qvel[:] = 0.0
                mujoco.mj_forward(model, data)
                close(data.qfrc_bias[dofs], theirs["gravity"])
            else:
                root = next(name for name, word in words.items() if word == mode)
                at, there = numpy.linalg.inv(pose(data, known[root])), numpy.linalg.inv(frames[root])
                for name, frame in frames.items():
                    assert numpy.abs(at @ pose(data, known[name]) - there @ frame).max() < 1e-9, name
                close(ours, theirs["held"][root])


def test_limits_drives_and_springs(models: dict[str, mujoco.MjModel]) -> None:
    """The expected values are copied from the file."""
    model = models["source"]
    assert {model.joint(k).name: tuple(model.joint(k).range) for k in range(model.njnt) if model.joint(k).limited[0]} == {
        "shoulder": (-1.2, 1.5), "elbow": (-0.4, 2.0), "gripper::slide": (-0.02, 0.05), "gripper::grip": (-0.5, 0.8),
    }
    assert {model.actuator(k).name: model.actuator(k).ctrlrange[1] for k in range(model.nu)} == {
        "shoulder": 30.0, "spin": 3.0, "gripper::slide": 40.0,
    }
    assert model.joint("elbow").stiffness[0] == 3.5 and model.joint("shoulder").damping[0] == 0.7
    assert model.joint("shoulder").frictionloss[0] == 0.2
    assert model.geom("trunk").friction[0] == 0.7


LINK = "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"


def sdf(inside: str, version: str = "1.9") -> str:
    links = "".join(f"<link name='{name}'><pose>{k} 0 0 0 0 0</pose>{LINK}</link>\n" for k, name in enumerate("abcd"))
    return f"<sdf version='{version}'><model name='m'>\n{links}{inside}</model></sdf>"


def joint(name: str, parent: str, child: str, kind: str = "continuous", axis: str = "<xyz>0 0 1</xyz>") -> str:
    axes = f"<axis>{axis}</axis>" if kind not in ("fixed", "ball") else ""
    return f"<joint name='{name}' type='{kind}'><parent>{parent}</parent><child>{child}</child>{axes}</joint>\n"


def read(tmp_path: Path, text: str) -> tuple[Imported | None, Report]:
    (tmp_path / "m.sdf").write_text(text)
    report = Report()
    return import_robot(str(tmp_path / "m.sdf"), report), report


REST = joint("k", "b", "c") + joint("l", "c", "d")
CHAIN = joint("j", "a", "b") + REST


def test_loop_is_closed_by_the_last_joint(tmp_path: Path) -> None:
    """The joint that reaches an already connected link last closes the loop. The direction of a joint does not matter for the tree."""
    found, report = read(tmp_path, sdf(joint("j", "b", "a") + joint("k", "b", "c") + joint("l", "c", "d") + joint("m", "a", "d", "ball")))
    assert found is not None and not report.failed
    model = compiled(found, tmp_path)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert [loop.name for loop in found.robot.loops] == ["m"] and model.neq == 1
    assert abs(data.efc_pos).max() < 1e-12


@pytest.mark.parametrize(("kind", "axis", "loop", "lost"), [
    ("fixed", "", "fixed", False), ("ball", "", "ball", False), ("revolute", "<xyz>0 0 1</xyz>", "continuous", False),
    ("revolute", "<xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit>", "continuous", True),
    ("continuous", "<xyz>0 0 1</xyz><dynamics><damping>1</damping></dynamics>", "continuous", True),
])
def test_loop_closing_joint_keeps_its_type_but_loses_limits(kind: str, axis: str, loop: str, lost: bool, tmp_path: Path) -> None:
    found, report = read(tmp_path, sdf(CHAIN + joint("m", "a", "d", kind, axis)))
    assert found is not None and not report.failed
    assert [(one.name, one.kind) for one in found.robot.loops] == [("m", loop)]
    assert [loss.what for loss in found.losses] == ["limits, drive and dynamics of joint `m`"] * lost


@pytest.mark.parametrize(("count", "allowed"), [(2, True), (3, False)])
def test_number_of_included_models_is_limited(count: int, allowed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thingc.tools.importing.sdf.MOST_INCLUDES", 2)
    (tmp_path / "one.sdf").write_text(f"<sdf version='1.9'><model name='one'><link name='l'>{LINK}</link></model></sdf>")
    names = [f"n{number}" for number in range(count)]
    includes = "".join(f"<include><uri>one.sdf</uri><name>{name}</name></include>" for name in names)
    joints = "".join(joint(f"j_{name}", "a", f"{name}::l", "fixed") for name in names)
    found, report = read(tmp_path, sdf(CHAIN + includes + joints))
    assert (found is not None) == allowed
    assert [one.message for one in report.sorted_diagnostics()] == ["the number of included models exceeds the maximum (2)"] * (not allowed)


def test_unlimited_slide_gets_limits_and_is_a_loss(tmp_path: Path) -> None:
    found, report = read(tmp_path, sdf(joint("j", "a", "b", "prismatic") + REST))
    assert found is not None and not report.failed
    assert [loss.what for loss in found.losses] == ["unlimited slide `j`"]
    assert tuple(compiled(found, tmp_path).joint("j").range) == (-1000.0, 1000.0)


def test_joint_against_the_tree_direction_is_reversed(tmp_path: Path) -> None:
    """`c` is attached to `b`, which already has a parent. q keeps its meaning: the position of `b` relative to `c`."""
    found, report = read(tmp_path, sdf(joint("j", "a", "b") + joint("k", "c", "b", axis="<xyz>0 0.6 0.8</xyz>") + joint("l", "c", "d")))
    assert found is not None and not report.failed
    model = compiled(found, tmp_path)
    data = mujoco.MjData(model)
    data.joint("k").qpos[0] = 0.7
    mujoco.mj_forward(model, data)
    relative = numpy.linalg.inv(pose(data, "c")) @ pose(data, "b")
    quaternion = numpy.array([numpy.cos(0.35), 0.0, 0.6 * numpy.sin(0.35), 0.8 * numpy.sin(0.35)])
    turned = numpy.zeros(9)
    mujoco.mju_quat2Mat(turned, quaternion)
    assert numpy.abs(relative[:3, :3] - turned.reshape(3, 3)).max() < 1e-12
    assert numpy.abs(relative[:3, 3] - [-1.0, 0.0, 0.0]).max() < 1e-12  # its axis goes through the frame of `b`


@pytest.mark.parametrize(("version", "axis"), [
    ("1.4", "<xyz>0 1 0</xyz>"), ("1.6", "<xyz>0 1 0</xyz><use_parent_model_frame>1</use_parent_model_frame>"),
    ("1.7", "<xyz expressed_in='__model__'>0 1 0</xyz>"), ("1.6", "<xyz>1 0 0</xyz>"),
])
def test_axis_frame_depends_on_version_and_attributes(version: str, axis: str, tmp_path: Path) -> None:
    """Expected is the conversion of libsdformat; the child's x axis is the model's y axis."""
    turned = f"<link name='e'><pose>0 0 1 0 0 {numpy.pi / 2}</pose>{LINK}</link>"
    found, _ = read(tmp_path, sdf(f"{turned}{CHAIN}{joint('n', 'a', 'e', axis=axis)}", version))
    assert found is not None
    (axis_of,) = (one.axis for hanging in found.robot.attachments for one in hanging.joints if one.name == "n")
    assert numpy.abs(numpy.array(axis_of) - [1.0, 0.0, 0.0]).max() < 1e-12


@pytest.mark.parametrize(("parent", "kind", "base", "root"), [
    ("world", "fixed", "fixed", "a"), ("world", "continuous", "fixed", "world"), ("", "", "free", "a"),
])
def test_base_and_root_of_a_model(parent: str, kind: str, base: str, root: str, tmp_path: Path) -> None:
    found, report = read(tmp_path, sdf(CHAIN + (joint("w", parent, "a", kind) if parent else "")))
    assert found is not None and not report.failed and (found.robot.base, found.robot.root) == (base, root)


def test_pose_with_a_quaternion(tmp_path: Path) -> None:
    """`quat_xyzw` has w last; the quaternion need not be normalized."""
    turned = f"<link name='e'><pose rotation_format='quat_xyzw'>1 2 3 0.2 0.4 0.8 1.0</pose>{LINK}</link>"
    found, report = read(tmp_path, sdf(f"{turned}{CHAIN}{joint('n', 'a', 'e', 'fixed')}"))
    assert found is not None and not report.failed
    (hanging,) = (one for one in found.robot.attachments if one.child == "e")
    expected = numpy.zeros(9)
    mujoco.mju_quat2Mat(expected, numpy.array([1.0, 0.2, 0.4, 0.8]) / numpy.sqrt(1.84))
    assert hanging.pose.translation == pytest.approx((1.0, 2.0, 3.0))
    assert numpy.array(hanging.pose.rotation) == pytest.approx(expected.reshape(3, 3), abs=1e-12)


def test_missing_inertial_uses_defaults_and_is_a_loss(tmp_path: Path) -> None:
    found, _ = read(tmp_path, "<sdf version='1.9'><model name='m'><link name='a'/></model></sdf>")
    assert found is not None and found.robot.links[0].weight is not None
    assert found.robot.links[0].weight.properties.mass == 1.0 and found.robot.links[0].weight.properties.inertia[2][2] == 1.0
    assert [loss.what for loss in found.losses] == ["the missing `<inertial>` of link `a`"]


def test_included_models_match_drake(tmp_path: Path) -> None:
    """The models are placed by their own frames, one inside another, and found by package and by path. They contain screw and universal
    joints."""
    rig = HERE / "included"
    found = import_cleanly(rig / "rig.sdf")
    assert found.losses == ()
    model = compiled(found, tmp_path)
    data, said = mujoco.MjData(model), json.loads((rig / "drake.json").read_text())
    for name, q in said["q"].items():
        data.joint(name).qpos[0] = q
        if name.endswith("thread"):
            data.joint(f"{name}:slide").qpos[0] = -0.05 * q / (2.0 * numpy.pi)
    mujoco.mj_forward(model, data)
    base = numpy.linalg.inv(pose(data, "base"))
    bodies = {model.body(k).name for k in range(model.nbody)}
    for name, theirs in said["frames in base"].items():
        if name in bodies:  # the other is welded to the base
            assert numpy.abs(base @ pose(data, name) - numpy.array(theirs)).max() < 1e-12, name
    assert len(bodies & said["frames in base"].keys()) == 8


@pytest.mark.parametrize(("wanted", "given"), [("parts/thing", {}), ("model://thing", {"thing": "../elsewhere/thing"})])
def test_included_file_uses_its_own_meshes_and_version(tmp_path: Path, wanted: str, given: dict[str, str]) -> None:
    """The included file is SDF 1.4, whose axes are in the model frame."""
    folder = tmp_path / "robot" / (given["thing"] if given else wanted)
    (folder / "meshes").mkdir(parents=True)
    (tmp_path / "robot").mkdir(exist_ok=True)
    (folder / "meshes" / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    mesh = "<visual name='v'><geometry><mesh><uri>meshes/m.obj</uri></mesh></geometry></visual>"
    (folder / "model.sdf").write_text(
        f"<sdf version='1.4'><model name='t'><link name='a'>{LINK}{mesh}</link>"
        f"<link name='b'><pose>0 0 0 0 0 {numpy.pi / 2}</pose>{LINK}</link>"
        f"{joint('j', 'a', 'b', axis='<xyz>0 1 0</xyz>')}</model></sdf>"
    )
    path, report = tmp_path / "robot" / "m.sdf", Report()
    path.write_text(f"<sdf version='1.9'><world name='w'><include><uri>{wanted}</uri></include>\n<include><uri>model://sun</uri></include></world></sdf>")
    found = import_robot(str(path), report, ImportRequest(packages={name: str(tmp_path / "robot" / one) for name, one in given.items()}))
    assert found is not None and [(one.code.code, one.span.line) for one in report.diagnostics if one.span is not None] == [("TC955", 2)]
    assert found.files["meshes/m.obj"] == (folder / "meshes" / "m.obj").read_bytes()
    assert [one.axis for hanging in found.robot.attachments for one in hanging.joints] == [pytest.approx((1.0, 0.0, 0.0))]
    assert [loss.what for loss in found.losses] == ["`<include>` of `<world>`"]


@pytest.mark.parametrize(("pitch", "lead"), [
    ("<screw_thread_pitch>0.01</screw_thread_pitch>", 0.01), ("<thread_pitch>-12.566370614359172</thread_pitch>", 0.5),
])
def test_screw_pitch_is_converted(pitch: str, lead: float, tmp_path: Path) -> None:
    """Expected is the conversion of libsdformat: `screw_thread_pitch` is `-2 pi / thread_pitch`."""
    text = sdf(joint("j", "a", "b", "screw").replace("</joint>", f"{pitch}</joint>") + REST)
    found, report = read(tmp_path, text)
    assert found is not None and not report.failed
    assert [one.lead for hanging in found.robot.attachments for one in hanging.joints if one.name == "j"] == [pytest.approx(lead)]


@pytest.mark.parametrize("kind", ["universal", "revolute2"])
def test_two_axes_need_not_be_perpendicular(kind: str, tmp_path: Path) -> None:
    """The first axis is fixed in the parent, the second moves with it. Each has its own limits and can be mimicked."""
    second = "<axis2><xyz>0 0.6 0.8</xyz><limit><lower>-1</lower><upper>2</upper><effort>3</effort></limit></axis2>"
    two = joint("j", "a", "b", kind, "<xyz>0 1 0</xyz>").replace("</joint>", f"{second}</joint>")
    follower = joint("k", "b", "c", axis="<xyz>1 0 0</xyz><mimic joint='j' axis='axis2'/>")
    found, report = read(tmp_path, sdf(two + follower + joint("l", "c", "d")))
    assert found is not None and not report.failed and found.losses == ()
    model = compiled(found, tmp_path)
    data = mujoco.MjData(model)
    data.joint("j_0").qpos[0], data.joint("j_1").qpos[0] = 0.4, 0.7
    mujoco.mj_forward(model, data)
    expected = rotation_matrix(0.4, (0, 1, 0)) @ rotation_matrix(0.7, (0, 0.6, 0.8))
    assert numpy.abs((numpy.linalg.inv(pose(data, "a")) @ pose(data, "b"))[:3, :3] - expected[:3, :3]).max() < 1e-12
    assert tuple(model.joint("j_1").range) == (-1.0, 2.0) and model.actuator("j_1").ctrlrange[1] == 3.0
    assert [one.follows.joint for hanging in found.robot.attachments for one in hanging.joints if one.follows is not None] == ["j_1"]


def test_mimic_reference_is_applied(tmp_path: Path) -> None:
    """q(k) = 2 (q(j) - 0.5) + 0.1 is 2 q(j) - 0.9."""
    mimic = "<mimic joint='j'><multiplier>2</multiplier><offset>0.1</offset><reference>0.5</reference></mimic>"
    found, report = read(tmp_path, sdf(joint("j", "a", "b") + joint("k", "b", "c", axis=f"<xyz>0 0 1</xyz>{mimic}") + joint("l", "c", "d")))
    assert found is not None and not report.failed
    model = compiled(found, tmp_path)
    assert model.neq == 1 and model.eq_data[0, :5] == pytest.approx([-0.9, 2.0, 0.0, 0.0, 0.0])


def test_screw_closes_a_loop_only_if_no_other_joint_can(tmp_path: Path) -> None:
    screws = {name: joint(name, *ends, "screw").replace("</joint>", "<screw_thread_pitch>1</screw_thread_pitch></joint>")
              for name, ends in {"j": "ab", "k": "bc", "l": "cd", "m": "ad"}.items()}
    found, report = read(tmp_path, sdf(CHAIN + screws["m"]))
    assert found is not None and not report.failed
    assert [loop.name for loop in found.robot.loops] == ["l"]
    compiled(found, tmp_path)
    found, report = read(tmp_path, sdf("".join(screws.values())))
    assert found is None and [one.message for one in report.diagnostics] == ["all joints in the loop of joint `m` are screws"]


def test_exported_screw_and_universal_joints_round_trip(tmp_path: Path) -> None:
    inertia = "{ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}"
    links = "\n".join(f"  {name}: {{link: true, mass: 1 kg, inertia: {inertia}, mounts: {{t: {{xyz: 0 0 100 mm}}}}}}" for name in "abc")
    joints = "  s: {type: screw, parent: a.t, child: b.origin, lead: -8 mm}\n  u: {type: universal, parent: b.t, child: c.origin}"
    (tmp_path / "r.yaml").write_text(f"thingc: assembly/1\nname: r\ncomponents:\n{links}\njoints:\n{joints}\n")
    thingc.family(tmp_path / "r.yaml").write({}, tmp_path / "out", emit=["sdf"])
    found = import_robot(str(tmp_path / "out" / "sdf" / "r_default" / "model.sdf"), Report())
    assert found is not None
    models = thingc.compile(tmp_path / "r.yaml").modes["default"].model(), compiled(found, tmp_path / "again")
    states = [mujoco.MjData(model) for model in models]
    for data in states:
        for name, q in (("s", 0.8), ("s:slide", -0.008 * 0.8 / (2.0 * numpy.pi)), ("u_0", -0.4), ("u_1", 1.1)):
            data.joint(name).qpos[0] = q
        mujoco.mj_forward(data.model, data)
    for name in "abc":
        assert numpy.abs(pose(states[0], name) - pose(states[1], name)).max() < 1e-12


@pytest.mark.parametrize(("text", "code", "line", "message"), [
    ("<robot/>", "TC951", 1, "expected the first element `<sdf>` (SDF), found `<robot>`"),
    (sdf(CHAIN, "2.0"), "TC952", 1, "`version` of `<sdf>`: expected 1.4 to 1.12, found `2.0`"),
    ("<sdf version='1.9'>\n</sdf>", "TC953", 1, "expected one model that is not static, found none"),
    ("<sdf version='1.9'><model name='a'/>\n<model name='b'/></sdf>", "TC953", 2, "expected one model that is not static, found `a`, `b`"),
    (sdf(CHAIN + "<include merge='1'><uri>m.sdf</uri></include>"), "TC952", 9, "`merge` is not supported"),
    (sdf(CHAIN + "<include><uri>m.sdf</uri>\n<name>n</name></include>"), "TC952", 9,
     "the number of included models exceeds the maximum (100)"),
    (sdf(CHAIN + "<include><uri>none.sdf</uri></include>"), "TC956", 9, "there is no file `none.sdf`"),
    (sdf(CHAIN + "<include><uri>m.sdf</uri><placement_frame>a</placement_frame></include>"), "TC952", 9,
     "an `<include>` with `<placement_frame>` requires `<pose>`"),
    (sdf(CHAIN + "<include/>"), "TC952", 9, "`<include>` has no `uri`"),
    (sdf(joint("j", "a", "b", "universal") + REST), "TC952", 6, "a `universal` joint requires `<axis2>`"),
    (sdf(joint("j", "a", "b", "screw") + REST), "TC952", 6, "`<joint>` has no `screw_thread_pitch`"),
    (sdf(joint("j", "a", "b", "gearbox") + REST), "TC952", 6, "joints of type `gearbox` are not supported"),
    (sdf(CHAIN + joint("o", "a", "z")), "TC952", 9, "there is no link, joint, frame or model `z`"),
    (sdf(joint("j", "a", "b") + joint("k", "b", "c")), "TC953", 5, "the robot has 2 links without a parent (`a`, `d`)"),
    (sdf(CHAIN + "<frame name='f'><pose relative_to='g'/></frame>\n<frame name='g'><pose relative_to='f'/></frame>"), "TC953", 9,
     "the poses form a cycle: `f` -> `g` -> `f`"),
    (sdf(CHAIN + "<frame name='a'/>"), "TC953", 9, "two elements of the model are named `a`"),
    (sdf(CHAIN + "<frame name='f'><pose>0 0 nan 0 0 0</pose></frame>"), "TC952", 9,
     "`pose` of `<frame>`: expected 6 finite numbers separated by spaces, found `nan`"),
    (sdf(joint("j", "a", "b", "hinge") + REST), "TC952", 6, "unknown joint type `hinge`"),
    (sdf(joint("j", "a", "b", axis="<xyz>0 0 0</xyz>") + REST), "TC952", 6,
     "the axis of a joint must not be 0 0 0"),
    (sdf(joint("j", "a", "b", axis="<xyz>0 0 1</xyz><limit><lower>2</lower><upper>1</upper></limit>") + REST),
     "TC952", 6, "`lower` (2) is above `upper` (1)"),
    (sdf(joint("j", "a", "b", axis="<xyz>0 0 1</xyz><mimic joint='q'/>") + REST), "TC952", 6,
     "joint `j` mimics `q`, not a moving joint"),
])
def test_errors_are_reported_at_their_line(text: str, code: str, line: int, message: str, tmp_path: Path) -> None:
    found, report = read(tmp_path, text)
    assert found is None
    said = [(one.code.code, one.span.line if one.span is not None else 0, one.message.split(" (searched")[0]) for one
    in report.sorted_diagnostics()]
    assert said == [(code, line, message)]


def compiled(found: Imported, folder: Path) -> mujoco.MjModel:
    return thingc.compile(write_import(found, folder)).modes["source"].model()


def pose(data: mujoco.MjData, word: str) -> numpy.ndarray:
    """Return the pose (4, 4) of the site with this name, or else of the body."""
    is_site = mujoco.mj_name2id(data.model, mujoco.mjtObj.mjOBJ_SITE, word) >= 0
    found, one = numpy.eye(4), data.site(word) if is_site else data.body(word)
    found[:3, :3], found[:3, 3] = one.xmat.reshape(3, 3), one.xpos
    return found


def close(ours: numpy.ndarray, theirs: list[object]) -> None:
    assert numpy.abs(ours - numpy.array(theirs)).max() <= 1e-9 * numpy.abs(numpy.array(theirs)).max()
