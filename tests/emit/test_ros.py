"""The ROS 2 package: its files against the REPs, its launch file with stubs of the launch modules, and its SRDF against geometry."""

from __future__ import annotations

import cmath
import dataclasses
import itertools
import math
import re
import runpy
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml
from msgspec.structs import replace
from scipy.spatial.transform import Rotation

from emit import small_robot
from graph.builder import MATE, assembly as document, box, component, coordinates_of, linked, mimic, mode, pose, ref, rz, t, where
from thingc.base.diagnostics import Code, Report
from thingc.base.package_info import PackageInfo
from thingc.base.pose import NO_POSE
from thingc.base.primitives import Primitive
from thingc.geometry.record import Mesh
from thingc.geometry.store.local import Store
from thingc.model.resolve.coordinates import Dynamics, Limit
from thingc.model.resolve.types import Drive, Joint
from thingc.model.robot.kinematic_tree import root as rooted
from thingc.targets.artifact import Artifacts
from thingc.targets.mjcf.emit import emit as emit_mjcf
from thingc.targets.name_mangling import package_name
from thingc.targets.request import EmitRequest
from thingc.targets.ros import collision_matrix
from thingc.targets.ros.emit import emit
from thingc.targets.urdf.emit import emit as emit_urdf
from thingc.targets.xml_writer import Element
from thingc.tools.cli.main import main

MOUNTS = {"in": MATE, "out": t(0.1, 0.0, 0.0)}
"""Mounts of a ball in a chain: `in` is inside the ball, `out` is 0.1 m along x."""


def build_request(model: Any, radii: Mapping[int, float], folder: str) -> EmitRequest:
    """Build a request for components `c0`, `c1` ..., each a ball with a radius [m] around its origin. Balls without a radius have no
    collision shape."""
    count = len(model.components)
    drawn = {"visual": Mesh(sha256="0" * 64, size=0, vertices=4, faces=4, closed=True, flat=False)}
    records = [
        box(f"p:B{k}", (0.05, 0.04, 0.03), mounts=MOUNTS, meshes=drawn,
            pieces=(Primitive(shape="sphere", size=(radii.get(k, 1.0),), pose=NO_POSE),))
        for k in range(count)
    ]
    report = Report()
    whole = linked(model, *records)
    robots = tuple(robot for robot in (rooted(whole, one, report) for one in whole.modes) if robot is not None)
    assert report.diagnostics == []
    return EmitRequest(
        assembly=whole, robots=robots, store=Store(folder), report=report, geometry=None,  # type: ignore[arg-type]
        workspace=small_robot.WORKSPACE,
    )


def balls(count: int, radii: Mapping[int, float]) -> list[Any]:
    return [
        component(f"c{k}", f"p:B{k}", visual=False, collision="part" if k in radii else "none") for k in range(count)
    ]


def xml(made: Artifacts, path: str) -> ElementTree.Element:
    (text,) = (content for name, content in made.files.items() if name.endswith(f"_description/{path}"))
    assert isinstance(text, bytes)
    return ElementTree.fromstring(text)


def text(made: Artifacts, path: str) -> str:
    (found,) = (content for name, content in made.files.items() if name.endswith(f"_description/{path}"))
    assert isinstance(found, bytes)
    return found.decode()


# --- a robot with every kind of drive ----------------------------------------------------------------------------------


def drive(kind: str, **said: Any) -> Drive:
    return Drive(component=None, kind=kind, origin=where(30), **said)


def joints() -> list[Joint]:
    """`yaw` has a position drive, `wheel` a velocity drive, `lift` a motor. `finger` mimics `lift`, `spindle` is a screw, and `flap` has
    no drive."""
    yaw, wheel, lift = (
        coordinates_of("yaw", "c0.out", "c1.in", "revolute", lower=-1.0, upper=2.0, drive=drive("position", kp=20.0, kv=1e-5)),
        coordinates_of("wheel", "c1.out", "c2.in", "continuous", velocity=3.0, drive=drive("velocity", kv=0.5)),
        coordinates_of("lift", "c2.out", "c3.in", "prismatic", lower=0.0, upper=0.02, effort=7.0, drive=drive("motor")),
    )
    loose = [
        *coordinates_of("finger", "c3.out", "c4.in", "prismatic", lower=0.0, upper=0.1, mimic=mimic("lift", 2.0, 0.01)),
        *coordinates_of("spindle", "c4.out", "c5.in", "screw"), *coordinates_of("flap", "c5.out", "c6.in", "revolute"),
    ]
    return [*yaw, *wheel, *lift, *loose]


@pytest.fixture(scope="module")
def request_of_all(tmp_path_factory: pytest.TempPathFactory) -> EmitRequest:
    """A request with two modes: `bench` is fixed and has all drives; `adrift` has a free base at the other end and two drives."""
    radii = {0: 0.01, 1: 0.01, 3: 0.01}
    modes = [
        mode("bench", ref("c0.out"), "fixed", pose="up", poses=("up", "down")),
        mode("adrift", ref("c6.in"), "free", actuators=("yaw", "lift")),
    ]
    poses = [pose("up", yaw=0.5, lift=0.02, spindle=math.pi), pose("down", yaw=-0.5)]
    mounts = {"tip": "c6.out", "base": "c0.in", "y": "c1.out"}
    model = document("Robot__7", balls(7, radii), joints(), modes=modes, poses=poses, mounts=mounts)
    request = build_request(model, radii, str(tmp_path_factory.mktemp("store")))
    said = PackageInfo(maintainer="Ada <3 & co", mail="ada@example.org", license="Apache-2.0", version="1.2.3")
    return replace(request, workspace=dataclasses.replace(request.workspace, about=said))


@pytest.fixture(scope="module")
def made(request_of_all: EmitRequest) -> Artifacts:
    return emit(request_of_all)


def test_package_has_expected_files(made: Artifacts) -> None:
    assert set(made.files) == {f"ros/robot_7_description/{path}" for path in (
        "CMakeLists.txt", "config/Robot__7_adrift.srdf", "config/Robot__7_bench.srdf", "config/controllers.yaml", "config/display.rviz",
        "launch/display.launch.py", "package.xml", "urdf/Robot__7_adrift.urdf", "urdf/Robot__7_bench.urdf",
    )}
    assert list(made.files) == sorted(made.files)


@pytest.mark.parametrize(("robot", "name"), [
    ("arm", "arm_description"), ("MInchW", "minchw_description"), ("A__b_", "a_b_description"), ("x2", "x2_description"),
])
def test_package_names_follow_rep_144(robot: str, name: str) -> None:
    assert package_name(robot) == name and re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name)


