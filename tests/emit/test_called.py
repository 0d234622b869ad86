"""Names in output files: `names:` of a document renames elements, and the readers of each format find them by these names."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints
from xml.etree import ElementTree

import mujoco
import pytest
from ruamel.yaml import YAML

import thingc
from thingc import modes
from thingc.base.diagnostics import Severity
from thingc.base.export_names import JointPath
from thingc.base.frozen_struct import FrozenStruct
from thingc.model.robot.types import Robot
from thingc.targets.custom_names import AS_WRITTEN

ARM = """thingc: assembly/1
name: arm
components:
  upper:
    link: true
    mass: 1 kg
    shapes: [{box: 50 50 200 mm}]
    mounts: {elbow: {xyz: 0 0 100 mm}}
  lower:
    link: true
    mass: 1 kg
    shapes: [{box: 50 50 200 mm}]
    mounts: {hand: {xyz: 0 0 100 mm}, above: {xyz: 0 0 150 mm}}
joints:
  elbow:
    type: revolute
    parent: upper.elbow
    child: lower.origin
    axis: [0, 1, 0]
    limit: {lower: -90 deg, upper: 90 deg}
    drive: {kind: position, kp: 5 N*m/rad, effort: 9 N*m}
  follower:
    type: revolute
    parent: upper.origin
    child: pulley.origin
    axis: [0, 1, 0]
    mimic: {joint: elbow, multiplier: 0.5}
mounts: {hand: lower.hand, above: lower.above}
sensors:
  imu: {type: imu, at: hand}
names:
  components: {lower: forearm-link}
  mounts: {hand: "tool/0", above: side}
  joints: {elbow: "2"}
  actuators: {elbow: elbow motor}
  sensors: {imu: tool-imu, "imu:gyro": gyro.0}
"""
PULLEY = "  pulley: {link: true, mass: 100 g, shapes: [{sphere: {radius: 20 mm}}]}\n"
PAIR = """thingc: assembly/1
name: pair
components:
  base:
    link: true
    mass: 5 kg
    shapes: [{box: 400 400 50 mm}]
    mounts: {left: {xyz: 0 100 200 mm}, right: {xyz: 0 -100 200 mm}}
  left: {assembly: arm.yaml, at: {in: base.left}}
  right: {assembly: arm.yaml, at: {in: base.right}}
tendons:
  string:
    path: [base.right, {around: left.hand, sphere: 30 mm, side: left.above}, base.left, {pulley: 2}, left.hand, right.hand]
    dynamics: {stiffness: 5 N/m}
    drive: {kind: motor, effort: 3 N}
sensors: {pull: {type: tendon, tendon: string}}
poses: {bent: {left.elbow: 30 deg, right.elbow: -30 deg}}
modes:
  stand: {root: base, base: fixed, pose: bent, actuators: ["left.*"]}
  hang: {root: left.hand, base: fixed, at: {xyz: 0 0 2 m}, pose: bent}
names:
  components: {base: base-link}
  tendons: {string: bow string}
  actuators: {string: puller}
  poses: {bent: "bent: 30"}
raw:
  mjcf:
    joint: {left.elbow: {margin: 0.01}}
    actuator: {left.elbow: {group: 2}, string: {group: 3}}
    tendon: {string: {margin: 0.02}}
    equality: {"left.follower:mimic": {solref: 0.03 1}}
    add:
      tendon: [{fixed: {name: cable, in: [{joint: {joint: left.elbow, coef: 2}}]}}]
  urdf: {joint: {left.elbow: {safety_controller: {k_velocity: 10}}}}
