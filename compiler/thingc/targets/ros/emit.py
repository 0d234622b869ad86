"""Write `ros/<name>_description/`, a ROS 2 package with the chosen modes, which is built by ament_cmake."""

from __future__ import annotations

from collections.abc import Iterable

from thingc.base.generated_header import heading
from thingc.base.package_info import PackageInfo
from thingc.base.safe_text import escape_control
from thingc.model.robot.types import Robot
from thingc.targets import raw
from thingc.targets.artifact import Artifacts, Content, Loss
from thingc.targets.capabilities import losses
from thingc.targets.geometry import Geometry, collect_geometry
from thingc.targets.name_mangling import package_name, safe
from thingc.targets.request import EmitRequest
from thingc.targets.ros.capabilities import CAPABILITIES
from thingc.targets.ros.collision_matrix import CollisionMatrix, adjacent, collision_matrix
from thingc.targets.ros.control import controllers, controllers_yaml, ros2_control
from thingc.targets.ros.joints import values
from thingc.targets.ros.rviz import launch_file, rviz_config
from thingc.targets.ros.srdf import srdf
from thingc.targets.urdf.links import MESHES, model
from thingc.targets.urdf.transmissions import transmission_losses
from thingc.targets.xml_writer import Element, write

RUN = (
    "ament_index_python", "controller_manager", "forward_command_controller", "hardware_interface", "joint_state_broadcaster",
    "joint_state_publisher", "joint_state_publisher_gui", "joint_trajectory_controller", "launch", "launch_ros", "robot_state_publisher",
    "rviz2",
)
"""Packages that are required by the launch file and by the controllers."""


def emit(request: EmitRequest) -> Artifacts:
    """Write the ROS 2 package. The package contains a URDF with `<ros2_control>` and an SRDF for each mode, and files that all modes
    share.
    """
    assembly, robots = request.assembly, request.robots
    name = package_name(assembly.name)
    folder, uri = f"ros/{name}", f"package://{name}/{MESHES}"
    geometry, flat = collect_geometry(assembly, "ros", f"{folder}/{MESHES}", request.report)
    document = assembly.definition.document
    comment = heading(document)
    trees = [model(robot, geometry.in_mode(robot.mode.name), request.report, uri) for robot in robots]
    raw.apply(assembly, robots, "urdf", trees, request.report)
    links, link_of = assembly.links, assembly.link_of
    colliding = {
        robot.mode.name: frozenset(safe(links[link_of[index]].name) for index, item in enumerate(shapes) if item.collision)
        for robot in robots for shapes in (geometry.in_mode(robot.mode.name).shapes,)
    }
    several = any(len(names) > 1 for names in colliding.values())
    matrices, matrix_losses = _collision_matrices(request, trees, geometry, uri) if several else ({}, [])
    files: dict[str, Content] = {f"{MESHES}/{file}": stored for file, stored in geometry.assets.items()}
    for robot, tree in zip(robots, trees, strict=True):
        file, mode_comment = f"{assembly.name}_{robot.mode.name}", heading(document, robot.mode.name)
        matrix = matrices.get(robot.mode.name)
        semantics = srdf(robot, colliding[robot.mode.name], matrix, request.report)
        proved = ", ".join(" and ".join(pair) for pair, apart in matrix.apart.items() if apart) if matrix is not None else ""
        pairs_comment = f' Proved with the reason "Never" for all positions of the joints: {proved}.' if proved else ""
        files[f"config/{file}.srdf"] = write(semantics, mode_comment + pairs_comment, sections=False).text.encode()
        control = ros2_control(robot)
        if control is not None:
            tree.children.append(control)
        files[f"urdf/{file}.urdf"] = write(tree, mode_comment).text.encode()
    mode_controllers = controllers(robots)
    files["config/controllers.yaml"] = f"# {comment}\n{controllers_yaml(mode_controllers)}".encode()
    files["config/display.rviz"] = rviz_config(robots[0], comment).encode()
    files["launch/display.launch.py"] = launch_file(robots, mode_controllers, comment).encode()
    files["CMakeLists.txt"] = cmake_lists(assembly.name, {path.partition("/")[0] for path in files}, comment).encode()
    description = " ".join(assembly.definition.description.split()) or f"The robot {assembly.name}."
    files["package.xml"] = package_xml(
        assembly.name, escape_control(description, limit=len(description)), request.workspace.about, comment,
    ).encode()
    all_losses = dict.fromkeys((*flat, *matrix_losses, *losses("ros", CAPABILITIES, assembly, robots), *transmission_losses("ros", robots)))
    return Artifacts(files={f"{folder}/{path}": content for path, content in sorted(files.items())}, losses=tuple(all_losses))


def _collision_matrices(
    request: EmitRequest, trees: list[Element], geometry: Geometry, uri: str,
) -> tuple[dict[str, CollisionMatrix], list[Loss]]:
    """Compute the collision matrix of each mode. If MuJoCo cannot compute a matrix, return an export loss instead.

    Modes with the same joints in their trees and the same shapes share a matrix, because the matrix does not depend on the root.
    """
    groups: dict[tuple[frozenset[str], str | None], list[tuple[Robot, Element]]] = {}
    for robot, tree in zip(request.robots, trees, strict=True):
        own_shapes = robot.mode.name if robot.mode.name in geometry.modes else None
        groups.setdefault((frozenset(joint.path for body in robot.bodies for joint in body.joints), own_shapes), []).append((robot, tree))
    by_mode: dict[str, CollisionMatrix] = {}
    matrix_losses: list[Loss] = []
    for group in groups.values():
        first, tree = group[0]
        starts = {robot.mode.name: values(first, robot.start.q) for robot, _ in group}
        try:
            matrix = collision_matrix(tree, uri, geometry.meshes, starts, adjacent(request.assembly), request.store)
        except ValueError:
            what = "disabled collisions: MuJoCo cannot read the shapes of the links"
            matrix_losses += [Loss("ros", robot.mode.name, robot.mode.name, what, "omitted", robot.mode.origin) for robot, _ in group]
        else:
            by_mode |= {robot.mode.name: matrix for robot, _ in group}
    return by_mode, matrix_losses


def package_xml(robot: str, description: str, about: PackageInfo, heading: str) -> str:
    """Return the text of `package.xml` for the ROS 2 package of a robot. `description` is the description of the robot in its document."""
    root = Element(tag="package", attributes={"format": "3"})
    root.fill({"name": package_name(robot), "version": about.version, "description": description})
    root.add_text("maintainer", about.maintainer, {"email": about.mail})
    root.fill({"license": about.license, "buildtool_depend": "ament_cmake"})
    for name in RUN:
        root.add_text("exec_depend", name)
    root.add("export").add_text("build_type", "ament_cmake")
    return f'<?xml version="1.0"?>\n{write(root, heading, sections=False).text}'


def cmake_lists(robot: str, folders: Iterable[str], heading: str) -> str:
    """Return the text of `CMakeLists.txt`. The file only installs folders, because nothing needs to be compiled."""
    return f"""\
# {heading}
cmake_minimum_required(VERSION 3.8)
project({package_name(robot)} NONE)

find_package(ament_cmake REQUIRED)

install(DIRECTORY {" ".join(sorted(folders))} DESTINATION share/${{PROJECT_NAME}})

ament_package()
"""
