"""Files for displaying a robot: a launch file with the mode as an argument, and the RViz configuration."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from thingc.model.robot.types import Robot
from thingc.targets.name_mangling import package_name, safe
from thingc.targets.ros.control import BROADCASTER, Controller
from thingc.targets.ros.joints import start, values
from thingc.targets.urdf.links import WORLD


def frame_of(robot: Robot) -> str:
    """Return the fixed frame for displaying a mode, which is the root of its URDF."""
    return safe(robot.assembly.links[robot.bodies[0].link].name) if robot.base == "free" else WORLD


def launch_file(robots: Sequence[Robot], controllers: Mapping[str, Sequence[Controller]], heading: str) -> str:
    """Return `display.launch.py`, the Python file for `ros2 launch`."""
    modes = "".join(_mode(robot, [one.name for one in controllers[robot.mode.name]]) for robot in robots)
    name = robots[0].assembly.name
    return _filled(_LAUNCH, HEADING=heading, PACKAGE=package_name(name), ROBOT=name, MODES=modes, BROADCASTER=BROADCASTER)


def rviz_config(frame: str, heading: str) -> str:
    """Return `display.rviz`: the robot on a grid, with its frames. `frame` is the fixed frame, unless RViz is started with `-f`."""
    return _filled(_RVIZ, HEADING=heading, FRAME=frame)


def _filled(template: str, **words: str) -> str:
    """Replace each `@WORD@` in a template. A single pass is required, because inserted strings may also contain such words."""
    return re.sub("@([A-Z]+)@", lambda word: words[word[1]], template)


def _mode(robot: Robot, controllers: list[str]) -> str:
    """Return the entry of a mode: the fixed frame, the start values of its joints [rad or m], and its controllers."""
    joints = "".join(f'            "{name}": {value + 0.0},\n' for name, value in values(robot, start(robot)).items())
    begin = f"{{\n{joints}        }}" if joints else "{}"
    named = ", ".join(f'"{name}"' for name in controllers)
    return f"""\
    "{robot.mode.name}": {{
        "frame": "{frame_of(robot)}",
        "start": {begin},
        "controllers": [{named}],
    }},
"""


_LAUNCH = '''\
# @HEADING@
"""Shows the robot in RViz: `ros2 launch @PACKAGE@ display.launch.py mode:=MODE`.

Its joints are moved by sliders, or with `control:=true` by controllers, on mock hardware.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

# For each mode: the fixed frame, the initial joint positions [rad or m], and the controllers.
MODES = {
@MODES@}


def generate_launch_description():
    def choice(name, default, choices, description):
        return DeclareLaunchArgument(name, default_value=default, choices=choices, description=description)

    flags = ["true", "false"]
    return LaunchDescription([
        choice("mode", next(iter(MODES)), list(MODES), "how the robot is used"),
        choice("gui", "true", flags, "whether joints have sliders"),
        choice("rviz", "true", flags, "whether RViz is started"),
        choice("control", "false", flags, "whether controllers move the joints, on mock hardware"),
        OpaqueFunction(function=nodes),
    ])


def nodes(context):
    def chosen(name):
        return LaunchConfiguration(name).perform(context)

    share = Path(get_package_share_directory("@PACKAGE@"))
    mode = MODES[chosen("mode")]
    text = (share / "urdf" / f"@ROBOT@_{chosen('mode')}.urdf").read_text(encoding="utf-8")
    description = {"robot_description": ParameterValue(text, value_type=str)}
    started = [Node(package="robot_state_publisher", executable="robot_state_publisher", parameters=[description])]
    if chosen("control") == "true":
        started.append(Node(
            package="controller_manager", executable="ros2_control_node", parameters=[str(share / "config" / "controllers.yaml")],
            remappings=[("~/robot_description", "/robot_description")],
        ))
        for name in ["@BROADCASTER@", *mode["controllers"]]:
            started.append(Node(package="controller_manager", executable="spawner", arguments=[name]))
    else:
        publisher = "joint_state_publisher_gui" if chosen("gui") == "true" else "joint_state_publisher"
        zeros = {f"zeros.{name}": value for name, value in mode["start"].items()}
        started.append(Node(package=publisher, executable=publisher, parameters=[zeros] if zeros else []))
    if chosen("rviz") == "true":
        rviz = ["-d", str(share / "config" / "display.rviz"), "-f", mode["frame"]]
        started.append(Node(package="rviz2", executable="rviz2", arguments=rviz))
    return started
'''


_RVIZ = """\
# @HEADING@
Panels:
  - Class: rviz_common/Displays
    Name: Displays
  - Class: rviz_common/Views
    Name: Views
Visualization Manager:
  Class: ""
  Displays:
    - Class: rviz_default_plugins/Grid
      Name: Grid
      Cell Size: 0.1
      Plane Cell Count: 20
      Enabled: true
      Value: true
    - Class: rviz_default_plugins/RobotModel
      Name: RobotModel
      Description Source: Topic
      Description Topic:
        Depth: 5
        Durability Policy: Transient Local
        History Policy: Keep Last
        Reliability Policy: Reliable
        Value: /robot_description
      Collision Enabled: false
      Visual Enabled: true
      Enabled: true
      Value: true
    - Class: rviz_default_plugins/TF
      Name: TF
      Marker Scale: 0.1
      Show Names: false
      Enabled: false
      Value: false
  Enabled: true
  Global Options:
    Background Color: 48; 48; 48
    Fixed Frame: @FRAME@
    Frame Rate: 30
  Tools:
    - Class: rviz_default_plugins/Interact
    - Class: rviz_default_plugins/MoveCamera
    - Class: rviz_default_plugins/Select
    - Class: rviz_default_plugins/FocusCamera
    - Class: rviz_default_plugins/Measure
  Value: true
  Views:
    Current:
      Class: rviz_default_plugins/Orbit
      Distance: 1.5
      Name: Current View
      Pitch: 0.4
      Target Frame: <Fixed Frame>
      Yaw: 0.8
      Value: Orbit (rviz)
"""
