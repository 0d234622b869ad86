"""The SO-101 of the gallery, compared with the files of its authors, which are read independently: poses, masses, zeros, motors, and
data of servos."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import thingc
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.types import Robot
from thingc.tools.cli.main import main

pytestmark = pytest.mark.slow

FOLDER = Path(__file__).resolve().parents[2] / "gallery/so101"
SOURCE = FOLDER / "source"
PAIRS = [("so101.yaml", "so101_new_calib.urdf"), ("old_calibration.yaml", "so101_old_calib.urdf")]
SERVO = 1e-9
"""The mass of a servo that is a separate component [kg]. Its true mass is part of the link, as in the source."""


def compiled(document: str, store: str) -> Robot:
    return thingc.compile(str(FOLDER / document), store=store).modes["bench"].robot


def transform(element: ET.Element | None) -> np.ndarray:
    """Parse the `<origin>` of an URDF element."""
    pose = np.eye(4)
    if element is not None:
        pose[:3, :3] = Rotation.from_euler("xyz", [float(x) for x in element.attrib["rpy"].split()]).as_matrix()
        pose[:3, 3] = [float(x) for x in element.attrib["xyz"].split()]
    return pose


def urdf_poses(root: ET.Element, q: dict[str, float]) -> dict[str, np.ndarray]:
    """Return the poses of all links in the frame of the root link."""
    joints = root.findall("joint")
    children = {joint.find("child").attrib["link"]: joint for joint in joints}  # type: ignore[union-attr]

    def pose(link: str) -> np.ndarray:
        if link not in children:
            return np.eye(4)
        joint, turn = children[link], np.eye(4)
        if joint.attrib["type"] != "fixed":
            axis = np.array([float(x) for x in joint.find("axis").attrib["xyz"].split()])  # type: ignore[union-attr]
            turn[:3, :3] = Rotation.from_rotvec(q[joint.attrib["name"]] * axis).as_matrix()
        return pose(joint.find("parent").attrib["link"]) @ transform(joint.find("origin")) @ turn  # type: ignore[union-attr]

    return {link.attrib["name"]: pose(link.attrib["name"]) for link in root.findall("link")}


@pytest.mark.parametrize(("document", "source"), PAIRS)
def test_link_poses_equal_those_of_the_urdf(document: str, source: str, shared_store: str) -> None:
    robot, root = compiled(document, shared_store), ET.parse(SOURCE / source).getroot()
    names = [robot.assembly.links[body.link].name for body in robot.bodies]
    moving = [joint.attrib["name"] for joint in root.findall("joint") if joint.attrib["type"] == "revolute"]
    assert {joint.path for body in robot.bodies for joint in body.joints} == set(moving) and len(moving) == 6
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = dict(zip(moving, rng.uniform(-2.0, 2.0, len(moving)), strict=True))
        expected, first = urdf_poses(root, q), body_poses(robot, q)[0]
        for name, pose in zip(names, body_poses(robot, q), strict=True):
            relative = first.inverse() @ pose
            assert np.abs(np.array(relative.rotation) - expected[name][:3, :3]).max() < 1e-9, name
            assert np.abs(np.array(relative.translation) - expected[name][:3, 3]).max() < 1e-9, name
    if document == "so101.yaml":  # LeRobot computes the pose of this frame
        tip = robot.assembly.occurrences[[one.path for one in robot.assembly.occurrences].index("gripper_link")].mounts["tip"].pose
        joint = next(joint for joint in root.findall("joint") if joint.attrib["name"] == "gripper_frame_joint")
        assert np.abs(np.array(tip.translation) - transform(joint.find("origin"))[:3, 3]).max() < 1e-12


@pytest.mark.parametrize(("document", "source"), PAIRS)
def test_masses_equal_those_of_the_urdf(document: str, source: str, shared_store: str) -> None:
    robot = compiled(document, shared_store)
    links = {link.name: link.properties for link in robot.assembly.links}
    for link in ET.parse(SOURCE / source).getroot().findall("link"):
        inertial, name = link.find("inertial"), link.attrib["name"]
        if name == "gripper_frame_link":
            continue  # 1e-9 kg, which stand for no mass
        assert inertial is not None
        mass = float(inertial.find("mass").attrib["value"])  # type: ignore[union-attr]
        centre = [float(x) for x in inertial.find("origin").attrib["xyz"].split()]  # type: ignore[union-attr]
        moments = {key: float(value) for key, value in inertial.find("inertia").attrib.items()}  # type: ignore[union-attr]
        found = links[name]
        assert abs(found.mass - mass) < 1.5 * SERVO and np.abs(np.array(found.centre) - centre).max() < 1e-8, name
        for key, value in moments.items():
            assert abs(found.inertia["xyz".index(key[1])]["xyz".index(key[2])] - value) < 2e-11, (name, key)


def test_both_calibrations_and_mjcf_are_one_mechanism(capsys: pytest.CaptureFixture[str], shared_store: str) -> None:
    def same(other: Path) -> list[str]:
        assert main(["same", str(FOLDER / "so101.yaml"), str(other), "--store", shared_store]) == 0
        return capsys.readouterr().out.splitlines()

    old = same(FOLDER / "old_calibration.yaml")
    assert old[0].endswith("the same mechanism; zeros: shoulder_lift -90 deg, elbow_flex +90 deg, wrist_roll -2.789 deg")
    assert same(SOURCE / "so101_new_calib.xml")[0].endswith("so101_new_calib.xml: the same mechanism")


def test_drives_equal_those_of_the_stock_servo(shared_store: str) -> None:
    """30 kgf cm and 45 rpm, as published by Feetech. The URDF has 10 N m and 10 rad/s, and the MJCF 3.35 N m."""
    for document, source in PAIRS:
        limits = ET.parse(SOURCE / source).getroot().findall("joint/limit")
        assert {(limit.attrib["effort"], limit.attrib["velocity"]) for limit in limits} == {("10", "10")}
        joints = [joint for body in compiled(document, shared_store).bodies for joint in body.joints]
        assert len(joints) == 6
        for joint in joints:
            assert joint.limit.effort == pytest.approx(30 * 0.0980665) and joint.limit.velocity == pytest.approx(45 * np.pi / 30)


def test_elbow_collides_within_the_limit_of_the_source(capsys: pytest.CaptureFixture[str], shared_store: str) -> None:
    """The limit in the file with the old calibration, 180 deg, is 90 deg here."""
    for upper, code in (("1.5708 rad", 0), ("1.62 rad", 1), ("1.69 rad", 1)):
        words = ["--only", "elbow", "--set", f"joints.elbow_flex.limit.upper={upper}", "--store", shared_store]
        assert main(["test", str(FOLDER / "so101.yaml"), *words]) == code, upper
        assert ("`shoulder_lift_servo` and `lower_arm_link` overlap" in capsys.readouterr().out) == bool(code)


def test_servo_is_at_the_place_of_the_source_mesh(shared_store: str) -> None:
    """The case of the stock servo is inside the box of the source mesh in each link."""
    robot = compiled("so101.yaml", shared_store)
    boxes = {}
    for name in ("sts3215_03a_v1", "sts3215_03a_no_horn_v1"):
        boxes[name] = trimesh.load_mesh(SOURCE / f"assets/{name}.stl").bounds
    by_path = {one.path: one for one in robot.assembly.occurrences}
    rest = dict(zip([one.path for one in robot.assembly.occurrences], robot.assembly.rest, strict=True))
    case = [(x, y, z) for x in (-0.0124, 0.0124) for y in (-0.0352, 0.0102) for z in (-0.0159, 0.0159)]
    for link in ET.parse(SOURCE / PAIRS[0][1]).getroot().findall("link"):
        for visual in link.findall("visual"):
            mesh = Path(visual.find("geometry/mesh").attrib["filename"]).stem  # type: ignore[union-attr]
            if mesh in boxes:
                servo = next(path for path, one in by_path.items() if path.endswith("_servo") and
                             robot.assembly.links[robot.assembly.link_of[one.index]].name == link.attrib["name"])
                placed = rest[link.attrib["name"]].inverse() @ rest[servo]
                corners = np.array(case) @ np.array(placed.rotation).T + np.array(placed.translation)
                inverse = np.linalg.inv(transform(visual.find("origin")))
                corners = corners @ inverse[:3, :3].T + inverse[:3, 3]
                low, high = boxes[mesh]
                assert (corners > low - 1e-4).all() and (corners < high + 1e-4).all(), servo
                assert np.ptp(corners, axis=0)[:2] == pytest.approx(high[:2] - low[:2], abs=1e-4), servo


def test_motors_equal_those_of_the_urdf(capsys: pytest.CaptureFixture[str]) -> None:
    """LeRobot and the transmissions of the URDF number the motors from the base to the gripper."""
    assert main(["calibration", str(FOLDER / "so101.yaml"), str(FOLDER / "nominal.calibration.yaml"), "--emit", "lerobot_motors"]) == 0
    told = json.loads(capsys.readouterr().out)
    root = ET.parse(SOURCE / PAIRS[0][1]).getroot()
    numbers = {
        one.find("joint").attrib["name"]: int(re.findall(r"\d+", one.find("actuator").attrib["name"])[0])  # type: ignore[union-attr]
        for one in root.findall("transmission")
    }
    assert {name: motor["id"] for name, motor in told.items()} == numbers and {motor["model"] for motor in told.values()} == {"sts3215"}
    assert list(told) == sorted(told, key=lambda name: int(told[name]["id"]))


def test_licence_is_included() -> None:
    assert "Apache License" in (SOURCE / "LICENSE").read_text() and "TheRobotStudio/SO-ARM100" in (SOURCE / "README.md").read_text()
    assert sum(path.stat().st_size for path in FOLDER.rglob("*") if path.is_file() and "build" not in path.parts) < 300_000