def test_package_manifest_follows_rep_149(made: Artifacts) -> None:
    """Format 3 of REP 149: required elements occur once in any order, the maintainer has a mail address, and `export` contains the build
    type."""
    assert text(made, "package.xml").startswith('<?xml version="1.0"?>\n')  # nothing, not even a comment, may stand before it
    package = xml(made, "package.xml")
    assert (package.tag, package.attrib) == ("package", {"format": "3"})
    once = {tag: package.findall(tag) for tag in ("name", "version", "description", "maintainer", "license", "export")}
    assert all(len(found) == 1 for found in once.values())
    assert {tag: found[0].text for tag, found in once.items() if tag != "export"} == {
        "name": "robot_7_description", "version": "1.2.3", "description": "The robot Robot__7.", "maintainer": "Ada <3 & co",
        "license": "Apache-2.0",
    }
    assert once["maintainer"][0].attrib == {"email": "ada@example.org"}
    assert [tool.text for tool in package.findall("buildtool_depend")] == ["ament_cmake"]
    assert package.findtext("export/build_type") == "ament_cmake"
    known = {"name", "version", "description", "maintainer", "license", "buildtool_depend", "exec_depend", "export"}
    assert {child.tag for child in package} == known


def test_unusual_descriptions_and_file_names_are_escaped(tmp_path: Path) -> None:
    """The manifest escapes characters that XML does not allow. A document whose name equals a placeholder of the template gives a valid
    launch file."""
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    document = tmp_path / "@MODES@.yaml"
    document.write_text('thingc: assembly/1\nname: odd\ndescription: "a\\x01b </description> \\ufffe"\ncomponents: {base: {frame: true}}\n')
    assert main(["build", str(document), "-o", str(tmp_path), "--emit", "ros"]) == 0
    package = tmp_path / "odd" / "ros" / "odd_description"
    manifest = ElementTree.parse(package / "package.xml")
    assert manifest.findtext("description") == r"a\x01b </description> \ufffe"
    launch = (package / "launch" / "display.launch.py").read_text()
    assert launch.startswith('# Written by thingc from @MODES@.yaml.\n"""Shows')
    compile(launch, "display.launch.py", "exec")


def test_used_packages_are_dependencies(made: Artifacts) -> None:
    """All packages that the launch file runs or imports, and all plugins, are `exec_depend` entries."""
    depends = {depend.text for depend in xml(made, "package.xml").findall("exec_depend")}
    launch, parameters = text(made, "launch/display.launch.py"), yaml.safe_load(text(made, "config/controllers.yaml"))
    run = set(re.findall(r'package="(\w+)"', launch)) | {"joint_state_publisher", "joint_state_publisher_gui"}
    imported = {module.partition(".")[0] for module in re.findall(r"^from ([\w.]+) import", launch, re.M)} - {"pathlib"}
    manager = parameters["controller_manager"]["ros__parameters"]
    plugins = {one["type"].partition("/")[0] for one in manager.values() if isinstance(one, dict)}
    assert run | imported | plugins | {"hardware_interface"} == depends  # the mock components are in hardware_interface


@pytest.mark.skipif(shutil.which("cmake") is None, reason="there is no cmake")
def test_cmake_installs_all_files(made: Artifacts, tmp_path: Path) -> None:
    """CMake configures and installs the package. Only `ament_package()` is a stub, which installs the manifest."""
    package, found = tmp_path / "robot_7_description", tmp_path / "ament"
    for name, content in made.files.items():
        assert isinstance(content, bytes)
        file = package / Path(name).relative_to("ros/robot_7_description")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    found.mkdir()
    (found / "ament_cmakeConfig.cmake").write_text(
        "macro(ament_package)\n  install(FILES package.xml DESTINATION share/${PROJECT_NAME})\nendmacro()\n",
    )
    where_to = [f"-Dament_cmake_DIR={found}", f"-DCMAKE_INSTALL_PREFIX={tmp_path / 'out'}"]
    for command in (["cmake", "-S", str(package), "-B", str(tmp_path / "b"), *where_to], ["cmake", "--install", str(tmp_path / "b")]):
        ran = subprocess.run(command, capture_output=True, text=True)
        assert ran.returncode == 0 and "Warning" not in ran.stderr, ran.stderr
    share = tmp_path / "out" / "share" / "robot_7_description"
    installed = {str(path.relative_to(share)) for path in share.rglob("*") if path.is_file()}
    assert installed == {str(Path(name).relative_to("ros/robot_7_description")) for name in made.files} - {"CMakeLists.txt"}


# --- the launch file ---------------------------------------------------------------------------------------------------


class Said:
    """Records the arguments with which a class of a launch module was called."""

    def __init__(self, *words: Any, **named: Any) -> None:
        self.words, self.named = words, named