"""


@pytest.fixture(scope="module")
def document(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pair")
    (folder / "arm.yaml").write_text(ARM.replace("joints:\n", f"{PULLEY}joints:\n", 1))
    (folder / "pair.yaml").write_text(PAIR)
    return folder / "pair.yaml"


@pytest.fixture(scope="module")
def pair(document: Path) -> thingc.Compiled:
    return thingc.compile(document)


@pytest.fixture(scope="module")
def files(document: Path) -> Path:
    """A build folder with MuJoCo, URDF, SDF, ROS and USD output."""
    folder = document.parent / "built"
    said = thingc.family(document).write({}, folder, emit=["mjcf", "urdf", "sdf", "ros", "usd"])
    assert not [one for one in said if one.severity is Severity.ERROR]
    return folder


def test_mujoco_elements_have_document_names(pair: thingc.Compiled) -> None:
    """Bodies, joints, actuators, sites, sensors and keyframes of the compiled model have the names from `names:`."""
    model = pair.modes["stand"].model()
    assert {model.body(k).name for k in range(1, model.nbody)} == {
        "base-link", "left/forearm-link", "left/pulley", "right/forearm-link", "right/pulley",
    }
    assert [model.joint(k).name for k in range(model.njnt)] == ["left/2", "left/follower", "right/2", "right/follower"]
    assert [model.actuator(k).name for k in range(model.nu)] == ["left/elbow motor"]
    assert model.actuator(0).trnid[0] == model.joint("left/2").id
    assert {"left/tool/0", "right/tool/0"} <= {model.site(k).name for k in range(model.nsite)}
    assert [model.sensor(k).name for k in range(3, 6)] == ["left/tool-imu:accelerometer", "left/gyro.0", "left/tool-imu:quat"]
    assert model.key("bent: 30").qpos[model.joint("left/2").qposadr[0]] == pytest.approx(0.5235987755982988)


def test_raw_attributes_accept_path_or_file_name(pair: thingc.Compiled) -> None:
    """`raw` attributes apply to an element by its path in the document or by its name in the file."""
    model = pair.modes["stand"].model()
    assert model.joint("left/2").margin[0] == 0.01 and model.joint("right/2").margin[0] == 0.0
    assert model.actuator("left/elbow motor").group[0] == 2
    assert model.eq("left/follower:mimic").solref[0] == 0.03
    assert pair.modes["hang"].model().actuator("puller").group[0] == 3 and model.tendon_margin[model.tendon("bow string").id] == 0.02
    cable = model.tendon("cable").id
    assert model.tendon_num[cable] == 1 and model.wrap_objid[model.tendon_adr[cable]] == model.joint("left/2").id


def test_tendons_wrap_renamed_sites(pair: thingc.Compiled, document: Path) -> None:
    """Spatial tendons wrap renamed sites and geoms. Their lengths equal those of the same documents without `names:`."""
    for name in ("arm", "pair"):
        whole = (document.parent / f"{name}.yaml").read_text()
        plain = document.parent / "plain" / f"{name}.yaml"
        plain.parent.mkdir(exist_ok=True)
        plain.write_text(whole.split("names:\n")[0])
    for mode in ("stand", "hang"):
        model, other = pair.modes[mode].model(), thingc.compile(plain).modes[mode].model()
        string, plainly = model.tendon("bow string").id, other.tendon("string").id
        through = model.wrap_objid[model.tendon_adr[string] :][: model.tendon_num[string]]
        assert through[-2:].tolist() == [model.site("left/tool/0").id, model.site("right/tool/0").id]
        assert model.wrap_prm[model.tendon_adr[string] + 1] == model.site("left/side").id
        assert model.sensor("pull:length").objid[0] == string
        assert mode == "stand" or model.actuator("puller").trnid[0] == string
        lengths = [data_at_first_key(one).tendon(k).length[0] for one, k in ((model, string), (other, plainly))]
        assert lengths[0] == pytest.approx(lengths[1], abs=1e-12) and lengths[0] > 0.1
        assert model.tendon_lengthspring[string] == pytest.approx(other.tendon_lengthspring[plainly])


def data_at_first_key(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return data


def test_mode_switch_works_with_renamed_joints(files: Path) -> None:
    """Switching the root from the base to the tool keeps the joint positions of renamed joints."""
    stand, hang = (mujoco.MjModel.from_xml_path(str(files / f"mjcf/pair_{mode}.xml")) for mode in ("stand", "hang"))
    robot, before, after = modes.Modes.load(files / "modes.json"), mujoco.MjData(stand), mujoco.MjData(hang)
    mujoco.mj_resetDataKeyframe(stand, before, stand.key("bent: 30").id)
    robot.switch(("stand", before), ("hang", after), tolerance=10.0)
    assert {name: float(after.joint(name).qpos[0]) for name in ("left/2", "right/2")} == pytest.approx(
        {"left/2": 0.5235987755982988, "right/2": -0.5235987755982988},
    )


def test_urdf_sdf_and_ros_use_document_names(files: Path) -> None:
    """URDF, SDF and the ROS controllers use the names from `names:`, with `_` as path separator. References inside a file use the same
    names."""
    urdf, sdf = (ElementTree.parse(files / path).getroot() for path in ("urdf/pair_stand.urdf", "sdf/pair_stand/model.sdf"))
    links = {link.attrib["name"] for link in urdf.iter("link")}
    assert {"base-link", "left_forearm-link", "right_forearm-link", "left_tool_0"} <= links and "left_lower" not in links
    joints = {joint.attrib["name"]: joint for joint in urdf.findall("joint")}
    assert joints["left_2"].find("child").attrib["link"] == "left_forearm-link"
    assert joints["left_follower"].find("mimic").attrib["joint"] == "left_2"
    assert joints["left_2"].find("safety_controller").attrib == {"k_velocity": "10"}
    assert {one.attrib["name"] for one in sdf.iter("joint")} >= {"left_2", "right_2"}
    assert next(one for one in sdf.iter("joint") if one.attrib["name"] == "left_2").find("child").text == "left_forearm-link"
    assert {one.attrib["name"] for one in sdf.iter("sensor")} == {"left_tool-imu", "right_tool-imu"}
    config = YAML(typ="safe").load(files / "ros/pair_description/config/controllers.yaml")
    assert any("left_2" in one["ros__parameters"].get("joints", ()) for one in config.values())


def test_usd_display_names_are_document_paths(files: Path) -> None:
    """USD prims carry the paths of the document, not the names from `names:`."""
    stage = (files / "usd/pair_stand.usda").read_text()
    assert '"left_lower"' in stage and "forearm" not in stage


def test_python_api_uses_document_names(pair: thingc.Compiled) -> None:
    """`Compiled.links` and keyframes have the names that the document uses."""
    assert {"left/lower", "right/lower"} <= set(pair.links)
    assert [frame.name for frame in pair.modes["stand"].robot.keyframes] == ["bent"]


PLAIN = {
    "ActuatorModel.name", "ActuatorModel.transmission", "Adhesion.mount", "Assembly.name", "Closure.name", "ExportedMount.mount",
    "ContactGroup.collides", "ContactGroup.name", "LinkedMode.name",
    "LinkedMode.simulation", "LinkedMount.mount", "LinkedSensor.cutoff", "LinkedSensor.noise", "LinkedSensor.parts",
    "Mate.child_mount", "Mate.parent_mount", "Mimic.name",
    "RawAttribute.target", "RawAttribute.value", "RawElement.section", "RawElement.tag",
    "Robot.name", "Span.file",
}
"""Text fields of records that are written to files unchanged, or that the rules of `called` handle."""


def records(hint: Any, seen: dict[str, Any]) -> dict[str, Any]:
    """Collect every field of all records reachable from a type, as `Record.field`. Records in `AS_WRITTEN` are skipped."""
    kind = get_origin(hint) or hint
    if isinstance(kind, type) and issubclass(kind, FrozenStruct):
        if kind not in AS_WRITTEN and not any(one.startswith(f"{kind.__name__}.") for one in seen):
            fields = {f"{kind.__name__}.{name}": inner for name, inner in get_type_hints(kind, include_extras=True).items()}
            seen.update(fields)
            for inner in fields.values():
                records(inner, seen)
    elif get_origin(hint) is not Annotated:
        for argument in get_args(hint):
            records(argument, seen)
    return seen


def has_text(hint: Any) -> bool:
    return hint in (str, Any) or (get_origin(hint) is not Annotated and any(has_text(one) for one in get_args(hint)))


def test_text_fields_of_records_are_typed_or_listed() -> None:
    """A field that contains the name of an element must have a type of `file_names`. Any other text field must be listed in PLAIN."""
    fields = records(Robot, {})
    assert {name for name, hint in fields.items() if has_text(hint)} == PLAIN
    assert fields["Mate.name"] == JointPath | None
