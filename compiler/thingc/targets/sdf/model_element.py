"""Write a robot in one mode as an SDF model.

Links have the same frames as in MJCF and `modes.json`. The frame of a joint is at the position of the joint, and has the axes of the child
link. Mounts, `frame` components and roots of modes become frames. Loops and holds become joints, because SDF allows any graph of links.
Drives become Gazebo systems, because SDF itself only supports effort and velocity limits.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Literal, get_args

from thingc.base.diagnostics import Report
from thingc.base.inertia import MassProperties, named_moments, physical_fault, within_triangle
from thingc.base.pose import IDENTITY, NO_POSE, Pose, make_translation, rpy_of
from thingc.base.source import Origin
from thingc.model.assembly.kinematics import joints_of, leaders
from thingc.model.assembly.types import ActuatorModel, JointEdge
from thingc.model.resolve.types import Material
from thingc.model.robot.kinematics import body_pose
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets.artifact import Loss
from thingc.targets.capabilities import drive_cell, written_as
from thingc.targets.connections import Connection, connections
from thingc.targets.geometry import INFINITE_HALF, Geometry, Shape, channels, named_shapes
from thingc.targets.name_mangling import LINK, MangledNames, frames
from thingc.targets.sdf.capabilities import CAPABILITIES, DriveForm
from thingc.targets.sdf.chain import SdfAxis, SdfJoint, ZeroState, chain
from thingc.targets.sdf.sensors import sensors_of_joint, sensors_of_link
from thingc.targets.xml_writer import NAMESPACES, Element, XmlValue

UNBOUNDED = 1e9
"""Effort limit [N m or N] that is written for a drive without a limit. Without this limit, the controllers of Gazebo would use their
default of 1000.
"""

SYSTEMS: dict[DriveForm, tuple[str, str]] = {
    "position controller": ("joint-position-controller", "JointPositionController"),
    "velocity controller": ("joint-controller", "JointController"), "force": ("apply-joint-force", "ApplyJointForce"),
}
"""The Gazebo system for each form of a drive."""

Kind = Literal["link", "joint", "frame"]
"""Kinds of elements in a model that have names. Elements of all kinds share one namespace."""

WORLD = "world"
"""The name that refers to the world in an SDF file. A link, a joint or a robot must not have this name."""

PLAIN, NEWER = "1.9", "1.11"
"""The SDF version of most files, and the version of files with a mimic joint or a screw. Older versions do not support these joints."""

LEAST_MASS, LEAST_INERTIA = 1e-9, 1e-12
"""Mass [kg] and moments of inertia [kg m^2] that are written for a link without mass, because SDF requires positive values."""

AXES = ("axis", "axis2")
"""The tags of the first and the second axis of a joint."""

MESHES = "meshes"
"""The folder that contains the meshes, beside the SDF file."""

PATCH_RADIUS = 16.0 / (3.0 * math.pi)
"""Radius [m] of the contact patch. With this radius, a coefficient of 1 gives the same torque as a torsional friction of 1 m in MuJoCo.