@pytest.fixture
def launched(made: Artifacts, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Function `launched(mode="bench", ...)` that returns the nodes of `display.launch.py`, run with stubs of the launch modules.

    Undeclared arguments and values outside the choices are errors, as in ROS."""
    for name, content in made.files.items():
        assert isinstance(content, bytes)
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(content)
    share = tmp_path / "ros" / "robot_7_description"

    def share_of(package: str) -> str:
        assert package == "robot_7_description"
        return str(share)

    class Configuration(Said):
        def perform(self, context: Mapping[str, str]) -> str:
            return context[self.words[0]]

    stubs: dict[str, dict[str, Any]] = {
        "ament_index_python.packages": {"get_package_share_directory": share_of}, "launch": {"LaunchDescription": Said},
        "launch.actions": {name: type(name, (Said,), {}) for name in ("DeclareLaunchArgument", "OpaqueFunction")},
        "launch.substitutions": {"LaunchConfiguration": Configuration}, "launch_ros.actions": {"Node": Said},
        "launch_ros.parameter_descriptions": {"ParameterValue": Said},
    }
    for name, content in stubs.items():
        for known in {name.partition(".")[0], name}:
            if known not in sys.modules:
                monkeypatch.setitem(sys.modules, known, ModuleType(known))
        vars(sys.modules[name]).update(content)

    def nodes(**chosen: str) -> list[dict[str, Any]]:
        described = runpy.run_path(str(share / "launch" / "display.launch.py"))["generate_launch_description"]()
        *arguments, started = described.words[0]
        context = {one.words[0]: one.named["default_value"] for one in arguments}
        choices = {one.words[0]: one.named["choices"] for one in arguments}
        assert choices["mode"] == ["bench", "adrift"] and set(chosen) <= set(choices)
        context |= chosen
        assert all(value in choices[name] for name, value in context.items())
        return [node.named for node in started.named["function"](context)]

    yield nodes


@pytest.mark.parametrize("mode_", ["bench", "adrift"])
def test_launch_file_starts_nodes_for_each_mode(made: Artifacts, launched: Any, mode_: str) -> None:
    """The description node gets the URDF of the mode as a string, and RViz starts with the root link as its fixed frame."""
    description, publisher, rviz = launched(mode=mode_)
    assert description["executable"] == description["package"] == "robot_state_publisher"
    ((name, value),) = description["parameters"][0].items()
    # A text that launch took for YAML would not stay one.
    assert (name, value.named) == ("robot_description", {"value_type": str})
    assert value.words[0] == text(made, f"urdf/Robot__7_{mode_}.urdf")
    assert publisher["executable"] == publisher["package"] == "joint_state_publisher_gui"
    assert rviz["arguments"][0] == "-d" and Path(rviz["arguments"][1]).is_file()
    links = {link.attrib["name"] for link in xml(made, f"urdf/Robot__7_{mode_}.urdf").findall("link")}
    children = {child.attrib["link"] for child in xml(made, f"urdf/Robot__7_{mode_}.urdf").iterfind("joint/child")}
    assert rviz["arguments"][2:] == ["-f", *(links - children)]


def test_joint_publisher_starts_at_the_start_pose(launched: Any) -> None:
    """The zeros of the joint state publisher are the start pose, as floats."""
    (zeros,) = launched(mode="bench")[1]["parameters"]
    assert zeros == {
        "zeros.yaw": 0.5, "zeros.wheel": 0.0, "zeros.lift": 0.02, "zeros.finger": 0.05, "zeros.spindle": math.pi,
        "zeros.spindle_slide": pytest.approx(0.025), "zeros.flap": 0.0,
    }
    assert all(type(value) is float for value in zeros.values()), "a whole number would be a parameter of another type"
    assert launched()[1]["parameters"] == [zeros]


def test_launch_arguments_select_nodes(launched: Any) -> None:
    """`gui`, `rviz`, `control` and `mode` select the started nodes and controllers."""
    def started(**chosen: str) -> list[str]:
        nodes = [(node["executable"], node.get("arguments")) for node in launched(**chosen)]
        return [f"spawner {words[0]}" if executable == "spawner" else executable for executable, words in nodes]

    assert started(gui="false") == ["robot_state_publisher", "joint_state_publisher", "rviz2"]
    assert started(rviz="false") == ["robot_state_publisher", "joint_state_publisher_gui"]
    controlled = ["robot_state_publisher", "ros2_control_node", "spawner joint_state_broadcaster", "spawner joint_trajectory_controller"]
    assert started(control="true", rviz="false") == [*controlled, "spawner velocity_controller", "spawner effort_controller"]
    assert started(control="true", rviz="false", mode="adrift") == [*controlled, "spawner effort_controller"]
    parameters = launched(control="true")[1]["parameters"]
    assert [Path(file).name for file in parameters] == ["controllers.yaml"] and all(Path(file).is_file() for file in parameters)


def test_rviz_settings_show_the_robot(made: Artifacts) -> None:
    """The RViz file subscribes to the description with transient local durability, because the description is published once."""
    settings = yaml.safe_load(text(made, "config/display.rviz"))["Visualization Manager"]
    shown = {display["Class"].partition("/")[2]: display for display in settings["Displays"]}
    assert shown["RobotModel"]["Description Topic"]["Value"] == "/robot_description" and shown["RobotModel"]["Enabled"]
    # The description is published once, before RViz listens.
    assert shown["RobotModel"]["Description Topic"]["Durability Policy"] == "Transient Local"
    assert settings["Global Options"]["Fixed Frame"] == "world"


# --- URDF and ros2_control ---------------------------------------------------------------------------------------------


def whole(urdf: str) -> str:
    """Add the compiler options that MuJoCo needs to keep fixed links and to find meshes in their folders."""
    return urdf.replace("</robot>", '<mujoco><compiler fusestatic="false" discardvisual="false" strippath="false"/></mujoco></robot>')


def test_urdf_matches_the_urdf_target(tmp_path: Path) -> None:
    """The URDF of the package equals that of the `urdf` target except for mesh paths, the MuJoCo element and the `ros2_control` block."""
    store = Store(str(tmp_path / "store"))
    whole = small_robot.assembly(store)
    bare = tuple(replace(one, overrides=replace(one.overrides, collision="none")) for one in whole.occurrences)
    request = small_robot.request(replace(whole, occurrences=bare), store)
    ours, plain = emit(request), emit_urdf(request)
    for mode_ in ("bench", "drawing", "adrift"):
        expected, found = plain.files[f"urdf/arm_{mode_}.urdf"], text(ours, f"urdf/arm_{mode_}.urdf")
        assert isinstance(expected, bytes)
        before, block, after = re.fullmatch(r"(.*\n)\n(  <ros2_control .*</ros2_control>\n)(</robot>\n)", found, re.S).groups()  # type: ignore[union-attr]
        assert "mujoco" not in found, "MuJoCo reads no packages, and urdf_parser_py reports unknown tags"
        plain_text = re.sub(r"  <mujoco>.*</mujoco>\n\n", "", expected.decode(), count=1, flags=re.S)
        assert f"{before}{after}".replace("package://arm_description/", "") == plain_text
        assert block.count("<joint ") == 2
        assert before.count('filename="package://arm_description/meshes/') == before.count("filename=") > 3
    named = {name.removeprefix("ros/arm_description/") for name in ours.files if "/meshes/" in name}
    assert named == {name.removeprefix("urdf/") for name in plain.files if "/meshes/" in name} and len(named) > 3


def block_of(made: Artifacts, mode_: str) -> dict[str, dict[str, Any]]:
    """Joints of `<ros2_control>`: command interfaces with their bounds, state interfaces with their initial values, and parameters."""
    block = xml(made, f"urdf/Robot__7_{mode_}.urdf").find("ros2_control")
    assert block is not None and block.attrib == {"name": "Robot__7", "type": "system"}
    assert block.findtext("hardware/plugin") == "mock_components/GenericSystem"

    def parameters(element: ElementTree.Element) -> dict[str, float]:
        return {one.attrib["name"]: float(one.text or "") for one in element.findall("param")}

    return {
        joint.attrib["name"]: {
            "commands": {one.attrib["name"]: parameters(one) for one in joint.findall("command_interface")},
            "states": {one.attrib["name"]: parameters(one) for one in joint.findall("state_interface")}, **parameters(joint),
        }
        for joint in block.findall("joint")
    }


def states(q: float, *more: str) -> dict[str, dict[str, float]]:
    return {"position": {"initial_value": pytest.approx(q)}, "velocity": {}, **{name: {} for name in more}}


def test_ros2_control_has_commands_and_states(made: Artifacts) -> None:
    """Drives become command interfaces with bounds. Every moving joint has state interfaces."""
    assert block_of(made, "bench") == {
        "yaw": {"commands": {"position": {"min": -1.0, "max": 2.0}}, "states": states(0.5), "kp": 20.0, "kv": 1e-5},
        "wheel": {"commands": {"velocity": {"min": -3.0, "max": 3.0}}, "states": states(0.0), "kv": 0.5},
        "lift": {"commands": {"effort": {"min": -7.0, "max": 7.0}}, "states": states(0.02, "effort")},
        "finger": {"commands": {}, "states": states(0.05)},
        "spindle": {"commands": {}, "states": states(math.pi)},
        "spindle_slide": {"commands": {}, "states": states(0.025)},
        "flap": {"commands": {}, "states": states(0.0)},
    }
    adrift = block_of(made, "adrift")
    assert {name for name, joint in adrift.items() if joint["commands"]} == {"yaw", "lift"}
    assert adrift["wheel"] == {"commands": {}, "states": states(0.0)}


def test_screw_and_ball_drives_in_ros2_control(tmp_path: Path) -> None:
    """The drive of a screw commands only its rotation. Drives of a ball joint have no command interface."""
    nut = coordinates_of("nut", "c0.out", "c1.in", "screw", drive=drive("position", kp=3.0))
    first, *others = coordinates_of("hip", "c1.out", "c2.in", "ball")
    joints = [*nut, replace(first, drive=drive("motor", effort=1.0, axis=(1.0, 0.0, 0.0))), *others]
    made = emit(build_request(document("r", balls(3, {}), joints, modes=[mode("m", ref("c0.in"))]), {}, str(tmp_path)))
    block = xml(made, "urdf/r_m.urdf").findall("ros2_control/joint")
    commands = {joint.attrib["name"]: [one.attrib["name"] for one in joint.findall("command_interface")] for joint in block}
    assert commands == {"nut": ["position"], "nut_slide": [], "hip_0": [], "hip_1": [], "hip_2": []}
    assert [one.attrib["name"] for one in xml(made, "config/r_m.srdf").findall("passive_joint")] == ["hip_0", "hip_1", "hip_2"]


@pytest.mark.parametrize("mode_", ["bench", "adrift"])
def test_ros2_control_block_is_accepted(made: Artifacts, mode_: str) -> None:
    """The block avoids the errors of the ros2_control parser: an unknown joint, a command for a mimic joint, or a leader that the block
    does not contain."""
    urdf = xml(made, f"urdf/Robot__7_{mode_}.urdf")
    joints = {joint.attrib["name"]: joint for joint in urdf.findall("joint")}
    block = block_of(made, mode_)
    assert set(block) == {name for name, joint in joints.items() if joint.attrib["type"] != "fixed"}
    followers = {name: follows.attrib["joint"] for name, joint in joints.items() if (follows := joint.find("mimic")) is not None}
    assert set(followers) == {"finger", "spindle_slide"} and set(followers.values()) <= set(block)
    assert not any(block[name]["commands"] for name in followers)


def test_controllers_match_the_drives(made: Artifacts) -> None:
    """Position drives get a trajectory controller with gains, velocity and motor drives forward controllers."""
    parameters = yaml.safe_load(text(made, "config/controllers.yaml"))
    manager = parameters.pop("controller_manager")["ros__parameters"]
    assert manager == {
        "update_rate": 100, "joint_state_broadcaster": {"type": "joint_state_broadcaster/JointStateBroadcaster"},
        "joint_trajectory_controller": {"type": "joint_trajectory_controller/JointTrajectoryController"},
        "velocity_controller": {"type": "forward_command_controller/ForwardCommandController"},
        "effort_controller": {"type": "forward_command_controller/ForwardCommandController"},
    }
    assert {name: one["ros__parameters"] for name, one in parameters.items()} == {
        "joint_trajectory_controller": {
            "joints": ["yaw"], "command_interfaces": ["position"], "state_interfaces": ["position", "velocity"],
            "gains": {"yaw": {"p": 20.0, "d": 1e-5}},
        },
        "velocity_controller": {"joints": ["wheel"], "interface_name": "velocity"},
        "effort_controller": {"joints": ["lift"], "interface_name": "effort"},
    }
    gains = parameters["joint_trajectory_controller"]["ros__parameters"]["gains"]["yaw"]
    assert all(type(gain) is float for gain in gains.values()), "a whole number, or a text, would be a parameter of another type"


def test_modes_with_other_drives_have_own_controllers(tmp_path: Path) -> None:
    """A mode with other actuators gets its own controller. Joints named `y` and `n` stay strings in YAML."""
    modes = [
        mode(name, ref("c0.out"), base, actuators=actuators)
        for name, base, actuators in (("a", "fixed", None), ("b", "fixed", ("n",)), ("c", "held", None), ("d", "fixed", ()))
    ]
    turns = [
        coordinates_of(name, f"c{k}.out", f"c{k + 1}.in", "revolute", drive=drive("position", kp=1.0)) for k, name in enumerate("yn")
    ]
    made = emit(build_request(document("r", balls(3, {}), [*turns[0], *turns[1]], modes=modes), {}, str(tmp_path)))
    parameters = yaml.safe_load(text(made, "config/controllers.yaml"))
    joints = {name: one["ros__parameters"]["joints"] for name, one in parameters.items() if name != "controller_manager"}
    # `y` and `n` are names here, though YAML takes them for yes and no.
    assert joints == {"joint_trajectory_controller": ["y", "n"], "joint_trajectory_controller_b": ["n"]}
    launch = text(made, "launch/display.launch.py")
    named = [re.findall(r'"(\w+)"', line) for line in re.findall(r'"controllers": \[(.*)\]', launch)]
    assert named == [["joint_trajectory_controller"], ["joint_trajectory_controller_b"], ["joint_trajectory_controller"], []]


def test_rigid_robot_has_no_control_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot without joints has no `ros2_control` block, an empty SRDF, and no sampling of contacts."""
    monkeypatch.setattr(collision_matrix, "_Sampler", None)  # nor does anybody look for contacts where nothing can touch
    made = emit(build_request(document("r", balls(1, {}), modes=[mode("m", ref("c0.out"))]), {}, str(tmp_path)))
    assert xml(made, "urdf/r_m.urdf").find("ros2_control") is None
    assert list(xml(made, "config/r_m.srdf")) == []
    assert '"start": {},' in text(made, "launch/display.launch.py")


# --- SRDF --------------------------------------------------------------------------------------------------------------


def groups_of(srdf: ElementTree.Element) -> dict[str, list[Any]]:
    return {
        group.attrib["name"]: [tuple(one.attrib.values()) for one in group] for group in srdf.findall("group")
    }


def test_groups_are_chains_to_moving_mounts(made: Artifacts) -> None:
    """Each exported mount that moves relative to the root is the tip of a group. A further group contains all joints."""
    everything = [(name,) for name in ("yaw", "wheel", "lift", "finger", "spindle", "spindle_slide", "flap")]
    assert next(iter(groups_of(xml(made, "config/Robot__7_bench.srdf")))) == "Robot__7"
    assert groups_of(xml(made, "config/Robot__7_bench.srdf")) == {"tip": [("c0", "tip")], "y": [("c0", "y")], "Robot__7": everything}
    assert set(groups_of(xml(made, "config/Robot__7_adrift.srdf"))) == {"base", "y", "Robot__7"}


def test_mounts_at_the_same_frame_share_a_group(tmp_path: Path) -> None:
    turn = coordinates_of("j0", "c0.out", "c1.in", "revolute", lower=-1.0, upper=1.0)
    mounts = {"first": "c1.out", "second": "c1.out", "third": "c1.in"}
    made = emit(build_request(document("r", balls(2, {}), turn, modes=[mode("m", ref("c0.in"))], mounts=mounts), {}, str(tmp_path)))
    assert set(groups_of(xml(made, "config/r_m.srdf"))) == {"r", "first", "third"}


def test_name_clash_with_screw_slide_is_reported(tmp_path: Path) -> None:
    """A joint named like the generated slide of a screw is reported."""
    turns = [
        *coordinates_of("spindle", "c0.out", "c1.in", "screw"),
        *coordinates_of("spindle_slide", "c1.out", "c2.in", "revolute", lower=-1.0, upper=1.0),
    ]
    request = build_request(document("r", balls(3, {}), turns, modes=[mode("m", ref("c0.in"))]), {}, str(tmp_path))
    emit(request)
    assert [one.message for one in request.report.diagnostics] == [
        "`spindle_slide` and the slide of `spindle` have the same joint name in URDF (`spindle_slide`)",
    ]


@pytest.mark.parametrize("mode_", ["bench", "adrift"])
def test_srdf_refers_to_joints_of_the_urdf(made: Artifacts, mode_: str) -> None:
    """Group states list the independent joints of their chain in the URDF. Passive joints are the independent joints without a command."""
    urdf, srdf = xml(made, f"urdf/Robot__7_{mode_}.urdf"), xml(made, f"config/Robot__7_{mode_}.srdf")
    assert srdf.attrib["name"] == urdf.attrib["name"]
    above = {
        joint.find("child").attrib["link"]: (joint.attrib["name"], joint.find("parent").attrib["link"])  # type: ignore[union-attr]
        for joint in urdf.findall("joint")
    }
    by_themselves = {
        joint.attrib["name"] for joint in urdf.findall("joint") if joint.attrib["type"] != "fixed" and joint.find("mimic") is None
    }
    inside: dict[str, set[str]] = {}
    for name, members in groups_of(srdf).items():
        inside[name] = {one[0] for one in members} & by_themselves
        if len(members[0]) == 2:
            ((first, link),) = members
            inside[name] = set()
            while link != first:
                joint, link = above[link]
                inside[name] |= {joint} & by_themselves
    for state in srdf.findall("group_state"):
        assert {joint.attrib["name"] for joint in state} == inside[state.attrib["group"]]
    passive = {joint.attrib["name"] for joint in srdf.findall("passive_joint")}
    driven = {name for name, joint in block_of(made, mode_).items() if joint["commands"]}
    assert passive == by_themselves - driven and "flap" in passive


def test_floating_base_is_a_virtual_joint(made: Artifacts) -> None:
    (floating,) = xml(made, "config/Robot__7_adrift.srdf").findall("virtual_joint")
    assert floating.attrib == {"name": "root", "type": "floating", "parent_frame": "world", "child_link": "c6"}
    assert xml(made, "config/Robot__7_bench.srdf").find("virtual_joint") is None


@pytest.mark.parametrize("root", ["c0.out", "c2.in"])
def test_named_pose_matches_mujoco(tmp_path: Path, root: str) -> None:
    """A ball and a screw have other joints in URDF. The group state and the initial values still give the poses of the MJCF model, for
    either root."""
    turns = {"hip_0": 0.4, "hip_1": -1.1, "hip_2": 0.7}
    both = [*coordinates_of("hip", "c0.out", "c1.in", "ball"), *coordinates_of("nut", "c1.out", "c2.in", "screw")]
    model = document(
        "r", balls(3, {}), both, modes=[mode("m", ref(root), pose="p", poses=("p",))], poses=[pose("p", nut=2.0, **turns)],
        mounts={"base": "c0.in", "tip": "c2.out"},
    )
    request = build_request(model, {}, str(tmp_path))
    made, reference = emit(request), emit_mjcf(request).files["mjcf/r_m.xml"]
    assert isinstance(reference, bytes)
    urdf, srdf = xml(made, "urdf/r_m.urdf"), xml(made, "config/r_m.srdf")
    wanted = mujoco.MjModel.from_xml_string(reference.decode())
    expected = mujoco.MjData(wanted)
    mujoco.mj_resetDataKeyframe(wanted, expected, 0)
    mujoco.mj_forward(wanted, expected)
    (state,) = (one for one in srdf.findall("group_state") if one.attrib["group"] == "r")
    begin = {joint.attrib["name"]: float(joint.findtext("state_interface/param") or "") for joint in urdf.iterfind("ros2_control/joint")}
    said = {joint.attrib["name"]: float(joint.attrib["value"]) for joint in state}
    assert said == {name: value for name, value in begin.items() if name != "nut_slide"}
    model_ = mujoco.MjModel.from_xml_string(whole(ElementTree.tostring(urdf).decode()))
    data = mujoco.MjData(model_)
    for name, value in begin.items():
        data.joint(name).qpos = value
    mujoco.mj_forward(model_, data)
    for name in ("tip", "base"):
        assert data.body(name).xpos == pytest.approx(expected.site(name).xpos, abs=1e-9)
        assert data.body(name).xmat == pytest.approx(expected.site(name).xmat, abs=1e-9)


@pytest.mark.parametrize(("base", "count"), [("planar", 3), ("ball", 3), ("held", 0)])
def test_moving_base_has_states_but_no_group(tmp_path: Path, base: str, count: int) -> None:
    """Joints of a planar or ball base have state interfaces and are passive, but no group contains them."""
    joint = coordinates_of("j", "c0.out", "c1.in", "revolute", drive=drive("position", kp=1.0))
    model = document("r", balls(2, {}), joint, modes=[mode("m", ref("c0.in"), base)], mounts={"tip": "c1.out"})
    made = emit(build_request(model, {}, str(tmp_path)))
    urdf, srdf = xml(made, "urdf/r_m.urdf"), xml(made, "config/r_m.srdf")
    names = [f"root_{k}" for k in range(count)]
    assert [one.attrib["name"] for one in urdf.iterfind("ros2_control/joint")] == [*names, "j"]
    assert [one.attrib["name"] for one in urdf.findall("joint") if one.attrib["type"] != "fixed"] == [*names, "j"]
    assert len(urdf.findall("ros2_control/joint/command_interface")) == 1
    assert groups_of(srdf) == {"tip": [("c0", "tip")], "r": [("j",)]} and srdf.find("virtual_joint") is None
    assert [one.attrib["name"] for one in srdf.findall("passive_joint")] == names
    assert '"frame": "world"' in text(made, "launch/display.launch.py")


def test_mount_named_like_the_robot_is_reported(tmp_path: Path) -> None:
    """A mount with the name of the group of all joints is reported."""
    joint = coordinates_of("j", "c0.out", "c1.in", "revolute")
    request = build_request(document("r", balls(2, {}), joint, modes=[mode("m", ref("c0.out"))], mounts={"r": "c1.out"}), {}, str(tmp_path))
    emit(request)
    (found,) = request.report.diagnostics
    assert found.code is Code.SAME_NAME and found.message == "`r` and the group of all joints have the same group name in SRDF (`r`)"


# --- which links meet --------------------------------------------------------------------------------------------------

RADII = {0: 0.02, 1: 0.02, 2: 0.02, 3: 0.02}
"""Radii of four balls 0.1 m apart along a chain. Balls that are not neighbours touch if their centres are nearer than 0.04 m."""


def chain(ranges: tuple[float, float, float], folder: Path, radii: Mapping[int, float] = RADII, **over: Any) -> Artifacts:
    """Chain of balls in a plane: the first joint turns the ball c1 about a point 0.1 m from c0, and so on."""
    turns = [
        one for k, reach in enumerate(ranges)
        for one in coordinates_of(f"j{k}", f"c{k}.out", f"c{k + 1}.in", "revolute", lower=-reach, upper=reach)
    ]
    modes = over.pop("modes", [mode("m", ref("c0.in"))])
    return emit(build_request(document("r", balls(4, radii), turns, modes=modes, **over), radii, str(folder)))


def disabled_pairs(made: Artifacts, mode_: str = "m") -> dict[tuple[str, str], str]:
    return {
        (one.attrib["link1"], one.attrib["link2"]): one.attrib["reason"]
        for one in xml(made, f"config/r_{mode_}.srdf").findall("disable_collisions")
    }


def centres(q: tuple[float, ...]) -> list[Any]:
    """Centres of the balls, computed with matrices."""
    at = [np.eye(4)]
    for angle in q:
        at.append(at[-1] @ t(0.1, 0.0, 0.0) @ rz(angle))
    return [matrix[:3, 3] for matrix in at]


@pytest.mark.parametrize("ranges", [(1.0, 1.0, 1.0), (3.0, 3.0, 3.0), (3.0, 3.0, 0.5), (0.5, 2.95, 0.2)])
def test_pairs_that_cannot_touch_are_disabled(tmp_path: Path, ranges: tuple[float, float, float]) -> None:
    """The oracle is a grid over all joints with the centres of the balls as complex numbers."""
    made = disabled_pairs(chain(ranges, tmp_path))
    first, second = (np.ravel(q) for q in np.meshgrid(*(np.linspace(-reach, reach, 25) for reach in ranges[:2])))
    steps = np.exp(1j * np.cumsum([0.0 * first, first, second], axis=0))
    at = np.concatenate([0.0 * steps[:1], np.cumsum(0.1 * steps, axis=0)])
    nearest = {(f"c{one}", f"c{other}"): np.abs(at[one] - at[other]).min() for one, other in itertools.combinations(range(4), 2)}
    assert not any(0.035 < gap < 0.045 for gap in nearest.values()), "the grid does not tell"
    neighbours = {("c0", "c1"): "Adjacent", ("c1", "c2"): "Adjacent", ("c2", "c3"): "Adjacent"}
    never = {pair: "Never" for pair, gap in nearest.items() if gap > 0.04 and pair not in neighbours}
    assert made == {**never, **neighbours}


def test_always_and_default_collisions_are_distinguished(tmp_path: Path) -> None:
    """c0 reaches c3 unless the chain is almost straight, so the pair is `Always`. c1 and c3 touch if the chain is folded at c2, as in
    the start pose of `s`, where the pairs are `Default`."""
    radii = {0: 0.27, 1: 0.02, 3: 0.02}
    modes = [mode("m", ref("c0.in")), mode("s", ref("c0.in"), pose="shut", poses=("shut",)), mode("back", ref("c3.in"))]
    made = chain((3.0, 3.0, 3.0), tmp_path, radii, modes=modes, poses=[pose("shut", j1=math.pi - 0.2)])
    drawn = np.random.default_rng(1).uniform(-3.0, 3.0, (2000, 3))
    far = [float(np.linalg.norm(at[3] - at[0])) > 0.29 for at in map(centres, map(tuple, drawn))]
    assert 0 < sum(far) < 0.05 * len(far) and np.linalg.norm(centres((0.0, 0.0, 0.0))[3]) > 0.29
    assert disabled_pairs(made) == {("c0", "c1"): "Adjacent", ("c0", "c3"): "Always"}
    assert disabled_pairs(made, "s") == {("c0", "c1"): "Adjacent", ("c0", "c3"): "Default", ("c1", "c3"): "Default"}
    assert disabled_pairs(made, "back") == {("c3", "c0"): "Always", ("c1", "c0"): "Adjacent"}, "the links in the order of the mode"


def test_pairs_that_two_joints_move_are_proved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """c2 meets c0 within 2e-6 rad of q0 = pi, which samples miss. The tiny balls touch there, so the pair is not `Never`. c1 stays 0.1 m
    from c0, and c3 at least 0.19 m from c1. Three joints move c3 relative to c0, so this pair is sampled."""
    tiny, ranges = dict.fromkeys(range(4), 1e-7), (math.pi, 0.5, 0.5)
    made = chain(ranges, tmp_path / "a", tiny)
    nearest = {gap: min(abs(1.0 + cmath.exp(1j * q)) for q in np.linspace(-gap, gap, 1001)) for gap in (math.pi, 0.5)}
    assert 0.1 * nearest[math.pi] < 2e-7 and 0.1 * nearest[0.5] > 0.19
    assert disabled_pairs(made) == {
        ("c0", "c1"): "Adjacent", ("c1", "c2"): "Adjacent", ("c2", "c3"): "Adjacent", ("c1", "c3"): "Never", ("c0", "c3"): "Never",
    }
    assert 'with the reason "Never" for all positions of the joints: c1 and c3. -->' in text(made, "config/r_m.srdf")
    monkeypatch.setattr(collision_matrix, "PROVED", 0)
    sampled = chain(ranges, tmp_path / "b", tiny)
    assert disabled_pairs(sampled)["c0", "c2"] == "Never" and "all positions" not in text(sampled, "config/r_m.srdf")


URDF_JOINTS = [
    ("revolute", "revolute", ""), ("revolute", "prismatic", ""), ("prismatic", "revolute", ""), ("continuous", "revolute", ""),
    ("revolute", "revolute", '<mimic joint="j0" multiplier="-2.5" offset="0.3"/>'),
    ("prismatic", "revolute", '<mimic joint="j0" multiplier="20" offset="-0.3"/>'),
]
"""Types of two joints in a chain, and the mimic of the second joint."""


@pytest.mark.parametrize("share", [0.99, 1.0005])
@pytest.mark.parametrize(("first", "second", "follows"), URDF_JOINTS)
def test_proofs_match_a_grid(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, first: str, second: str, follows: str, share: float,
) -> None:
    """A ball and a thin rod, on the ends of a chain of two joints. The radius of the ball is `share` of the smallest distance of its centre
    from the rod, which is computed on a grid of joint positions. A single sample does not find the contact."""
    monkeypatch.setattr(collision_matrix, "SAMPLES", 1)
    random = np.random.default_rng(3)
    axes = [one / np.linalg.norm(one) for one in random.normal(size=(2, 3))]
    origins, middle, ball = random.uniform(-0.1, 0.1, (2, 3)), np.array([0.05, -0.03, 0.04]), np.array([-0.25, 0.3, 0.3])
    ends = {"revolute": (-0.9, 1.3), "prismatic": (-0.05, 0.08), "continuous": (-math.pi, math.pi)}
    x, y = (values.ravel() for values in np.meshgrid(*(np.linspace(*ends[kind], 121) for kind in (first, second)), indexing="ij"))
    if follows:
        multiplier, start = (float(word) for word in re.findall(r'(?:multiplier|offset)="(.*?)"', follows))
        y = multiplier * x + start

    def place(point: Any) -> Any:
        at = np.tile(point, (len(x), 1))
        for kind, axis, origin, q in ((second, axes[1], origins[1], y), (first, axes[0], origins[0], x)):
            at = origin + (at + np.outer(q, axis) if kind == "prismatic" else Rotation.from_rotvec(np.outer(q, axis)).apply(at))
        return at

    low, high = (place(middle + [0.0, 0.0, end]) for end in (-0.1, 0.1))
    along = np.clip(((ball - low) * (high - low)).sum(axis=1) / 0.04, 0.0, 1.0)
    nearest = float(np.linalg.norm(low + along[:, None] * (high - low) - ball, axis=1).min())
    rod = f'<origin xyz="{" ".join(map(str, middle))}"/><geometry><box size="1e-5 1e-5 0.2"/></geometry>'
    joints = "".join(
        f'<joint name="j{k}" type="{kind}"><origin xyz="{" ".join(map(str, origins[k]))}"/><parent link="c{k}"/><child link="c{k + 1}"/>'
        f'<axis xyz="{" ".join(map(str, axes[k]))}"/>{limit(*ends[kind]) if kind != "continuous" else limit(-1e9, 1e9)}'
        f'{follows if k else ""}</joint>' for k, kind in enumerate((first, second))
    )
    links = f'{sphere(0, " ".join(map(str, ball)), share * nearest)}<link name="c1"/><link name="c2"><collision>{rod}</collision></link>'
    tree = element(ElementTree.fromstring(f'<robot name="r">{links}{joints}</robot>'))
    matrix = collision_matrix.collision_matrix(tree, "meshes", (), {}, (), Store(str(tmp_path)))
    assert matrix.counts == {} and matrix.apart == {("c0", "c2"): share < 1.0}


def sphere(number: int, place: str | None, radius: float) -> str:
    """Link `c0`, `c1` ... with a sphere, or without a shape if it has no place."""
    shape = f'<collision><origin xyz="{place}"/><geometry><sphere radius="{radius}"/></geometry></collision>'
    return f'<link name="c{number}">{shape if place else ""}</link>'


def limit(lower: float, upper: float) -> str:
    return f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>'


def element(node: ElementTree.Element) -> Element:
    return Element(tag=node.tag, attributes=dict(node.attrib), children=[element(child) for child in node])


@pytest.mark.parametrize(("radius", "apart"), [(0.035, False), (0.041, True)])
def test_thin_vane_that_sweeps_past_a_pin_is_not_reported_as_never(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, radius: float, apart: bool,
) -> None:
    """A vane of 0.2 mm reaches from the axis to 40 mm, and meets a pin with a radius of 0.25 mm unless the pin is farther away. Between two
    of 50 samples, the vane moves by 5 mm on average."""
    monkeypatch.setattr(collision_matrix, "SAMPLES", 50)
    pin = sphere(0, f"{0.6 * radius} {0.8 * radius} 0", 0.00025).replace("<sphere", '<cylinder length="0.02"')
    vane = '<link name="c2"><collision><origin xyz="0.02 0 0"/><geometry><box size="0.04 0.0002 0.002"/></geometry></collision></link>'
    joints = "".join(
        f'<joint name="j{k}" type="{kind}"><parent link="c{k}"/><child link="c{k + 1}"/><axis xyz="0 0 1"/>{limit(-3.0, 3.0)}</joint>'
        for k, kind in enumerate(("revolute", "fixed"))
    )
    tree = element(ElementTree.fromstring(f'<robot name="r">{pin}<link name="c1"/>{vane}{joints}</robot>'))
    matrix = collision_matrix.collision_matrix(tree, "meshes", (), {}, (), Store(str(tmp_path)))
    assert matrix.counts == {} and matrix.apart == {("c0", "c2"): apart}


@pytest.mark.parametrize(("first", "second", "follows", "bare"), [
    ("prismatic", "prismatic", "", 1), ("continuous", "continuous", '<mimic joint="j0" multiplier="0.5" offset="0"/>', 1),
    ("prismatic", "continuous", '<mimic joint="j0" multiplier="1" offset="0"/>', 0),
])
def test_joints_with_an_infinite_range_are_not_proved(tmp_path: Path, first: str, second: str, follows: str, bare: int) -> None:
    """A slide without limits may leave the sampled range, and then a joint that follows the slide may turn farther than in this range. A
    joint with half of the angle of another joint repeats after two turns."""
    links = "".join(sphere(k, None if k == bare else "0 0 0", 0.01) for k in range(3))
    joints = "".join(
        f'<joint name="j{k}" type="{kind}"><origin xyz="{1.0 - 0.5 * k} 0 0"/><parent link="c{k}"/><child link="c{k + 1}"/>'
        f'<axis xyz="0 0 1"/>{limit(-1e9, 1e9)}{follows if k else ""}</joint>' for k, kind in enumerate((first, second))
    )
    tree = element(ElementTree.fromstring(f'<robot name="r">{links}{joints}</robot>'))
    assert collision_matrix.collision_matrix(tree, "meshes", (), {}, (), Store(str(tmp_path))).apart == {}


@pytest.mark.parametrize(("radius", "counts", "apart"), [(0.01, {}, {("c1", "c2"): True}), (0.2, {("c1", "c2"): 1}, {})])
def test_pairs_that_a_floating_joint_moves_never_have_a_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, radius: float, counts: dict[str, int], apart: dict[str, bool],
) -> None:
    """The shapes of both robots are at the same places, and their matrices are in one store."""
    monkeypatch.setattr(collision_matrix, "SAMPLES", 1)
    store, matrices = Store(str(tmp_path)), {}
    for kind in ("fixed", "floating"):
        links = "".join(sphere(k, "0 0 0", radius) for k in range(3))
        joints = "".join(
            f'<joint name="j{k}" type="{moves}"><origin xyz="{0.1 * k} 0 0"/><parent link="c0"/><child link="c{k}"/><axis xyz="0 0 1"/>'
            f"{limit(-0.1, 0.1)}</joint>" for k, moves in ((1, kind), (2, "revolute"))
        )
        tree = element(ElementTree.fromstring(f'<robot name="r">{links}{joints}</robot>'))
        matrices[kind] = collision_matrix.collision_matrix(tree, "meshes", (), {}, (("c0", "c1"), ("c0", "c2")), store)
    assert (matrices["fixed"].counts, matrices["fixed"].apart) == (counts, apart)
    assert (matrices["floating"].counts, matrices["floating"].apart) == ({}, {("c1", "c2"): False})


