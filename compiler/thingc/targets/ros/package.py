"""What makes a folder a package: `package.xml` (format 3, REP 149) and the `CMakeLists.txt` that installs it (REP 122)."""

from __future__ import annotations

from collections.abc import Iterable

from thingc.base.package_info import PackageInfo
from thingc.targets.name_mangling import package_name
from thingc.targets.xml_writer import Element, write

RUN = (
    "ament_index_python", "controller_manager", "forward_command_controller", "hardware_interface", "joint_state_broadcaster",
    "joint_state_publisher", "joint_state_publisher_gui", "joint_trajectory_controller", "launch", "launch_ros", "robot_state_publisher",
    "rviz2",
)
"""The packages that its launch file and its controllers come from."""


def package_xml(robot: str, description: str, said: PackageInfo, heading: str) -> str:
    """The manifest of the package of a robot; `description` is what its document says of it."""
    root = Element(tag="package", attributes={"format": "3"})
    root.say("name", package_name(robot))
    root.say("version", said.version)
    root.say("description", description)
    root.say("maintainer", said.maintainer, {"email": said.mail})
    root.say("license", said.license)
    root.say("buildtool_depend", "ament_cmake")
    for name in RUN:
        root.say("exec_depend", name)
    export = Element(tag="export")
    export.say("build_type", "ament_cmake")
    root.children.append(export)
    return f'<?xml version="1.0"?>\n{write(root, heading, sections=False).text}'


def cmake_lists(robot: str, folders: Iterable[str], heading: str) -> str:
    """Installs the folders, which are all there is to build."""
    return f"""\
# {heading}
cmake_minimum_required(VERSION 3.8)
project({package_name(robot)} NONE)

find_package(ament_cmake REQUIRED)

install(DIRECTORY {" ".join(sorted(folders))} DESTINATION share/${{PROJECT_NAME}})

ament_package()
"""