In ODE, the torque is `3 pi / 16` times the coefficient, the radius and the normal force.
"""


def model(robot: Robot, geometry: Geometry, zero: ZeroState, report: Report, losses: list[Loss]) -> Element:
    """Create the `<sdf>` element of a mode. The model is written in the state `zero`, in which all joints are at 0.

    Add an export loss to `losses` for each name that was changed. If two links or two joints have the same name, an error is reported.
    """
    return _Builder(robot, geometry, zero, report, losses).build()


class _Builder:
    def __init__(self, robot: Robot, geometry: Geometry, zero: ZeroState, report: Report, losses: list[Loss]) -> None:
        self.robot = robot
        self.geometry = geometry
        self.zero = zero
        self.assembly = robot.assembly
        self.robots = MangledNames("name", "SDF", report)
        self.parts = MangledNames("name", "SDF", report)
        self.names: dict[Kind, MangledNames] = {kind: MangledNames("name", "SDF", report) for kind in get_args(Kind)}
        self.owners: dict[str, str] = {}
        self.losses = losses
        links = [robot.assembly.links[body.link] for body in robot.bodies]
        self.links = [self._name("link", link.name, link.origin) for link in links]
        self.root = Element(tag="sdf", attributes={"version": PLAIN}, origin=robot.mode.origin)
        self.connections = [(edge, chain(edge, zero.q)) for edge in connections(robot, CAPABILITIES["loops"], closed=zero.closed)]
        self.joints = {step.path: self._name("joint", step.path, edge.origin) for edge, steps in self.connections for step in steps}
        axes = [(step, axis, tag) for _, steps in self.connections for step in steps for axis, tag in zip(step.axes, AXES, strict=False)]
        self.axes = {axis.joint.path: (self.joints[step.path], tag) for step, axis, tag in axes}
        self.follows = leaders(joint for joint in joints_of(robot.assembly) if joint.path in self.axes)

    def build(self) -> Element:
        """Build the `<sdf>` element. The model contains links, joints, frames, and Gazebo systems that drive joints, in this order."""
        robot, names = self.robot, self.links
        self.robots.take(WORLD, (), "the world")
        name = self.robots.take(self.assembly.name, self.assembly.definition.origin, "the robot")
        model = self.root.add("model", {"name": name, "canonical_link": names[0]}, robot.mode.origin)
        model.add_text("self_collide", "true")
        for index, body in enumerate(robot.bodies):
            pose = self.zero.base if body.parent is None else body_pose(body, NO_POSE, self.zero.q)
            self._link(model, names[index], index, pose, None if body.parent is None else names[body.parent])
        for edge, steps in self.connections:
            self._connect(model, WORLD if edge.parent is None else names[edge.parent], names[edge.child], edge, steps)
        for index, sites in frames(robot).items():
            for site in sites:
                name = self._name("frame", site.path, site.origin)
                frame = model.add("frame", {"name": name, "attached_to": names[index]}, site.origin)
                _set_pose(frame, site.pose)
        for _, steps in self.connections:
            model.children.extend(plugin(robot, self.zero, steps, self.joints))
        return self.root

    def _name(self, kind: Kind, path: str, origin: Origin, description: str | None = None) -> str:
        """Reserve the SDF name of an element with a path in the document, and return it. `description` is its name in messages.

        Links, joints and frames share one namespace. If an element of another kind already has the name, the kind is appended to the name,
        as SDFormat does for files older than 1.7.
        """
        name = mangled = self.names[kind].take(path, origin, description or f"{kind} `{path}`")
        while name in self.owners:
            name = f"{name}_{kind}"
        self.owners[name] = f"{kind} `{path}`"
        if name != mangled and description is None:
            what = f"the name: replaced by `{name}`"
            self.losses.append(Loss("sdf", None, path, what, "approximated", origin))
        return name

    def _connect(self, model: Element, parent: str, child: str, connection: Connection, steps: tuple[SdfJoint, ...]) -> None:
        """Add the SDF joints between two links. Also add the intermediate links, which have the pose of the child link."""
        *intermediate, last = steps
        for step in intermediate:
            link_name = self._name("link", f"{step.path}{LINK}", connection.origin, f"the child link of joint `{step.path}`")
            link = model.add("link", {"name": link_name}, connection.origin)
            _set_pose(link, NO_POSE, child)
            _add_inertial(link, MassProperties(mass=LEAST_MASS, centre=step.at))
            self._joint(model, step, parent, link_name, connection.origin)
            parent = link_name
        element = self._joint(model, last, parent, child, connection.origin)
        if connection.in_tree:
            sensors_of_joint(self.robot, connection.child, last.at, element, self.parts)

    def _joint(self, model: Element, step: SdfJoint, parent: str, child: str, origin: Origin) -> Element:
        """Add a joint with one or two axes to the SDF model, and return its element."""
        element = model.add("joint", {"name": self.joints[step.path], "type": step.type}, origin)
        _set_pose(element, make_translation(*step.at))
        screw = 2.0 * math.pi * step.axes[0].twist.pitch if step.type == "screw" else None
        element.fill({"parent": parent, "child": child, "screw_thread_pitch": screw})
        if screw is not None:
            self.root.attributes["version"] = NEWER
        for tag, axis in zip(AXES, step.axes, strict=False):
            self._axis(element, tag, axis, alone=len(step.axes) == 1)
        return element

    def _axis(self, joint: Element, tag: str, axis: SdfAxis, *, alone: bool) -> None:
        """Add an axis element to an SDF joint, with the limits, the dynamics and the mimic constraint of its coordinate.

        If the leader of a mimic joint is also a mimic joint, the independent joint is written as the leader, as in URDF. `alone` is True if
        the joint has only this axis.
        """
        coordinate, at_zero = axis.joint, self.zero.q.get(axis.joint.path, 0.0)
        element = joint.add(tag)
        element.add_text("xyz", axis.twist.axis)
        dynamics = coordinate.dynamics
        if dynamics.damping or dynamics.friction or dynamics.stiffness:
            dynamics_element = element.add("dynamics")
            dynamics_element.fill({"damping": dynamics.damping or None, "friction": dynamics.friction or None})
            if dynamics.stiffness:
                dynamics_element.fill({"spring_reference": (dynamics.rest or 0.0) - at_zero, "spring_stiffness": dynamics.stiffness})
        leader, multiplier, offset = self.follows.get(coordinate.path, (coordinate.path, 1.0, 0.0))
        follows = leader != coordinate.path and leader in self.axes
        driven = coordinate.actuator is not None and coordinate.path in self.robot.present
        effort = coordinate.limit.effort if coordinate.limit.effort is not None else None if driven or follows else 0.0
        lower, upper = (None if end is None else end - at_zero for end in (coordinate.limit.lower, coordinate.limit.upper))
        element.add("limit").fill({"lower": lower, "upper": upper, "effort": effort, "velocity": coordinate.limit.velocity})
        if not follows:
            return
        leader_joint, leader_axis = self.axes[leader]
        offset += multiplier * self.zero.q[leader] - at_zero
        origin = coordinate.mimic.origin if coordinate.mimic is not None else coordinate.origin
        mimic = element.add("mimic", {"joint": leader_joint, "axis": leader_axis}, origin)
        mimic.fill({"multiplier": multiplier, "offset": offset, "reference": 0.0})
        self.root.attributes["version"] = NEWER
        if alone and (leader_joint, "axis2") not in self.axes.values():
            self.root.attributes["xmlns:drake"] = NAMESPACES["drake"]
            joint.add("drake:mimic", {"joint": leader_joint, "multiplier": multiplier, "offset": offset})

    def _link(self, model: Element, name: str, index: int, pose: Pose, parent: str | None) -> None:
        """Add a link with its inertia, shapes and sensors to the SDF model."""
        link = self.assembly.links[self.robot.bodies[index].link]
        element = model.add("link", {"name": name}, link.origin)
        _set_pose(element, pose, parent)
        _add_inertial(element, link.properties)
        for member, part_pose in zip(link.members, link.poses, strict=True):
            shapes = self.geometry.shapes[member]
            for path, shape in named_shapes(shapes.visual, f"{shapes.path}_visual"):
                visual = element.add("visual", {"name": self.parts.take(path, shapes.origin)}, shapes.origin)
                _shape(visual, shape, part_pose)
                if shape.color is not None:
                    _set_colour(visual, shape.color)
            for path, shape in named_shapes(shapes.collision, f"{shapes.path}_collision"):
                collision = element.add("collision", {"name": self.parts.take(path, shapes.origin)}, shapes.origin)
                _shape(collision, shape, part_pose)
                _add_friction(collision, shape.material)
        sensors_of_link(self.robot, index, element, self.parts)


def _set_pose(element: Element, pose: Pose, relative_to: str | None = None) -> None:
    """Add a `<pose>` element. The element is omitted if the pose is the identity."""
    if relative_to is not None or pose != NO_POSE:
        rpy = (0.0, 0.0, 0.0) if pose.rotation == IDENTITY else rpy_of(pose.rotation)
        attributes = {} if relative_to is None else {"relative_to": relative_to}
        element.add_text("pose", (*pose.translation, *rpy), attributes)


def _shape(element: Element, shape: Shape, at: Pose) -> None:
    _set_pose(element, at @ shape.pose)
    geometry = element.add("geometry").add(shape.kind)
    match shape.kind:
        case "mesh":
            geometry.add_text("uri", f"{MESHES}/{shape.mesh}.obj")
        case "box":
            geometry.add_text("size", tuple(2.0 * half for half in shape.size))
        case "sphere":
            geometry.add_text("radius", shape.size[0])
        case "ellipsoid":
            geometry.add_text("radii", shape.size)
        case "plane":
            geometry.fill({"normal": "0 0 1", "size": tuple(2.0 * (half or INFINITE_HALF) for half in shape.size[:2])})
        case _:
            geometry.fill({"radius": shape.size[0], "length": 2.0 * shape.size[1]})


def _set_colour(visual: Element, color: str) -> None:
    """Set the colour of a visual element."""
    *_, opacity = channels(color)
    if opacity < 1.0:
        visual.add_text("transparency", 1.0 - opacity)
    visual.add("material").fill(dict.fromkeys(("ambient", "diffuse"), channels(color)))


def _add_friction(collision: Element, material: Material | None) -> None:
    """Add the friction of a material to a collision element. Nothing is added if the material does not specify friction."""
    if material is None or (material.slide is None and material.torsion is None):
        return
    friction = collision.add("surface").add("friction")
    if material.slide is not None:
        friction.add("ode").fill({"mu": material.slide, "mu2": material.slide})
    if material.torsion is not None:
        torsional: dict[str, XmlValue] = {"coefficient": "1", "use_patch_radius": "true", "patch_radius": PATCH_RADIUS * material.torsion}
        friction.add("torsional").fill(torsional)


def _add_inertial(link: Element, properties: MassProperties) -> None:
    """Add an `<inertial>` element to a link: mass [kg], centre of mass [m], and inertia about it [kg m^2] along the axes of the link.

    A zero mass, and an inertia that no solid can have, are replaced by small positive values.
    """
    minimum = LEAST_INERTIA
    fault = physical_fault(properties.inertia) is not None
    i = ((minimum, 0.0, 0.0), (0.0, minimum, 0.0), (0.0, 0.0, minimum)) if fault else within_triangle(properties.inertia)
    inertial = link.add("inertial")
    _set_pose(inertial, make_translation(*properties.centre))
    inertial.add_text("mass", properties.mass or LEAST_MASS)
    inertial.add("inertia").fill(named_moments(i))


def plugin(robot: Robot, zero: ZeroState, steps: Iterable[SdfJoint], names: Mapping[str, str]) -> Iterator[Element]:
    """Yield the Gazebo controller plugins of a mode. Each plugin drives a joint with one axis that has a drive in this mode.

    The controllers are PID controllers with the gains of the drive. For a motor, the plugin applies forces to the joint. `names` contains
    the SDF names of joints, by joint path.
    """
    for step in steps:
        if len(step.axes) == 1 and step.axes[0].joint.path in robot.present:
            joint = step.axes[0].joint
            form = None if joint.actuator is None else written_as(CAPABILITIES["drives"][drive_cell(joint, joint.actuator)])
            if joint.actuator is not None and form is not None:
                yield _controller(robot, zero, names[step.path], joint, joint.actuator, form)


def gazebo_system(file: str, system: str) -> dict[str, XmlValue]:
    """Return the attributes of a plugin for a Gazebo system, from the names of its file and its class."""
    return {"filename": f"gz-sim-{file}-system", "name": f"gz::sim::systems::{system}"}


def _controller(robot: Robot, zero: ZeroState, name: str, joint: TreeJoint | JointEdge, drive: ActuatorModel, form: DriveForm) -> Element:
    element = Element(tag="plugin", attributes=gazebo_system(*SYSTEMS[form]), origin=drive.origin)
    element.fill({"joint_name": name, "use_force_commands": "true" if form == "velocity controller" else None})
    if form != "force":
        p, d = (drive.kp, drive.kv) if form == "position controller" else (drive.kv, None)
        effort = UNBOUNDED if joint.limit.effort is None else joint.limit.effort
        element.fill({"p_gain": p or 0.0, "i_gain": 0.0, "d_gain": d or 0.0, "cmd_max": effort or 0.0, "cmd_min": -effort or 0.0})
    if form == "position controller" and robot.keyframes:
        element.add_text("initial_position", robot.keyframes[0].q[joint.path] - zero.q[joint.path] or 0.0)
    return element