def test_free_bodies_without_other_joints_have_no_disabled_pairs(tmp_path: Path) -> None:
    links = "".join(sphere(k, "0 0 0", 0.01) for k in range(3))
    joints = "".join(f'<joint name="j{k}" type="floating"><parent link="c0"/><child link="c{k}"/></joint>' for k in (1, 2))
    tree = element(ElementTree.fromstring(f'<robot name="r">{links}{joints}</robot>'))
    matrix = collision_matrix.collision_matrix(tree, "meshes", (), {}, (), Store(str(tmp_path)))
    assert matrix.counts == {} and matrix.apart == dict.fromkeys(itertools.combinations(("c0", "c1", "c2"), 2), False)


def test_excluded_pairs_have_reason_user(tmp_path: Path) -> None:
    modes = [mode("m", ref("c0.in"), exclude=((ref("c0.in"), ref("c3.in")),))]
    assert disabled_pairs(chain((3.0, 3.0, 3.0), tmp_path, modes=modes))["c0", "c3"] == "User"


def test_sampling_respects_mimic_joints(tmp_path: Path) -> None:
    """c1 turns by q and c2 by -q, so c3 stays beside c0, although each joint alone would bring them together."""
    turns = [
        *coordinates_of("j0", "c0.out", "c1.in", "revolute", lower=-3.0, upper=3.0),
        *coordinates_of("j1", "c1.out", "c2.in", "revolute", lower=-3.0, upper=3.0, mimic=mimic("j0", -1.0)),
        *coordinates_of("j2", "c2.out", "c3.in", "revolute", lower=-0.01, upper=0.01),
    ]
    made = disabled_pairs(emit(build_request(document("r", balls(4, RADII), turns, modes=[mode("m", ref("c0.in"))]), RADII, str(tmp_path))))
    folded = [centres((q, -q, 0.0)) for q in np.linspace(-3.0, 3.0, 601)]
    assert min(np.linalg.norm(at[3] - at[0]) for at in folded) > 0.05 and min(np.linalg.norm(at[2] - at[0]) for at in folded) < 0.03
    assert made["c0", "c3"] == "Never" and ("c0", "c2") not in made


def test_collision_matrix_is_cached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second run in the same store does not sample. Other joint ranges do."""
    ranges = (3.0, 3.0, 0.5)
    first, again = chain(ranges, tmp_path / "a"), chain(ranges, tmp_path / "b")
    assert first.files == again.files, "the same bytes each time"
    monkeypatch.setattr(collision_matrix, "_Sampler", None)
    assert chain(ranges, tmp_path / "a").files == first.files, "from the store"
    with pytest.raises(TypeError):
        chain((3.0, 3.0, 0.6), tmp_path / "a")


@pytest.mark.parametrize("fault", [ValueError("no volume"), mujoco.FatalError("no memory")])
def test_rejected_shapes_are_an_export_loss(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: Exception) -> None:
    """If MuJoCo cannot read the shapes, only adjacent pairs are disabled and a loss is reported."""
    def refused(*_: Any) -> None:
        raise fault

    monkeypatch.setattr(collision_matrix, "_Sampler", refused)
    made = chain((1.0, 1.0, 1.0), tmp_path)
    assert set(disabled_pairs(made).values()) == {"Adjacent"}
    assert ("m", "disabled collisions: MuJoCo cannot read the shapes of the links") in {(loss.mode, loss.what) for loss in made.losses}


# --- losses, and the whole way -----------------------------------------------------------------------------------------


def test_losses_match_urdf_except_for_other_files(tmp_path: Path) -> None:
    """Losses equal those of `urdf`, minus those that the SRDF or the controllers cover."""
    hip = coordinates_of("hip", "c0.out", "c1.in", "ball")
    driven = [replace(hip[0], drive=Drive(component=None, kind="motor", axis=(1.0, 0.0, 0.0), origin=where(30))), *hip[1:]]
    knee = coordinates_of("knee", "c1.out", "c2.in", "revolute", drive=drive("position", kp=5.0))
    knee = [replace(one, dynamics=Dynamics(armature=0.1), limit=Limit(lower=-1.0, upper=1.0)) for one in knee]
    modes = [mode("m", ref("c0.in"), poses=("p",), exclude=((ref("c0.in"), ref("c2.in")),))]
    request = build_request(document("r", balls(3, {}), [*driven, *knee], modes=modes, poses=[pose("p", knee=0.5)]), {}, str(tmp_path))
    of_urdf = {(loss.path, loss.what) for loss in emit_urdf(request).losses}
    made = emit(request)
    assert {loss.target for loss in made.losses} == {"ros"}
    assert of_urdf - {(loss.path, loss.what) for loss in made.losses} == {
        ("p", "the pose: not supported by URDF"), ("m", "excluded contacts of links without a common joint"),
        ("knee", "the drive: position, kp 5: a transmission without gains"),
    }
    omitted = {(loss.path, loss.what) for loss in made.losses if loss.how == "omitted"}
    assert ("hip_0", "the drive: motor about 1, 0, 0: no joint in the file has this axis") in omitted


def test_arm_package_builds_and_loads(root: Path, tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The URDF files of the arm's package load in MuJoCo, and `--deny-loss` turns its losses into errors."""
    command = ["build", str(root / "assemblies" / "arm.yaml"), "--emit", "ros", "-o", str(tmp_path), "--store", shared_store]
    assert main(command) == 0, capsys.readouterr().err
    assert main([*command, "--deny-loss"]) == 1
    assert "ros cannot fully represent `yaw`: the armature of" in capsys.readouterr().err
    package = tmp_path / "arm" / "ros" / "arm_description"
    for file in sorted((package / "urdf").iterdir()):
        resolved = file.read_text().replace("package://arm_description/", f"{package}/")
        model = mujoco.MjModel.from_xml_string(whole(resolved))
        assert model.nmesh > 10 and model.njnt == 4
    pairs = ElementTree.parse(package / "config" / "arm_bench.srdf").getroot().findall("disable_collisions")
    assert [one.attrib["reason"] for one in pairs].count("Adjacent") == 4
